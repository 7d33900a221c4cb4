//! A CS0015 as the plant file describes it.

use super::board::events::Pulses;
use super::board::hardware::{Hardware, Shared};
use super::canopen::communication::{Factory, PdoConfig, PdoDirection, is_rate};
use super::canopen::master::MasterConfig;
use super::canopen::node::{BootUp, GuardingConfig, Node};
use super::port::{Firmware, Program, WATCHDOG_US};
use super::ram::{RETAIN_BYTES, Registers};
use crate::can::Message;
use crate::devices::can_bus::CanSocket;
use crate::devices::canopen::pdo::Transmission;
use crate::devices::cs0015::registers::DEVICE;
use crate::devices::emulation::settings::{range, refused_at};
use crate::devices::{BuildError, Device, DeviceConfig, Plain, Plug, PortConfig};
use crate::identity::{DeviceIndex, PortNumber};
use crate::journal::Origin;
use crate::layout;
use crate::layout::Area;
use crate::memory::Segment;
use serde::Deserialize;
use std::sync::Arc;
use toml::Spanned;
use toml::de::{Error, ValueDeserializer};

/// A CS0015 of the plant file.
#[derive(Clone, Debug)]
pub struct Cs0015Config {
    /// Name, unique among the devices.
    pub name: String,
    /// Name of the bus.
    pub bus: Option<String>,
    /// Node-ID at delivery, 1 to 127.
    pub node_id: u8,
    /// Bit rate at delivery, in kbit/s.
    pub kbit_s: u16,
    /// Kind of the boot-up message.
    pub boot_up: BootUp,
    /// The program of the controller.
    pub program: Program,
}

/// Keys of the section in the plant file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[serde(expecting = "a CS0015: a table with its settings")]
struct Section {
    name: String,
    bus: Option<String>,
    node_id: Option<Spanned<u8>>,
    kbit_s: Option<Spanned<u16>>,
    program: Option<Spanned<String>>,
    cycle_us: Option<Spanned<u64>>,
    boot_up: Option<Spanned<String>>,
    guarding: Option<Spanned<GuardingSection>>,
    nodes: Option<Spanned<Vec<u64>>>,
    guard_ms: Option<Spanned<u64>>,
    life: Option<Spanned<u8>>,
    sync_ms: Option<Spanned<u64>>,
    #[serde(default)]
    pdo_tx: Vec<Spanned<PdoSection>>,
    #[serde(default)]
    pdo_rx: Vec<Spanned<PdoSection>>,
}

/// Settings that a program gives to `PDO_TX_CONFIG` or `PDO_RX_CONFIG` (p. 47-50).
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[serde(expecting = "a PDO: a table with its settings")]
struct PdoSection {
    pdo: u64,
    id: Option<u64>,
    trans_type: Option<u64>,
    inhibit_ms: Option<u64>,
}

/// Settings that a program gives to `NMS_GUARDING_CONFIG` (p. 46).
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[serde(expecting = "node guarding: a table with its settings")]
struct GuardingSection {
    guard_time_ms: Option<Spanned<u16>>,
    life_time: Option<Spanned<u8>>,
    cycle_period_ms: Option<Spanned<u16>>,
}

impl GuardingSection {
    fn config(&self) -> GuardingConfig {
        let ms = |time: &Option<Spanned<u16>>| time.as_ref().map_or(0, |time| *time.get_ref());
        GuardingConfig {
            guard_ms: ms(&self.guard_time_ms),
            life: self.life_time.as_ref().map_or(0, |life| *life.get_ref()),
            cycle_ms: ms(&self.cycle_period_ms),
        }
    }
}

/// Returns the value of a key if it is in its range.
fn checked<T: Copy + Into<u64>>(
    what: &'static str,
    name: &str,
    value: Option<&Spanned<T>>,
    preset: T,
    (allowed, right): (core::ops::RangeInclusive<u64>, &'static str),
) -> Result<T, Error> {
    let Some(value) = value else { return Ok(preset) };
    let number = *value.get_ref();
    range(what, name, number.into(), allowed, right)
        .map_err(|error| refused_at(value.span(), error.to_string()))?;
    Ok(number)
}

impl Cs0015Config {
    /// Reads a `[[device]]` section of kind `cs0015`.
    pub(crate) fn read(value: ValueDeserializer<'_>) -> Result<Arc<dyn DeviceConfig>, Error> {
        let section = Section::deserialize(value)?;
        let name = section.name.as_str();
        let node_id = checked("node_id", name, section.node_id.as_ref(), 32, (1..=127, "1 to 127"))?;
        let kbit_s = section.kbit_s.as_ref().map_or(125, |kbit_s| *kbit_s.get_ref());
        if let Some(kbit_s) = section.kbit_s.as_ref().filter(|kbit_s| !is_rate(*kbit_s.get_ref())) {
            let right = "10, 20, 50, 100, 125, 250, 500 or 1000";
            let text = format!("kbit_s of '{name}' is {}; it must be {right}", kbit_s.get_ref());
            return Err(refused_at(kbit_s.span(), text));
        }
        let limits = (1_000..=WATCHDOG_US, "1000 to 200000: a longer cycle trips the watchdog");
        let cycle_us = checked("cycle_us", name, section.cycle_us.as_ref(), 10_000, limits)?;
        let boot_up = match section.boot_up.as_ref().map(|it| (it.get_ref().as_str(), it.span())) {
            None | Some(("none", _)) => BootUp::None,
            Some(("empty-emcy", _)) => BootUp::EmptyEmergency,
            Some(("700", _)) => BootUp::Guarding,
            Some((other, span)) => {
                let text = format!("boot_up of '{name}' is '{other}'; it is one of none, empty-emcy, 700");
                return Err(refused_at(span, text));
            }
        };
        let mut pdos = Vec::new();
        for (way, sections) in
            [(PdoDirection::Receive, &section.pdo_rx), (PdoDirection::Transmit, &section.pdo_tx)]
        {
            for pdo in sections {
                pdos.push(read_pdo(name, way, pdo)?);
            }
        }
        let guarding = section.guarding.as_ref().map(|guarding| guarding.get_ref().config());
        let program = match section.program.as_ref().map(|it| (it.get_ref().as_str(), it.span())) {
            None | Some(("slave", _)) => {
                section.has_no_master()?;
                Program::BuiltIn { pdos, cycle_us, guarding, master: None }
            }
            Some(("master", span)) => {
                Program::BuiltIn { pdos, cycle_us, guarding, master: Some(section.master(node_id, span)?) }
            }
            Some(("attached", span)) => {
                section.has_no_master()?;
                if !pdos.is_empty() || guarding.is_some() {
                    let text = format!("the program of '{name}' sets guarding, pdo_rx and pdo_tx itself");
                    return Err(refused_at(span, text));
                }
                Program::Attached { cycle_us }
            }
            Some(("none", span)) => {
                section.has_no_master()?;
                if !pdos.is_empty() || section.cycle_us.is_some() || guarding.is_some() {
                    let text =
                        format!("without a program '{name}' has no cycle_us, guarding, pdo_rx or pdo_tx");
                    return Err(refused_at(span, text));
                }
                Program::None
            }
            Some((other, span)) => {
                let right = "none, slave, master, attached";
                let text = format!("program of '{name}' is '{other}'; it is one of {right}");
                return Err(refused_at(span, text));
            }
        };
        let Section { name, bus, .. } = section;
        Ok(Arc::new(Cs0015Config { name, bus, node_id, kbit_s, boot_up, program }))
    }
}

impl Section {
    /// Refuses keys that only a master has.
    fn has_no_master(&self) -> Result<(), Error> {
        let spans = [
            self.nodes.as_ref().map(Spanned::span),
            self.guard_ms.as_ref().map(Spanned::span),
            self.life.as_ref().map(Spanned::span),
            self.sync_ms.as_ref().map(Spanned::span),
        ];
        let text = "only program = 'master' has nodes, guard_ms, life and sync_ms";
        spans.into_iter().flatten().next().map_or(Ok(()), |span| Err(refused_at(span, text.to_owned())))
    }

    /// Returns the settings of a master's program. `span` is the position of the key `program` in the file.
    fn master(&self, own: u8, span: core::ops::Range<usize>) -> Result<MasterConfig, Error> {
        let name = self.name.as_str();
        let Some(nodes) = &self.nodes else {
            return Err(refused_at(span, format!("the master '{name}' needs its nodes = [1, 2]")));
        };
        let mut numbers: Vec<u8> = Vec::new();
        for node in nodes.get_ref() {
            let number =
                u8::try_from(*node).ok().filter(|number| (1..=127).contains(number) && *number != own);
            match number.filter(|number| !numbers.contains(number)) {
                Some(number) => numbers.push(number),
                None => {
                    let text = format!(
                        "nodes of '{name}': {node} must be 1 to 127, not its own node_id, and listed once"
                    );
                    return Err(refused_at(nodes.span(), text));
                }
            }
        }
        let times = || (1..=65_535, "1 to 65535");
        let guard_ms = checked("guard_ms", name, self.guard_ms.as_ref(), 200, times())?;
        let life = checked("life", name, self.life.as_ref(), 3, (1..=255, "1 to 255"))?;
        let sync_ms = checked("sync_ms", name, self.sync_ms.as_ref(), 0, times())?;
        let sync_us = Some(sync_ms * 1000).filter(|sync_us| *sync_us != 0);
        Ok(MasterConfig { nodes: numbers, guard_us: guard_ms * 1000, life, sync_us })
    }
}

fn read_pdo(
    name: &str,
    way: PdoDirection,
    section: &Spanned<PdoSection>,
) -> Result<(PdoDirection, usize, PdoConfig), Error> {
    let refuse = |text: String| refused_at(section.span(), format!("a PDO of '{name}': {text}"));
    let PdoSection { pdo, id, trans_type, inhibit_ms } = section.get_ref();
    if !(1..=8).contains(pdo) {
        return Err(refuse(format!("pdo is {pdo}; it must be 1 to 8")));
    }
    if let Some(id) = id.filter(|id| !(0x380..=0x7FF).contains(id)) {
        return Err(refuse(format!("id is 0x{id:X}; it must be 0x380 to 0x7FF, or be left out")));
    }
    let code = trans_type.unwrap_or(255);
    let kind = u8::try_from(code).ok().filter(|code| *code != 254).and_then(Transmission::from_code);
    let kind = kind.ok_or_else(|| refuse(format!("trans_type is {code}; it must be 0 to 240, or 255")))?;
    let inhibit_ms = match (inhibit_ms, way) {
        (None, _) => 0,
        (Some(_), PdoDirection::Receive) => {
            return Err(refuse("only a transmit PDO has inhibit_ms".to_owned()));
        }
        (Some(ms @ 0..=65_535), PdoDirection::Transmit) => *ms,
        (Some(ms), _) => return Err(refuse(format!("inhibit_ms is {ms}; it must be 0 to 65535"))),
    };
    let id = id.map(|id| id as u16);
    Ok((way, (pdo - 1) as usize, PdoConfig { id, kind, inhibit_us: inhibit_ms * 1000 }))
}

impl DeviceConfig for Cs0015Config {
    fn name(&self) -> &str {
        &self.name
    }

    fn layout(&self) -> &'static layout::DeviceLayout {
        &DEVICE
    }

    fn ports(&self) -> Vec<PortConfig<'_>> {
        DEVICE.ports.iter().map(|port| PortConfig::of(port, self.bus.as_deref())).collect()
    }

    fn messages(&self, _: PortNumber) -> Vec<Message> {
        super::canopen::messages::of(self)
    }

    fn retain_bytes(&self) -> u32 {
        RETAIN_BYTES as u32
    }

    fn novram(&self) -> Option<&'static Area> {
        super::board::retained::area()
    }

    fn build(
        &self,
        index: DeviceIndex,
        segment: Segment,
    ) -> Result<(Box<dyn Device>, Vec<Plug>), BuildError> {
        let factory = Factory { node: self.node_id, kbit_s: self.kbit_s };
        let (mut plugs, shared, pulses) = (Vec::new(), Shared::default(), Pulses::default());
        for port in DEVICE.ports {
            let node = Node::new(Registers::new(&segment)?, factory, self.boot_up);
            let origin = Origin { plc: index, node: port.number };
            let firmware = Firmware::new(node, self.program.clone(), shared.clone(), pulses.clone());
            let socket =
                CanSocket { origin, segment: segment.clone(), layout: &DEVICE, port: Box::new(firmware) };
            let (number, bus) = (port.number, self.bus.clone());
            plugs.push(Plug { number, family: port.medium, bus, socket: Box::new(socket) });
        }
        let has_program = self.program != Program::None;
        let hardware = Hardware::new(&segment, has_program, shared, pulses)?;
        Ok((Box::new(Plain::new(index, &self.name, &DEVICE, segment, hardware)?), plugs))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Arc<dyn DeviceConfig>, Error> {
        let read = || Cs0015Config::read(ValueDeserializer::parse(text)?);
        read().map_err(|mut error: Error| {
            error.set_input(Some(text));
            error
        })
    }

    #[test]
    fn a_name_is_enough() {
        let config = read("{ name = 'panel' }").unwrap();
        assert_eq!((config.name(), config.retain_bytes(), config.ports()[0].bus), ("panel", 256, None));
        let text = format!("{config:?}");
        assert!(text.contains("node_id: 32, kbit_s: 125"), "{text}");
    }

    #[test]
    fn each_mistake_in_the_plant_file_is_reported_with_its_position() {
        for (key, expected) in [
            ("node_id = 0", "node_id of 'panel' is 0; it must be 1 to 127"),
            ("kbit_s = 33", "kbit_s of 'panel' is 33; it must be 10, 20"),
            ("cycle_us = 999", "cycle_us of 'panel' is 999; it must be 1000 to 200000"),
            ("boot_up = '600'", "boot_up of 'panel' is '600'; it is one of none, empty-emcy, 700"),
            (
                "program = 'other'",
                "program of 'panel' is 'other'; it is one of none, slave, master, attached",
            ),
            ("program = 'attached', guarding = {}", "the program of 'panel' sets guarding, pdo_rx"),
            ("program = 'attached', nodes = [1]", "only program = 'master' has nodes"),
            ("program = 'none', cycle_us = 5000", "without a program 'panel' has no cycle_us"),
            ("pdo_tx = [{ pdo = 9 }]", "a PDO of 'panel': pdo is 9; it must be 1 to 8"),
            ("pdo_tx = [{ pdo = 1, id = 0x200 }]", "id is 0x200; it must be 0x380 to 0x7FF"),
            ("pdo_rx = [{ pdo = 1, trans_type = 254 }]", "trans_type is 254; it must be 0 to 240, or 255"),
            ("pdo_rx = [{ pdo = 1, inhibit_ms = 5 }]", "only a transmit PDO has inhibit_ms"),
            ("pdo_tx = [{ pdo = 1, inhibit_ms = 65536 }]", "inhibit_ms is 65536; it must be 0 to 65535"),
            ("guarding = { guard_time_ms = 65536 }", "expected u16"),
            ("guarding = { life = 3 }", "unknown field `life`"),
            ("program = 'none', guarding = {}", "without a program 'panel' has no cycle_us, guarding"),
            ("nodes = [1]", "only program = 'master' has nodes"),
            ("program = 'master'", "the master 'panel' needs its nodes"),
            ("program = 'master', nodes = [32]", "32 must be 1 to 127, not its own node_id, and listed once"),
            (
                "program = 'master', nodes = [1, 1]",
                "1 must be 1 to 127, not its own node_id, and listed once",
            ),
            (
                "program = 'master', nodes = [1], sync_ms = 0",
                "sync_ms of 'panel' is 0; it must be 1 to 65535",
            ),
            ("node = 5", "unknown field `node`"),
        ] {
            let message = read(&format!("{{ name = 'panel',\n{key} }}")).unwrap_err().to_string();
            assert!(message.contains(expected) && message.contains("line 2,"), "{key}\n{message}");
        }
    }
}
