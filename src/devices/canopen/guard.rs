//! Node guarding, node side. A master sends remote frames, and the node answers with its state and a toggle bit. If the
//! requests stop, the node reports that its master is missing.

use super::nmt::State;
use super::supervision::Supervision;
use serde::{Deserialize, Serialize};

/// State of node guarding in the guarded node.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct NodeGuarding {
    toggle: bool,
    /// Supervision of the master's requests.
    pub life: Supervision,
}

impl NodeGuarding {
    /// Called when the master has sent a request. Returns the single byte of the answer. The toggle bit of
    /// the first answer is 0.
    pub(crate) fn asked(&mut self, state: State, now: u64) -> u8 {
        let toggle = u8::from(self.toggle) << 7;
        self.toggle = !self.toggle;
        self.life.start(now);
        state.code() | toggle
    }

    /// Returns to the state before the first request, as at a start of the communication.
    pub(crate) fn reset(&mut self) {
        self.toggle = false;
        self.life.stop();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_toggle_and_missing_requests_are_noticed() {
        let mut it = NodeGuarding::default();
        it.life.set_period(300, 0);
        assert_eq!(it.life.next_time(), u64::MAX, "before the first request");
        assert_eq!(it.asked(State::PreOperational, 10), 0x7F);
        assert_eq!(it.asked(State::Operational, 20), 0x85);
        assert_eq!(it.asked(State::Stopped, 30), 0x04);
        assert!(it.life.look(330));
        it.reset();
        assert_eq!((it.life.is_missing(), it.asked(State::Operational, 400)), (false, 0x05));
    }
}
