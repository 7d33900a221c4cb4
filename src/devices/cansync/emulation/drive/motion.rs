//! Motion of the drive. The speed reaches its target at once or along a ramp, and the angle follows the
//! speed. If an external model drives the motor, the model defines the speed.

use serde::{Deserialize, Serialize};

/// Speed of the drive in increments per millisecond, and its angle in increments. An increment is the 2^32nd part of a
/// revolution, so the angle wraps around once per revolution (decision D-162).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Motion {
    /// The speed that the drive demands. Without an external model, the motor has this speed.
    speed: i32,
    angle: u32,
    /// Remainder of the ramp, in millionths of an increment of speed.
    speed_carry: u64,
    /// Remainder of the angle, in thousandths of an increment.
    angle_carry: i64,
    /// The motor's speed according to the external model.
    turned: Option<i32>,
}

impl Motion {
    /// Returns the motor's speed.
    #[inline]
    pub(crate) fn speed(&self) -> i32 {
        self.turned.unwrap_or(self.speed)
    }

    /// Returns the speed that the drive demands of its motor.
    pub(crate) const fn demand(&self) -> i32 {
        self.speed
    }

    /// Sets the motor's speed according to an external model. With `None`, the motor follows the demand.
    pub(crate) const fn turn(&mut self, speed: Option<i32>) {
        self.turned = speed;
    }

    /// Returns the angle of the motor.
    #[inline]
    pub(crate) const fn angle(&self) -> u32 {
        self.angle
    }

    /// Advances by `interval_us` towards the speed `target`, by at most `ramp` increments of speed per second (0: at
    /// once). Returns the motor's speed.
    #[inline]
    pub(crate) fn step(&mut self, target: i32, interval_us: u32, ramp: u32) -> i32 {
        if self.speed != target {
            match ramp {
                0 => self.speed = target,
                _ => self.ramp(target, ramp, interval_us),
            }
        }
        let speed = self.speed();
        if speed != 0 {
            let way = i64::from(speed) * i64::from(interval_us) + self.angle_carry;
            self.angle = self.angle.wrapping_add((way / 1000) as u32);
            self.angle_carry = way % 1000;
        }
        speed
    }

    /// Advances through one interval for each of the `targets`. There must be at least one target. An
    /// interval has two parts with the lengths `parts` in us. In the first part, the target of the previous
    /// interval is still valid; before the first interval, this is `before`. Returns true if the motor is at
    /// a standstill in any part.
    #[inline]
    pub(crate) fn steps(
        &mut self,
        before: i32,
        targets: impl Iterator<Item = i32> + Clone,
        parts: [u32; 2],
        ramp: u32,
    ) -> bool {
        if ramp == 0
            && let Some(has_stopped) = self.steps_at_once(before, targets.clone(), parts)
        {
            return has_stopped;
        }
        let (mut before, mut has_stopped) = (before, false);
        for target in targets {
            has_stopped |= self.step(before, parts[0], ramp) == 0;
            has_stopped |= self.step(target, parts[1], ramp) == 0;
            before = target;
        }
        has_stopped
    }

    /// Calculates the result of [`Motion::steps`] without a ramp in one step. This is possible if the result
    /// does not depend on the order of the targets: the remainder must have the direction of the motor's last
    /// motion.
    #[inline]
    fn steps_at_once(
        &mut self,
        before: i32,
        targets: impl Iterator<Item = i32>,
        [old_us, new_us]: [u32; 2],
    ) -> Option<bool> {
        let first = self.turned.unwrap_or(before);
        let (mut last, mut sum, mut has_stopped) = (before, 0, first == 0);
        let (mut lowest, mut highest) = (first.min(0), first.max(0));
        let mut add = |speed: i32| {
            sum += i64::from(speed);
            has_stopped |= speed == 0;
            (lowest, highest) = (speed.min(lowest), speed.max(highest));
        };
        match self.turned {
            None => targets.for_each(|target| {
                add(target);
                last = target;
            }),
            Some(speed) => targets.for_each(|target| {
                add(speed);
                last = target;
            }),
        }
        if (lowest < 0 || self.angle_carry < 0) && (highest > 0 || self.angle_carry > 0) {
            return None;
        }
        // Each target is valid for the time of a whole interval, with two exceptions: `before` is valid for
        // the first part of the first interval, and the last target is valid only for the second part of its
        // interval.
        let interval_us = i64::from(old_us) + i64::from(new_us);
        let shift = i64::from(first) - i64::from(self.turned.unwrap_or(last));
        let way = sum.checked_mul(interval_us)?.checked_add(shift.checked_mul(old_us.into())?)?;
        let way = way.checked_add(self.angle_carry)?;
        self.speed = last;
        self.angle = self.angle.wrapping_add((way / 1000) as u32);
        self.angle_carry = way % 1000;
        Some(has_stopped)
    }

    fn ramp(&mut self, target: i32, ramp: u32, interval_us: u32) {
        let way = u64::from(ramp) * u64::from(interval_us) + self.speed_carry;
        let step = way / 1_000_000;
        let distance = self.speed.abs_diff(target);
        if step >= u64::from(distance) {
            self.speed = target;
            self.speed_carry = 0;
            return;
        }
        self.speed_carry = way % 1_000_000;
        // The step is smaller than the distance to the target. So it fits in 32 bits, and the speed cannot
        // exceed the target.
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
    fn without_a_ramp_the_speed_is_the_target() {
        let mut motion = Motion::default();
        assert_eq!(motion.step(0x1122_3344, 2000, 0), 0x1122_3344);
        assert_eq!(motion.step(-5, 2000, 0), -5);
    }

    #[test]
    fn ramp_takes_its_time_in_both_directions() {
        let mut motion = Motion::default();
        let speeds: Vec<i32> = (0..4).map(|_| motion.step(5000, 2000, 1_000_000)).collect();
        assert_eq!(speeds, [2000, 4000, 5000, 5000]);
        let speeds: Vec<i32> = (0..3).map(|_| motion.step(0, 2000, 1_000_000)).collect();
        assert_eq!(speeds, [3000, 1000, 0]);
    }

    #[test]
    fn a_slow_ramp_moves_after_several_intervals() {
        // 100 increments per second are 0.2 increments per interval of 2 ms.
        let mut motion = Motion::default();
        let speeds: Vec<i32> = (0..10).map(|_| motion.step(50, 2000, 100)).collect();
        assert_eq!(speeds, [0, 0, 0, 0, 1, 1, 1, 1, 1, 2]);
    }

    #[test]
    fn whole_range_without_overflow() {
        let mut motion = Motion::default();
        motion.step(i32::MIN, u32::MAX, u32::MAX);
        assert_eq!(motion.step(i32::MAX, 900_000, u32::MAX), i32::MIN.wrapping_add_unsigned(3_865_470_565));
        assert_eq!(motion.step(i32::MAX, 900_000, u32::MAX), i32::MAX);
    }

    #[test]
    fn angle_is_the_integral_of_the_speed_without_rounding_away() {
        let mut motion = Motion::default();
        for _ in 0..3 {
            motion.step(1, 500, 0);
        }
        assert_eq!(motion.angle(), 1, "one increment per ms for 1.5 ms");
        motion.step(-1, 2500, 0);
        assert_eq!(motion.angle(), u32::MAX);
        motion.step(1 << 30, 1000, 0);
        assert_eq!(motion.angle(), (1 << 30) - 1);
    }

    #[test]
    fn an_external_model_turns_the_motor_while_the_drive_keeps_its_demand() {
        let mut motion = Motion::default();
        motion.turn(Some(1000));
        assert_eq!(motion.step(5000, 2000, 1_000_000), 1000);
        assert_eq!((motion.demand(), motion.speed(), motion.angle()), (2000, 1000, 2000));
        motion.turn(None);
        assert_eq!(motion.step(5000, 2000, 1_000_000), 4000);
    }

    proptest! {
        #![proptest_config(crate::property_tests())]

        #[test]
        fn steps_are_equal_to_single_steps(
            targets in prop_oneof![
                prop::collection::vec(any::<i32>(), 1..9),
                prop::collection::vec(-3..=0, 1..9),
                prop::collection::vec(0..2000, 1..9),
            ],
            speed in -2000..2000,
            before in prop_oneof![-2000..2000, any::<i32>()],
            parts in prop_oneof![Just([750, 1250]), [1..9000_u32, 1..9000_u32], any::<[u32; 2]>()],
            ramp in prop_oneof![Just(0), any::<u32>()],
            turned: Option<i16>,
        ) {
            let mut one_by_one = Motion::default();
            one_by_one.step(speed, 1, 0);
            one_by_one.turn(turned.map(i32::from));
            let mut at_once = one_by_one;
            let mut has_stopped = false;
            let mut old = before;
            for target in &targets {
                has_stopped |= one_by_one.step(old, parts[0], ramp) == 0;
                has_stopped |= one_by_one.step(*target, parts[1], ramp) == 0;
                old = *target;
            }
            prop_assert_eq!(at_once.steps(before, targets.iter().copied(), parts, ramp), has_stopped);
            prop_assert_eq!(at_once, one_by_one);
        }

        #[test]
        fn never_overshoots(speed: i32, target: i32, ramp: u32, interval: u32) {
            let mut motion = Motion { speed, ..Motion::default() };
            let after = motion.step(target, interval, ramp);
            prop_assert!((speed.min(target)..=speed.max(target)).contains(&after));
        }
    }
}
