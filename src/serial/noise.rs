//! Tests only: one direction of a line that loses, changes, marks, doubles and delays characters, and makes breaks.

use super::{Character, CharacterError};
use proptest::prelude::*;
use std::collections::VecDeque;

/// What happens to a character.
#[derive(Clone, Copy, Debug)]
pub(super) enum Fault {
    Lost,
    /// These bits change, and the receiver does not notice it.
    Changed(u8),
    /// The receiver notices an error.
    Marked(CharacterError),
    Doubled,
    /// The line carries the character, and all later ones, after this time in microseconds.
    Delayed(u64),
}

/// Faults that a receiver notices.
pub(super) fn marked() -> impl Strategy<Value = Fault> {
    let errors = [CharacterError::Parity, CharacterError::Framing, CharacterError::Overrun];
    prop::sample::select(errors.to_vec()).prop_map(Fault::Marked)
}

/// Faults that a receiver does not notice.
pub(super) fn hidden() -> impl Strategy<Value = Fault> {
    prop_oneof![Just(Fault::Lost), (1u8..).prop_map(Fault::Changed), Just(Fault::Doubled)]
}

/// Any fault.
pub(super) fn any_fault() -> impl Strategy<Value = Fault> {
    prop_oneof![
        3 => hidden(),
        1 => marked(),
        1 => Just(Fault::Marked(CharacterError::Break)),
        1 => (1u64..3_000_000).prop_map(Fault::Delayed)
    ]
}

/// Faults with the number of good characters before each fault.
pub(super) fn faults(
    fault: impl Strategy<Value = Fault>,
    most: usize,
) -> impl Strategy<Value = Vec<(usize, Fault)>> {
    prop::collection::vec((0usize..40, fault), 0..=most)
}

/// One direction of a line.
pub(super) struct Direction {
    character_time: u64,
    faults: VecDeque<(usize, Fault)>,
    free: u64,
    delay: u64,
    arriving: VecDeque<(u64, Character)>,
    /// The characters that the receiver got.
    pub(super) received: Vec<Character>,
}

impl Direction {
    pub(super) fn new(character_time: u64, faults: Vec<(usize, Fault)>) -> Self {
        let (faults, arriving) = (faults.into(), VecDeque::new());
        Direction { character_time, faults, free: 0, delay: 0, arriving, received: Vec::new() }
    }

    /// Sends characters from `now` on.
    pub(super) fn send(&mut self, now: u64, octets: &[u8]) {
        for &octet in octets {
            let fault = match self.faults.front_mut() {
                Some((0, _)) => self.faults.pop_front().map(|(_, fault)| fault),
                Some((left, _)) => {
                    *left -= 1;
                    None
                }
                None => None,
            };
            let character = match fault {
                Some(Fault::Changed(bits)) => Character::Byte(octet ^ bits),
                Some(Fault::Marked(error)) => Character::Error(error),
                _ => Character::Byte(octet),
            };
            if let Some(Fault::Delayed(delay)) = fault {
                self.delay += delay;
            }
            let count = match fault {
                Some(Fault::Lost) => 0,
                Some(Fault::Doubled) => 2,
                _ => 1,
            };
            self.free = self.free.max(now);
            for _ in 0..count.max(1) {
                self.free += self.character_time;
            }
            for copy in (0..count).rev() {
                self.arriving.push_back((self.free - copy * self.character_time + self.delay, character));
            }
        }
    }

    /// Time of the next character at the receiver.
    pub(super) fn next(&self) -> Option<u64> {
        self.arriving.front().map(|(time, _)| *time)
    }

    /// Takes the next character if it arrives at `now`.
    pub(super) fn take(&mut self, now: u64) -> Option<(u64, Character)> {
        let arrival = self.arriving.pop_front_if(|(time, _)| *time <= now)?;
        self.received.push(arrival.1);
        Some(arrival)
    }
}
