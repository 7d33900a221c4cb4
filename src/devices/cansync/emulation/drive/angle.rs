//! Mode "synchronous reference position": conversion of the angle reference value (P258) to a speed.
//!
//! The drive interpolates from one reference value to the next over the SYNC slot (P167). If no new value
//! comes, it continues with the same slope (manual 5.00005.03a p. 74, 5.01010.01 p. 22). A proportional loop
//! with speed feed-forward makes the drive follow this set point (decision D-163).

use serde::{Deserialize, Serialize};

/// Returns the mask of the effective bits of the angle reference value (table of manual 5.00005.03a p. 74).
///
/// The drive's control interval is half a PWM period: 125 us at 4 kHz. The drive divides the slot into a
/// number of steps that is a power of two. So the number of masked low bits is the binary logarithm of the
/// number of control intervals, rounded up. A slot that is not in the table is rounded up to the next slot of
/// the table (decision D-161).
pub(crate) const fn mask(sync_slot_us: u16, pwm_khz: u16) -> u32 {
    if sync_slot_us == 0 {
        return 0xFFF8_0000;
    }
    // Two control intervals for each kHz and millisecond.
    let steps = (sync_slot_us as u32 * pwm_khz as u32 * 2).div_ceil(1000);
    !(steps.next_power_of_two() - 1)
}

/// The set point between two reference values.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct SetPoint {
    /// Angle at the start of the present slope.
    from: u32,
    /// Distance covered within one slot.
    way: i32,
    elapsed_us: u64,
    slot_us: u32,
}

impl SetPoint {
    /// Holds the drive at `angle`.
    #[inline]
    pub(crate) fn hold(&mut self, angle: u32) {
        *self = SetPoint { from: angle, ..SetPoint::default() };
    }

    /// Starts a slope to a reference value. The set point reaches the value after one slot, or at once if the
    /// slot is 0 us long.
    #[inline]
    pub(crate) fn reference(&mut self, value: u32, slot_us: u16) {
        let (from, _) = self.now();
        *self = match slot_us {
            0 => SetPoint { from: value, ..SetPoint::default() },
            _ => SetPoint {
                from,
                way: value.wrapping_sub(from) as i32,
                elapsed_us: 0,
                slot_us: u32::from(slot_us),
            },
        };
    }

    /// Advances the angle by `us` microseconds.
    #[inline]
    pub(crate) fn pass(&mut self, us: u32) {
        self.elapsed_us += u64::from(us);
    }

    /// Returns the set point and its speed in increments per millisecond.
    #[inline]
    pub(crate) fn now(&self) -> (u32, i64) {
        if self.way == 0 {
            return (self.from, 0);
        }
        let slot = i64::from(self.slot_us.max(1));
        let moved = i128::from(self.way) * i128::from(self.elapsed_us) / i128::from(slot);
        (self.from.wrapping_add(moved as u32), i64::from(self.way) * 1000 / slot)
    }
}

/// Returns the speed that brings `angle` to `set_point` with `gain` (1/s), added to the set point's own
/// speed.
///
/// In one step of `step_us` the drive moves at most by the whole distance.
#[inline]
pub(super) fn follow((set_point, speed): (u32, i64), angle: u32, gain: u32, step_us: u32) -> i64 {
    let error = i64::from(set_point.wrapping_sub(angle) as i32);
    let gain = i64::from(gain.min(1_000_000 / step_us.max(1)));
    speed + error * gain / 1000
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masks_of_page_74() {
        for (pwm, masks) in [
            (4, [0xFFF8_0000, 0xFFFF_FFFC, 0xFFFF_FFF8, 0xFFFF_FFF0, 0xFFFF_FFE0, 0xFFFF_FFC0]),
            (8, [0xFFF8_0000, 0xFFFF_FFF8, 0xFFFF_FFF0, 0xFFFF_FFE0, 0xFFFF_FFC0, 0xFFFF_FF80]),
        ] {
            for (slot, expected) in [0, 500, 1000, 2000, 4000, 8000].into_iter().zip(masks) {
                assert_eq!(mask(slot, pwm), expected, "P167 {slot} P103 {pwm}");
            }
        }
    }

    #[test]
    fn slots_between_are_rounded_up() {
        assert_eq!(mask(1500, 4), mask(2000, 4));
        assert_eq!(mask(7999, 8), mask(8000, 8));
        assert_eq!(mask(1, 4), 0xFFFF_FFFF);
    }

    #[test]
    fn set_point_moves_evenly_and_continues_without_a_new_reference() {
        let mut set_point = SetPoint::default();
        set_point.hold(1000);
        set_point.reference(1400, 2000);
        let points: Vec<u32> = (0..6)
            .map(|_| {
                set_point.pass(500);
                set_point.now().0
            })
            .collect();
        assert_eq!(points, [1100, 1200, 1300, 1400, 1500, 1600]);
        assert_eq!(set_point.now().1, 200);
    }

    #[test]
    fn the_set_point_takes_the_shorter_direction() {
        let mut set_point = SetPoint::default();
        set_point.hold(100);
        set_point.reference(0xFFFF_FF9C, 1000);
        set_point.pass(500);
        assert_eq!(set_point.now(), (0, -200));
    }

    #[test]
    fn a_slot_of_0_is_a_step() {
        let mut set_point = SetPoint::default();
        set_point.reference(0x8000_0000, 0);
        assert_eq!(set_point.now(), (0x8000_0000, 0));
    }

    #[test]
    fn one_step_covers_at_most_the_whole_distance() {
        // 8000 increments in 8 ms are 1000 increments per ms. The gain must not change this speed.
        assert_eq!(follow((8000, 0), 0, 1000, 8000), 1000);
        assert_eq!(follow((8000, 0), 0, 50, 8000), 400);
        assert_eq!(follow((8000, 7), 8000, 50, 500), 7);
    }
}
