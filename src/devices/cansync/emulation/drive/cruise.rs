//! Processes many intervals in one step, for a synchronized drive that receives only reference values of the master.
//!
//! The result is the same as if [`Drive::edge`] processed each interval. `Drive::edge` is used for all other
//! drives and edges. Here, values that cannot change during these intervals are checked only once. If all
//! intervals are uniform, the result depends only on their speed reference values, so the intervals are not
//! processed one by one.

use super::catch_up::{BusEvent, PendingEvents, UniformIntervals};
use super::monitoring::Monitor;
use super::{Drive, card, parts_of, regler};

impl Drive {
    /// Processes as many of the events before the last edge as possible, and returns their number. The card takes no
    /// samples.
    pub(super) fn cruise(&mut self, since: &PendingEvents) -> usize {
        let is_disturbed = self.regler.reports_error() || self.monitors.iter().any(Monitor::is_missing);
        if !self.is_synchronized() || is_disturbed {
            return 0;
        }
        let Some(mut run) = self.regler.begin_run() else { return 0 };
        let Some(mut references) = self.card.begin_run(&self.regler) else { return 0 };
        let mut taken = self.take_in_run(since.one_by_one, &mut run, &mut references);
        if taken == since.one_by_one.len() {
            let alike = since.alike.passed();
            let is_taken = self.leap(&since.alike, &mut run, &mut references);
            taken += if is_taken { alike.len() } else { self.take_in_run(alike, &mut run, &mut references) };
        }
        self.card.end_run(&references, &mut self.regler);
        self.regler.end_run();
        taken
    }

    /// Processes the events one by one, up to an edge that cannot be part of the run.
    fn take_in_run(
        &mut self,
        passed: &[BusEvent],
        run: &mut regler::Run,
        references: &mut card::References,
    ) -> usize {
        for (taken, it) in passed.iter().enumerate() {
            match *it {
                BusEvent::Edge { now_us, interval_us } => {
                    if interval_us != run.sync_slot_us || !self.sync.take_regular_edge(now_us, interval_us) {
                        return taken;
                    }
                    (self.edge_is_missing, self.exchanges) = (false, true);
                    let [before_us, after_us] = parts_of(interval_us);
                    self.regler.step_in_run(run, before_us);
                    if let Some(speed) = self.card.hand_over_in_run(references) {
                        run.speed_reference = speed;
                    }
                    self.regler.step_in_run(run, after_us);
                }
                BusEvent::Reference { kbit_s, channel, ref payload } => {
                    if kbit_s == self.kbit_s {
                        self.card.receive_in_run(references, channel, payload);
                    }
                }
            }
        }
        passed.len()
    }

    /// Processes all intervals at once. Returns false if they must be processed one by one.
    fn leap(
        &mut self,
        alike: &UniformIntervals,
        run: &mut regler::Run,
        references: &mut card::References,
    ) -> bool {
        let Some((first_us, last_us, interval_us)) = alike.edges() else { return false };
        let heard = alike.heard_at(self.kbit_s);
        if interval_us != run.sync_slot_us
            || !self.card.misses_nothing(references, heard)
            || !self.sync.take_regular_edge(first_us, interval_us)
        {
            return false;
        }
        self.sync.has_gone_on(last_us);
        (self.edge_is_missing, self.exchanges) = (false, true);
        let now = self.card.hand_over_in_run(references).unwrap_or(run.speed_reference);
        let parts = parts_of(interval_us);
        match references.speeds(alike, heard) {
            // A value that arrives in an interval takes effect in the next interval.
            Some(speeds) => {
                let before_last = speeds.len() - 1;
                let speeds = speeds.take(before_last);
                self.regler.steps_in_run(run, parts, core::iter::once(now).chain(speeds));
            }
            None => {
                self.regler.steps_in_run(run, parts, core::iter::repeat_n(now, alike.count()));
            }
        }
        self.card.leap(references, alike, heard);
        true
    }
}
