//! The watch over the registers of a CANsync node, as part of the access checker ([`check`](crate::check)).
//!
//! `registers` says what is to be watched at which register, `node` finds what was written, `judge` holds it against the
//! rules, `mapping` those about frames as a whole.

mod judge;
mod mapping;
mod node;
mod registers;

pub(super) use node::NodeWatch;

use crate::layout::RegisterPhase;

/// What the rules must know about a node beyond its registers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facts {
    /// It is the master of its bus.
    pub is_master: bool,
    /// Which structure is valid.
    pub live: RegisterPhase,
    /// The node waits for initialization data, and the PLC has ordered to take them over.
    pub takes_over_init: bool,
    /// The node is in set-up mode or active operation.
    pub is_on_bus: bool,
    /// The node is in active operation.
    pub is_active: bool,
    /// For frames 1 and 2: when in the present interval the deadline was missed, in emulated microseconds, if the
    /// frame went out in the interval before.
    pub missed: [Option<u64>; 2],
    /// Slaves that a master expects, a bit each.
    pub expected: u32,
}
