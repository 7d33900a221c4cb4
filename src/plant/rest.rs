//! Looks at registers that find nothing to do, and are left out.
//!
//! A processor cycle looks at registers that nobody has to announce. When one has been, everybody who could look rests and
//! nobody writes, those up to the next event find what it found, so they need not be made: nobody can tell the difference.
//! Whoever lets time pass is the only one who can write before it has passed, but for a program that has mapped an image:
//! that one is seen at the next look behind, so there is one whenever [`Plant::advance_to`] comes to a processor cycle for
//! the first time.
//!
//! While a bus is at work, a look also shows what is on the wire at its moment. Of several in a stretch of time that passes
//! in one go, the last one is enough for that, if none of them finds anything to do.

use super::Plant;
use super::ports::Port;

impl Plant {
    /// As [`Plant::next_event`], but for processor cycles that would find nothing to do: whoever waits for a register need
    /// not look at it before, unless another program writes it.
    pub fn next_change(&self) -> u64 {
        let others = self.next_besides_cycle();
        if self.has_looked && self.next_cycle < others && self.is_quiescent() {
            others
        } else {
            self.next_event()
        }
    }

    /// When something other than a processor cycle is due.
    fn next_besides_cycle(&self) -> u64 {
        let first = self.next_device.min(self.faults.next_time());
        self.media.iter().map(|medium| medium.next_time()).fold(first, u64::min)
    }

    /// A processor cycle was the last that happened: leaves those before `until` out if they would find nothing to do.
    #[inline]
    pub(super) fn leave_out_cycles(&mut self, until: u64) {
        if self.next_cycle < until && self.is_quiescent() {
            let count = (until - self.next_cycle).div_ceil(self.cycle_us);
            self.journal.tick_through(self.next_cycle, self.cycle_us, count);
            self.next_cycle += count * self.cycle_us;
        }
    }

    /// The next processor cycle is due: leaves it out, and those behind it up to `due`, when something else is, if they would
    /// find nothing to do but to show a traffic that another one before `time` shows anew (decision D-585).
    #[inline]
    pub(super) fn leaves_cycles_out(&mut self, due: u64, time: u64) -> bool {
        let (first, cycle_us) = (self.next_cycle, self.cycle_us);
        if first + cycle_us > time || self.watching || !self.is_unobserved() {
            return false;
        }
        // Nothing happens in between: what the last one does not find, those before it do not find either.
        let more = (due.min(time - cycle_us) - first) / cycle_us;
        let Some(more) =
            [more, 0].into_iter().find(|more| self.poll_changes_nothing(first + more * cycle_us))
        else {
            return false;
        };
        self.is_seen = true;
        self.journal.tick_through(first, cycle_us, more + 1);
        self.next_cycle += (more + 1) * cycle_us;
        true
    }

    /// The next processor cycle up to `time` that is needed, as far as can be said now: media that go on by themselves make
    /// those before it where one would find something to do.
    pub(super) fn last_needed_cycle(&mut self, time: u64) -> u64 {
        let first = self.next_cycle;
        let may_be_left = first + self.cycle_us <= time && !self.watching && self.is_unobserved();
        if !may_be_left || !self.poll_changes_nothing(first) {
            return first;
        }
        self.is_seen = true;
        // The journal is told the time at the first one behind its next look.
        let wanted = time.min(self.journal.next_look().saturating_add(self.cycle_us - 1)).max(first);
        first + (wanted - first) / self.cycle_us * self.cycle_us
    }

    /// Whether nobody follows registers or forces them, and nothing is to be disturbed.
    #[inline]
    pub(super) fn is_unobserved(&self) -> bool {
        self.faults.is_empty() && !self.journal.follows() && self.forces.list().is_empty()
    }

    fn poll_changes_nothing(&self, now: u64) -> bool {
        let is_seen = self.is_seen;
        let mut devices = self.devices.iter().zip(self.ports.of_devices());
        devices.all(|(device, ports)| {
            let in_vain =
                |port: &Port| self.media[port.medium].poll_changes_nothing(port.place, now, is_seen);
            (is_seen || device.poll_changes_nothing()) && (!device.is_up() || ports.iter().all(in_vain))
        })
    }

    /// Whether looks find nothing to do until something else is due, after one that has found what there was.
    fn is_quiescent(&self) -> bool {
        let mut devices = self.devices.iter().zip(self.ports.of_devices());
        self.faults.is_empty()
            && devices.all(|(device, ports)| {
                let mut ports = ports.iter();
                let rest = |port: &Port| self.media[port.medium].is_quiescent(port.place);
                (!device.is_up() || ports.all(rest)) && device.is_quiescent()
            })
    }
}
