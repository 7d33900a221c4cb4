//! Skipping of polls that change nothing.
//!
//! A processor cycle polls the registers, because clients do not announce their stores. If all ports and
//! devices are quiescent after a cycle, and no register is written, the cycles until the next event would
//! change nothing. The plant skips these cycles.
//!
//! No client can see the difference. Until the clock has reached the next event, only two kinds of clients can write:
//! the client that advances the clock, and programs that have mapped an image. The next poll sees their writes, because
//! the plant always polls when [`Plant::advance_to`] reaches a processor cycle for the first time.
//!
//! While a bus is busy, a poll also updates the registers that show the present traffic. If one call advances the clock
//! over several polls that change nothing else, the plant makes only the last poll.

use super::Plant;
use super::ports::Port;

impl Plant {
    /// Returns a time like [`Plant::next_event`], but ignores processor cycles that change nothing. A client that waits
    /// for a register need not poll the register before this time, unless another program writes it.
    pub fn next_change(&self) -> u64 {
        let others = self.next_besides_cycle();
        if self.has_looked && self.next_cycle < others && self.is_quiescent() {
            others
        } else {
            self.next_event()
        }
    }

    /// Returns the time of the next event other than a processor cycle.
    fn next_besides_cycle(&self) -> u64 {
        let first = self.next_device.min(self.faults.next_time());
        self.buses.iter().map(|bus| bus.next_time()).fold(first, u64::min)
    }

    /// Called after a processor cycle that no other event has followed. Skips the cycles before `until` if they would
    /// change nothing.
    #[inline]
    pub(super) fn leave_out_cycles(&mut self, until: u64) {
        if self.next_cycle < until && self.is_quiescent() {
            let count = (until - self.next_cycle).div_ceil(self.cycle_us);
            self.journal.tick_through(self.next_cycle, self.cycle_us, count);
            self.next_cycle += count * self.cycle_us;
        }
    }

    /// Skips the processor cycles until `due` if they would only update the registers that show the live traffic. `due` is
    /// the time of the next event other than a processor cycle. A later cycle, at `time` at the latest, updates these
    /// registers (decision D-585). Returns true if no cycle is left at `due` or earlier.
    #[inline]
    pub(super) fn leaves_cycles_out(&mut self, due: u64, time: u64) -> bool {
        while self.next_cycle <= due {
            if !self.leaves_first_cycles_out(due, time) {
                return false;
            }
        }
        true
    }

    /// Skips the next processor cycle, and the cycles after it until `due` if a single check can decide about them. Returns
    /// false if the next cycle must run.
    fn leaves_first_cycles_out(&mut self, due: u64, time: u64) -> bool {
        let (first, cycle_us) = (self.next_cycle, self.cycle_us);
        if first + cycle_us > time || self.watching || !self.is_unobserved() {
            return false;
        }
        // No event occurs before the last of these polls. If the last poll changes nothing, the earlier polls change
        // nothing either.
        let span = due.min(time - cycle_us) - first;
        // Usually the next event comes before the second poll. This needs no division.
        let more = if span < cycle_us { 0 } else { span / cycle_us };
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

    /// Returns the last processor cycle up to `time` that must run, as far as can be determined now. Earlier
    /// cycles may also change something. Buses that run independently run these cycles themselves.
    pub(super) fn last_needed_cycle(&mut self, time: u64) -> u64 {
        let first = self.next_cycle;
        let may_be_left = first + self.cycle_us <= time && !self.watching && self.is_unobserved();
        if !may_be_left || !self.poll_changes_nothing(first) {
            return first;
        }
        self.is_seen = true;
        // The journal must get the time of the first cycle after `next_look`.
        let wanted = time.min(self.journal.next_look().saturating_add(self.cycle_us - 1)).max(first);
        first + (wanted - first) / self.cycle_us * self.cycle_us
    }

    /// True if no registers are followed or forced, and there are no faults: nothing outside the firmware
    /// depends on each single event.
    #[inline]
    pub(super) fn is_unobserved(&self) -> bool {
        self.faults.is_empty() && !self.journal.follows() && self.forces.list().is_empty()
    }

    fn poll_changes_nothing(&self, now: u64) -> bool {
        let is_seen = self.is_seen;
        let mut devices = self.devices.iter().zip(self.ports.of_devices());
        devices.all(|(device, ports)| {
            let in_vain =
                |port: &Port| self.buses[port.bus.index()].poll_changes_nothing(port.place, now, is_seen);
            let is_idle = is_seen && !device.needs_each_cycle() || device.poll_changes_nothing();
            is_idle && (!device.is_up() || ports.iter().all(in_vain))
        })
    }

    /// True if further polls would change nothing until another event occurs. The last poll must have handled all
    /// changes.
    fn is_quiescent(&self) -> bool {
        let mut devices = self.devices.iter().zip(self.ports.of_devices());
        self.faults.is_empty()
            && devices.all(|(device, ports)| {
                let mut ports = ports.iter();
                let rest = |port: &Port| self.buses[port.bus.index()].is_quiescent(port.place);
                (!device.is_up() || ports.all(rest)) && device.is_quiescent()
            })
    }
}
