//! What an installation has that faults can concern.

use super::{Effect, NodeEffect, Refusal};

/// Buses, slaves and nodes that a fault can name.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sites {
    /// The slaves of each bus in the order of the plant file, bit n for slave number n.
    pub slaves: Vec<u32>,
    /// For each PLC in the order of the plant file: whether its nodes 1 and 2 are on a bus.
    pub nodes: Vec<[bool; 2]>,
}

impl Sites {
    /// Checks that what the fault names is there.
    pub(super) fn check(&self, effect: &Effect) -> Result<(), Refusal> {
        match *effect {
            Effect::Frame { bus, .. } | Effect::Sync { bus, .. } => self.slaves_of(bus).map(|_| ()),
            Effect::Slave { bus, slave, .. } => {
                let present = self.slaves_of(bus)?;
                if present.checked_shr(slave.into()).unwrap_or(0) & 1 == 0 {
                    return Err(Refusal::NoSlave { bus, slave, present });
                }
                Ok(())
            }
            Effect::Node { plc, node, what } => {
                let count = self.nodes.len() as u16; // the plant file's indices are 16 bits wide
                let nodes = self.nodes.get(usize::from(plc)).ok_or(Refusal::UnknownPlc { plc, count })?;
                match (what, node, nodes) {
                    (NodeEffect::Trip(_) | NodeEffect::Silent | NodeEffect::Slow(_), 0, _) => Ok(()),
                    (NodeEffect::BusOff | NodeEffect::Overrun, 1, [true, _]) => Ok(()),
                    (NodeEffect::BusOff | NodeEffect::Overrun, 2, [_, true]) => Ok(()),
                    _ => Err(Refusal::NoNode { plc, node }),
                }
            }
        }
    }

    fn slaves_of(&self, bus: u16) -> Result<u32, Refusal> {
        let count = self.slaves.len() as u16; // as above
        self.slaves.get(usize::from(bus)).copied().ok_or(Refusal::UnknownBus { bus, count })
    }
}
