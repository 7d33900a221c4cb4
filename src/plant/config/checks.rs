//! Checks that concern several devices or buses of a plant.

use super::{MOST, PlantConfig, PlantError, PortOf, equal_numbers};
use crate::devices;
use crate::devices::emulation::settings::range;
use crate::devices::{BuildError, BusSection, CardPlace, DeviceConfig};
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
        for (what, count) in [("PLC", self.devices.len()), ("bus", self.buses.len())] {
            if count > MOST {
                return Err(PlantError::TooMany { what, count });
            }
        }
        self.check_cards()?;
        check_names("PLC", self.devices.iter().map(|device| device.name()))?;
        check_names("bus", self.buses.iter().map(|bus| bus.name()))?;
        let participants = self.buses.iter().flat_map(|bus| bus.participants());
        check_names("drive", participants.map(|(name, _)| name))?;
        let buses: HashMap<_, _> = self.buses.iter().map(|bus| (bus.name(), &**bus)).collect();
        for device in &self.devices {
            device.check()?;
            self.check_ports(&**device, &buses)?;
        }
        for bus in &self.buses {
            bus.check()?;
            for door in bus.doors() {
                devices::door_fits(bus.family(), *door)
                    .map_err(|reason| BuildError::own(bus.name(), "doors", reason))?;
            }
        }
        let ports = self.ports_of_buses();
        for bus in &self.buses {
            check_bus(&**bus, ports.get(bus.name()).map_or(&[], Vec::as_slice))?;
        }
        self.resolved_faults().map(|_| ())
    }

    fn check_ports(
        &self,
        device: &dyn DeviceConfig,
        buses: &HashMap<&str, &dyn BusSection>,
    ) -> Result<(), PlantError> {
        for port in &device.ports() {
            let Some(name) = port.bus else { continue };
            let plc = device.name().to_owned();
            let Some(bus) = buses.get(name) else {
                let known: Vec<&str> = self.buses.iter().map(|bus| bus.name()).collect();
                let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
                let (port, bus) = (port.name.to_owned(), name.to_owned());
                return Err(PlantError::UnknownBus { plc, port, bus, known });
            };
            let right = device.layout().port_numbered(port.number).map_or(bus.family(), |port| port.medium);
            if right != bus.family() {
                let (port, bus, kind) = (port.name.to_owned(), name.to_owned(), bus.family());
                return Err(PlantError::OtherKind { plc, port, bus, kind, right });
            }
        }
        Ok(())
    }
}

impl PlantConfig {
    /// Checks that each option card is in a separate slot of a controller with slots.
    fn check_cards(&self) -> Result<(), PlantError> {
        let mut taken: HashMap<(&str, u8), &str> = HashMap::new();
        for device in &self.devices {
            let Some(CardPlace { controller, slot, .. }) = device.card_place() else { continue };
            let name = device.name();
            let refused = |reason: String| Err(BuildError::own(name, "slot", reason).into());
            let slots = self.device(controller).map_or(0, |device| device.card_slots());
            if !(1..=slots).contains(&slot) {
                return refused(format!(
                    "'{name}': '{controller}' has no slot {slot} for option cards; number of its slots: {slots}"
                ));
            }
            if let Some(other) = taken.insert((controller, slot), name) {
                return refused(format!(
                    "'{name}': slot {slot} of '{controller}' already has the option card '{other}'; use another slot"
                ));
            }
        }
        Ok(())
    }
}

fn check_bus(bus: &dyn BusSection, ports: &[PortOf<'_>]) -> Result<(), PlantError> {
    let name = || bus.name().to_owned();
    let mut masters = ports.iter().filter(|(_, port)| port.address.is_none());
    if bus.has_one_master()
        && let (Some((first, first_port)), Some((second, second_port))) = (masters.next(), masters.next())
    {
        let (first, second) = ((*first).to_owned(), (*second).to_owned());
        let (first_port, second_port) = (first_port.name.to_owned(), second_port.name.to_owned());
        return Err(PlantError::TwoMasters { bus: name(), first, first_port, second, second_port });
    }
    let equal = equal_numbers(bus, ports).into_iter().next().filter(|_| bus.refuses_equal_numbers());
    equal.map_or(Ok(()), |(number, first, second)| {
        Err(PlantError::SlaveNumber { bus: name(), number, first, second })
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
