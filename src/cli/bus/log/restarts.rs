//! Restarts of the clock of a logger during a recording.

use super::{Message, telegram_us};
use crate::cli::{output, time};
use crate::plural::plural;
use std::collections::HashMap;

/// Largest disorder of a logger, in microseconds (D-824). A logger writes the frames of several interfaces, or of one
/// transfer over USB, out of order by a few milliseconds.
const LARGEST_DISORDER_US: u64 = 20_000;
/// Interval in microseconds from the last frame before a restart to the first one after it (D-825): longer than the longest frame
/// of CAN at 10 kbit/s, so that the first frame need not wait for the bus.
const PAUSE_US: u64 = 20_000;
/// An interface keeps its clock after the restart of another one, if its time is nearer to the clock before the restart by
/// more than this, in microseconds (D-824).
const OTHER_CLOCK_US: u64 = 1_000_000;
/// Lowest rate of PROFIBUS in bit/s.
const LOWEST_BIT_S: u64 = 9_600;
/// Maximum number of restarts with an own note.
const SHOWN_RESTARTS: usize = 5;

/// A message of a log before it is assigned to a bus.
pub(super) struct Entry {
    pub(super) interface: String,
    /// True if the message is selected.
    pub(super) is_selected: bool,
    /// Position in the log.
    pub(super) at: usize,
    pub(super) time_us: u64,
    pub(super) message: Message,
}

/// A restart of the logger's clock. The times come from the log, in microseconds.
#[derive(Debug, PartialEq, Eq)]
struct Restart {
    /// Position of the first message with the restarted clock.
    at: usize,
    before_us: u64,
    after_us: u64,
}

/// After each restart of the logger's clock, increases the following times so that they continue. Prints a note for
/// each restart; `unit` is the unit of the positions.
pub(super) fn continue_times(log: &mut [Entry], unit: &str) {
    let restarts = find_and_continue(log);
    for Restart { at, before_us, after_us } in restarts.iter().take(SHOWN_RESTARTS) {
        output::note(&format!(
            "{unit} {at}: the clock of the log started again: {} follows {}; the intervals after this {unit} are kept",
            time::seconds(*after_us),
            time::seconds(*before_us)
        ));
    }
    let more = restarts.len().saturating_sub(SHOWN_RESTARTS);
    if more > 0 {
        output::note(&format!("the clock of the log started again {} later", plural(more as u64, "time")));
    }
}

/// A part of the log with one run of the logger's clock.
struct ClockRun {
    /// The time of the first message, as it is in the log and as it is increased.
    begin_us: u64,
    begin_continued_us: u64,
    /// The latest time in the log.
    latest_us: u64,
}

impl ClockRun {
    /// True if a time is nearer to this run than to the run `new` of a clock that has started again.
    fn is_nearer(&self, time_us: u64, new: &Self) -> bool {
        let distance = |run: &Self| time_us.abs_diff(run.latest_us);
        distance(new) > distance(self).saturating_add(OTHER_CLOCK_US)
    }
}

/// An interface of the log.
struct Interface {
    /// Index of its run of the clock.
    run: usize,
    /// Its latest time in this run.
    latest_us: u64,
}

/// True if a time is so much before the latest one of its interface that this is no disorder of the logger.
fn falls(time_us: u64, latest_us: u64) -> bool {
    time_us.saturating_add(LARGEST_DISORDER_US) < latest_us
}

/// Continues the times, and returns the restarts.
fn find_and_continue(log: &mut [Entry]) -> Vec<Restart> {
    let next_us = next_times(log);
    let mut restarts = Vec::new();
    let mut runs = vec![ClockRun { begin_us: 0, begin_continued_us: 0, latest_us: 0 }];
    let mut interfaces: HashMap<String, Interface> = HashMap::new();
    // The latest of the increased times.
    let mut latest_continued_us = 0;
    for (entry, next_us) in log.iter_mut().zip(next_us) {
        let newest = runs.len() - 1;
        let time_us = entry.time_us;
        let known = interfaces.get(&entry.interface).map(|it| (it.run, it.latest_us));
        let (run, latest_us) = match known {
            Some((run, latest_us)) if run == newest => {
                let is_restart =
                    falls(time_us, latest_us) && next_us.is_some_and(|next_us| falls(next_us, latest_us));
                if is_restart {
                    restarts.push(Restart {
                        at: entry.at,
                        before_us: runs[newest].latest_us,
                        after_us: time_us,
                    });
                    let pause_us = PAUSE_US + duration_us(&entry.message);
                    runs.push(ClockRun {
                        begin_us: time_us,
                        begin_continued_us: u64::saturating_add(latest_continued_us, pause_us),
                        latest_us: time_us,
                    });
                    (newest + 1, time_us)
                } else {
                    (newest, latest_us)
                }
            }
            // Since the last message of this interface, the clock of another one has started again. Interfaces of one
            // logger have one clock, but a log can also contain the interfaces of several loggers.
            Some((run, latest_us))
                if !falls(time_us, latest_us) && runs[run].is_nearer(time_us, &runs[newest]) =>
            {
                (run, latest_us)
            }
            None if newest > 0 && runs[newest - 1].is_nearer(time_us, &runs[newest]) => (newest - 1, 0),
            _ => (newest, 0),
        };
        let after = Interface { run, latest_us: latest_us.max(time_us) };
        match interfaces.get_mut(&entry.interface) {
            Some(interface) => *interface = after,
            None => drop(interfaces.insert(entry.interface.clone(), after)),
        }
        let run = &mut runs[run];
        run.latest_us = run.latest_us.max(time_us);
        let continued = i128::from(run.begin_continued_us) + i128::from(time_us) - i128::from(run.begin_us);
        entry.time_us = u64::try_from(continued.max(0)).unwrap_or(u64::MAX);
        latest_continued_us = entry.time_us.max(latest_continued_us);
    }
    restarts
}

/// Returns for each message the time of the next message of the same interface.
fn next_times(log: &[Entry]) -> Vec<Option<u64>> {
    let mut next_of: HashMap<&str, u64> = HashMap::new();
    let mut times: Vec<_> =
        log.iter().rev().map(|entry| next_of.insert(entry.interface.as_str(), entry.time_us)).collect();
    times.reverse();
    times
}

/// Returns the duration of a message at the lowest rate, in microseconds. The time of a telegram is its end. A frame of
/// CAN is short enough for [`PAUSE_US`].
fn duration_us(message: &Message) -> u64 {
    match message {
        Message::Frame(_) => 0,
        Message::Telegram(octets) => telegram_us(octets, LOWEST_BIT_S),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can::{Frame, Payload};
    use proptest::prelude::*;

    fn log(times: &[(&str, u64)]) -> Vec<Entry> {
        let entry = |(index, (interface, time_us)): (usize, &(&str, u64))| Entry {
            interface: (*interface).to_owned(),
            is_selected: true,
            at: index + 1,
            time_us: *time_us,
            message: Message::Frame(Frame::standard(1, Payload::EMPTY)),
        };
        times.iter().enumerate().map(entry).collect()
    }

    fn continued(times: &[(&str, u64)]) -> (Vec<u64>, Vec<Restart>) {
        let mut log = log(times);
        let restarts = find_and_continue(&mut log);
        (log.iter().map(|entry| entry.time_us).collect(), restarts)
    }

    #[test]
    fn the_intervals_after_a_restart_are_kept() {
        let (times, restarts) =
            continued(&[("a", 97_655_775), ("a", 97_593_688), ("a", 97_594_000), ("a", 97_700_000)]);
        assert_eq!(times, [97_655_775, 97_675_775, 97_676_087, 97_782_087]);
        assert_eq!(restarts, [Restart { at: 2, before_us: 97_655_775, after_us: 97_593_688 }]);
    }

    #[test]
    fn each_restart_of_a_log_is_found() {
        let (times, restarts) =
            continued(&[("a", 5_000_000), ("a", 0), ("a", 1_000), ("a", 900_000), ("a", 0), ("a", 7)]);
        assert_eq!(times, [5_000_000, 5_020_000, 5_021_000, 5_920_000, 5_940_000, 5_940_007]);
        assert_eq!(restarts.iter().map(|it| it.at).collect::<Vec<_>>(), [2, 5]);
    }

    /// All interfaces of a log have one clock: their times relative to each other stay the same.
    #[test]
    fn a_restart_holds_for_all_interfaces() {
        let (times, restarts) = continued(&[
            ("a", 9_000_000),
            ("b", 9_000_500),
            ("a", 100),
            ("b", 600),
            ("a", 2_000),
            ("b", 2_500),
        ]);
        assert_eq!(times, [9_000_000, 9_000_500, 9_020_500, 9_021_000, 9_022_400, 9_022_900]);
        assert_eq!(restarts.len(), 1);
    }

    /// A log can contain the interfaces of several loggers. A restart of the first one does not change the times of the second
    /// one, nor those of an interface that appears later with the clock of the second one.
    #[test]
    fn a_restart_does_not_hold_for_a_clock_that_continues() {
        let (times, restarts) = continued(&[
            ("a", 100_000_000),
            ("b", 100_100_000),
            ("a", 0),
            ("b", 100_200_000),
            ("c", 100_250_000),
            ("a", 100_000),
            ("b", 100_300_000),
            ("c", 100_350_000),
            ("d", 110_000),
        ]);
        let wanted =
            [100_120_000, 100_200_000, 100_250_000, 100_220_000, 100_300_000, 100_350_000, 100_230_000];
        assert_eq!(times, [&[100_000_000, 100_100_000][..], &wanted].concat());
        assert_eq!(restarts, [Restart { at: 3, before_us: 100_100_000, after_us: 0 }]);
        // The clock of the second one starts again later.
        let (times, restarts) = continued(&[
            ("a", 9_000_000),
            ("b", 9_000_500),
            ("a", 0),
            ("b", 9_010_000),
            ("b", 100),
            ("a", 200),
        ]);
        assert_eq!(times, [9_000_000, 9_000_500, 9_020_500, 9_010_000, 9_020_600, 9_020_700]);
        assert_eq!(restarts.len(), 1);
    }

    /// Earlier times that are no restart: a logger writes one interface after the other, frames are out of order by 20
    /// ms, or a single frame has a wrong time.
    #[test]
    fn a_disorder_is_no_restart() {
        for times in [
            &[("a", 100_000), ("a", 200_000), ("b", 100_500), ("b", 200_500), ("a", 300_000)][..],
            &[("a", 100_000), ("a", 80_000), ("a", 80_001), ("a", 110_000)],
            &[("a", 5_000_000), ("a", 1_000_000), ("a", 5_001_000)],
            &[("a", 5_000_000), ("a", 1_000_000)],
        ] {
            let (continued, restarts) = continued(times);
            assert!(restarts.is_empty(), "{times:?}");
            assert!(continued.iter().zip(times).all(|(time, (_, before))| time == before), "{times:?}");
        }
    }

    #[test]
    fn the_pause_is_longer_than_a_telegram() {
        let mut log = log(&[("a", 9_000_000), ("a", 100), ("a", 200)]);
        for entry in &mut log {
            entry.message = Message::Telegram(vec![0; 96]);
        }
        find_and_continue(&mut log);
        // 96 octets have 1,056 bits.
        assert_eq!(log[1].time_us, 9_000_000 + 20_000 + 110_000);
    }

    proptest! {
        #![proptest_config(crate::property_tests())]

        /// The times may have any size and may fall at any place. Between two restarts, the intervals do not change.
        #[test]
        fn intervals_between_restarts_are_kept(times in prop::collection::vec(0_u64..1 << 40, 0..40)) {
            let with_interface: Vec<_> = times.iter().map(|time_us| ("a", *time_us)).collect();
            let (after, restarts) = continued(&with_interface);
            for index in 1..times.len() {
                let is_restart = restarts.iter().any(|it| it.at == index + 1);
                let interval = |times: &[u64]| i128::from(times[index]) - i128::from(times[index - 1]);
                // A continued time is not negative.
                let is_cut = after[index] == 0 || after[index - 1] == 0;
                prop_assert!(is_restart || is_cut || interval(&times) == interval(&after));
            }
        }

        #[test]
        fn the_largest_times_are_accepted(times in prop::collection::vec(any::<u64>(), 0..40)) {
            continued(&times.iter().map(|time_us| ("a", *time_us)).collect::<Vec<_>>());
        }
    }
}
