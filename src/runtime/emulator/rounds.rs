//! The emulator's main loop.
//!
//! One thread does everything: it advances the clock, answers rung doorbells and channel requests, and sleeps on the
//! doorbells until the next event. In each pass of the loop the thread reads the number of rings, then checks
//! everything, and then sleeps unless a doorbell has rung since it read the number. So the sleep misses no ring.

use super::Emulator;
use crate::memory::bell;
use crate::memory::header::LONGEST_LEAD_US;
use crate::runtime::lockstep::NoWitness;
use std::time::Duration;

/// Longest sleep. A change without a ring of the doorbell is detected at the latest after this time.
pub(in crate::runtime) const LONGEST_SLEEP: Duration = Duration::from_millis(100);

/// Longest step of emulated time while no other process has the image open. A client that attaches may at first see
/// registers as they were up to this time earlier.
const UNSEEN_US: u64 = 10_000;

/// Longest step of emulated time. After the machine was suspended, the clock may have to catch up with hours; signals
/// and clients are handled between the steps.
const LONGEST_STEP_US: u64 = LONGEST_LEAD_US;
/// Largest number of consecutive register writes that an emulator in busy mode answers, at one emulated time, before it
/// does other work.
const LONGEST_CHAIN: u32 = 16;
/// Number of polls without a new write after which such a chain ends.
const LOOKS: u32 = 64;

impl Emulator {
    pub(super) fn run_stepped(&mut self) {
        while !self.is_stopping() {
            self.look_at_rings();
            self.give_order_turns();
            self.save_novram(false);
            if self.serve_channel() {
                self.announce();
            } else if !self.options.busy && !self.is_time_passing() && !self.lockstep.is_in_turn() {
                self.sleep(LONGEST_SLEEP);
            }
        }
    }

    /// Returns the time of the real-time clock, limited to one step after the plant's time, and to the time of a change
    /// of the clock's speed.
    pub(super) fn real_now(&self) -> u64 {
        let change = self.speed_change.as_ref();
        change
            .map_or_else(|| self.wall.now().min(self.plant.now() + LONGEST_STEP_US), |change| change.from_us)
    }

    pub(super) fn run_real_time(&mut self) {
        while !self.is_stopping() {
            let rung = self.note_rings();
            let now = self.real_now();
            let look = rung || self.options.busy && self.plant.control_changed();
            let due = self.advance_real_time(now);
            self.note_lateness();
            if look {
                self.plant.processor_cycle();
                if self.options.busy {
                    self.answer_on();
                }
                self.lockstep.look(&mut self.plant, &mut NoWitness);
            }
            self.guests.send_heard(&mut self.plant);
            self.guests.grant(self.plant.now());
            self.guests.enter(&mut self.plant, false);
            if look || due {
                self.announce();
                self.notify_events();
            }
            self.save_novram(false);
            if self.serve_channel() {
                // A write through the channel has the effect of a ring of the doorbell: the firmware polls the
                // registers at once.
                self.plant.processor_cycle();
                self.announce();
            } else if !self.options.busy {
                self.sleep(self.wall.until(self.next_seen()).min(LONGEST_SLEEP));
            }
        }
    }

    /// A client that polls usually writes again as soon as it has its answer. So the emulator first answers such
    /// writes, at the same emulated time (decision D-583).
    fn answer_on(&mut self) {
        for _ in 0..LONGEST_CHAIN {
            self.announce();
            if !(0..LOOKS).any(|_| self.plant.control_changed()) {
                return;
            }
            self.plant.processor_cycle();
        }
    }

    /// Used with a stepped clock. Gives a turn to each task in lockstep if its board has requested a start or stop. The
    /// task obeys at the moment of the request, even if the clock does not advance.
    fn give_order_turns(&mut self) {
        if self.is_time_passing() || !self.lockstep.has_turns() {
            return;
        }
        let Emulator { plant, lockstep, stop, .. } = self;
        lockstep.take_turns(plant, || stop.is_made(), &mut NoWitness);
        self.travel.touch();
        self.announce();
    }

    /// Returns the time of the next event that another process can see or must answer. Used in real time.
    fn next_seen(&self) -> u64 {
        let next = self.plant.next_event();
        let is_seen = !self.watch.is_alone() || self.is_listened_to() || self.guests.are_present();
        let next = if is_seen { next } else { next.max(self.plant.now() + UNSEEN_US) };
        next.min(self.guests.next_turn())
    }

    /// Used with a stepped clock. Handles requests to the boards now. Everything else that a ring of a doorbell can
    /// announce is handled when the clock advances.
    pub(in crate::runtime) fn look_at_rings(&mut self) {
        if self.note_rings() {
            self.guests.look(&mut self.plant);
            let (boards, tasks) =
                (self.plant.look_at_boards(), self.lockstep.look(&mut self.plant, &mut NoWitness));
            if boards || tasks {
                self.travel.touch();
                self.announce();
            }
        }
    }

    /// Reads the number of rings of each PLC's doorbell; returns true if one has rung since the last call.
    pub(in crate::runtime) fn note_rings(&mut self) -> bool {
        let mut rung = false;
        for (noted, image) in self.rings.iter_mut().zip(&self.images) {
            let rings = image.header().doorbell.rings();
            rung |= core::mem::replace(noted, rings) != rings;
        }
        rung
    }

    /// Sleeps until a doorbell is rung again, or until `timeout`.
    pub(in crate::runtime) fn sleep(&self, timeout: Duration) {
        if let ([image], [rings]) = (&self.images[..], &self.rings[..]) {
            image.header().doorbell.wait(*rings, Some(timeout));
            return;
        }
        let bells: Vec<_> = self
            .images
            .iter()
            .map(|image| &image.header().doorbell)
            .zip(self.rings.iter().copied())
            .collect();
        bell::wait_any(&bells, Some(timeout));
    }

    /// Wakes waiting clients: registers may have changed.
    pub(in crate::runtime) fn announce(&self) {
        self.images.iter().for_each(|image| image.header().answer.ring());
    }
}
