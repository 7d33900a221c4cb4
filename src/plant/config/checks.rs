//! Checks of a plant as a whole that no device or medium can make by itself.

use super::{MOST, PlantConfig, PlantError, PortOf, equal_numbers};
use crate::devices;
use crate::devices::settings::range;
use crate::devices::{BUS_KINDS, BuildError, BusSection, DeviceConfig};
use std::collections::{BTreeSet, HashMap};

impl PlantConfig {
    /// Checks all parts of a plant file.
    ///
    /// # Errors
    /// [`PlantError`] with the wrong entry and a correct value.
    pub fn check(&self) -> Result<(), PlantError> {
        if self.devices.is_empty() {
            return Err(PlantError::NoPlc);
        }
        range("processor_cycle_us", "plant", self.processor_cycle_us.into(), 10..=10_000, "10 to 10000")
            .map_err(BuildError::from)?;
        // A port without a bus may need a placeholder, which has an index like a bus.
        let ports = self.devices.iter().flat_map(|device| device.ports());
        let placeholders = BUS_KINDS.len() + ports.filter(|port| port.medium.is_none()).count();
        for (what, count) in [("PLC", self.devices.len()), ("bus", self.media.len() + placeholders)] {
            if count > MOST {
                return Err(PlantError::TooMany { what, count });
            }
        }
        check_names("PLC", self.devices.iter().map(|device| device.name()))?;
        check_names("bus", self.media.iter().map(|medium| medium.name()))?;
        let participants = self.media.iter().flat_map(|medium| medium.participants());
        check_names("drive", participants.map(|(name, _)| name))?;
        let media: HashMap<_, _> = self.media.iter().map(|medium| (medium.name(), &**medium)).collect();
        for device in &self.devices {
            device.check()?;
            self.check_ports(&**device, &media)?;
        }
        for medium in &self.media {
            medium.check()?;
            for door in medium.doors() {
                devices::door_fits(medium.family(), *door)
                    .map_err(|reason| BuildError::own(medium.name(), "doors", reason))?;
            }
        }
        let ports = self.ports_of_media();
        for medium in &self.media {
            check_medium(&**medium, ports.get(medium.name()).map_or(&[], Vec::as_slice))?;
        }
        self.resolved_faults().map(|_| ())
    }

    fn check_ports(
        &self,
        device: &dyn DeviceConfig,
        media: &HashMap<&str, &dyn BusSection>,
    ) -> Result<(), PlantError> {
        for port in &device.ports() {
            let Some(bus) = port.medium else { continue };
            let plc = device.name().to_owned();
            let Some(medium) = media.get(bus) else {
                let known: Vec<&str> = self.media.iter().map(|medium| medium.name()).collect();
                let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
                let (port, bus) = (port.name.to_owned(), bus.to_owned());
                return Err(PlantError::UnknownBus { plc, port, bus, known });
            };
            let right =
                device.layout().port_numbered(port.number).map_or(medium.family(), |port| port.medium);
            if right != medium.family() {
                let (port, bus, kind) = (port.name.to_owned(), bus.to_owned(), medium.family());
                return Err(PlantError::OtherKind { plc, port, bus, kind, right });
            }
        }
        Ok(())
    }
}

fn check_medium(medium: &dyn BusSection, ports: &[PortOf<'_>]) -> Result<(), PlantError> {
    let bus = || medium.name().to_owned();
    let mut masters = ports.iter().filter(|(_, port)| port.address.is_none());
    if medium.has_one_master()
        && let (Some((first, first_port)), Some((second, second_port))) = (masters.next(), masters.next())
    {
        let (first, second) = ((*first).to_owned(), (*second).to_owned());
        let (first_port, second_port) = (first_port.name.to_owned(), second_port.name.to_owned());
        return Err(PlantError::TwoMasters { bus: bus(), first, first_port, second, second_port });
    }
    let equal = equal_numbers(medium, ports).into_iter().next().filter(|_| medium.refuses_equal_numbers());
    equal.map_or(Ok(()), |(number, first, second)| {
        Err(PlantError::SlaveNumber { bus: bus(), number, first, second })
    })
}

fn check_names<'a>(what: &'static str, names: impl Iterator<Item = &'a str>) -> Result<(), PlantError> {
    let mut seen = BTreeSet::new();
    for name in names {
        if crate::memory::names::check_plc(name).is_err() {
            return Err(PlantError::Name { what, name: name.to_owned() });
        }
        if !seen.insert(name) {
            return Err(PlantError::Duplicate { what, name: name.to_owned() });
        }
    }
    Ok(())
}
