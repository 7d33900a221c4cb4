//! A step of the stepped clock: emulated time passes, and waits for those who have a seat in lockstep, tasks and guests.
//!
//! Guests have their turns after everything else that is due at a microsecond, all who are due at once, and what they have
//! sent in them enters together, by bus and number: who is faster makes no difference. While guests have seats, time
//! passes from event to event, so that a frame brings its hearers their turn at the moment at which it arrives.

use super::Emulator;
use crate::request::Host;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// How often the emulator looks whether it is to stop while a guest has its turn.
const LOOK: Duration = Duration::from_millis(20);
/// How long a turn of a guest may really take. It is less than a client waits for the answer to a step.
const PATIENCE: Duration = Duration::from_secs(5);

impl Emulator {
    /// Lets emulated time pass until `target`. `false`: the emulator is to stop, or a task or a guest has its turn and somebody is to
    /// be heard meanwhile; then it is to be called again with the same target.
    pub(super) fn step_to(&mut self, target: u64) -> bool {
        // On the way nobody enters but those with seats, wherever it pauses.
        if self.under_way.take() != Some(target) && !self.lockstep.is_in_turn() {
            self.guests.enter(&mut self.plant, true);
        }
        let has_arrived = self.go_on_to(target);
        self.under_way = (!has_arrived).then_some(target);
        has_arrived
    }

    fn go_on_to(&mut self, target: u64) -> bool {
        loop {
            if !self.lockstep.is_in_turn() && !self.give_turns() {
                return false;
            }
            let until = if self.guests.have_seats() { self.next_event().min(target) } else { target };
            let stop = &self.stop;
            self.lockstep.advance(&mut self.plant, until, || stop.load(Ordering::Acquire));
            self.guests.tell(&self.plant);
            if self.lockstep.is_in_turn() || self.stop.load(Ordering::Acquire) {
                return false;
            }
            let is_due = self.guests.next_turn() <= self.plant.now();
            if self.plant.now() >= target && !is_due {
                return true;
            }
            // Who has one turn after the other keeps nobody waiting.
            if self.guests.have_seats() && self.should_pause() {
                return false;
            }
        }
    }

    /// Turns for all guests with seats that are due now, and what they and those before them have sent enters. `false`: told
    /// to stop, or a turn goes on.
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

    /// Waits until nobody has a turn. Meanwhile the boards answer, so that guests that have mapped an image can ask them.
    /// `false`: the emulator is to stop, or somebody is to be heard before that.
    fn await_guests(&mut self) -> bool {
        let since = *self.turn_since.get_or_insert_with(Instant::now);
        while self.guests.have_turns() {
            if self.note_rings() && self.plant.look_at_boards() {
                self.announce();
            }
            if self.stop.load(Ordering::Acquire) {
                return false;
            }
            if since.elapsed() >= PATIENCE {
                self.guests.give_up(&mut self.plant);
                break;
            }
            if self.should_pause() {
                return false;
            }
            // Whatever a guest does rings.
            if self.guests.have_turns() {
                self.sleep(LOOK);
            }
        }
        self.turn_since = None;
        true
    }
}
