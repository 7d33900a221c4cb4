//! `w_COMMAND_REG`: which values are exchanged, and when (manual 5.00005.03a p. 88-91).

use crate::devices::omega_drive_line_2::registers::values::baps_command_reg::{
    METHOD, NUMBER, SAME_CYCLE, SLICES, TIME_SLICE,
};
use core::ops::Range;
use serde::{Deserialize, Serialize};

/// Time slice of the drive for the BAPS, in us.
pub(crate) const SLICE_US: u64 = 500;
/// Number of reference values that are transferred in one communication with [`Method::SameCycle`].
const SAME_CYCLE_WRITES: usize = 2;
/// First version of the drive software that transfers four actual values in one communication (manual p. 104).
pub(super) const FOUR_ACTUAL_VALUES: u32 = 309;

/// Bits 2-1: method for the selection of reference and actual values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Method {
    /// Time-slice method. Each communication transfers one of up to eight values. Value x is transferred half
    /// as often as value x-1.
    TimeSlice,
    /// Each communication transfers two reference values, and two (with newer drive software, four) actual
    /// values.
    SameCycle,
}

/// Cycle times for a value of `w_COMMAND_REG`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Cycle {
    method: Method,
    period: u64,
    first: u64,
}

impl Cycle {
    /// Reads `w_COMMAND_REG`; `None` if method or number is a reserved value. Reserved bits are ignored (decision
    /// D-153).
    pub(crate) fn from_register(word: u16) -> Option<Self> {
        let method = match word & METHOD {
            TIME_SLICE => Method::TimeSlice,
            SAME_CYCLE => Method::SameCycle,
            _ => return None,
        };
        let number = (word & NUMBER) >> NUMBER.trailing_zeros();
        // With a counter, the period is `number` slices. With binary division, time slot v comes every 2^v
        // slices, and slice 2^(v-1) is its first one. The communication takes place one slice later (decision
        // D-154).
        let (period, first) = match (number, word & SLICES != 0) {
            (0, _) => return None,
            (number, false) => (u64::from(number), u64::from(number)),
            (number, true) => (1 << number, (1 << (number - 1)) + 1),
        };
        Some(Cycle { method, period: period * SLICE_US, first: first * SLICE_US })
    }

    /// Selection of the values.
    #[inline]
    pub(crate) fn method(&self) -> Method {
        self.method
    }

    /// t_cycK: time between two communications, in us.
    #[inline]
    pub(crate) fn communication_us(&self) -> u64 {
        self.period
    }

    /// Returns the time from the configuration to the first communication, in us.
    pub(crate) fn first_us(&self) -> u64 {
        self.first
    }

    /// Returns t_cycP: the time between two exchanges of value `x` (0 to 7), in us.
    #[cfg(test)]
    pub(crate) fn value_us(&self, x: u8) -> u64 {
        match self.method {
            Method::TimeSlice => (2 * self.period) << x,
            Method::SameCycle => self.period,
        }
    }

    /// Returns the reference values and actual values of communication `count`, counted from 1, with this
    /// version of the drive software (D-15).
    pub(crate) fn values(&self, count: u64, software: u32) -> (Range<usize>, Range<usize>) {
        match self.method {
            Method::TimeSlice => {
                let x = count.trailing_zeros() as usize;
                let due = if x < 8 { x..x + 1 } else { 0..0 };
                (due.clone(), due)
            }
            Method::SameCycle if software < FOUR_ACTUAL_VALUES => (0..SAME_CYCLE_WRITES, 0..2),
            Method::SameCycle => (0..SAME_CYCLE_WRITES, 0..4),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cycle(word: u16) -> Cycle {
        Cycle::from_register(word).unwrap()
    }

    #[test]
    fn communication_cycle_by_counter() {
        // Manual p. 89: 0.5 ms times 1, 2, 3, 4 and 15.
        for (number, us) in [(1, 500), (2, 1000), (3, 1500), (4, 2000), (15, 7500)] {
            assert_eq!(cycle(number << 4).communication_us(), us);
            assert_eq!(cycle(number << 4).first_us(), us);
        }
    }

    #[test]
    fn communication_cycle_by_time_slice() {
        // Manual p. 89: 0.5 ms times two to the power of 1, 2, 3, 4, 5 and 15.
        for (number, ms) in [(1, 1), (2, 2), (3, 4), (4, 8), (5, 16), (15, 16384)] {
            assert_eq!(cycle(number << 4 | 8).communication_us(), ms * 1000);
        }
        // The first communication comes one slice after the first time slot v. Time slots 1 are the odd
        // slices; time slots 2 are the slices 2, 6, 10 and so on.
        for (number, first) in [(1, 1000), (2, 1500), (3, 2500), (15, 8_192_500)] {
            assert_eq!(cycle(number << 4 | 8).first_us(), first);
        }
    }

    #[test]
    fn value_cycles_of_the_time_slice_method() {
        // The two tables of page 90, in ms: t_cycK 0.5 ms, and 2 ms by counter and by time slice.
        for (command_reg, table) in [
            (0x10, [1, 2, 4, 8, 16, 32, 64, 128]),
            (0x40, [4, 8, 16, 32, 64, 128, 256, 512]),
            (0x28, [4, 8, 16, 32, 64, 128, 256, 512]),
        ] {
            for (x, ms) in (0..8).zip(table) {
                assert_eq!(cycle(command_reg).value_us(x), ms * 1000, "16#{command_reg:04X}, value {x}");
            }
        }
        assert_eq!(cycle(0xF8).value_us(7), 4_194_304_000, "more than an hour");
    }

    #[test]
    fn every_value_is_exchanged_exactly_once_per_cycle() {
        let cycle = cycle(0x10);
        let mut last = [None; 8];
        for count in 1..=4096u64 {
            let (writes, reads) = cycle.values(count, 309);
            assert_eq!(writes, reads);
            for x in writes {
                if let Some(last) = last[x] {
                    assert_eq!(
                        (count - last) * cycle.communication_us(),
                        cycle.value_us(x as u8),
                        "value {x}"
                    );
                }
                last[x] = Some(count);
            }
        }
        assert!(last.iter().all(Option::is_some));
        assert_eq!(cycle.values(256, 309), (0..0, 0..0));
    }

    #[test]
    fn the_same_cycle_for_all() {
        let cycle = cycle(0x44);
        assert_eq!(cycle.method(), Method::SameCycle);
        for x in 0..4 {
            assert_eq!(cycle.value_us(x), 2000);
        }
        assert_eq!(cycle.values(1, 309), (0..2, 0..4));
        assert_eq!(cycle.values(2, 308), (0..2, 0..2));
    }

    #[test]
    fn reserved_methods_and_number_0() {
        for word in [0x0000, 0x0008, 0x0012, 0x0016, 0x00FA, 0x0004] {
            assert_eq!(Cycle::from_register(word), None, "16#{word:04X}");
        }
        assert_eq!(Cycle::from_register(0xFF11), Cycle::from_register(0x0010));
    }
}
