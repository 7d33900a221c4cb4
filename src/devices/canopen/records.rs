//! What the journal tells of a node.

use super::nmt::State;
use crate::event_kinds;
use crate::journal::{EventCodec, EventText, Fields, Kind, Reader};

/// The kind of [`NodeState`], one for all devices that tell of their nodes.
pub static NODE_STATE: &Kind = NodeState::KIND;

/// All kinds.
pub static KINDS: &[&Kind] = &[NODE_STATE];

event_kinds! {
    /// The CANopen node is in another state.
    NodeState = 61, "node_state", Rare, at plc {
        /// As in guarding telegrams.
        to: u8,
        /// The Node-ID.
        node: u8,
    }
}

/// A state in words.
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
