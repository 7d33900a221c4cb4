//! A CAN-DP/2 as the plant file describes it.

use super::firmware::can_port::CanSide;
use super::firmware::dp_port;
use super::firmware::dp_port::DpPort;
use super::firmware::gateway::Gateway;
use super::firmware::master::Master;
use super::firmware::ram::Registers;
use super::firmware::stored::Stored;
use super::firmware::{Shared, share};
use crate::devices::can_bus::CanSocket;
use crate::devices::can_dp2::registers::{DEVICE, FRONT_SWITCHES};
use crate::devices::emulation::settings::{range, refused_at};
use crate::devices::profibus_bus::ProfibusSocket;
use crate::devices::{BuildError, Device, DeviceConfig, Plain, Plug, PortConfig, can_bus};
use crate::identity::DeviceIndex;
use crate::journal::Origin;
use crate::layout;
use crate::layout::{Area, Port};
use crate::memory::Segment;
use serde::Deserialize;
use std::sync::Arc;
use toml::Spanned;
use toml::de::{Error, ValueDeserializer};

/// A CAN-DP/2 of the plant file.
#[derive(Clone, Debug)]
pub struct CanDp2Config {
    name: String,
    profibus: Option<String>,
    can: Option<String>,
    switches: u8,
}

/// Keys of the section in the plant file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[serde(expecting = "a CAN-DP/2: a table with its settings")]
struct Section {
    name: String,
    profibus: Option<String>,
    can: Option<String>,
    switches: Option<Spanned<i64>>,
}

impl CanDp2Config {
    /// Reads a `[[device]]` section of kind `can-dp2`.
    pub(crate) fn read(value: ValueDeserializer<'_>) -> Result<Arc<dyn DeviceConfig>, Error> {
        let Section { name, profibus, can, switches } = Section::deserialize(value)?;
        let switches = match switches {
            None => 3,
            Some(set) => {
                // A negative value becomes the largest number, so that the range check refuses it, too.
                let value = u64::try_from(*set.get_ref()).unwrap_or(u64::MAX);
                range("switches", &name, value, 0..=0xFF, "0x00 to 0xFF")
                    .map_err(|error| refused_at(set.span(), error.to_string()))?;
                value as u8
            }
        };
        Ok(Arc::new(CanDp2Config { name, profibus, can, switches }))
    }

    /// Returns the name of the bus to which a port is connected.
    fn bus(&self, port: &Port) -> Option<&str> {
        if port.medium == can_bus::FAMILY { self.can.as_deref() } else { self.profibus.as_deref() }
    }
}

impl DeviceConfig for CanDp2Config {
    fn name(&self) -> &str {
        &self.name
    }

    fn layout(&self) -> &'static layout::DeviceLayout {
        &DEVICE
    }

    fn ports(&self) -> Vec<PortConfig<'_>> {
        let port = |port: &'static Port| PortConfig {
            address: (port.name == "dp").then(|| dp_port::address(self.switches.into()) as u8),
            ..PortConfig::of(port, self.bus(port))
        };
        DEVICE.ports.iter().map(port).collect()
    }

    fn novram(&self) -> Option<&'static Area> {
        super::firmware::stored::area()
    }

    fn build(
        &self,
        index: DeviceIndex,
        segment: Segment,
    ) -> Result<(Box<dyn Device>, Vec<Plug>), BuildError> {
        let gateway: Shared = share(Gateway::new(Registers::new(&segment)?));
        let mut plugs = Vec::new();
        for port in DEVICE.ports {
            let origin = Origin { plc: index, node: port.number };
            let registers = Registers::new(&segment)?;
            let (segment, layout, gateway) = (segment.clone(), &DEVICE, gateway.clone());
            let socket: Box<dyn core::any::Any + Send> = match port.name {
                "can" => Box::new(CanSocket {
                    origin,
                    segment,
                    layout,
                    port: Box::new(CanSide::new(registers, gateway)),
                }),
                "mst" => {
                    let port = Box::new(Master::new(&segment)?);
                    Box::new(ProfibusSocket { origin, segment, layout, port })
                }
                _ => {
                    let port = Box::new(DpPort::new(registers, gateway));
                    Box::new(ProfibusSocket { origin, segment, layout, port })
                }
            };
            let bus = self.bus(port).map(str::to_owned);
            plugs.push(Plug { number: port.number, family: port.medium, bus, socket });
        }
        segment.firmware_header()?.put(|page| &page.front[FRONT_SWITCHES], self.switches.into());
        let stored = Stored::new(&segment)?;
        Ok((Box::new(Plain::new(index, &self.name, &DEVICE, segment, stored)?), plugs))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn switches_are_two_hexadecimal_digits() {
        let read = |text: &str| {
            let read = CanDp2Config::read(ValueDeserializer::parse(text).unwrap());
            read.map(|config| format!("{config:?}")).map_err(|error| error.to_string())
        };
        let right = read("{ name = 'gw', profibus = 'dp', can = 'open', switches = 0x7D }").unwrap();
        assert!(right.contains("switches: 125"), "{right}");
        for wrong in ["256", "-1"] {
            let error = read(&format!("{{ name = 'gw', switches = {wrong} }}")).unwrap_err();
            assert!(
                error.contains("switches of 'gw' is") && error.contains("it must be 0x00 to 0xFF"),
                "{error}"
            );
        }
        assert!(read("{ name = 'gw', bus = 'dp' }").unwrap_err().contains("unknown field `bus`"));
    }
}
