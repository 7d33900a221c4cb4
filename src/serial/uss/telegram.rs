//! Telegrams as characters.

#[cfg(feature = "emulator")]
use serde::{Deserialize, Serialize};

/// The first character of a telegram.
pub const STX: u8 = 0x02;

/// Largest number of characters of the net data.
pub const MAX_DATA: usize = 252;

/// `ADR`: the address of a slave, and the kind of the telegram.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "emulator", derive(Serialize, Deserialize))]
pub struct Address(pub u8);

impl Address {
    /// A telegram for all slaves. Slaves do not answer it.
    pub const BROADCAST: Self = Address(0x20);

    /// Returns the address of a slave; only the lower five bits of `station` count.
    #[must_use]
    pub const fn of_station(station: u8) -> Self {
        Address(station & 0x1F)
    }

    /// Returns the address for a mirror telegram, which the slave returns unchanged.
    #[must_use]
    pub const fn mirror(self) -> Self {
        Address(self.0 | 0x40)
    }

    /// Returns the number of the slave, 0 to 31.
    #[must_use]
    pub const fn station(self) -> u8 {
        self.0 & 0x1F
    }

    /// True for a telegram for all slaves.
    #[must_use]
    pub const fn is_broadcast(self) -> bool {
        self.0 & 0x20 != 0
    }

    /// True for a mirror telegram.
    #[must_use]
    pub const fn is_mirror(self) -> bool {
        self.0 & 0x40 != 0
    }

    /// True for a special telegram. The manufacturer defines the meaning of its net data.
    #[must_use]
    pub const fn is_special(self) -> bool {
        self.0 & 0x80 != 0
    }
}

/// A telegram.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "emulator", derive(Serialize, Deserialize))]
pub struct Telegram {
    /// Address and kind.
    pub address: Address,
    /// Net data, at most [`MAX_DATA`] characters.
    pub data: Vec<u8>,
}

/// Reason for which characters are not a telegram.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, thiserror::Error)]
#[cfg_attr(feature = "emulator", derive(Serialize, Deserialize))]
pub enum TelegramError {
    /// `LGE` is too small or too large.
    #[error("LGE is {0}; it counts the characters after it, and must be 2 to 254")]
    Length(u8),
    /// The check sum is wrong.
    #[error("BCC is 16#{found:02X}; it must be 16#{expected:02X}")]
    CheckSum {
        /// Check sum of the telegram.
        found: u8,
        /// Check sum that the characters require.
        expected: u8,
    },
    /// A character was damaged.
    #[error("a character of the telegram has a parity or framing error, or was lost in the receiver")]
    DamagedCharacter,
    /// The line was interrupted.
    #[error("break: the line was interrupted")]
    Break,
    /// The telegram took longer than 1.5 times its characters.
    #[error("the telegram is incomplete after 1.5 times the time of its characters")]
    Late,
    /// The net data have more than [`MAX_DATA`] characters.
    #[error("{0} characters of net data; a telegram has at most 252")]
    TooLong(usize),
}

impl Telegram {
    /// Returns the characters of the telegram.
    ///
    /// # Errors
    /// The net data are longer than [`MAX_DATA`].
    pub fn characters(&self) -> Result<Vec<u8>, TelegramError> {
        let length = u8::try_from(self.data.len() + 2).ok().filter(|length| *length <= LONGEST);
        let Some(length) = length else { return Err(TelegramError::TooLong(self.data.len())) };
        let mut characters = vec![STX, length, self.address.0];
        characters.extend(&self.data);
        characters.push(check_sum(&characters));
        Ok(characters)
    }

    /// Returns the telegram of complete characters, from `STX` to `BCC`.
    pub(super) fn of_characters(characters: &[u8]) -> Result<Self, TelegramError> {
        match characters {
            [head @ .., found] if head.len() >= 3 => match check_sum(head) {
                expected if expected == *found => {
                    Ok(Telegram { address: Address(head[2]), data: head[3..].to_vec() })
                }
                expected => Err(TelegramError::CheckSum { found: *found, expected }),
            },
            _ => Err(TelegramError::Late),
        }
    }
}

/// Largest value of `LGE`.
pub(super) const LONGEST: u8 = 254;

fn check_sum(characters: &[u8]) -> u8 {
    characters.iter().fold(0, |sum, character| sum ^ character)
}
