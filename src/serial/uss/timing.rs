//! Times of the protocol.

#[cfg(feature = "emulator")]
use serde::{Deserialize, Serialize};

/// Bits of a character: start bit, eight data bits, even parity, stop bit.
const CHARACTER_BITS: u64 = 11;

/// Times that follow from the baud rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "emulator", derive(Serialize, Deserialize))]
pub struct Timing {
    baud_rate: u32,
}

impl Timing {
    /// Longest time from the end of a request to the begin of the answer, in microseconds.
    pub const RESPONSE_DELAY: u64 = 20_000;

    /// Returns the times for a baud rate in bit/s. A rate of 0 counts as 1.
    #[must_use]
    pub const fn new(baud_rate: u32) -> Self {
        Timing { baud_rate: if baud_rate == 0 { 1 } else { baud_rate } }
    }

    /// Returns the time of consecutive characters in microseconds, rounded up.
    #[must_use]
    pub const fn characters(self, count: u64) -> u64 {
        (count * CHARACTER_BITS * 1_000_000).div_ceil(self.baud_rate as u64)
    }

    /// Returns the shortest silence before a telegram in microseconds: two characters.
    #[must_use]
    pub const fn start_delay(self) -> u64 {
        self.characters(2)
    }

    /// Returns the longest time from the end of `STX` to the end of the telegram in microseconds, for `data` characters
    /// of net data: 1.5 times the characters `LGE`, `ADR`, net data and `BCC`.
    #[must_use]
    pub const fn residual(self, data: usize) -> u64 {
        self.characters(3 * (data as u64 + 3)).div_ceil(2)
    }
}
