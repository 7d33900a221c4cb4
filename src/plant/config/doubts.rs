//! Settings of a plant file that are allowed but are probably a mistake.

use super::places::NamedSections;
use super::{PlantConfig, PortOf, equal_numbers};
use crate::devices::{BusSection, Doubt, MasterConfig};
use std::collections::HashMap;
use std::sync::Arc;
use toml::de::DeTable;

impl PlantConfig {
    /// Returns settings that are allowed but are probably a mistake, with their lines in `text`, the original text of
    /// the file.
    #[must_use]
    pub fn doubts(&self, text: &str) -> Vec<(Option<usize>, Doubt)> {
        let ports = self.ports_of_buses();
        let devices: HashMap<_, _> = self.devices.iter().map(|device| (device.name(), device)).collect();
        let master = |(name, port): &PortOf<'_>| {
            let device = devices.get(name)?;
            port.address.is_none().then(|| MasterConfig {
                name: format!("{name}:{}", port.name),
                kbit_s: device.kbit_s(port.number),
            })
        };
        let of = |bus: &Arc<dyn BusSection>| {
            let masters: Vec<_> = ports.get(bus.name()).into_iter().flatten().filter_map(master).collect();
            let mut doubts = bus.doubts(&masters);
            let ports = ports.get(bus.name()).map_or(&[][..], Vec::as_slice);
            let has_stations = !ports.is_empty() || !bus.participants().is_empty();
            if bus.has_one_master() && masters.is_empty() && has_stations {
                let text = format!("bus '{}' has no master, so its stations wait without end", bus.name());
                doubts.push(Doubt { section: bus.name().to_owned(), key: "name", text });
            }
            doubts.extend(equal_numbers(&**bus, ports).into_iter().map(|(number, first, second)| Doubt {
                section: second.split(':').next().unwrap_or_default().to_owned(),
                key: "switches",
                text: format!(
                    "'{first}' and '{second}' have the same address {number} on bus '{}', so every request to it has two \
                     colliding answers; give each a separate address",
                    bus.name()
                ),
            }));
            doubts
        };
        let of_devices = self.devices.iter().flat_map(|device| device.doubts());
        let doubts: Vec<_> = of_devices.chain(self.buses.iter().flat_map(of)).collect();
        if doubts.is_empty() {
            return Vec::new();
        }
        let table = DeTable::parse(text).ok();
        let sections = table.as_ref().map(|table| NamedSections::new(table.get_ref()));
        // The line ends are searched only once, because there may be as many doubts as lines.
        let ends: Vec<_> =
            text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n').map(|it| it.0).collect();
        let placed = |doubt: Doubt| {
            let offset =
                sections.as_ref().and_then(|sections| sections.offset_of_key(&doubt.section, doubt.key));
            (offset.map(|offset| 1 + ends.partition_point(|end| *end < offset)), doubt)
        };
        doubts.into_iter().map(placed).collect()
    }
}
