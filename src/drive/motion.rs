//! How the drive moves: the speed follows its reference, at once or along a ramp.

use std::num::NonZeroU32;

/// The speed of the drive, in increments of the drive's own speed format.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    speed: i32,
    ramp_per_second: Option<NonZeroU32>,
    /// Part of an increment left over by the ramp, in millionths.
    carry: u64,
}

impl Motion {
    /// A drive at standstill. Without a ramp the speed takes the value of its reference at once.
    pub const fn new(ramp_per_second: Option<NonZeroU32>) -> Self {
        Motion { speed: 0, ramp_per_second, carry: 0 }
    }

    /// Moves on by `interval_us` towards `target`; returns the new speed.
    #[inline]
    pub fn step(&mut self, target: i32, interval_us: u32) -> i32 {
        if self.speed != target {
            match self.ramp_per_second {
                None => self.speed = target,
                Some(ramp) => self.ramp(target, ramp, interval_us),
            }
        }
        self.speed
    }

    fn ramp(&mut self, target: i32, ramp: NonZeroU32, interval_us: u32) {
        let way = u64::from(ramp.get()) * u64::from(interval_us) + self.carry;
        let step = way / 1_000_000;
        let distance = self.speed.abs_diff(target);
        if step >= u64::from(distance) {
            self.speed = target;
            self.carry = 0;
            return;
        }
        self.carry = way % 1_000_000;
        // Below the distance, so it fits 32 bits and cannot overshoot.
        let step = step as u32;
        self.speed = if target > self.speed {
            self.speed.wrapping_add_unsigned(step)
        } else {
            self.speed.wrapping_sub_unsigned(step)
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn without_a_ramp_the_speed_is_the_reference() {
        let mut motion = Motion::new(None);
        assert_eq!(motion.step(0x1122_3344, 2000), 0x1122_3344);
        assert_eq!(motion.step(-5, 2000), -5);
    }

    #[test]
    fn ramp_takes_its_time_in_both_directions() {
        let mut motion = Motion::new(NonZeroU32::new(1_000_000));
        let speeds: Vec<i32> = (0..4).map(|_| motion.step(5000, 2000)).collect();
        assert_eq!(speeds, [2000, 4000, 5000, 5000]);
        let speeds: Vec<i32> = (0..3).map(|_| motion.step(0, 2000)).collect();
        assert_eq!(speeds, [3000, 1000, 0]);
    }

    #[test]
    fn slow_ramp_does_not_stand_still() {
        // 100 increments per second are 0.2 per interval of 2 ms.
        let mut motion = Motion::new(NonZeroU32::new(100));
        let speeds: Vec<i32> = (0..10).map(|_| motion.step(50, 2000)).collect();
        assert_eq!(speeds, [0, 0, 0, 0, 1, 1, 1, 1, 1, 2]);
    }

    #[test]
    fn whole_range_without_overflow() {
        let mut motion = Motion::new(NonZeroU32::new(u32::MAX));
        motion.step(i32::MIN, u32::MAX);
        assert_eq!(motion.step(i32::MAX, 900_000), i32::MIN.wrapping_add_unsigned(3_865_470_565));
        assert_eq!(motion.step(i32::MAX, 900_000), i32::MAX);
    }

    proptest! {
        #[test]
        fn never_overshoots(start: i32, target: i32, ramp: u32, interval: u32) {
            let mut motion = Motion { speed: start, ramp_per_second: NonZeroU32::new(ramp), carry: 0 };
            let speed = motion.step(target, interval);
            prop_assert!((start.min(target)..=start.max(target)).contains(&speed));
        }
    }
}
