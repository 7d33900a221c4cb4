//! Fast inputs: signals at inputs 0 to 3, and the functions `FREQUENCY`, `CYCLE` and `INC_ENCODER` (p. 96-99).

use serde::{Deserialize, Serialize};

/// Number of fast inputs.
pub(crate) const INPUTS: usize = 4;
/// Number of encoders. Their channels A and B are inputs 0 and 1, and inputs 2 and 3.
pub(crate) const ENCODERS: usize = 2;
/// A whole period of a signal. The unit is millihertz times microseconds.
const PERIOD: u64 = 1_000_000_000;
/// Longest time that `CYCLE` returns, in ms.
const MOST_MS: u64 = 65_535;

/// A square wave from a moment on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct Wave {
    /// Frequency of the signal in millihertz.
    mhz: u32,
    /// Start of the wave, in microseconds.
    since: u64,
    /// Phase at the start. The unit is that of [`PERIOD`].
    from: u64,
    /// Number of positive edges at the start.
    edges: u64,
}

impl Wave {
    /// Returns the phase at `now`, counted from the last edge before the start. The unit is that of
    /// [`PERIOD`].
    fn phase(&self, now: u64) -> u64 {
        self.from + now.saturating_sub(self.since) * u64::from(self.mhz)
    }

    fn edges(&self, now: u64) -> u64 {
        self.edges + self.phase(now) / PERIOD
    }
}

/// The signal at an input. Its phase is continuous when the frequency changes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Signal {
    wave: Wave,
    /// Wave before the last change.
    before: Wave,
}

impl Signal {
    /// Changes the frequency to this value in mHz from `now` on; 0 stops the signal.
    pub(crate) fn set(&mut self, mhz: u32, now: u64) {
        if mhz != self.wave.mhz {
            let (phase, edges) = (self.wave.phase(now) % PERIOD, self.wave.edges(now));
            self.before = core::mem::replace(&mut self.wave, Wave { mhz, since: now, from: phase, edges });
        }
    }

    /// Returns the number of positive edges until `now`. If `now` is before the last two changes of the
    /// frequency, returns the number at the earlier change.
    fn edges(&self, now: u64) -> u64 {
        if now < self.wave.since { self.before.edges(now) } else { self.wave.edges(now) }
    }

    /// True if the signal is high. It is high in the first half of each period. `None` if there is no signal.
    pub(crate) fn level(&self, now: u64) -> Option<bool> {
        (self.wave.mhz != 0).then(|| self.wave.phase(now) % PERIOD < PERIOD / 2)
    }

    /// Returns the time from one edge to the next in ms, 0 for a stopped signal.
    fn cycle_ms(&self) -> u64 {
        // The period in ms is 1000000 divided by the frequency in mHz.
        let mhz = u64::from(self.wave.mhz);
        (1_000_000 + mhz / 2).checked_div(mhz).unwrap_or(0)
    }
}

/// `CYCLE` at an input.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct Cycle {
    /// Number of edges at the initialisation; `None` before the initialisation.
    from: Option<u64>,
    ms: u16,
}

/// `INC_ENCODER` at a pair of inputs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct Encoder {
    /// Number of edges of channel A at the last count; `None` before the initialisation.
    from: Option<u64>,
    counter: i32,
}

/// Results of `INC_ENCODER`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct EncoderCount {
    /// Value of the output COUNTER.
    pub counter: i32,
    /// UP: true if the counter has counted up since the last call.
    pub is_up: bool,
    /// DOWN: true if the counter has counted down since the last call.
    pub is_down: bool,
}

/// The fast inputs of a controller: inputs 0 to 3, encoders 0 and 1.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct FastInputs {
    pub signals: [Signal; INPUTS],
    /// Encoders that turn backwards. Signal B is then ahead of signal A.
    pub is_backwards: [bool; ENCODERS],
    /// Time of the initialisation by `FREQUENCY`.
    frequencies: [Option<u64>; INPUTS],
    cycles: [Cycle; INPUTS],
    encoders: [Encoder; ENCODERS],
}

impl FastInputs {
    /// Handles power-on: the signals continue, and all measurements are reset.
    pub(crate) fn power_on(&mut self) {
        *self = FastInputs { signals: self.signals, is_backwards: self.is_backwards, ..Self::default() };
    }

    /// Returns the levels of the inputs with signals, and a mask of these inputs, bit n for input n.
    pub(crate) fn levels(&self, now: u64) -> (u16, u16) {
        let mut levels = (0, 0);
        for (input, signal) in self.signals.iter().enumerate() {
            if let Some(is_high) = signal.level(now) {
                levels.0 |= u16::from(is_high) << input;
                levels.1 |= 1 << input;
            }
        }
        levels
    }

    /// Runs `FREQUENCY` (p. 97): returns the frequency in Hz, from the positive edges within the last
    /// complete TIMEBASE. Returns 0 until the first TIMEBASE is complete.
    pub(crate) fn frequency(&mut self, input: u8, is_init: bool, base_us: u64, now: u64) -> u16 {
        let signal = &self.signals[usize::from(input)];
        let from = &mut self.frequencies[usize::from(input)];
        if is_init {
            *from = Some(now);
        }
        let Some(from) = *from else { return 0 };
        // If the program calls late, it gets the value of the last complete time base.
        let base_us = base_us.max(1);
        let Some(last) = ((now - from) / base_us).checked_sub(1) else { return 0 };
        let begin = from + last * base_us;
        let edges = signal.edges(begin + base_us) - signal.edges(begin);
        u16::try_from((edges * 1_000_000 + base_us / 2) / base_us).unwrap_or(u16::MAX)
    }

    /// Runs `CYCLE` (p. 98): returns the time in ms between two positive edges, as soon as there were two
    /// edges.
    pub(crate) fn cycle(&mut self, input: u8, is_init: bool, now: u64) -> u16 {
        let signal = &self.signals[usize::from(input)];
        let it = &mut self.cycles[usize::from(input)];
        if is_init {
            *it = Cycle { from: Some(signal.edges(now)), ms: 0 };
        }
        if it.from.is_some_and(|from| signal.edges(now) >= from + 2) && signal.wave.mhz != 0 {
            it.ms = signal.cycle_ms().min(MOST_MS) as u16;
        }
        it.ms
    }

    /// Runs `INC_ENCODER` (p. 99): counts positive edges of channel A, up or down.
    pub(crate) fn encoder(
        &mut self,
        encoder: u8,
        is_init: bool,
        preset: Option<i32>,
        now: u64,
    ) -> EncoderCount {
        let is_backwards = self.is_backwards[usize::from(encoder)];
        let edges = self.signals[2 * usize::from(encoder)].edges(now);
        let it = &mut self.encoders[usize::from(encoder)];
        if is_init {
            *it = Encoder { from: Some(edges), counter: 0 };
        }
        let Some(before) = it.from else { return EncoderCount::default() };
        it.from = Some(edges);
        if let Some(preset) = preset {
            it.counter = preset;
            return EncoderCount { counter: preset, is_up: false, is_down: false };
        }
        let steps = edges - before;
        // The counter wraps at both ends.
        let by = steps as i32;
        it.counter = it.counter.wrapping_add(if is_backwards { by.wrapping_neg() } else { by });
        let has_moved = steps != 0;
        let (is_up, is_down) = (has_moved && !is_backwards, has_moved && is_backwards);
        EncoderCount { counter: it.counter, is_up, is_down }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1000;

    fn with(input: usize, mhz: u32) -> FastInputs {
        let mut inputs = FastInputs::default();
        inputs.signals[input].set(mhz, 0);
        inputs
    }

    #[test]
    fn a_period_is_high_in_its_first_half() {
        let inputs = with(0, 1_000);
        for (at, is_high) in
            [(0, true), (499_999, true), (500_000, false), (999_999, false), (1_000_000, true)]
        {
            assert_eq!(inputs.levels(at), (u16::from(is_high), 1), "at {at} us");
        }
        assert_eq!(with(0, 0).levels(MS), (0, 0), "no signal, no level");
    }

    /// Manual p. 97.
    #[test]
    fn a_frequency_is_measured_over_the_last_whole_time_base() {
        let mut inputs = with(3, 500_000);
        let mut at = |is_init, ms: u64| inputs.frequency(3, is_init, 100 * MS, ms * MS);
        assert_eq!(at(false, 0), 0, "not initialised");
        assert_eq!((at(true, 10), at(false, 109), at(false, 110)), (0, 0, 500));
        inputs.signals[3].set(0, 110 * MS);
        assert_eq!(inputs.frequency(3, false, 100 * MS, 150 * MS), 500);
        assert_eq!(inputs.frequency(3, false, 100 * MS, 210 * MS), 0);
    }

    /// Manual p. 98.
    #[test]
    fn a_cycle_needs_two_edges() {
        let mut inputs = with(0, 10_000);
        let mut at = |is_init, ms: u64| inputs.cycle(0, is_init, ms * MS);
        assert_eq!((at(true, 50), at(false, 199), at(false, 200)), (0, 0, 100));
        let mut slow = with(0, 1);
        slow.cycle(0, true, 0);
        assert_eq!(slow.cycle(0, false, 2_000_000_000), 65_535, "the longest time");
    }

    /// Manual p. 99.
    #[test]
    fn an_encoder_counts_up_and_down() {
        let mut inputs = with(2, 1_000_000);
        let counted = |counter, is_up, is_down| EncoderCount { counter, is_up, is_down };
        assert_eq!(inputs.encoder(1, true, None, 0), counted(0, false, false));
        assert_eq!(inputs.encoder(1, false, None, 10 * MS), counted(10, true, false));
        inputs.is_backwards[1] = true;
        assert_eq!(inputs.encoder(1, false, None, 13 * MS), counted(7, false, true));
        assert_eq!(inputs.encoder(1, false, Some(-100), 20 * MS), counted(-100, false, false));
        assert_eq!(inputs.encoder(1, false, None, 21 * MS), counted(-101, false, true));
        inputs.signals[2].set(0, 21 * MS);
        assert_eq!(inputs.encoder(1, false, None, 40 * MS), counted(-101, false, false));
        inputs.power_on();
        assert_eq!(inputs.encoder(1, false, None, 50 * MS), counted(0, false, false));
    }

    #[test]
    fn a_signal_keeps_its_phase_when_the_frequency_changes() {
        let mut signal = Signal::default();
        signal.set(1_000, 0);
        signal.set(2_000, 250 * MS);
        assert_eq!((signal.level(250 * MS), signal.edges(624 * MS)), (Some(true), 0));
        assert_eq!(
            (signal.edges(625 * MS), signal.level(625 * MS), signal.level(900 * MS)),
            (1, Some(true), Some(false))
        );
        signal.set(0, 700 * MS);
        assert_eq!((signal.edges(9_000 * MS), signal.level(9_000 * MS)), (1, None));
    }
}
