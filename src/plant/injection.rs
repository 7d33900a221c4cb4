//! Faults as the plant's callers see them, and what acts on nodes and slaves as a whole.

use super::Plant;
use crate::devices::cansync::medium::SimBus;
use crate::fault::{Effect, Fault, FaultStatus, Faults, NodeEffect, Refusal, Sites, SlaveEffect};

impl Plant {
    /// Adds a fault; one whose time has come begins at once. Returns its number.
    ///
    /// # Errors
    /// [`Refusal`]: a number out of range, a bus, slave or node that the plant does not have, too many faults.
    pub fn add_fault(&mut self, fault: Fault) -> Result<u16, Refusal> {
        fault.check(&self.sites())?;
        let id = self.faults.add(self.now, fault, &mut self.journal)?;
        self.advance_faults();
        Ok(id)
    }

    /// Clears fault number `id`.
    ///
    /// # Errors
    /// [`Refusal::UnknownFault`] if there is none of that number, or no longer.
    pub fn clear_fault(&mut self, id: u16) -> Result<(), Refusal> {
        self.faults.clear(self.now, id, &mut self.journal)?;
        self.switch_slaves();
        Ok(())
    }

    /// Clears all faults; returns how many there were.
    pub fn clear_faults(&mut self) -> u16 {
        let ids: Vec<u16> = self.faults().map(|fault| fault.id).collect();
        let cleared = ids.into_iter().filter(|id| self.clear_fault(*id).is_ok());
        cleared.count() as u16 // at most MAX_FAULTS
    }

    /// The faults that wait or act, in the order in which they were added.
    pub fn faults(&self) -> impl Iterator<Item = FaultStatus> {
        self.faults.list()
    }

    /// Begins and ends what is due now.
    pub(super) fn advance_faults(&mut self) {
        self.faults.advance(self.now, &mut self.journal);
        self.switch_slaves();
        self.strike_controllers();
        self.find_next_slice();
    }

    fn switch_slaves(&mut self) {
        for (index, bus) in self.buses.iter_mut().enumerate() {
            bus.set_off(self.now, slaves_off(&self.faults, index));
        }
    }

    /// What faults can concern.
    fn sites(&self) -> Sites {
        Sites {
            slaves: self.buses.iter().map(SimBus::slaves).collect(),
            nodes: self.plcs.iter().map(|plc| [1, 2].map(|node| plc.bus_of(node).is_some())).collect(),
        }
    }

    /// BUS-off of nodes whose CAN controller works, faults of drives that have none.
    pub(super) fn strike_controllers(&mut self) {
        let (now, plcs, buses) = (self.now, &mut self.plcs, &mut self.buses);
        self.faults.strike(now, &mut self.journal, |effect, _| {
            let (plc, node) = match *effect {
                Effect::Node { plc, node, what: NodeEffect::BusOff } => (plc, node),
                Effect::Node { plc, what: NodeEffect::Trip(number), .. } => {
                    let trips = plcs.get_mut(usize::from(plc))?.trip_drive(now, number);
                    return trips.then_some(0);
                }
                Effect::Slave { bus, slave, what: SlaveEffect::Trip(number) } => {
                    let trips = buses.get_mut(usize::from(bus))?.trip_drive(now, slave, number);
                    return trips.then_some(0);
                }
                _ => return None,
            };
            let plc = plcs.get_mut(usize::from(plc))?;
            let (goes, slave) = match node {
                1 => (plc.slave.go_bus_off(), Some(plc.slave.number())),
                _ => (plc.master.go_bus_off(), None),
            };
            if let Some(bus) = plc.bus_of(node).and_then(|bus| buses.get_mut(bus)).filter(|_| goes) {
                bus.node_went_off(now, slave);
            }
            goes.then_some(0)
        });
    }
}

/// Slaves of a bus that are off, bit n for slave n.
fn slaves_off(faults: &Faults, index: usize) -> u32 {
    faults.acting().fold(0, |off, effect| match *effect {
        Effect::Slave { bus, slave, what: SlaveEffect::Off } if usize::from(bus) == index => {
            off | 1u32.checked_shl(slave.into()).unwrap_or(0)
        }
        _ => off,
    })
}
