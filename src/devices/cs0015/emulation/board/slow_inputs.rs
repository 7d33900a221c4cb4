//! Inputs 4 to 15 and their filter, which passes only signals of up to 25 Hz (p. 7).

use super::fast_inputs;
use serde::{Deserialize, Serialize};

/// Half a period at 25 Hz, in us. A level that is shorter has no effect (D-660).
const LEAST_US: u64 = 20_000;
/// Inputs without this filter, bit n for input n.
const FAST: u16 = (1 << fast_inputs::INPUTS) - 1;

/// The filter of inputs 4 to 15.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct SlowInputs {
    /// Levels after the filter, bit n for input n.
    passed: u16,
    /// Levels at the terminals at the last check.
    terminals: u16,
    /// Start of the present level of each terminal, in us.
    since: [u64; 16],
}

impl SlowInputs {
    /// Handles power-on. The present levels at the terminals take effect at once.
    pub(crate) fn power_on(terminals: u16, now: u64) -> Self {
        SlowInputs { passed: terminals, terminals, since: [now; 16] }
    }

    /// Checks the terminals at `now`.
    pub(crate) fn look(&mut self, terminals: u16, now: u64) {
        if self.passed == self.terminals && self.terminals == terminals {
            return;
        }
        for (input, since) in self.since.iter_mut().enumerate() {
            let bit = 1 << input;
            if now - *since >= LEAST_US {
                self.passed = self.passed & !bit | self.terminals & bit;
            }
            if (self.terminals ^ terminals) & bit != 0 {
                *since = now;
            }
        }
        self.terminals = terminals;
    }

    /// Returns the levels of all inputs; inputs 0 to 3 are not filtered.
    pub(crate) fn levels(&self, terminals: u16) -> u16 {
        terminals & FAST | self.passed & !FAST
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1000;

    /// Manual p. 7: inputs 4 to 15 follow signals of at most 25 Hz.
    #[test]
    fn a_level_passes_after_half_a_period_of_25_hz() {
        let mut inputs = SlowInputs::power_on(0, 0);
        inputs.look(0x8013, 100 * MS);
        assert_eq!(inputs.levels(0x8013), 0x0003, "inputs 0 to 3 have no such filter");
        inputs.look(0x8013, 119 * MS);
        assert_eq!(inputs.levels(0x8013), 0x0003);
        inputs.look(0x8013, 120 * MS);
        assert_eq!(inputs.levels(0x8013), 0x8013);
    }

    /// Manual p. 7.
    #[test]
    fn a_signal_of_25_hz_passes_and_a_faster_one_does_not() {
        let edges = |half_us: u64| {
            let mut inputs = SlowInputs::default();
            let mut seen = Vec::new();
            for now in (0..1000 * MS).step_by(500) {
                let level = if (now / half_us).is_multiple_of(2) { 0 } else { 0x10 };
                inputs.look(level, now);
                seen.push(inputs.levels(level));
            }
            seen.windows(2).filter(|two| two[0] != two[1]).count()
        };
        assert_eq!((edges(20 * MS), edges(19 * MS)), (48, 0));
    }
}
