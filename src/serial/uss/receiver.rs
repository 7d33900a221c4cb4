//! Finds telegrams among the characters of the line. Times are in microseconds.

use super::telegram::{LONGEST, STX, Telegram, TelegramError};
use super::timing::Timing;
use crate::serial::{Character, CharacterError};
#[cfg(feature = "emulator")]
use serde::{Deserialize, Serialize};

#[derive(Clone, Debug)]
#[cfg_attr(feature = "emulator", derive(Serialize, Deserialize))]
pub(super) struct Receiver {
    timing: Timing,
    /// Added to the longest time of a telegram, in microseconds.
    tolerance: u64,
    /// End of the last character of any telegram.
    last: Option<u64>,
    /// Characters of the telegram, and the end of its `STX`.
    characters: Vec<u8>,
    begin: u64,
}

impl Receiver {
    pub(super) const fn new(timing: Timing) -> Self {
        Receiver { timing, tolerance: 0, last: None, characters: Vec::new(), begin: 0 }
    }

    /// Sets a time in microseconds by which a telegram may be longer.
    pub(super) fn set_tolerance(&mut self, tolerance: u64) {
        self.tolerance = tolerance;
    }

    /// Returns the time at which the telegram that has begun must be complete.
    pub(super) fn deadline(&self) -> Option<u64> {
        let longest = self.timing.residual(self.data()) + self.tolerance;
        (!self.characters.is_empty()).then(|| self.begin + longest)
    }

    /// Number of characters of net data; the largest one while `LGE` has not come.
    fn data(&self) -> usize {
        usize::from(self.characters.get(1).copied().unwrap_or(LONGEST).saturating_sub(2))
    }

    /// Drops the telegram that has begun. The next one begins after a start delay.
    pub(super) fn drop_telegram(&mut self) {
        self.characters.clear();
    }

    /// Takes a character that ended at `at`. Returns a telegram at its end, or the reason why it is none.
    pub(super) fn received(
        &mut self,
        at: u64,
        character: Character,
    ) -> Option<Result<Telegram, TelegramError>> {
        let silent = self
            .last
            .is_none_or(|last| at >= last + self.timing.start_delay() + self.timing.characters(1) - 1);
        self.last = Some(at);
        let late = self.deadline().is_some_and(|deadline| at > deadline);
        if late {
            self.drop_telegram();
        }
        let result = match character.byte() {
            Some(octet) if self.characters.is_empty() => {
                if silent && octet == STX {
                    self.characters.push(octet);
                    self.begin = at;
                }
                None
            }
            Some(octet) => self.append(octet),
            None if self.characters.is_empty() => None,
            None if character == Character::Error(CharacterError::Break) => Some(Err(TelegramError::Break)),
            None => Some(Err(TelegramError::DamagedCharacter)),
        };
        if result.is_some() {
            self.drop_telegram();
        }
        if late { Some(Err(TelegramError::Late)) } else { result }
    }

    fn append(&mut self, octet: u8) -> Option<Result<Telegram, TelegramError>> {
        if self.characters.len() == 1 && !(2..=LONGEST).contains(&octet) {
            return Some(Err(TelegramError::Length(octet)));
        }
        self.characters.push(octet);
        let is_complete = self.characters.len() >= self.data() + 4;
        is_complete.then(|| Telegram::of_characters(&self.characters))
    }
}
