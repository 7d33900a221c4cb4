//! Looks at registers that find nothing to do, and are left out.
//!
//! A processor cycle looks at registers that nobody has to announce. When one has been, everybody who could look rests and
//! nobody writes, those up to the next event find what it found, so they need not be made: nobody can tell the difference.
//! Whoever lets time pass is the only one who can write before it has passed, but for a program that has mapped an image:
//! that one is seen at the next look behind, so there is one whenever [`Plant::advance_to`] comes to a processor cycle for
//! the first time.

use super::Plant;

impl Plant {
    /// As [`Plant::next_event`], but for processor cycles that would find nothing to do: whoever waits for a register need
    /// not look at it before, unless another program writes it.
    pub fn next_change(&self) -> u64 {
        let others = self.next_besides_cycle();
        if self.has_looked && self.next_cycle < others && self.rests() { others } else { self.next_event() }
    }

    /// When something other than a processor cycle is due.
    fn next_besides_cycle(&self) -> u64 {
        let first = self.next_device.min(self.faults.next_time());
        self.media().iter().map(|medium| medium.next_time()).fold(first, u64::min)
    }

    /// A processor cycle was the last that happened: leaves those before `until` out if they would find nothing to do.
    #[inline]
    pub(super) fn leave_out_cycles(&mut self, until: u64) {
        if self.next_cycle < until && self.rests() {
            let count = (until - self.next_cycle).div_ceil(self.cycle_us);
            self.journal.tick_through(self.next_cycle, self.cycle_us, count);
            self.next_cycle += count * self.cycle_us;
        }
    }

    /// Whether looks find nothing to do until something else is due, after one that has found what there was.
    fn rests(&self) -> bool {
        let mut devices = self.devices.iter().zip(self.ports.of_devices());
        self.faults.is_empty()
            && devices.all(|(device, ports)| {
                let mut ports = ports.iter();
                let rest = |port: &super::ports::Port| self.media[port.medium].rests(port.place);
                (!device.is_up() || ports.all(rest)) && device.rests()
            })
    }
}
