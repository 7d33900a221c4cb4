//! Fault confinement: the effect of errors on a station (ISO 11898-1).
//!
//! Every controller counts the errors in transmitted and in received frames. If a controller has too many
//! errors, its error flags first become recessive, so that it no longer disturbs other stations. With still
//! more errors it leaves the bus.

use super::BitRate;
use serde::{Deserialize, Serialize};

/// The error state of a controller on its bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum ErrorState {
    /// The controller takes part, and its error flags are dominant.
    #[default]
    Active,
    /// The controller takes part as in [`ErrorState::Active`], but a counter has reached 96: the bus is heavily
    /// disturbed.
    Warning,
    /// A counter is above 127. The controller takes part, but its error flags are recessive, and after its own frames
    /// it waits for eight more bits.
    Passive,
    /// The counter of transmit errors is above 255. The controller does not take part.
    BusOff,
}

impl ErrorState {
    /// All states, from good to bad.
    pub const ALL: [ErrorState; 4] =
        [ErrorState::Active, ErrorState::Warning, ErrorState::Passive, ErrorState::BusOff];

    /// Returns the name of the state for programs.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            ErrorState::Active => "error_active",
            ErrorState::Warning => "error_warning",
            ErrorState::Passive => "error_passive",
            ErrorState::BusOff => "bus_off",
        }
    }
}

/// The two error counters of a controller.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct ErrorCounters {
    transmit: u16,
    receive: u16,
}

/// Lowest value of a counter at which the state is [`ErrorState::Warning`].
const WARNING: u16 = 96;
/// Highest value of the counters with which a station is error-active.
const LAST_ACTIVE: u16 = 127;
/// Highest value of the transmit counter with which a station takes part.
const LAST_ON: u16 = 255;
/// Step of the transmit counter for an error in a transmitted frame.
const TRANSMIT_STEP: u16 = 8;

impl ErrorCounters {
    /// Transmit errors, 0 to 256; 256 is BUS-off.
    #[must_use]
    pub const fn transmit(self) -> u16 {
        self.transmit
    }

    /// Receive errors, 0 to 128.
    #[must_use]
    pub const fn receive(self) -> u16 {
        self.receive
    }

    /// Returns the error state that follows from the counters.
    #[must_use]
    pub const fn state(self) -> ErrorState {
        let most = if self.transmit > self.receive { self.transmit } else { self.receive };
        if self.transmit > LAST_ON {
            ErrorState::BusOff
        } else if most > LAST_ACTIVE {
            ErrorState::Passive
        } else if most >= WARNING {
            ErrorState::Warning
        } else {
            ErrorState::Active
        }
    }

    /// Called when a transmitted frame has arrived.
    pub fn sent(&mut self) {
        self.transmit = self.transmit.saturating_sub(1);
    }

    /// Called when a frame of another station was received.
    pub fn received(&mut self) {
        self.receive = self.receive.saturating_sub(1);
    }

    /// Called when a transmitted frame has ended in an error.
    pub fn transmit_error(&mut self) {
        self.transmit = (self.transmit + TRANSMIT_STEP).min(LAST_ON + 1);
    }

    /// Called when no station has acknowledged the transmitted frame. An error-passive station does not count this
    /// error, so that a station alone on a bus repeats its frame without a limit.
    pub fn not_acknowledged(&mut self) {
        if self.state() < ErrorState::Passive {
            self.transmit_error();
        }
    }

    /// Called when a frame of another station has ended in an error. The counter of receive errors stops at
    /// 128, so the next good frame lowers it to 127. The standard requires a value from 119 to 127 after such
    /// a frame.
    pub fn receive_error(&mut self) {
        self.receive = (self.receive + 1).min(LAST_ACTIVE + 1);
    }

    /// Called when the controller switches itself off.
    pub fn bus_off(&mut self) {
        self.transmit = LAST_ON + 1;
    }
}

/// Number of sequences of eleven recessive bits after which a BUS-off station takes part again.
const RUNS: u32 = 128;
/// Number of recessive bits of a sequence that counts for the recovery from BUS-off.
const RUN: u32 = 11;

/// Recovery from BUS-off: 128 sequences of eleven consecutive recessive bits. An idle bus consists of such sequences. A
/// bus with frames has at least one such sequence after each frame.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Recovery {
    /// Number of sequences that are still missing.
    left: u32,
    /// Time from which sequences count, in nanoseconds.
    from_ns: u64,
}

impl Recovery {
    /// Starts the recovery at `now_ns`.
    #[must_use]
    pub const fn new(now_ns: u64) -> Self {
        Recovery { left: RUNS, from_ns: now_ns }
    }

    /// Called when a frame begins. The bus was recessive from `quiet_ns` to `begin_ns`.
    pub fn frame_begins(&mut self, begin_ns: u64, quiet_ns: u64, rate: BitRate) {
        // Times on the wire are rounded up by less than 1 ns. Without the `+ 1`, rounding could make a
        // complete sequence too short.
        let elapsed = u128::from((begin_ns + 1).saturating_sub(quiet_ns.max(self.from_ns)));
        let runs = elapsed * u128::from(rate.bit_s()) / (1_000_000_000 * u128::from(RUN));
        self.left = self.left.saturating_sub(u32::try_from(runs).unwrap_or(u32::MAX));
    }

    /// Returns the end of the recovery if the bus has been recessive since `quiet_ns` and no frame begins before this
    /// end.
    #[must_use]
    pub fn end_ns(&self, quiet_ns: u64, rate: BitRate) -> u64 {
        quiet_ns.max(self.from_ns).saturating_add(rate.time_ns(self.left * RUN))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(count: usize, mut step: impl FnMut(&mut ErrorCounters)) -> ErrorCounters {
        let mut counters = ErrorCounters::default();
        (0..count).for_each(|_| step(&mut counters));
        counters
    }

    #[test]
    fn the_limits_of_the_standard() {
        use ErrorState::{Active, BusOff, Passive, Warning};
        for (errors, transmit, state) in [
            (11, 88, Active),
            (12, 96, Warning),
            (15, 120, Warning),
            (16, 128, Passive),
            (31, 248, Passive),
            (32, 256, BusOff),
            (40, 256, BusOff),
        ] {
            let counters = after(errors, ErrorCounters::transmit_error);
            assert_eq!((counters.transmit(), counters.state()), (transmit, state), "{errors} errors");
        }
        for (errors, state) in [(95, Active), (96, Warning), (127, Warning), (128, Passive), (1000, Passive)]
        {
            assert_eq!(after(errors, ErrorCounters::receive_error).state(), state, "{errors} errors");
        }
    }

    #[test]
    fn a_good_frame_takes_one_away() {
        let mut counters = after(16, ErrorCounters::transmit_error);
        counters.sent();
        assert_eq!((counters.transmit(), counters.state()), (127, ErrorState::Warning));
        let mut counters = after(500, ErrorCounters::receive_error);
        counters.received();
        assert_eq!((counters.receive(), counters.state()), (127, ErrorState::Warning));
        let mut good = ErrorCounters::default();
        good.sent();
        good.received();
        assert_eq!(good, ErrorCounters::default());
    }

    #[test]
    fn alone_a_station_becomes_passive_and_no_more() {
        let alone = after(1000, ErrorCounters::not_acknowledged);
        assert_eq!((alone.transmit(), alone.state()), (128, ErrorState::Passive));
    }

    #[test]
    fn the_way_back_counts_runs_of_eleven_bits() {
        let rate = BitRate::new(125_000).unwrap();
        let mut it = Recovery::new(1_000_000);
        assert_eq!(it.end_ns(0, rate), 1_000_000 + 128 * 11 * 8_000);
        // 10 bits are not a sequence, 21 are one, and recessive bits before the start do not count.
        it.frame_begins(1_080_000, 0, rate);
        it.frame_begins(2_000_000, 2_000_000 - 21 * 8_000, rate);
        assert_eq!(it.end_ns(3_000_000, rate), 3_000_000 + 127 * 11 * 8_000);
        // Eleven bits that rounding has made a nanosecond shorter.
        let odd = BitRate::new(33_300).unwrap();
        let mut it = Recovery::new(0);
        it.frame_begins(odd.time_ns(111), odd.time_ns(100), odd);
        assert_eq!(it.end_ns(u64::MAX / 2, odd) - u64::MAX / 2, odd.time_ns(127 * 11));
    }
}
