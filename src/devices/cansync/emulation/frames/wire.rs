//! Duration of a frame and of its occupation of the bus, in microseconds of the plant's clock.

use super::Frame;
use crate::can::wire;

/// Duration of a frame from its start bit, in microseconds, rounded up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Airtime {
    /// Duration from the start bit to the end of the end-of-frame field. At this time the receivers have the
    /// frame.
    pub delivery_us: u32,
    /// Duration from the start bit to the end of the intermission. At this time the next frame may begin.
    pub occupation_us: u32,
}

/// Returns the duration of a frame at `kbit_s` kbit/s; `u32::MAX` at 0 kbit/s.
#[inline]
pub fn airtime(frame: &Frame, kbit_s: u32) -> Airtime {
    let bits = wire::bits(&(*frame).into());
    Airtime {
        delivery_us: bits_to_us(bits - wire::INTERMISSION, kbit_s),
        occupation_us: bits_to_us(bits, kbit_s),
    }
}

#[inline]
fn bits_to_us(bits: u32, kbit_s: u32) -> u32 {
    // The divisors are constants for the usual rates: a division by a variable would take as long as the rest
    // of the function.
    match kbit_s {
        1000 => bits,
        500 => bits * 2,
        250 => bits * 4,
        125 => bits * 8,
        0 => u32::MAX,
        other => (bits * 1000).div_ceil(other),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can;

    #[test]
    fn times_are_those_of_the_bits_rounded_up() {
        let frame = Frame::new(0x2AA, &[0x55; 8]).unwrap();
        for kbit_s in [1000, 800, 500, 333, 250, 125, 1] {
            let rate = can::BitRate::new(kbit_s * 1000).unwrap();
            let exact = wire::airtime(&can::Frame::from(frame), rate);
            let expected = Airtime {
                delivery_us: exact.delivery_ns.div_ceil(1000) as u32,
                occupation_us: exact.occupation_ns.div_ceil(1000) as u32,
            };
            assert_eq!(airtime(&frame, kbit_s), expected, "{kbit_s} kbit/s");
        }
        assert_eq!(airtime(&frame, 0), Airtime { delivery_us: u32::MAX, occupation_us: u32::MAX });
    }
}
