//! Faults as the plant's callers see them, and what acts on nodes and slaves as a whole.

use super::Plant;
use crate::fault::{Effect, Fault, FaultStatus, Faults, Hit, NodeEffect, Refusal, Sites, SlaveEffect};

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
        self.find_next_device();
    }

    fn switch_slaves(&mut self) {
        for (index, medium) in self.media.iter_mut().enumerate() {
            medium.set_off(self.now, slaves_off(&self.faults, index));
        }
    }

    /// What faults can concern.
    fn sites(&self) -> Sites {
        let nodes = 0..self.devices.len();
        Sites {
            slaves: self.media().iter().map(|medium| medium.participants()).collect(),
            nodes: nodes.map(|device| [1, 2].map(|port| self.is_plugged(device, port))).collect(),
        }
    }

    /// BUS-off of nodes whose CAN controller works, faults of drives that have none.
    pub(super) fn strike_controllers(&mut self) {
        let Plant { now, devices, media, ports, faults, journal, .. } = self;
        let now = *now;
        faults.strike(now, journal, |effect, _| {
            let hits = match *effect {
                Effect::Node { plc, node, what: NodeEffect::BusOff } => {
                    let port = ports.find(plc.into(), node)?;
                    media[port.medium].go_bus_off(port.place, now)
                }
                Effect::Node { plc, what: NodeEffect::Trip(number), .. } => {
                    devices.get_mut(usize::from(plc))?.trip(now, number)
                }
                Effect::Slave { bus, slave, what: SlaveEffect::Trip(number) } => {
                    media.get_mut(usize::from(bus))?.trip(now, slave, number)
                }
                _ => return None,
            };
            hits.then_some(Hit::Plain)
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
