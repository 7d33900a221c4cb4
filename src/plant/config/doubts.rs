//! Settings of a plant file that are allowed but are probably a mistake.

use super::{PlantConfig, PortOf, equal_numbers, file, places};
use crate::devices::{BusSection, Doubt, MasterConfig};
use std::sync::Arc;

impl PlantConfig {
    /// Returns allowed settings that are probably a mistake, with their lines in `text`, the file as it
    /// was read.
    #[must_use]
    pub fn doubts(&self, text: &str) -> Vec<(Option<usize>, Doubt)> {
        let ports = self.ports_of_buses();
        let master = |(name, port): &PortOf<'_>| {
            let device = self.device(name)?;
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
        let placed = |doubt: Doubt| {
            let offset = places::offset_of_key(&doubt.section, doubt.key, text);
            (offset.map(|offset| file::line_of(text, offset)), doubt)
        };
        let of_devices = self.devices.iter().flat_map(|device| device.doubts());
        of_devices.chain(self.buses.iter().flat_map(of)).map(placed).collect()
    }
}
