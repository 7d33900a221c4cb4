//! Many intervals in one go, of a drive that runs in step with SYNC and gets nothing but reference values of the master.
//!
//! It is the same as interval by interval: what cannot change meanwhile is looked at once, what changes is at hand. A drive
//! or an edge that is not of this kind is left to [`Drive::edge`]. Where all intervals are alike, not even each of them is
//! looked at: of what they bring, only the speed reference values of all of them matter.

use super::catch_up::{Alike, Passed, Since};
use super::monitoring::Monitor;
use super::{Drive, card, parts_of, regler};

impl Drive {
    /// Takes as much of what came before the last edge as can be taken in this way; returns how much that is. The card
    /// samples nothing.
    pub(super) fn cruise(&mut self, since: &Since) -> usize {
        let is_disturbed = self.regler.reports_error() || self.monitors.iter().any(Monitor::is_away);
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

    /// Interval by interval, up to an edge that is not of this kind.
    fn take_in_run(
        &mut self,
        passed: &[Passed],
        run: &mut regler::Run,
        references: &mut card::References,
    ) -> usize {
        for (taken, it) in passed.iter().enumerate() {
            match *it {
                Passed::Edge { now_us, interval_us } => {
                    if interval_us != run.sync_slot_us || !self.sync.goes_on(now_us, interval_us) {
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
                Passed::Reference { kbit_s, channel, ref payload } => {
                    if kbit_s == self.kbit_s {
                        self.card.receive_in_run(references, channel, payload);
                    }
                }
            }
        }
        passed.len()
    }

    /// All intervals at once; `false`: they are to be taken one by one.
    fn leap(&mut self, alike: &Alike, run: &mut regler::Run, references: &mut card::References) -> bool {
        let Some((first_us, last_us, interval_us)) = alike.edges() else { return false };
        let heard = alike.heard_at(self.kbit_s);
        if interval_us != run.sync_slot_us
            || !self.card.misses_nothing(references, heard)
            || !self.sync.goes_on(first_us, interval_us)
        {
            return false;
        }
        self.sync.has_gone_on(last_us);
        (self.edge_is_missing, self.exchanges) = (false, true);
        let now = self.card.hand_over_in_run(references).unwrap_or(run.speed_reference);
        let parts = parts_of(interval_us);
        match references.speeds(alike, heard) {
            // What comes in an interval counts from the next one on.
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
