//! The part of emulated time that a reader shows, and its resolution.
//!
//! A counted record can represent millions of events, but a picture has only about a thousand columns.

/// Number of parts into which a picture's width is divided: more than any picture has columns.
#[cfg(all(feature = "script", feature = "studio"))]
const GRAINS: u64 = 4096;

/// A part of emulated time, and the smallest distance at which a reader can distinguish two events.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Window {
    from_us: u64,
    to_us: u64,
    /// Minimum distance of events in microseconds; events at smaller distances are omitted.
    grain_us: u64,
}

impl Window {
    /// The window that contains all events.
    pub(crate) const ALL: Self = Window { from_us: 0, to_us: u64::MAX, grain_us: 0 };

    /// Returns the window of a picture from `from_us` to `to_us`.
    #[cfg(all(feature = "script", feature = "studio"))]
    pub(crate) fn of_picture(from_us: u64, to_us: u64) -> Self {
        Window { from_us, to_us, grain_us: to_us.saturating_sub(from_us) / GRAINS }
    }

    /// Returns times from a series of `count` equal events at intervals of `period_us`, the last one at `last_us`. The
    /// result has the events in the window, the last event before the window and the first event after it, in ascending
    /// order. No event precedes power-on.
    pub(crate) fn times(self, last_us: u64, count: u64, period_us: u64) -> impl Iterator<Item = u64> + use<> {
        let period = period_us.max(1);
        let possible = if period_us == 0 { 1 } else { (last_us / period).saturating_add(1) };
        let count = count.min(possible);
        let last = count.saturating_sub(1);
        let first_us = last_us - last * period_us;
        let until = |us: u64| us.checked_sub(first_us).map(|distance| distance / period);
        let begin = until(self.from_us).unwrap_or(0).min(last);
        let end = until(self.to_us).map_or(0, |at| at.saturating_add(1)).clamp(begin, last);
        let step = (self.grain_us / period).max(1);
        let steps = (end - begin).div_ceil(step);
        let shown = if count == 0 { 0 } else { steps.saturating_add(1) };
        (0..shown).map(move |n| {
            let number = begin.saturating_add(n.saturating_mul(step)).min(end);
            first_us + number * period_us
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(window: Window, last_us: u64, count: u64, period_us: u64) -> Vec<u64> {
        window.times(last_us, count, period_us).collect()
    }

    #[test]
    fn without_a_window_all_events_are_there() {
        assert_eq!(times(Window::ALL, 120, 3, 10), [100, 110, 120]);
        assert_eq!(times(Window::ALL, 120, 1, 0), [120]);
        assert_eq!(times(Window::ALL, 120, 0, 10), [0; 0]);
        // No event is before power-on.
        assert_eq!(times(Window::ALL, 25, 1_000_000_000, 10), [5, 15, 25]);
        assert_eq!(times(Window::ALL, 25, 1_000_000_000, 0), [25]);
    }

    #[cfg(all(feature = "script", feature = "studio"))]
    #[test]
    fn a_picture_has_the_events_in_its_window_and_one_on_each_side() {
        let window = Window::of_picture(104, 126);
        assert_eq!(times(window, 150, 6, 10), [100, 110, 120, 130]);
        assert_eq!(times(window, 50, 3, 10), [50]);
        assert_eq!(times(window, 250, 3, 10), [230]);
        assert_eq!(times(Window::of_picture(0, 10), 7, 1, 0), [7]);
    }

    #[cfg(all(feature = "script", feature = "studio"))]
    #[test]
    fn a_picture_has_no_more_events_than_it_can_show() {
        for last_us in [1_000_000_000, u64::MAX] {
            let shown = times(Window::of_picture(0, last_us), last_us, u64::MAX, 1);
            assert!((GRAINS as usize..3 * GRAINS as usize).contains(&shown.len()), "{}", shown.len());
            assert_eq!(shown.last(), Some(&last_us));
            assert!(shown.is_sorted());
        }
    }
}
