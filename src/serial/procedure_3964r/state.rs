//! States of a partner, and the reception of a block. Times are in microseconds.

use super::{DLE, ETX, ProcedureError, Settings};

#[derive(Clone, Debug, Default)]
pub(super) enum State {
    /// Nothing is transmitted.
    #[default]
    Idle,
    /// Wrong characters came; the line must be silent until this time.
    Noise { until: u64 },
    /// `STX` was sent.
    Connecting { until: u64 },
    /// The block is sent.
    Sending,
    /// The partner interrupted the block; the line must be silent until this time.
    Disturbed { until: u64 },
    /// The block was sent.
    Acknowledging { until: u64 },
    /// `STX` came while no buffer was free.
    WaitingForBuffer { until: u64 },
    /// The connection was granted.
    Receiving { until: u64, reception: Reception },
    /// A block was refused; its repetition is expected.
    Repeating { until: u64 },
}

impl State {
    /// Returns the time at which the state ends if no character comes.
    pub(super) const fn until(&self) -> Option<u64> {
        match self {
            State::Idle | State::Sending => None,
            State::Noise { until }
            | State::Connecting { until }
            | State::Disturbed { until }
            | State::Acknowledging { until }
            | State::WaitingForBuffer { until }
            | State::Receiving { until, .. }
            | State::Repeating { until } => Some(*until),
        }
    }
}

/// A block during its reception.
#[derive(Clone, Debug, Default)]
pub(super) struct Reception {
    block: Vec<u8>,
    sum: u8,
    position: Position,
    /// The first error. The reception continues until the end of the block.
    pub(super) error: Option<ProcedureError>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Position {
    #[default]
    Text,
    AfterDle,
    CheckSum,
}

impl Reception {
    /// Takes a character; `None` is a damaged one. Returns the block at its end.
    pub(super) fn take(
        &mut self,
        octet: Option<u8>,
        settings: &Settings,
    ) -> Option<Result<Vec<u8>, ProcedureError>> {
        let Some(octet) = octet else {
            self.note(ProcedureError::DamagedCharacter);
            // A damaged check sum ends the block, too.
            if self.position == Position::CheckSum {
                return Some(self.end());
            }
            self.position = Position::Text;
            return None;
        };
        if self.position == Position::CheckSum {
            if octet != self.sum {
                self.note(ProcedureError::CheckSum { found: octet, expected: self.sum });
            }
            return Some(self.end());
        }
        self.sum ^= octet;
        match (self.position, octet) {
            (Position::Text, DLE) => self.position = Position::AfterDle,
            (Position::Text, _) => self.append(octet, settings),
            (_, ETX) if settings.check_sum => self.position = Position::CheckSum,
            (_, ETX) => return Some(self.end()),
            (_, DLE) => {
                self.position = Position::Text;
                self.append(DLE, settings);
            }
            (_, _) => {
                self.position = Position::Text;
                self.note(ProcedureError::WrongEscape(octet));
            }
        }
        None
    }

    fn append(&mut self, octet: u8, settings: &Settings) {
        if self.block.len() < settings.longest_block {
            self.block.push(octet);
        } else {
            self.note(ProcedureError::TooLong(settings.longest_block));
        }
    }

    fn note(&mut self, error: ProcedureError) {
        self.error.get_or_insert(error);
    }

    fn end(&mut self) -> Result<Vec<u8>, ProcedureError> {
        if self.block.is_empty() {
            self.note(ProcedureError::Empty);
        }
        match self.error {
            Some(error) => Err(error),
            None => Ok(core::mem::take(&mut self.block)),
        }
    }
}
