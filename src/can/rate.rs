//! Bit rates and the time that bits take.

use std::num::NonZeroU32;

/// The bit rate of a bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BitRate(NonZeroU32);

impl BitRate {
    /// Creates the rate of `bit_s` bits per second; the maximum of CAN is 1 000 000. `None` for 0, because no bit would
    /// ever arrive.
    pub const fn new(bit_s: u32) -> Option<Self> {
        match NonZeroU32::new(bit_s) {
            Some(bit_s) => Some(BitRate(bit_s)),
            None => None,
        }
    }

    /// Returns bits per second.
    pub const fn bit_s(self) -> u32 {
        self.0.get()
    }

    /// Returns the duration of `bits` bits in nanoseconds, rounded up.
    #[inline]
    pub const fn time_ns(self, bits: u32) -> u64 {
        (bits as u64 * 1_000_000_000).div_ceil(self.0.get() as u64)
    }

    /// Returns the number of bits that begin within `ns` nanoseconds.
    pub(super) const fn bits_begun(self, ns: u64) -> u32 {
        let bits = (ns as u128 * self.0.get() as u128).div_ceil(1_000_000_000);
        if bits > u32::MAX as u128 { u32::MAX } else { bits as u32 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_take_their_time() {
        for (bit_s, bits, ns) in [
            (1_000_000, 135, 135_000),
            (800_000, 111, 138_750),
            (125_000, 1, 8_000),
            (83_333, 1, 12_001),
            (10_000, 160, 16_000_000),
            (1, u32::MAX, 4_294_967_295_000_000_000),
        ] {
            assert_eq!(BitRate::new(bit_s).unwrap().time_ns(bits), ns, "{bits} bits at {bit_s} bit/s");
        }
        assert_eq!(BitRate::new(0), None);
        let rate = BitRate::new(125_000).unwrap();
        let begun = [0, 1, 8_000, 8_001, u64::MAX].map(|ns| rate.bits_begun(ns));
        assert_eq!(begun, [0, 1, 1, 2, u32::MAX]);
    }
}
