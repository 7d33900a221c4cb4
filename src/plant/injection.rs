//! Functions of the plant for faults.

use super::Plant;
use crate::devices;
use crate::fault::{DeviceSite, Fault, FaultStatus, Owner, Refusal, Sites};

impl Plant {
    /// Adds a fault and returns its number. If the start time of the fault has passed, the fault begins immediately.
    ///
    /// # Errors
    /// [`Refusal`]: the plant has no such bus, slave or port, the target cannot have this fault, or there are
    /// too many faults.
    pub fn add_fault(&mut self, fault: Fault) -> Result<u16, Refusal> {
        let owner = self.sites().owner(&fault)?;
        let id = self.faults.add(self.now, fault, owner, &mut self.journal)?;
        self.advance_faults();
        Ok(id)
    }

    /// Clears fault number `id`.
    ///
    /// # Errors
    /// [`Refusal::UnknownFault`] if no fault has that number, or the fault has ended.
    pub fn clear_fault(&mut self, id: u16) -> Result<(), Refusal> {
        self.faults.clear(self.now, id, &mut self.journal)?;
        self.tell_of_faults();
        self.find_next_device();
        Ok(())
    }

    /// Clears all faults. Returns how many there were.
    pub fn clear_faults(&mut self) -> u16 {
        let ids: Vec<u16> = self.faults().map(|fault| fault.id).collect();
        let cleared = ids.into_iter().filter(|id| self.clear_fault(*id).is_ok());
        cleared.count() as u16 // at most MAX_FAULTS
    }

    /// Returns the pending and active faults, in the order in which they were added.
    pub fn faults(&self) -> impl Iterator<Item = FaultStatus> {
        self.faults.list()
    }

    /// True if the fault with this number has taken effect since it was added, even if it has ended. After a return to an
    /// earlier moment, only pending and active faults are known.
    pub fn fault_has_acted(&self, id: u16) -> bool {
        self.faults.has_acted(id)
    }

    /// Begins and ends faults at the present time.
    pub(super) fn advance_faults(&mut self) {
        self.faults.advance(self.now, &mut self.journal);
        self.tell_of_faults();
        self.fire();
        self.find_next_device();
    }

    fn tell_of_faults(&mut self) {
        self.is_rescheduled = true;
        (self.has_looked, self.is_seen) = (false, false);
        for bus in &mut self.buses {
            if let Some(faulty) = bus.faults() {
                faulty.faults_changed(self.now, &self.faults);
            }
        }
        for device in &mut self.devices {
            if let Some(faulty) = device.faults() {
                faulty.faults_changed(self.now, &self.faults);
            }
        }
    }

    /// Returns the targets that faults can have in this plant.
    pub(super) fn sites(&self) -> Sites {
        let buses = self.buses().iter();
        let buses = buses.map(|bus| devices::bus_site(bus.family(), bus.participants()));
        let devices = self.devices.iter().zip(self.ports.of_devices()).map(|(device, ports)| {
            let plugged = ports.iter().filter(|port| port.bus.index() < self.named_buses);
            DeviceSite {
                layout: device.layout(),
                faults: device.fault_kinds(),
                plugged: plugged.map(|port| (port.number, port.bus)).collect(),
                drives: ports.iter().map(|port| port.number).filter(|port| device.is_drive(*port)).collect(),
            }
        });
        Sites { buses: buses.collect(), devices: devices.collect() }
    }

    /// Applies the faults that act at a certain time, without an operation of their target.
    pub(super) fn fire(&mut self) {
        let Plant { now, devices, buses, faults, journal, is_rescheduled, .. } = self;
        *is_rescheduled = true;
        let now = *now;
        faults.fire_all(now, journal, |owner, target, effect| match owner {
            Owner::Bus(index) => buses.get_mut(index.index())?.faults()?.fire(now, target, effect),
            Owner::Device(index) => devices.get_mut(index.index())?.faults()?.fire(now, target, effect),
        });
    }
}
