//! Blocks that convert a value to another range or delay it (p. 117, 123-124).

use super::order::ms;
use crate::plc::{Ram, function_block};
use core::time::Duration;
use std::collections::VecDeque;

function_block! {
    /// Converts a value from one range to another (p. 117).
    pub struct NORM() {
        in {
            /// Input value of the block.
            X: u16;
            /// Lower limit of its range.
            XH: u16;
            /// Upper limit of its range.
            XL: u16;
            /// Lower limit of the other range.
            YH: u16;
            /// Upper limit of the other range.
            YL: u16;
        }
        out {
            /// Value in the other range.
            Y: u16;
        }
    }
}

impl NORM {
    /// Runs one PLC cycle. If a value is outside its range, the nearer limit of the range is used.
    pub fn call(&mut self) {
        let [x, from, to, low, high] = [self.X, self.XH, self.XL, self.YH, self.YL].map(i64::from);
        let x = x.clamp(from.min(to), from.max(to));
        // With a positive divisor, the Euclidean division rounds down on a falling line, too (D-480).
        let (rise, run) = ((x - from) * (high - low) * (to - from).signum(), (to - from).abs());
        self.Y = (low + rise.checked_div_euclid(run).unwrap_or(0)) as u16;
    }
}

/// Values with their start times. Each value is valid until the start time of the next value.
#[derive(Clone, Debug)]
pub struct ValueHistory<T> {
    /// Start time and value, the oldest first. After a call of `ago`, the first entry is the value at the
    /// requested time, if the history goes back that far.
    values: VecDeque<(u64, T)>,
}

impl<T> Default for ValueHistory<T> {
    fn default() -> Self {
        ValueHistory { values: VecDeque::new() }
    }
}

impl<T: Copy + PartialEq> ValueHistory<T> {
    /// Records that `value` is valid from `now` on. Returns the value of `us` microseconds ago, or `None` if
    /// there was no value at that time. Removes older values.
    pub(super) fn ago(&mut self, value: T, now: u64, us: u64) -> Option<T> {
        if self.values.back().is_none_or(|(_, last)| *last != value) {
            self.values.push_back((now, value));
        }
        let is_over = |since: u64| since.checked_add(us).is_some_and(|at| at <= now);
        while self.values.get(1).is_some_and(|(since, _)| is_over(*since)) {
            self.values.pop_front();
        }
        self.values.front().filter(|(since, _)| is_over(*since)).map(|(_, value)| *value)
    }
}

/// Converts a TIME to microseconds, in whole milliseconds.
pub(super) fn us(time: Duration) -> u64 {
    u64::from(ms(time)) * 1000
}

function_block! {
    /// Delays a value by a time (p. 123). The program must call the block in every cycle.
    pub struct DELAY(ram: Ram) {
        in {
            /// Input value of the block.
            X: u16;
            /// Delay of the block.
            T: Duration;
        }
        out {
            /// The value of `X` a time `T` ago. The output is 0 until `T` has passed.
            Y: u16;
        }
        internal: ValueHistory<u16>;
    }
}

impl DELAY {
    /// Runs one PLC cycle.
    pub fn call(&mut self, ram: &Ram) {
        self.Y = self.internal.ago(self.X, ram.now_us(), us(self.T)).unwrap_or(0);
    }
}

function_block! {
    /// A low-pass filter: the output follows the input with a time constant (p. 124).
    pub struct PT1(ram: Ram) {
        in {
            /// Input value of the block.
            X: u16;
            /// Time constant of the block.
            T1: Duration;
        }
        out {
            /// Filtered value, from 0 on.
            Y: u16;
        }
        internal: LowPass;
    }
}

/// State of a low-pass filter.
#[derive(Clone, Debug, Default)]
pub struct LowPass {
    y: f64,
    called_at: Option<u64>,
}

impl PT1 {
    /// Runs one PLC cycle. The block assumes that `X` has had its present value since the previous call.
    pub fn call(&mut self, ram: &Ram) {
        let now = ram.now_us();
        let passed = now.saturating_sub(self.internal.called_at.replace(now).unwrap_or(now));
        let x = f64::from(self.X);
        let LowPass { y, .. } = &mut self.internal;
        *y = match us(self.T1) {
            0 => x,
            t1 => x + (*y - x) * (-(passed as f64) / t1 as f64).exp(),
        };
        self.Y = y.round() as u16;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::cs0015::registers::DEVICE;
    use crate::memory::Segment;

    const MS: u64 = 1000;

    fn ram() -> Ram {
        Ram::of(&Segment::of(&DEVICE)).unwrap()
    }

    /// Each line is given from both of its ends (D-480).
    #[test]
    fn a_scaled_value_is_rounded_down_on_rising_and_falling_lines() {
        for (points, expected) in [
            ([(0, 0), (3, 100)], [0, 33, 66, 100]),
            ([(0, 100), (3, 0)], [100, 66, 33, 0]),
            ([(0, 65_535), (3, 65_533)], [65_535, 65_534, 65_533, 65_533]),
        ] {
            for [(XH, YH), (XL, YL)] in [points, [points[1], points[0]]] {
                let scaled = [0, 1, 2, 3].map(|X| {
                    let mut norm = NORM { X, XH, XL, YH, YL, ..Default::default() };
                    norm.call();
                    norm.Y
                });
                assert_eq!(scaled, expected, "({XH}, {YH}) to ({XL}, {YL})");
            }
        }
        let mut norm = NORM { X: 5, XH: 4, XL: 4, YH: 7, YL: 9, ..Default::default() };
        norm.call();
        assert_eq!(norm.Y, 7, "equal limits");
    }

    #[test]
    fn a_value_is_delayed_by_its_time() {
        let ram = ram();
        let mut delay = DELAY { T: Duration::from_millis(30), ..Default::default() };
        let mut seen = Vec::new();
        for (cycle, x) in [5, 6, 6, 7, 8, 8, 8, 8, 8].into_iter().enumerate() {
            ram.header().virtual_time_us.store(cycle as u64 * 10 * MS);
            delay.X = x;
            delay.call(&ram);
            seen.push(delay.Y);
        }
        assert_eq!(seen, [0, 0, 0, 5, 6, 6, 7, 8, 8]);
        (delay.X, delay.T) = (9, Duration::ZERO);
        delay.call(&ram);
        assert_eq!(delay.Y, 9);
        assert_eq!(delay.internal.values.len(), 1, "old values are removed");
    }

    /// After the time constant, a step has reached 63 %, with any cycle time.
    #[test]
    fn a_filter_follows_with_its_time_constant() {
        for cycle in [1, 10, 100] {
            let ram = ram();
            let mut filter = PT1 { X: 10_000, T1: Duration::from_millis(100), ..Default::default() };
            let mut at = 0;
            while at <= 100 {
                ram.header().virtual_time_us.store(at * MS);
                filter.call(&ram);
                assert_eq!(filter.Y == 0, at == 0);
                at += cycle;
            }
            assert_eq!(filter.Y, 6321, "{cycle}");
            ram.header().virtual_time_us.store(10_000 * MS);
            filter.call(&ram);
            assert_eq!(filter.Y, 10_000);
            (filter.X, filter.T1) = (3, Duration::ZERO);
            filter.call(&ram);
            assert_eq!(filter.Y, 3);
        }
    }
}
