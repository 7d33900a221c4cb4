//! Bit rates, and the conversion between bit times and the microseconds of a plant.

/// A bit rate of PROFIBUS.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct BusRate(u32);

impl BusRate {
    /// All bit rates, in bit/s.
    pub const ALL: [BusRate; 11] = [
        BusRate(9_600),
        BusRate(19_200),
        BusRate(31_250),
        BusRate(45_450),
        BusRate(93_750),
        BusRate(187_500),
        BusRate(500_000),
        BusRate(1_500_000),
        BusRate(3_000_000),
        BusRate(6_000_000),
        BusRate(12_000_000),
    ];

    /// Returns the rate with `bit_s` bit/s, if PROFIBUS has it.
    #[must_use]
    pub fn new(bit_s: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|rate| rate.0 == bit_s)
    }

    /// Returns bits per second.
    #[must_use]
    pub const fn bit_s(self) -> u32 {
        self.0
    }

    /// Longest time that a master waits for the start of an answer, in bit times. It is longer than the largest T_SDR
    /// of a slave at this rate.
    #[must_use]
    pub const fn slot_bits(self) -> u64 {
        match self.0 {
            0..=500_000 => 200,
            500_001..=1_500_000 => 300,
            1_500_001..=6_000_000 => 600,
            _ => 1000,
        }
    }

    /// Returns the number of whole bit times that have passed at microsecond `us`.
    #[must_use]
    pub const fn bits_at(self, us: u64) -> u64 {
        scale(us, self.0 as u64, 1_000_000, 0)
    }

    /// Returns the first microsecond at which `bits` bit times have passed.
    #[must_use]
    pub const fn us_at(self, bits: u64) -> u64 {
        scale(bits, 1_000_000, self.0 as u64, self.0 as u64 - 1)
    }
}

/// Returns `value * by / of`, with `round` added before the division, or the largest value if the result does
/// not fit.
const fn scale(value: u64, by: u64, of: u64, round: u64) -> u64 {
    let scaled = (value as u128 * by as u128 + round as u128) / of as u128;
    if scaled > u64::MAX as u128 { u64::MAX } else { scaled as u64 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn bits_take_their_time() {
        for (bit_s, bits, us) in [
            (9_600, 1, 105),
            (45_450, 11, 243),
            (500_000, 1, 2),
            (1_500_000, 1, 1),
            (1_500_000, 3, 2),
            (12_000_000, 12, 1),
            (12_000_000, 13, 2),
        ] {
            assert_eq!(BusRate::new(bit_s).unwrap().us_at(bits), us, "{bits} bits at {bit_s} bit/s");
        }
        assert_eq!(BusRate::new(12_000_000).unwrap().bits_at(u64::MAX), u64::MAX);
        assert_eq!(BusRate::new(125_000), None);
    }

    proptest! {
    #![proptest_config(crate::property_tests())]

        /// At the returned microsecond the bit times have passed; at the microsecond before, they have not.
        #[test]
        fn a_microsecond_is_the_first_one(rate in 0..BusRate::ALL.len(), bits in 1..1u64 << 40) {
            let rate = BusRate::ALL[rate];
            let us = rate.us_at(bits);
            prop_assert!(rate.bits_at(us) >= bits && rate.bits_at(us - 1) < bits);
        }
    }
}
