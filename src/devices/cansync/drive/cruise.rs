//! Many intervals in one go, of a drive that runs in step with SYNC and gets nothing but reference values of the master.
//!
//! It is the same as interval by interval: what cannot change meanwhile is looked at once, what changes is at hand. A drive
//! or an edge that is not of this kind is left to [`Drive::edge`].

use super::monitoring::Monitor;
use super::{Drive, Passed};

impl Drive {
    /// Takes as much as can be taken in this way; returns how much that is. The card samples nothing.
    pub(super) fn cruise(&mut self, passed: &[Passed]) -> usize {
        let is_disturbed = self.regler.reports_error() || self.monitors.iter().any(Monitor::is_away);
        if !self.is_synchronized() || is_disturbed {
            return 0;
        }
        let Some(mut run) = self.regler.begin_run() else { return 0 };
        let Some(mut references) = self.card.begin_run(&self.regler) else { return 0 };
        let mut taken = 0;
        for it in passed {
            match *it {
                Passed::Edge { now_us, interval_us } => {
                    if interval_us != run.sync_slot_us || !self.sync.goes_on(now_us, interval_us) {
                        break;
                    }
                    self.edge_is_missing = false;
                    if let Some(speed) = self.card.hand_over_in_run(&mut references) {
                        run.speed_reference = speed;
                    }
                    self.regler.step_in_run(&run, interval_us);
                }
                Passed::Reference { kbit_s, channel, ref payload } => {
                    if kbit_s == self.kbit_s {
                        self.card.receive_in_run(&mut references, channel, payload);
                    }
                }
            }
            taken += 1;
        }
        self.card.end_run(&references, &mut self.regler.store);
        self.regler.end_run();
        taken
    }
}
