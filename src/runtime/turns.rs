//! A step of the stepped clock: advances the emulated time, and waits for tasks and guests that have a seat in lockstep
//! (see `docs/reference/can.md`, "Time").
//!
//! At each emulated time, all other events are handled first. Then all guests have their turns together. When all turns
//! are over, the frames that the guests have sent enter the buses together, ordered by bus and guest number. So the
//! order of the frames does not depend on the real speed of the guests. While guests have seats, the clock advances
//! from event to event, so that the receivers of a frame get their turn at the moment of its arrival.

use super::Emulator;
use crate::awake_time::AwakeTime;
use crate::request::Host;
use std::time::Duration;

/// Interval at which the emulator checks whether it must stop during a guest's turn.
const LOOK: Duration = Duration::from_millis(20);
/// Longest real time of a guest's turn. It is shorter than the time for which a client waits for the answer to a step.
const PATIENCE: Duration = Duration::from_secs(5);

impl Emulator {
    /// Advances the clock to `target`. Returns false if the emulator must stop, or if other clients must be served
    /// during the turn of a task or guest; then call it again with the same target.
    pub(super) fn step_to(&mut self, target: u64) -> bool {
        // During a step only guests with seats can connect, even while the step is paused.
        if self.under_way.take() != Some(target) && !self.lockstep.is_in_turn() {
            self.guests.enter(&mut self.plant, true);
        }
        let has_arrived = self.continue_to(target);
        self.under_way = (!has_arrived).then_some(target);
        has_arrived
    }

    fn continue_to(&mut self, target: u64) -> bool {
        loop {
            if !self.lockstep.is_in_turn() && !self.give_turns() {
                return false;
            }
            let until = if self.guests.have_seats() {
                self.next_event().min(target)
            } else if self.guests.have_due_frames() {
                // There is room again after one of the next changes.
                self.next_change().min(target)
            } else {
                target
            };
            let Emulator { plant, lockstep, stop, slice, .. } = &mut *self;
            lockstep.advance(plant, until, || stop.is_made(), &|| slice.is_over());
            self.guests.send_due_frames(&mut self.plant);
            self.guests.send_heard(&mut self.plant);
            if self.lockstep.is_in_turn() || self.stop.is_made() {
                return false;
            }
            let is_due = self.guests.next_turn() <= self.plant.now();
            if self.plant.now() >= target && !is_due {
                return true;
            }
            // Guests can have many turns one after the other, and scripts of devices can take long. They must not block
            // other clients, so the step may pause here.
            if self.should_pause() {
                return false;
            }
        }
    }

    /// Gives turns to all guests with seats at their time, and passes their frames to the plant. Returns false if
    /// stopped or if a turn is still in progress.
    fn give_turns(&mut self) -> bool {
        while self.guests.have_seats() {
            self.guests.grant(self.plant.now());
            if !self.await_guests() {
                return false;
            }
            self.guests.enter_seated(&mut self.plant);
            if self.guests.next_turn() > self.plant.now() {
                break;
            }
        }
        true
    }

    /// Waits until no guest has a turn. During the wait the boards answer requests, because a guest may also have
    /// mapped an image. Returns false if the emulator must stop, or if other clients must be served first.
    fn await_guests(&mut self) -> bool {
        self.turn_time.get_or_insert_with(AwakeTime::start);
        while self.guests.have_turns() {
            if self.note_rings() && self.plant.look_at_boards() {
                self.announce();
            }
            if self.stop.is_made() {
                return false;
            }
            if self.turn_time.as_mut().is_some_and(|time| time.elapsed() >= PATIENCE) {
                self.guests.give_up(&mut self.plant);
                break;
            }
            if self.should_pause() {
                return false;
            }
            // The thread wakes up at every action of a guest, because each action rings the doorbell.
            if self.guests.have_turns() {
                self.sleep(LOOK);
            }
        }
        self.turn_time = None;
        true
    }
}
