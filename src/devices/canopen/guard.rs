//! Node guarding: a master asks by remote frames, the node answers with its state and a bit that toggles; a node that is asked no
//! more misses its master.

use super::nmt::State;
use super::supervision::Supervision;
use serde::{Deserialize, Serialize};

/// The guarded end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Guarded {
    toggle: bool,
    /// Whether the master goes on asking.
    pub life: Supervision,
}

impl Guarded {
    /// The master has asked: the answer's only byte. The first one does not have the toggle bit.
    pub fn asked(&mut self, state: State, now: u64) -> u8 {
        let toggle = u8::from(self.toggle) << 7;
        self.toggle = !self.toggle;
        self.life.start(now);
        state.code() | toggle
    }

    /// The communication starts anew: nobody has asked yet.
    pub fn reset(&mut self) {
        self.toggle = false;
        self.life.stop();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_toggle_and_who_is_not_asked_any_more_notices() {
        let mut it = Guarded::default();
        it.life.set_period(300, 0);
        assert_eq!(it.life.next_time(), u64::MAX, "nobody has asked yet");
        assert_eq!(it.asked(State::PreOperational, 10), 0x7F);
        assert_eq!(it.asked(State::Operational, 20), 0x85);
        assert_eq!(it.asked(State::Stopped, 30), 0x04);
        assert!(it.life.look(330));
        it.reset();
        assert_eq!((it.life.is_missing(), it.asked(State::Operational, 400)), (false, 0x05));
    }
}
