//! A module as the plant file describes it.

use super::channels::{CHANNELS, Channels, Model};
use super::module::Module;
use crate::can::Message;
use crate::devices::can_bus::CanSocket;
use crate::devices::canopen::messages::{MessageInfo, NodeMessages};
use crate::devices::cr201x::registers::DEVICE;
use crate::devices::emulation::settings::refused_at;
use crate::devices::{BuildError, Device, DeviceConfig, Plain, Plug, PortConfig};
use crate::identity::{DeviceIndex, PortNumber};
use crate::journal::Origin;
use crate::layout;
use crate::memory::Segment;
use serde::Deserialize;
use std::sync::Arc;
use toml::Spanned;
use toml::de::{Error, ValueDeserializer};

/// A module of the plant file.
#[derive(Clone, Debug)]
pub struct Cr201xConfig {
    /// Name, unique among the devices.
    pub name: String,
    /// Name of the bus.
    pub bus: Option<String>,
    /// Node-ID, 1 to 127.
    pub node_id: u8,
    /// Type of the module, and configuration of its connectors at delivery.
    pub channels: Channels,
}

/// Keys of the section in the plant file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[serde(expecting = "an I/O module: a table with its settings")]
struct Section {
    name: String,
    bus: Option<String>,
    module: Spanned<String>,
    node_id: Spanned<u64>,
    channels: Option<Spanned<Vec<u64>>>,
    pwm_hz: Option<Spanned<u64>>,
}

impl Cr201xConfig {
    /// Reads a `[[device]]` section of kind `cr201x`.
    pub(crate) fn read(value: ValueDeserializer<'_>) -> Result<Arc<dyn DeviceConfig>, Error> {
        let Section { name, bus, module, node_id, channels, pwm_hz } = Section::deserialize(value)?;
        let model = match module.get_ref().as_str() {
            "cr2010" => Model::Cr2010,
            "cr2011" => Model::Cr2011,
            other => {
                let text = format!("module of '{name}' is '{other}'; it is cr2010 or cr2011");
                return Err(refused_at(module.span(), text));
            }
        };
        let number = u8::try_from(*node_id.get_ref()).ok().filter(|number| (1..=127).contains(number));
        let Some(node_id) = number else {
            let text = format!("node_id of '{name}' is {}; it must be 1 to 127", node_id.get_ref());
            return Err(refused_at(node_id.span(), text));
        };
        let mut it = Channels::new(model);
        if let Some(kinds) = channels {
            let refuse = |text: String| refused_at(kinds.span(), format!("channels of '{name}': {text}"));
            if kinds.get_ref().len() != model.values() {
                let (given, right) = (kinds.get_ref().len(), model.values());
                return Err(refuse(format!("{given} values; a {} has {right}", model.name())));
            }
            for (index, kind) in kinds.get_ref().iter().enumerate() {
                if !u8::try_from(*kind).is_ok_and(|kind| it.set(index, kind)) {
                    let right: Vec<_> = model.allowed(index).iter().map(u8::to_string).collect();
                    return Err(refuse(format!(
                        "number {} is {kind}; it is {}",
                        index + 1,
                        right.join(", ")
                    )));
                }
            }
        }
        if let Some(hz) = pwm_hz
            && !u8::try_from(*hz.get_ref()).is_ok_and(|hz| it.set_pwm(hz))
        {
            let text = format!("pwm_hz of '{name}' is {}; it must be 20 to 200", hz.get_ref());
            return Err(refused_at(hz.span(), text));
        }
        Ok(Arc::new(Cr201xConfig { name, bus, node_id, channels: it }))
    }
}

impl DeviceConfig for Cr201xConfig {
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
        let of = NodeMessages { node: &self.name };
        let id = |first: u32| first + u32::from(self.node_id);
        let bits: Vec<_> = (1..=CHANNELS).map(|it| format!("connector_{it}")).collect();
        let bits: Vec<_> = bits.iter().map(|name| (name.as_str(), 1)).collect();
        let words = ["word_1", "word_2", "word_3", "word_4"].map(|name| (name, 16));
        let all = [
            (id(0x180), MessageInfo::sent("TX_PDO1", "Digital inputs"), &bits[..]),
            (id(0x280), MessageInfo::sent("TX_PDO2", "Analog inputs, currents"), &words),
            (id(0x200), MessageInfo::received("RX_PDO1", "Digital outputs"), &bits),
            (id(0x300), MessageInfo::received("RX_PDO2", "Analog outputs"), &words),
        ];
        let pdos = all.into_iter().map(|(cob_id, about, signals)| of.message(cob_id, about, signals));
        let services = of.services(id(0x080), id(0x700), id(0x600), id(0x580));
        of.broadcasts(0x080, false).chain(services).chain(pdos).flatten().collect()
    }

    fn build(
        &self,
        index: DeviceIndex,
        segment: Segment,
    ) -> Result<(Box<dyn Device>, Vec<Plug>), BuildError> {
        let mut plugs = Vec::new();
        for port in DEVICE.ports {
            let module = Module::new(&segment, self.node_id, self.channels)?;
            let origin = Origin { plc: index, node: port.number };
            let socket =
                CanSocket { origin, segment: segment.clone(), layout: &DEVICE, port: Box::new(module) };
            let (number, bus) = (port.number, self.bus.clone());
            plugs.push(Plug { number, family: port.medium, bus, socket: Box::new(socket) });
        }
        Ok((Box::new(Plain::new(index, &self.name, &DEVICE, segment, ())?), plugs))
    }
}
