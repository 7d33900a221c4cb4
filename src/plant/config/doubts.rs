//! What a plant file may say and can hardly mean.

use super::{PlantConfig, PortOf, file, places};
use crate::devices::{Doubt, MasterConfig, MediumConfig};
use std::sync::Arc;

impl PlantConfig {
    /// What in it is allowed and can hardly be meant, with its line in `text`, the file as it was read.
    #[must_use]
    pub fn doubts(&self, text: &str) -> Vec<(Option<usize>, Doubt)> {
        let ports = self.ports_of_media();
        let master = |(name, port): &PortOf<'_>| {
            let device = self.device(name)?;
            port.address.is_none().then(|| MasterConfig {
                name: format!("{name}:{}", port.name),
                kbit_s: device.kbit_s(port.number),
            })
        };
        let of = |medium: &Arc<dyn MediumConfig>| {
            let masters: Vec<_> = ports.get(medium.name()).into_iter().flatten().filter_map(master).collect();
            medium.doubts(&masters)
        };
        let placed = |doubt: Doubt| {
            let offset = places::offset_of_key(&doubt.section, doubt.key, text);
            (offset.map(|offset| file::line_of(text, offset)), doubt)
        };
        let of_devices = self.devices.iter().flat_map(|device| device.doubts());
        of_devices.chain(self.media.iter().flat_map(of)).map(placed).collect()
    }
}
