//! Asynchronous serial communication over RS485: characters, their formats and times, a line that several participants
//! share, and the protocols 3964R and USS.
//!
//! The module depends on no device. It uses no I/O and no clock. On the line, times are counted in
//! [ticks](TICKS_PER_SECOND): a bit of each permitted baud rate is a whole number of ticks. The plant uses microseconds,
//! so times are converted at its interface ([`ticks_from`], [`us_at`]).

mod character;
#[cfg(feature = "emulator")]
mod format;
#[cfg(feature = "emulator")]
mod line;
#[cfg(test)]
mod noise;
pub mod procedure_3964r;
pub mod uss;

pub use character::{Character, CharacterError, Received};
#[cfg(feature = "emulator")]
pub use format::{BAUD_RATES, CharacterFormat, Parity, Wires};
#[cfg(feature = "emulator")]
pub use line::{Line, OnLine, Pair, Signal};

/// An emulated time in microseconds.
pub type Time = u64;

/// Number of ticks in a second: the highest baud rate of the port (manual 5.00005.03a p. 10).
pub const TICKS_PER_SECOND: u32 = 38_400;

/// Returns the first tick that does not begin before microsecond `us`.
#[must_use]
pub const fn ticks_from(us: Time) -> u64 {
    scale(us, TICKS_PER_SECOND, 1_000_000)
}

/// Returns the first microsecond at which `ticks` ticks have passed.
#[must_use]
pub const fn us_at(ticks: u64) -> Time {
    scale(ticks, 1_000_000, TICKS_PER_SECOND)
}

/// Returns `value * by / of`, rounded up; the largest value if the result does not fit.
const fn scale(value: u64, by: u32, of: u32) -> u64 {
    let scaled = (value as u128 * by as u128).div_ceil(of as u128);
    if scaled > u64::MAX as u128 { u64::MAX } else { scaled as u64 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn conversions_round_up() {
        for (us, ticks) in
            [(0, 0), (1, 1), (26, 1), (27, 2), (1_000_000, 38_400), (u64::MAX, 708_354_972_430_446_783)]
        {
            assert_eq!(ticks_from(us), ticks, "{us}");
        }
        for ticks in [0, 1, 11, 383, 38_400, 1_000_000_007] {
            // Both conversions round up.
            assert!((ticks..=ticks + 1).contains(&ticks_from(us_at(ticks))), "{ticks}");
        }
        assert_eq!((us_at(11), us_at(38_400)), (287, 1_000_000));
        assert_eq!(us_at(u64::MAX), u64::MAX);
    }
}
