//! Automatic slave numbers (manual 5.00005.03a p. 159-160; counters: decision D-08).

use crate::devices::cansync::frames::LAST_SLAVE;
use crate::devices::cansync::registers::values::request;
use serde::{Deserialize, Serialize};

/// Counter for a register that contains a slave number, or 16#80 for automatic numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Counter(Option<u8>);

impl Counter {
    /// Starts a new interval. The counter is 0 in the first interval of active operation. It increases by 1
    /// per interval up to `max` and then restarts at 0. `max` is `b_MAX_SL_NR`; a value above 31 counts as 31
    /// (decision D-25).
    #[inline]
    pub(crate) fn next_interval(&mut self, max: u8) {
        self.0 = Some(match self.0 {
            Some(n) if n < max.min(LAST_SLAVE) => n + 1,
            _ => 0,
        });
    }

    /// Returns to the state before active operation.
    pub(crate) fn restart(&mut self) {
        self.0 = None;
    }

    /// Returns the slave number that `register` selects in this interval; `None` if it selects no slave (decision
    /// D-25).
    #[inline]
    pub(crate) fn resolve(self, register: u8) -> Option<u8> {
        match register {
            0..=LAST_SLAVE => Some(register),
            request::AUTOMATIC => Some(self.0.unwrap_or(0)),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// T19: 16#80 with `b_MAX_SL_NR` = 3 requests the frames of 0, 1, 2, 3, 0, 1 ...
    #[test]
    fn counts_to_the_maximum_and_starts_again() {
        let mut counter = Counter::default();
        let asked: Vec<_> = (0..6)
            .map(|_| {
                counter.next_interval(3);
                counter.resolve(request::AUTOMATIC)
            })
            .collect();
        assert_eq!(asked, [0, 1, 2, 3, 0, 1].map(Some));
        assert_eq!(counter.resolve(7), Some(7));
    }

    #[test]
    fn a_number_that_no_slave_has_selects_no_slave() {
        let counter = Counter(Some(5));
        for register in 0..=u8::MAX {
            let expected = match register {
                0..=31 => Some(register),
                0x80 => Some(5),
                _ => None,
            };
            assert_eq!(counter.resolve(register), expected, "16#{register:02X}");
        }
    }

    #[test]
    fn a_maximum_that_no_slave_has_counts_as_31() {
        for max in [31, 32, 127, 128, 255] {
            let mut counter = Counter(Some(30));
            counter.next_interval(max);
            assert_eq!(counter.resolve(request::AUTOMATIC), Some(31), "{max}");
            counter.next_interval(max);
            assert_eq!(counter.resolve(request::AUTOMATIC), Some(0), "{max}");
        }
    }

    #[test]
    fn a_lowered_maximum_starts_again_at_zero() {
        let mut counter = Counter::default();
        for _ in 0..6 {
            counter.next_interval(31);
        }
        counter.next_interval(2);
        assert_eq!(counter.resolve(request::AUTOMATIC), Some(0));
    }
}
