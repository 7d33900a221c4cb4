//! Characters as a receiver sees them.

#[cfg(feature = "emulator")]
use serde::{Deserialize, Serialize};

/// A character that a receiver has received: a byte, or an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "emulator", derive(Serialize, Deserialize))]
pub enum Character {
    /// The character arrived without an error that its receiver could detect.
    Byte(u8),
    /// The receiver has detected an error. The content of the character is unknown.
    Error(CharacterError),
}

/// An error that a receiver has detected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, thiserror::Error)]
#[cfg_attr(feature = "emulator", derive(Serialize, Deserialize))]
pub enum CharacterError {
    /// The parity bit does not fit the data bits.
    #[error("wrong parity")]
    Parity,
    /// The character has no stop bit at the expected time.
    #[error("no stop bit")]
    Framing,
    /// The line was low for a character time or longer.
    #[error("break")]
    Break,
    /// Characters before this one were lost, because the receiver had no room.
    #[error("characters lost")]
    Overrun,
}

impl Character {
    /// Returns the byte, if the character has no error.
    #[must_use]
    pub const fn byte(self) -> Option<u8> {
        match self {
            Character::Byte(byte) => Some(byte),
            Character::Error(_) => None,
        }
    }
}

impl From<u8> for Character {
    fn from(byte: u8) -> Self {
        Character::Byte(byte)
    }
}

/// The content of a receiver's data and error registers after a character.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Received {
    /// Data bits as the receiver has sampled them; 0 after a break.
    pub octet: u8,
    /// The error that the receiver has detected.
    pub error: Option<CharacterError>,
}

impl From<Received> for Character {
    fn from(received: Received) -> Self {
        received.error.map_or(Character::Byte(received.octet), Character::Error)
    }
}
