//! What can be wrong with the description of a fault.

use super::kind::{Field, Kind};
use super::{FrameSlot, MAX_FAULTS};
use crate::journal::Names;
use core::fmt;
use thiserror::Error;

/// Why an installation refuses a fault. Made of numbers only, so that it can travel; buses and PLCs are counted
/// from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Refusal {
    /// A number out of its range.
    #[error("{field} is {}; it must be {} to {}", show(*.field, *.value), show(*.field, *.least), show(*.field, *.most))]
    Range {
        /// The field.
        field: Field,
        /// Its value.
        value: u64,
        /// Smallest value.
        least: u64,
        /// Largest value.
        most: u64,
    },
    /// An identifier with bits outside its mask.
    #[error("id 16#{id:03X} can never match under the mask 16#{mask:03X}; clear the bits outside the mask")]
    NeverMatches {
        /// The identifier.
        id: u16,
        /// The mask.
        mask: u16,
    },
    /// A count for a fault that does not come in hits.
    #[error("count has no meaning for slave_off; give duration_us, or clear the fault")]
    NotCounted,
    /// No such bus.
    #[error("bus {bus} does not exist; there are {count}, numbered from 0")]
    UnknownBus {
        /// The bus.
        bus: u16,
        /// Number of buses.
        count: u16,
    },
    /// No such PLC.
    #[error("PLC {plc} does not exist; there are {count}, numbered from 0")]
    UnknownPlc {
        /// The PLC.
        plc: u16,
        /// Number of PLCs.
        count: u16,
    },
    /// No such slave.
    #[error("bus {bus} has no slave {slave}; its slaves are: {}", slave_list(*.present))]
    NoSlave {
        /// The bus.
        bus: u16,
        /// The slave number.
        slave: u8,
        /// The slaves it has, bit n for slave n.
        present: u32,
    },
    /// A node that is not on a bus.
    #[error("node{node} of PLC {plc} is not on a bus; name a node, 1 or 2, that is")]
    NoNode {
        /// The PLC.
        plc: u16,
        /// The node.
        node: u8,
    },
    /// Too many faults at a time.
    #[error("there are {MAX_FAULTS} faults already; clear one first")]
    TooMany,
    /// No fault of that number.
    #[error("there is no fault {id}; it may have ended")]
    UnknownFault {
        /// The number.
        id: u16,
    },
}

/// What is wrong with a [`FaultSpec`](super::FaultSpec).
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum FaultError {
    /// A kind that does not exist.
    #[error("kind = \"{kind}\": there is no such fault; the kinds are: {}", list(Kind::ALL, Kind::name))]
    UnknownKind {
        /// As given.
        kind: String,
    },
    /// A field that is missing.
    #[error("{}: {field} is missing; {right}", .kind.name())]
    Missing {
        /// The kind.
        kind: Kind,
        /// The field.
        field: Field,
        /// What would be right.
        right: String,
    },
    /// A field that the kind does not have.
    #[error("{0}: {field} has no meaning; its fields are: {1}, at_us, count, duration_us", .kind.name(), list(.kind.fields().iter().copied(), Field::name))]
    NotForKind {
        /// The kind.
        kind: Kind,
        /// The field.
        field: Field,
    },
    /// A slot that does not exist, or not for this kind.
    #[error("{}: slot = \"{slot}\"; it must be {}", .kind.name(), list(.kind.slots().iter().copied(), FrameSlot::name))]
    Slot {
        /// The kind.
        kind: Kind,
        /// As given.
        slot: String,
    },
    /// A bus that does not exist.
    #[error("{}: bus \"{bus}\" does not exist; buses are: {known}", .kind.name())]
    UnknownBus {
        /// The kind.
        kind: Kind,
        /// As given.
        bus: String,
        /// The buses there are.
        known: String,
    },
    /// A PLC that does not exist.
    #[error("{}: PLC \"{plc}\" does not exist; PLCs are: {known}", .kind.name())]
    UnknownPlc {
        /// The kind.
        kind: Kind,
        /// As given.
        plc: String,
        /// The PLCs there are.
        known: String,
    },
    /// Two ways to end.
    #[error("{}: count and duration_us exclude each other; give one of them", .kind.name())]
    TwoLimits {
        /// The kind.
        kind: Kind,
    },
    /// A slave that the bus does not have.
    #[error("{}: bus \"{bus}\" has no slave {slave}; its slaves are: {}", .kind.name(), slave_list(*.present))]
    NoSlave {
        /// The kind.
        kind: Kind,
        /// The bus.
        bus: String,
        /// The slave number.
        slave: u8,
        /// The slaves it has, bit n for slave n.
        present: u32,
    },
    /// A node that is not on a bus.
    #[error("{}: node{node} of PLC \"{plc}\" is not on a bus; name a node, 1 or 2, that is", .kind.name())]
    NoNode {
        /// The kind.
        kind: Kind,
        /// The PLC.
        plc: String,
        /// The node.
        node: u8,
    },
    /// Numbers that are refused.
    #[error("{}: {refusal}", .kind.name())]
    Refused {
        /// The kind.
        kind: Kind,
        /// Why.
        refusal: Refusal,
    },
}

impl FaultError {
    /// The refusal of a fault, with the names of what it concerns.
    pub fn refused(kind: Kind, refusal: Refusal, names: &Names) -> Self {
        match refusal {
            Refusal::NoSlave { bus, slave, present } => {
                FaultError::NoSlave { kind, bus: names.bus(bus).into_owned(), slave, present }
            }
            Refusal::NoNode { plc, node } => {
                FaultError::NoNode { kind, plc: names.plc(plc).into_owned(), node }
            }
            refusal => FaultError::Refused { kind, refusal },
        }
    }
}

impl fmt::Display for Field {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// A value in the base in which its field is written.
fn show(field: Field, value: u64) -> String {
    if field.is_hexadecimal() { format!("16#{value:03X}") } else { value.to_string() }
}

fn list<T>(items: impl IntoIterator<Item = T>, name: impl Fn(T) -> &'static str) -> String {
    items.into_iter().map(name).collect::<Vec<_>>().join(", ")
}

/// Slave numbers as text; bit n of `mask` stands for slave n.
pub fn slave_list(mask: u32) -> String {
    let numbers: Vec<_> = (0..32).filter(|n| mask >> n & 1 != 0).map(|n: u32| n.to_string()).collect();
    if numbers.is_empty() { "none".to_owned() } else { numbers.join(", ") }
}
