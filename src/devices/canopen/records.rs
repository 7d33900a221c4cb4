//! Journal events of a node.

use super::nmt::State;
use crate::event_kinds;
use crate::journal::{EventCodec, EventKind, EventText, Fields, Reader};

/// The kind of [`NodeState`], shared by all devices that report states of nodes.
pub(crate) static NODE_STATE: &EventKind = NodeState::KIND;

/// All event kinds of this module.
pub(crate) static KINDS: &[&EventKind] = &[NODE_STATE];

event_kinds! {
    /// The state of the CANopen node has changed.
    NodeState = 61, "node_state", Rare, at plc {
        /// Number of the state in guarding telegrams.
        to: u8,
        /// Node-ID of the device.
        node: u8,
    }
}

/// Returns the name of a state.
fn state(code: u8) -> &'static str {
    match State::from_code(code) {
        Some(State::Initialising) => "initialising",
        Some(State::PreOperational) => "pre-operational",
        Some(State::Operational) => "operational",
        Some(State::Stopped) => "prepared",
        None => "unknown",
    }
}

impl EventText for NodeState {
    fn text(&self, _: &mut Reader) -> String {
        format!("CANopen node {}: {}", self.node, state(self.to))
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        Fields::new().with("to", state(self.to)).with("node", self.node)
    }
}
