//! Access checks for the registers of a CANsync node, as part of the access checker ([`check`](crate::check)).
//!
//! `registers` defines the checks of each register, and `node` detects writes. `judge` contains the rules for
//! single writes, and `mapping` the rules for whole frames.

mod judge;
mod mapping;
mod node;
mod registers;

pub(super) use node::NodeWatch;

use crate::layout::RegisterPhase;

/// Facts about a node that the rules need in addition to its registers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Facts {
    /// True if the node is the master of its bus.
    pub is_master: bool,
    /// Phase, which selects the valid structure.
    pub live: RegisterPhase,
    /// True if the node waits for initialization data, and the PLC has ordered it to take them over.
    pub takes_over_init: bool,
    /// True if the node is in set-up mode or active operation.
    pub is_on_bus: bool,
    /// True if the node is in active operation.
    pub is_active: bool,
    /// Time in emulated microseconds at which the deadline of frame 1 or 2 was missed in the present
    /// interval. `None` if the deadline was not missed, or if the frame was not sent in the previous
    /// interval.
    pub missed: [Option<u64>; 2],
    /// Slaves that a master expects, bit n for slave n.
    pub expected: u32,
}
