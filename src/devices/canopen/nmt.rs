//! Network management: the states of a node, and the commands that change them.

use serde::{Deserialize, Serialize};

/// State of a node, with its number in guarding telegrams.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Hash, bytemuck::CheckedBitPattern, Serialize, Deserialize,
)]
#[repr(u8)]
pub(crate) enum State {
    /// The device is not a CANopen node yet, or is restarting.
    #[default]
    Initialising = 0,
    /// The node is reached by SDO only.
    PreOperational = 127,
    /// The node exchanges PDOs, too.
    Operational = 5,
    /// The node takes part only in network management and guarding.
    Stopped = 4,
}

impl State {
    /// Returns the number in guarding telegrams.
    #[must_use]
    pub(crate) const fn code(self) -> u8 {
        self as u8
    }

    /// Returns the state with this number.
    #[must_use]
    pub(crate) fn from_code(code: u8) -> Option<Self> {
        bytemuck::checked::try_cast(code).ok()
    }

    /// True if SDOs are served and emergencies sent.
    #[must_use]
    pub(crate) const fn has_sdo(self) -> bool {
        matches!(self, State::PreOperational | State::Operational)
    }

    /// True if PDOs are exchanged.
    #[must_use]
    pub(crate) const fn has_pdo(self) -> bool {
        matches!(self, State::Operational)
    }
}

/// A command of a master to a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Command {
    /// The NMT command "Start Remote Node".
    Start,
    /// The NMT command "Stop Remote Node".
    Stop,
    /// The NMT command "Enter Pre-Operational".
    EnterPreOperational,
    /// The NMT command "Reset Node".
    ResetNode,
    /// The NMT command "Reset Communication".
    ResetCommunication,
}

impl Command {
    /// Returns the number on the wire.
    #[must_use]
    pub(crate) const fn code(self) -> u8 {
        match self {
            Command::Start => 1,
            Command::Stop => 2,
            Command::EnterPreOperational => 128,
            Command::ResetNode => 129,
            Command::ResetCommunication => 130,
        }
    }

    /// Parses the data of a frame with identifier 0: returns the command if it is for `node` or for all nodes.
    #[must_use]
    pub(crate) fn parse(data: &[u8], node: u8) -> Option<Self> {
        let &[command, to] = data else { return None };
        if to != 0 && to != node {
            return None;
        }
        Some(match command {
            1 => Command::Start,
            2 => Command::Stop,
            128 => Command::EnterPreOperational,
            129 => Command::ResetNode,
            130 => Command::ResetCommunication,
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_convert_in_both_directions() {
        let states =
            [State::Initialising, State::PreOperational, State::Operational, State::Stopped].map(State::code);
        assert_eq!(states, [0, 127, 5, 4]);
        assert!((0..=u8::MAX).all(|code| State::from_code(code).is_none_or(|state| state.code() == code)));
    }

    #[test]
    fn commands_are_two_bytes_for_one_node_or_all() {
        assert_eq!(Command::parse(&[1, 0], 32), Some(Command::Start));
        assert_eq!(Command::parse(&[130, 32], 32), Some(Command::ResetCommunication));
        let known = (0..=u8::MAX).filter_map(|code| Some((code, Command::parse(&[code, 0], 32)?)));
        assert!(known.clone().count() == 5 && known.clone().all(|(code, command)| command.code() == code));
        for other in [&[1, 33][..], &[1], &[1, 32, 0], &[3, 32], &[]] {
            assert_eq!(Command::parse(other, 32), None, "{other:?}");
        }
    }
}
