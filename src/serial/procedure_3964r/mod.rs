//! The procedure 3964R (DIN 66019; CP 341 manual): a data link of two partners that exchange blocks of octets.
//!
//! The sender requests the connection with `STX`, and the receiver grants it with `DLE`. Then follow the octets of the
//! block, where each 16#10 is doubled, and `DLE ETX BCC`. The receiver acknowledges the block with `DLE`, or refuses it
//! with `NAK`. The procedure 3964 is the same without `BCC`.
//!
//! [`Procedure`] is one partner as a state machine without input and output. Its user passes the characters of the line
//! to [`Procedure::received`], and sends the characters that [`Procedure::poll`] returns. Times are emulated times in
//! microseconds.
//!
//! ```
//! use commram::serial::Character;
//! use commram::serial::procedure_3964r::{Event, Priority, Procedure, Settings};
//!
//! let mut plc = Procedure::new(Settings::new(Priority::High, 286));
//! plc.send(b"\x05\x10")?;
//! assert_eq!(plc.poll(0), [0x02]); // STX
//! plc.received(1_000, Character::Byte(0x10)); // the partner grants the connection with DLE
//! let mut text = Vec::new();
//! while let Some(time) = plc.due().filter(|time| *time < 5_000) {
//!     text.extend(plc.poll(time));
//! }
//! assert_eq!(text, [0x05, 0x10, 0x10, 0x10, 0x03, 0x16]); // 16#10 is doubled; 05 ^ 10 ^ 10 ^ 10 ^ 03 = 16
//! plc.received(6_000, Character::Byte(0x10)); // the partner acknowledges the block
//! assert_eq!(plc.next_event(), Some(Event::Sent));
//! # Ok::<(), commram::serial::procedure_3964r::SendError>(())
//! ```
//!
//! **What the check sum cannot detect.** `BCC` is the exclusive or of all characters after `STX`. A lost or added
//! character 16#00, two changes of the same bits, two exchanged characters, and a change that makes a character of the
//! block the end of the block can leave it correct. The parity bit of the characters detects most of these faults.

mod frame;
#[cfg(test)]
mod noise_tests;
mod settings;
mod state;
#[cfg(test)]
mod tests;

pub use frame::{DLE, ETX, NAK, STX, frame};
pub use settings::{Priority, Settings};

use crate::serial::{Character, CharacterError};
use state::{Reception, State};
use std::collections::VecDeque;

/// Reason for which a block was not transmitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, thiserror::Error)]
pub enum ProcedureError {
    /// All connection attempts failed.
    #[error(
        "no connection: the partner did not answer STX with DLE within the acknowledgement delay, in any attempt"
    )]
    NoConnection,
    /// All transmissions failed, or the partner refused them.
    #[error(
        "the partner acknowledged no transmission of the block; check parity, baud rate and BCC of both partners"
    )]
    NotAcknowledged,
    /// The line was interrupted.
    #[error("break: the line was interrupted")]
    Break,
    /// The next character did not come within the character delay.
    #[error("the block is incomplete: the next character did not come within the character delay")]
    CharacterDelay,
    /// A character was damaged.
    #[error("a character of the block has a parity or framing error, or was lost in the receiver")]
    DamagedCharacter,
    /// A `DLE` was followed by a character other than `DLE` and `ETX`.
    #[error("DLE was followed by 16#{0:02X}; only DLE and ETX may follow DLE in a block")]
    WrongEscape(u8),
    /// The check sum is wrong.
    #[error("the check sum is 16#{found:02X}; it must be 16#{expected:02X}")]
    CheckSum {
        /// Check sum of the block.
        found: u8,
        /// Check sum that the characters of the block require.
        expected: u8,
    },
    /// The block has no octet.
    #[error("the block is empty; a block has at least one octet")]
    Empty,
    /// The block is longer than [`Settings::longest_block`].
    #[error("the block is longer than {0} octets")]
    TooLong(usize),
    /// The receiver has no free buffer: the user takes no events.
    #[error("no free buffer: the program has not fetched the received blocks")]
    NoBuffer,
    /// The partner did not repeat a refused block within the block waiting time.
    #[error("the partner did not repeat the refused block within the block waiting time")]
    NotRepeated,
    /// A character other than `STX` came while no block was transmitted.
    #[error("a character other than STX came outside a block")]
    Unexpected,
}

/// Reason for which [`Procedure::send`] refuses a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SendError {
    /// The block has no octet.
    #[error("the block is empty; a block has at least one octet")]
    Empty,
    /// The block is longer than [`Settings::longest_block`].
    #[error("the block has {found} octets; it may have at most {longest}")]
    TooLong {
        /// Number of octets of the block.
        found: usize,
        /// Largest number of octets.
        longest: usize,
    },
    /// Another block is being sent.
    #[error("the procedure sends one block at a time; wait for `Sent` or `SendFailed`")]
    Busy,
}

/// Result of a transmission.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Event {
    /// A block has come, with a correct check sum.
    Received(Vec<u8>),
    /// A transmission from the partner failed. The partner can repeat it.
    ReceiveFailed(ProcedureError),
    /// The partner has acknowledged the block.
    Sent,
    /// The block was given up. If only the acknowledgement was lost, the partner has received the block nevertheless.
    SendFailed(ProcedureError),
}

/// A block to be sent.
#[derive(Clone, Debug)]
struct Job {
    block: Vec<u8>,
    connections: u8,
    transmissions: u8,
}

/// One partner of the procedure 3964R.
#[derive(Clone, Debug)]
pub struct Procedure {
    settings: Settings,
    state: State,
    job: Option<Job>,
    /// Characters for the line, and the earliest time of the first one.
    output: VecDeque<u8>,
    line_free: u64,
    /// Number of failed transmissions from the partner in a row.
    refused: u8,
    is_paused: bool,
    events: VecDeque<Event>,
}

impl Procedure {
    /// Returns an idle partner.
    #[must_use]
    pub fn new(settings: Settings) -> Self {
        Procedure {
            settings,
            state: State::Idle,
            job: None,
            output: VecDeque::new(),
            line_free: 0,
            refused: 0,
            is_paused: false,
            events: VecDeque::new(),
        }
    }

    /// Returns the settings.
    #[must_use]
    pub const fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Starts the transmission of a block. The next [`Event::Sent`] or [`Event::SendFailed`] is its result.
    ///
    /// # Errors
    /// The block is empty or too long, or another block is being sent.
    pub fn send(&mut self, block: &[u8]) -> Result<(), SendError> {
        if self.job.is_some() {
            return Err(SendError::Busy);
        }
        if block.is_empty() {
            return Err(SendError::Empty);
        }
        let longest = self.settings.longest_block;
        if block.len() > longest {
            return Err(SendError::TooLong { found: block.len(), longest });
        }
        self.job = Some(Job { block: block.to_vec(), connections: 0, transmissions: 0 });
        Ok(())
    }

    /// True while a block is being sent.
    #[must_use]
    pub const fn is_sending(&self) -> bool {
        self.job.is_some()
    }

    /// Takes the oldest event. Received blocks occupy their buffer until this call.
    pub fn next_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    /// Returns the time of the next action of [`poll`](Self::poll) if no further character comes; `None` if there is
    /// none.
    #[must_use]
    pub fn due(&self) -> Option<u64> {
        if !self.output.is_empty() {
            return Some(self.line_free);
        }
        match &self.state {
            State::Idle if self.job.is_some() => Some(self.line_free),
            State::WaitingForBuffer { until, .. } if self.free_buffers() == 0 => Some(*until),
            State::WaitingForBuffer { .. } => Some(self.line_free),
            state => state.until(),
        }
    }

    /// Advances to `now`, in microseconds. Returns the characters that begin now. Several calls return
    /// the characters of one block, because an answer of the partner can end the transmission.
    pub fn poll(&mut self, now: u64) -> Vec<u8> {
        self.expire(now);
        if self.output.is_empty() {
            match self.state {
                State::Idle if self.job.is_some() => self.connect(now),
                State::WaitingForBuffer { .. } if self.free_buffers() > 0 => self.grant(now),
                _ => {}
            }
        }
        let mut characters = Vec::new();
        while let Some(character) = self.output.front().copied().filter(|_| self.line_free <= now) {
            self.output.pop_front();
            characters.push(character);
            self.line_free += self.settings.character_time;
        }
        if self.output.is_empty() && matches!(self.state, State::Sending) {
            self.state = State::Acknowledging { until: self.line_free + self.settings.acknowledgement_delay };
        }
        characters
    }

    /// Lets requests of the partner wait for a free buffer, also if there is one.
    pub const fn pause_reception(&mut self, is_paused: bool) {
        self.is_paused = is_paused;
    }

    /// Number of blocks that can still be received before the user takes events.
    fn free_buffers(&self) -> usize {
        if self.is_paused {
            return 0;
        }
        let used = self.events.iter().filter(|event| matches!(event, Event::Received(_))).count();
        self.settings.receive_buffers.saturating_sub(used)
    }

    /// Adds an event. The number of errors is bounded: the oldest error gives way.
    fn report(&mut self, event: Event) {
        const MOST_EVENTS: usize = 64;
        if self.events.len() >= MOST_EVENTS + self.settings.receive_buffers {
            let error = self.events.iter().position(|event| matches!(event, Event::ReceiveFailed(_)));
            self.events.remove(error.unwrap_or(0));
        }
        self.events.push_back(event);
    }

    fn put(&mut self, now: u64, characters: &[u8]) {
        self.line_free = self.line_free.max(now);
        self.output.extend(characters);
    }

    /// Time of the end of the characters that are in the output.
    fn end_of_output(&self) -> u64 {
        self.line_free + self.settings.character_time * self.output.len() as u64
    }

    /// Requests the connection.
    fn connect(&mut self, now: u64) {
        let Some(job) = &mut self.job else { return };
        job.connections += 1;
        self.put(now, &[STX]);
        self.state = State::Connecting { until: self.end_of_output() + self.settings.acknowledgement_delay };
    }

    /// Repeats the request for the connection, or gives up.
    fn connect_again(&mut self, now: u64) {
        match &self.job {
            Some(job) if job.connections < self.settings.connection_attempts => self.connect(now),
            _ => {
                self.put(now, &[NAK]);
                self.end_job(Event::SendFailed(ProcedureError::NoConnection));
            }
        }
    }

    /// Repeats the block from its connection on, or gives up. The partner gets `NAK` if it must leave its state.
    fn transmit_again(&mut self, now: u64, must_refuse: bool) {
        self.output.clear();
        let attempts = self.settings.transmission_attempts;
        let is_last = self.job.as_ref().is_none_or(|job| job.transmissions >= attempts);
        if must_refuse || is_last {
            self.put(now, &[NAK]);
        }
        if is_last {
            return self.end_job(Event::SendFailed(ProcedureError::NotAcknowledged));
        }
        if let Some(job) = &mut self.job {
            job.connections = 0;
        }
        self.connect(now);
    }

    fn end_job(&mut self, event: Event) {
        self.job = None;
        self.state = State::Idle;
        self.report(event);
    }

    /// The partner has granted the connection.
    fn transmit(&mut self, now: u64) {
        let Some(job) = &mut self.job else { return };
        job.transmissions += 1;
        let text = frame(&job.block, self.settings.check_sum);
        self.put(now, &text);
        self.state = State::Sending;
    }

    /// Answers the request for a connection.
    fn requested(&mut self, now: u64) {
        if self.free_buffers() == 0 {
            self.state = State::WaitingForBuffer { until: now + self.settings.buffer_wait };
        } else {
            self.grant(now);
        }
    }

    fn grant(&mut self, now: u64) {
        self.put(now, &[DLE]);
        let until = self.end_of_output() + self.settings.character_delay;
        self.state = State::Receiving { until, reception: Reception::default() };
    }

    /// Refuses the transmission, and waits for its repetition.
    fn refuse(&mut self, now: u64, error: ProcedureError) {
        self.put(now, &[NAK]);
        self.report(Event::ReceiveFailed(error));
        self.refused += 1;
        if self.refused >= self.settings.transmission_attempts {
            self.refused = 0;
            self.state = State::Idle;
        } else {
            self.state = State::Repeating { until: now + self.settings.block_wait };
        }
    }

    /// Handles the end of a time.
    fn expire(&mut self, now: u64) {
        if self.state.until().is_none_or(|until| now < until) {
            return;
        }
        match core::mem::take(&mut self.state) {
            State::Connecting { .. } => self.connect_again(now),
            State::Acknowledging { .. } | State::Disturbed { .. } => self.transmit_again(now, true),
            State::Noise { .. } => {
                self.put(now, &[NAK]);
                self.report(Event::ReceiveFailed(ProcedureError::Unexpected));
            }
            State::WaitingForBuffer { .. } => {
                self.put(now, &[NAK]);
                self.report(Event::ReceiveFailed(ProcedureError::NoBuffer));
            }
            State::Receiving { reception, .. } => {
                self.refuse(now, reception.error.unwrap_or(ProcedureError::CharacterDelay));
            }
            State::Repeating { .. } => {
                self.refused = 0;
                self.report(Event::ReceiveFailed(ProcedureError::NotRepeated));
            }
            State::Idle | State::Sending => {}
        }
    }

    /// Passes a character of the line to the procedure. `at` is the time of its last bit, in microseconds.
    pub fn received(&mut self, at: u64, character: Character) {
        self.expire(at);
        if character == Character::Error(CharacterError::Break) {
            return self.interrupted();
        }
        let octet = character.byte();
        match &mut self.state {
            State::Idle | State::Repeating { .. } => match octet {
                Some(STX) => self.requested(at),
                Some(NAK) => {}
                _ => self.state = State::Noise { until: at + self.settings.character_delay },
            },
            State::Noise { until } => *until = at + self.settings.character_delay,
            State::Connecting { .. } => match octet {
                Some(DLE) => self.transmit(at),
                // Conflict: both partners want to send.
                Some(STX) if self.settings.priority == Priority::High => {}
                Some(STX) => {
                    if let Some(job) = &mut self.job {
                        job.connections = 0;
                    }
                    self.requested(at);
                }
                _ => self.connect_again(at),
            },
            State::Sending => match octet {
                Some(NAK) => self.transmit_again(at, false),
                _ => {
                    self.output.clear();
                    self.state = State::Disturbed { until: at + self.settings.character_delay };
                }
            },
            State::Disturbed { until } => *until = at + self.settings.character_delay,
            State::Acknowledging { .. } => match octet {
                Some(DLE) => self.end_job(Event::Sent),
                _ => self.transmit_again(at, false),
            },
            State::WaitingForBuffer { .. } => {}
            State::Receiving { until, reception } => {
                *until = at + self.settings.character_delay;
                if let Some(result) = reception.take(octet, &self.settings) {
                    self.end_reception(at, result);
                }
            }
        }
    }

    fn end_reception(&mut self, at: u64, result: Result<Vec<u8>, ProcedureError>) {
        match result {
            Ok(block) => {
                self.put(at, &[DLE]);
                self.refused = 0;
                self.state = State::Idle;
                self.report(Event::Received(block));
            }
            Err(error) => self.refuse(at, error),
        }
    }

    /// A break ends what the procedure does.
    fn interrupted(&mut self) {
        self.output.clear();
        self.refused = 0;
        match core::mem::take(&mut self.state) {
            State::Connecting { .. }
            | State::Sending
            | State::Disturbed { .. }
            | State::Acknowledging { .. } => {
                self.end_job(Event::SendFailed(ProcedureError::Break));
            }
            // A block that has not begun is sent when the line is free.
            State::Idle | State::Noise { .. } => {}
            _ => self.report(Event::ReceiveFailed(ProcedureError::Break)),
        }
    }
}
