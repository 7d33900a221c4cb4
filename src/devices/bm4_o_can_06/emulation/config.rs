//! A b maXX PLC with its option modules as the plant file describes it.

use super::Bm4Plc;
use crate::devices::bm4_o_can_06::registers::{BAUD_RATES, DEVICE};
use crate::devices::cansync::drive::{CardFunction, DriveConfig};
use crate::devices::emulation::settings::{range, refused_at, time, time_or_none};
use crate::devices::{BuildError, Device, DeviceConfig, Doubt, Plug, PortConfig};
use crate::identity::{DeviceIndex, PortNumber};
use crate::layout;
use crate::layout::Port;
use crate::memory::Segment;
use core::ops::Range;
use serde::Deserialize;
use std::sync::Arc;
use toml::Spanned;
use toml::de::{Error, ValueDeserializer};

/// Kind of a module.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(expecting = "a kind of module, as a word")]
pub enum ModuleKind {
    /// BM4-O-CAN-06: the master of its bus.
    #[serde(rename = "can-06")]
    Can06,
    /// BM4-O-CAN-05. With DIP switch 9 at ON it is a slave of the PLC, with the switch at OFF a slave of the
    /// controller.
    #[serde(rename = "can-05")]
    Can05,
}

/// Function of a module that has power.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Work {
    /// The master of its bus.
    Master,
    /// A slave with registers in the PLC.
    PlcSlave,
    /// A slave of the controller, at this baud rate in kbit/s; `None` for the rate of its bus in the plant file.
    ControllerSlave(Option<u16>),
    /// The module has no function: DIP switch 10 is at ON (decision D-648).
    InitError,
    /// The module has no function: DIP switches 1 to 3 have a combination without a baud rate (p. 27, 31).
    UnknownBaudRate,
}

/// A CANsync option module.
#[derive(Clone, Debug)]
pub struct ModuleConfig {
    /// Slot of the module.
    pub port: &'static Port,
    /// Kind of the module.
    pub kind: ModuleKind,
    /// Name of the port's bus, if the port is connected.
    pub bus: Option<String>,
    /// Slave number at DIP switches 4 to 8, 0 to 31. A BM4-O-CAN-06 has no slave number.
    pub dip: u8,
    /// DIP switch 9 of a BM4-O-CAN-05. True if it is ON: the module is then a slave with registers in the PLC.
    pub dip9: bool,
    /// Baud rate of a slave of the controller: DIP switches 3, 2 and 1 as a binary number. `None` for the baud rate of
    /// the bus.
    pub dip_baud: Option<u8>,
    /// DIP switch 10. True for ON. The manual requires OFF.
    pub dip10: bool,
    /// The module that provides the SYNC signal which this master passes on (decision D-12).
    pub sync_in_from: Option<&'static Port>,
    /// Emulated time that a slave needs to lock to the SYNC signal, in us (default 1 s; D-07).
    pub lock_time_us: u64,
    /// Emulated time without SYNC that ends the lock, in us; `None` for two and a half intervals (D-124).
    pub sync_loss_us: Option<u64>,
}

impl ModuleConfig {
    /// Returns the function of the module when it has power.
    pub(super) fn work(&self) -> Work {
        match (self.kind, self.dip9, self.dip_baud) {
            (ModuleKind::Can06, ..) => Work::Master,
            (ModuleKind::Can05, ..) if self.dip10 => Work::InitError,
            (ModuleKind::Can05, true, _) => Work::PlcSlave,
            (ModuleKind::Can05, false, None) => Work::ControllerSlave(None),
            (ModuleKind::Can05, false, Some(switches)) => {
                let known = CONTROLLER_RATES.iter().find(|(number, _)| *number == switches);
                known.map_or(Work::UnknownBaudRate, |(_, kbit_s)| Work::ControllerSlave(Some(*kbit_s)))
            }
        }
    }

    /// True if the PLC has registers of the module.
    pub(super) fn has_registers(&self) -> bool {
        self.kind == ModuleKind::Can06 || self.dip9
    }
}

/// Combinations of DIP switches 3, 2 and 1 of a slave of the controller, each with its baud rate in kbit/s
/// (p. 27).
pub(super) const CONTROLLER_RATES: [(u8, u16); 4] = [(0b011, 125), (0b100, 250), (0b101, 500), (0b110, 1000)];

/// A b maXX PLC of the plant file.
#[derive(Clone, Debug)]
pub struct Bm4Config {
    /// Name, unique among the devices.
    pub name: String,
    /// The module that raises event 11; `None` if the PLC has no modules (decision D-365).
    pub sync_source: Option<&'static Port>,
    /// Modules of the PLC, from slot G to slot M.
    pub modules: Vec<ModuleConfig>,
}

/// The section as written in the file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[serde(expecting = "a b maXX PLC: a table with its settings")]
struct Section {
    name: String,
    sync_source: Option<Spanned<String>>,
    #[serde(default)]
    module: Vec<ModuleSection>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[serde(expecting = "a module: a table with its settings")]
struct ModuleSection {
    slot: Spanned<String>,
    kind: ModuleKind,
    bus: Option<String>,
    dip: Option<Spanned<u8>>,
    dip9: Option<Spanned<bool>>,
    dip_baud: Option<Spanned<u8>>,
    dip10: Option<Spanned<bool>>,
    sync_in_from: Option<Spanned<String>>,
    lock_time_us: Option<Spanned<u64>>,
    sync_loss_us: Option<Spanned<u64>>,
}

impl Bm4Config {
    /// Reads a `[[device]]` section of kind `bm4-plc`.
    pub(crate) fn read(value: ValueDeserializer<'_>) -> Result<Arc<dyn DeviceConfig>, Error> {
        let Section { name, sync_source, module } = Section::deserialize(value)?;
        let mut modules: Vec<ModuleConfig> = Vec::with_capacity(module.len());
        let mut sync_in = Vec::new();
        for section in module {
            let slot = section.slot.span();
            let (module, from) = section.read(&name)?;
            if modules.iter().any(|other| other.port.number == module.port.number) {
                let text = format!("there are two modules in slot '{}'", letter(module.port));
                return Err(refused_at(slot, text));
            }
            sync_in.extend(from.map(|from| (module.port.number, from)));
            modules.push(module);
        }
        modules.sort_by_key(|module| module.port.number);
        for (number, from) in sync_in {
            let source = occupied(&modules, "sync_in_from", &from)?;
            if source.number == number {
                return Err(refused_at(from.span(), "sync_in_from names the module's own slot".to_owned()));
            }
            let module = modules.iter_mut().find(|module| module.port.number == number);
            module.into_iter().for_each(|module| module.sync_in_from = Some(source));
        }
        let sync_source = match sync_source {
            Some(slot) => Some(occupied(&modules, "sync_source", &slot)?),
            None => modules.iter().find(|module| module.has_registers()).map(|module| module.port),
        };
        Ok(Arc::new(Bm4Config { name, sync_source, modules }))
    }
}

impl Bm4Config {
    /// True if a SYNC signal from the source module can reach this master. The source module must have a signal, and
    /// the signal must not come from the master's own bus (decision D-646).
    pub(super) fn hands_sync_to(&self, module: &ModuleConfig) -> bool {
        let source = module.sync_in_from.and_then(|port| self.module(port));
        source.is_some_and(|source| match source.work() {
            Work::Master => true,
            Work::PlcSlave => source.bus.is_some() && source.bus != module.bus,
            Work::ControllerSlave(_) | Work::InitError | Work::UnknownBaudRate => false,
        })
    }

    fn module(&self, port: &Port) -> Option<&ModuleConfig> {
        self.modules.iter().find(|module| module.port.number == port.number)
    }

    /// Returns the setting of a module that prevents the module's function, if there is one.
    fn doubt_of(&self, module: &ModuleConfig) -> Option<Doubt> {
        let name = format!("{}:{}", self.name, module.port.name);
        let doubt = |key, text| Some(Doubt { section: name.clone(), key, text });
        match (module.work(), &module.bus, module.sync_in_from) {
            (Work::InitError, ..) => {
                let text = format!(
                    "DIP switch 10 of module '{name}' must be OFF: its initialization ends with an error, and it does nothing"
                );
                doubt("dip10", text)
            }
            (Work::UnknownBaudRate, ..) => {
                let text = format!(
                    "DIP switches 3, 2 and 1 of module '{name}' name no baud rate, so it does nothing; 0b011 is 125 kbit/s, \
                     0b100 250, 0b101 500, 0b110 1000"
                );
                doubt("dip_baud", text)
            }
            (Work::Master, _, Some(from)) if !self.hands_sync_to(module) => {
                let source = self.module(from);
                let why = match source.map(|source| (source.work(), &source.bus)) {
                    Some((Work::PlcSlave, Some(_))) => "that module is on the same bus",
                    Some((Work::PlcSlave, None)) => "that module has no bus",
                    _ => "that module has no registers in the PLC",
                };
                let text = format!(
                    "'{name}' can pass on the SYNC signal at {}, and none can come from there: {why}",
                    from.name
                );
                doubt("sync_in_from", text)
            }
            (Work::Master, None, _) => {
                let text = format!(
                    "module '{name}' has no bus: its PLC has a SYNC signal, and no slave receives the frames of the module"
                );
                doubt("slot", text)
            }
            (Work::PlcSlave | Work::ControllerSlave(_), None, _) => {
                let text = format!("module '{name}' has no bus: no SYNC signal and no frame reaches it");
                doubt("slot", text)
            }
            _ => None,
        }
    }

    /// Returns a slave of the controller as a drive of its bus, with a name such as `maxx:slotH`. It has the
    /// mapping and the parameters of a drive with CANsync card (decision D-649).
    pub(super) fn drive_of(&self, module: &ModuleConfig, kbit_s: Option<u16>) -> DriveConfig {
        let name = format!("{}:{}", self.name, module.port.name);
        DriveConfig {
            kbit_s,
            // The function that supports all four rates.
            card_function: CardFunction::Old,
            lock_time_us: module.lock_time_us,
            sync_loss_us: module.sync_loss_us,
            ..DriveConfig::demo(name, module.dip)
        }
    }
}

impl ModuleSection {
    /// Returns the module, and the slot that can provide the SYNC signal for it.
    fn read(self, plc: &str) -> Result<(ModuleConfig, Option<Spanned<String>>), Error> {
        let Some(port) = port_of(self.slot.get_ref()) else {
            let text = format!("there is no slot '{}'; slots are: {}", self.slot.get_ref(), slots());
            return Err(refused_at(self.slot.span(), text));
        };
        let is_master = self.kind == ModuleKind::Can06;
        let refuse = |span: Option<Range<usize>>, text: &str| {
            span.map_or(Ok(()), |span| Err(refused_at(span, text.to_owned())))
        };
        if is_master {
            let no_dip = "a BM4-O-CAN-06 has no DIP switches";
            refuse(self.dip.as_ref().map(Spanned::span), no_dip)?;
            refuse(self.dip9.as_ref().map(Spanned::span), no_dip)?;
            refuse(self.dip_baud.as_ref().map(Spanned::span), no_dip)?;
            refuse(self.dip10.as_ref().map(Spanned::span), no_dip)?;
            let no_lock = "a BM4-O-CAN-06 does not synchronize, lock_time_us is a BM4-O-CAN-05's";
            refuse(self.lock_time_us.as_ref().map(Spanned::span), no_lock)?;
            let no_loss = "a BM4-O-CAN-06 does not synchronize, sync_loss_us is a BM4-O-CAN-05's";
            refuse(self.sync_loss_us.as_ref().map(Spanned::span), no_loss)?;
        } else {
            let no_sync_in = "only a BM4-O-CAN-06 passes a SYNC signal on";
            refuse(self.sync_in_from.as_ref().map(Spanned::span), no_sync_in)?;
        }
        if let Some(dip) = &self.dip {
            let name = format!("{plc}:{}", port.name);
            let checked = range("dip", &name, (*dip.get_ref()).into(), 0..=31, "0 to 31");
            checked.map_err(|error| refused_at(dip.span(), error.to_string()))?;
        }
        let dip9 = self.dip9.is_none_or(Spanned::into_inner);
        if let Some(baud) = &self.dip_baud {
            let reserved =
                "DIP switches 1 to 3 are reserved with DIP switch 9 at ON; the program sets the baud rate";
            refuse(dip9.then(|| baud.span()), reserved)?;
            let name = format!("{plc}:{}", port.name);
            let checked = range("dip_baud", &name, (*baud.get_ref()).into(), 0..=7, "0 to 7");
            checked.map_err(|error| refused_at(baud.span(), error.to_string()))?;
        }
        let module = ModuleConfig {
            port,
            kind: self.kind,
            bus: self.bus,
            dip: self.dip.map_or(0, Spanned::into_inner),
            dip9,
            dip_baud: self.dip_baud.map(Spanned::into_inner),
            dip10: self.dip10.is_some_and(Spanned::into_inner),
            sync_in_from: None,
            lock_time_us: self.lock_time_us.map_or(1_000_000, Spanned::into_inner),
            sync_loss_us: self.sync_loss_us.map(Spanned::into_inner),
        };
        Ok((module, self.sync_in_from))
    }
}

/// Returns the letter of a slot.
fn letter(port: &Port) -> &'static str {
    port.name.trim_start_matches("slot")
}

fn port_of(slot: &str) -> Option<&'static Port> {
    DEVICE.ports.iter().find(|port| letter(port) == slot)
}

fn slots() -> String {
    DEVICE.ports.iter().map(letter).collect::<Vec<_>>().join(", ")
}

/// Returns the slot that `key` names; the slot must contain a module.
fn occupied(modules: &[ModuleConfig], key: &str, slot: &Spanned<String>) -> Result<&'static Port, Error> {
    let module = modules.iter().find(|module| letter(module.port) == slot.get_ref());
    module.map(|module| module.port).ok_or_else(|| {
        let known = modules.iter().map(|module| letter(module.port)).collect::<Vec<_>>().join(", ");
        let known = if known.is_empty() {
            "there is none at all".to_owned()
        } else {
            format!("modules are in: {known}")
        };
        let text = format!("{key} names slot '{}', in which there is no module; {known}", slot.get_ref());
        refused_at(slot.span(), text)
    })
}

impl DeviceConfig for Bm4Config {
    fn name(&self) -> &str {
        &self.name
    }

    fn layout(&self) -> &'static layout::DeviceLayout {
        &DEVICE
    }

    fn check(&self) -> Result<(), BuildError> {
        for module in &self.modules {
            let name = format!("{}:{}", self.name, module.port.name);
            time("lock_time_us", &name, module.lock_time_us)?;
            time_or_none("sync_loss_us", &name, module.sync_loss_us)?;
        }
        Ok(())
    }

    fn ports<'a>(&'a self) -> Vec<PortConfig<'a>> {
        let port = |module: &'a ModuleConfig| PortConfig {
            number: module.port.number,
            name: module.port.name,
            bus: module.bus.as_deref(),
            address: (module.kind == ModuleKind::Can05).then_some(module.dip),
        };
        let takes_part =
            |module: &&ModuleConfig| !matches!(module.work(), Work::InitError | Work::UnknownBaudRate);
        self.modules.iter().filter(takes_part).map(port).collect()
    }

    fn is_drive(&self, port: PortNumber) -> bool {
        let module = self.modules.iter().find(|module| module.port.number == port);
        module.is_some_and(|module| matches!(module.work(), Work::ControllerSlave(_)))
    }

    fn kbit_s(&self, _: PortNumber) -> Vec<u16> {
        BAUD_RATES.iter().map(|rate| rate.kbit_per_s).collect()
    }

    fn doubts(&self) -> Vec<Doubt> {
        self.modules.iter().filter_map(|module| self.doubt_of(module)).collect()
    }

    /// The manual of the modules does not mention retain flags.
    fn retain_bytes(&self) -> u32 {
        0
    }

    fn build(
        &self,
        index: DeviceIndex,
        segment: Segment,
    ) -> Result<(Box<dyn Device>, Vec<Plug>), BuildError> {
        let (plc, ports) = Bm4Plc::new(index, self, segment)?;
        Ok((Box::new(plc), ports))
    }
}

#[cfg(test)]
mod tests {
    use crate::devices::DeviceConfig;
    use toml::de::{Error, ValueDeserializer};

    fn read(text: &str) -> Result<std::sync::Arc<dyn DeviceConfig>, Error> {
        let read = || super::Bm4Config::read(ValueDeserializer::parse(text)?);
        read().map_err(|mut error: Error| {
            error.set_input(Some(text));
            error
        })
    }

    #[test]
    fn modules_are_masters_and_slaves_in_the_order_of_the_slots() {
        let config = read(
            "{ name = 'maxx', module = [{ slot = 'M', kind = 'can-05', bus = 'b', dip = 6 }, \
             { slot = 'G', kind = 'can-06', sync_in_from = 'M' }] }",
        )
        .unwrap();
        let ports = config.ports();
        let ports: Vec<_> =
            ports.iter().map(|port| (port.name, port.number.0, port.bus, port.address)).collect();
        assert_eq!(ports, [("slotG", 1, None, None), ("slotM", 6, Some("b"), Some(6))]);
    }

    #[test]
    fn each_mistake_is_reported_with_its_place() {
        let cases = [
            ("{ slot = 'I', kind = 'can-06' }", "there is no slot 'I'; slots are: G, H, J, K, L, M"),
            ("{ slot = 'G', kind = 'can-06' },\n{ slot = 'G', kind = 'can-06' }", "two modules in slot 'G'"),
            ("{ slot = 'G', kind = 'can-07' }", "unknown variant `can-07`"),
            ("{ slot = 'G', kind = 'can-06', dip = 3 }", "a BM4-O-CAN-06 has no DIP switches"),
            ("{ slot = 'G', kind = 'can-06', dip10 = true }", "a BM4-O-CAN-06 has no DIP switches"),
            ("{ slot = 'G', kind = 'can-05', dip_baud = 0b101 }", "reserved with DIP switch 9 at ON"),
            (
                "{ slot = 'G', kind = 'can-05', dip9 = false, dip_baud = 8 }",
                "dip_baud of 'maxx:slotG' is 8; it must be 0 to 7",
            ),
            ("{ slot = 'G', kind = 'can-05', sync_in_from = 'G' }", "only a BM4-O-CAN-06 passes"),
            ("{ slot = 'G', kind = 'can-05', dip = 32 }", "dip of 'maxx:slotG' is 32; it must be 0 to 31"),
            ("{ slot = 'G', kind = 'can-06', sync_in_from = 'H' }", "slot 'H', in which there is no module"),
            ("{ slot = 'G', kind = 'can-06', sync_in_from = 'G' }", "the module's own slot"),
        ];
        for (module, expected) in cases {
            let text = format!("{{ name = 'maxx', module = [\n{module}\n] }}");
            let message = read(&text).unwrap_err().to_string();
            assert!(message.contains(expected), "{text}\n{message}");
            let line = 1 + module.lines().count();
            assert!(message.contains(&format!("line {line},")), "{text}\n{message}");
        }
        let message = read("{ name = 'maxx', sync_source = 'G' }").unwrap_err().to_string();
        assert!(message.ends_with("there is none at all\n"), "{message}");
        let text = "{ name = 'maxx', sync_source = 'K', module = [{ slot = 'G', kind = 'can-06' }] }";
        let message = read(text).unwrap_err().to_string();
        assert!(message.contains("sync_source names slot 'K'"), "{message}");
    }
}
