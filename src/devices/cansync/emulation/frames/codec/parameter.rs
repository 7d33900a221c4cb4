//! Parameter jobs and their answers (manual 5.00005.03a p. 139-140, 5.01010.01 p. 26-27).
//!
//! The length alone distinguishes the jobs: 4 bytes read, 6 bytes write a word, 8 bytes write a doubleword.
//! An answer of 6 bytes may be a value or an error, and an answer of 4 bytes may be a finished write or BUSY.
//! Bits 6 and 5 of the first byte distinguish these answers. The decoder needs the job to check that an
//! answer fits it.

use super::CodecError;
use crate::can::Payload;
use crate::devices::cansync::frames::{Frame, FrameKind};
use crate::devices::cansync::registers::descriptor;
use crate::devices::cansync::registers::values::par_element;
use crate::layout::Meaning;
use serde::{Deserialize, Serialize};

/// Highest parameter number.
pub(crate) const MAX_NUMBER: u16 = 4095;
/// The element with the parameter's value. It is the only element that can be written.
pub(crate) const VALUE_ELEMENT: u8 = par_element::VALUE;

/// Returns the meaning of a slave's error number.
pub(crate) fn error_text(number: u16) -> &'static str {
    application_error(&descriptor::MEANING_PAR_ERROR, number)
}

/// Returns the text of the layout for an error number. Other numbers are defined by the application.
pub(super) fn application_error(errors: &'static Meaning, number: u16) -> &'static str {
    errors.value(number.into()).map_or("error of the application", |known| known.text)
}

/// Access of a parameter job.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Access {
    /// Read. The answer has the format.
    Read,
    /// The job writes this word.
    WriteWord(u16),
    /// The job writes this doubleword.
    WriteDoubleword(u32),
}

/// A parameter job of the master.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct ParameterJob {
    number: u16,
    element: u8,
    sub_slave: u16,
    access: Access,
}

impl ParameterJob {
    /// Creates a job for the value (element 7) of parameter `number` of the slave itself (sub-slave address 0).
    ///
    /// # Errors
    /// [`CodecError::ParameterNumber`] above 4095.
    #[inline]
    pub const fn new(number: u16, access: Access) -> Result<Self, CodecError> {
        if number > MAX_NUMBER {
            return Err(CodecError::ParameterNumber(number));
        }
        Ok(ParameterJob { number, element: VALUE_ELEMENT, sub_slave: 0, access })
    }

    /// Returns the job with another element, 0 to 7.
    ///
    /// # Errors
    /// [`CodecError::Element`] above 7.
    #[inline]
    pub const fn with_element(self, element: u8) -> Result<Self, CodecError> {
        if element > 7 {
            return Err(CodecError::Element(element));
        }
        Ok(ParameterJob { element, ..self })
    }

    /// Returns the job for a sub-slave; 0 is the slave itself.
    #[inline]
    pub const fn with_sub_slave(self, sub_slave: u16) -> Self {
        ParameterJob { sub_slave, ..self }
    }

    /// Parameter number, 0 to 4095.
    #[inline]
    pub const fn number(&self) -> u16 {
        self.number
    }

    /// Element selection, 0 to 7; 7 is the value.
    #[inline]
    pub const fn element(&self) -> u8 {
        self.element
    }

    /// Sub-slave address; 0 is the slave itself.
    #[inline]
    pub const fn sub_slave(&self) -> u16 {
        self.sub_slave
    }

    /// Returns whether the job reads or writes, with the value to write.
    #[inline]
    pub const fn access(&self) -> Access {
        self.access
    }

    /// Returns the answer to this job.
    #[inline]
    pub const fn answer(&self, result: ParameterResult) -> ParameterResponse {
        ParameterResponse { number: self.number, sub_slave: self.sub_slave, result }
    }

    /// Returns the frame to `slave` (0 to 127, on a bus 0 to 31).
    #[inline]
    pub const fn frame(&self, slave: u8) -> Frame {
        let [number_low, number_high] = self.number.to_le_bytes();
        let control = self.element << 4 | number_high;
        let [sub_low, sub_high] = self.sub_slave.to_le_bytes();
        let payload = match self.access {
            Access::Read => Payload::from_padded([control, number_low, sub_low, sub_high, 0, 0, 0, 0], 4),
            Access::WriteWord(value) => {
                let [a, b] = value.to_le_bytes();
                Payload::from_padded([control, number_low, a, b, sub_low, sub_high, 0, 0], 6)
            }
            Access::WriteDoubleword(value) => {
                let [a, b, c, d] = value.to_le_bytes();
                Payload::from_padded([control, number_low, a, b, c, d, sub_low, sub_high], 8)
            }
        };
        Frame::of(FrameKind::Job(slave), payload)
    }

    /// Decodes the data field of a parameter job.
    ///
    /// # Errors
    /// [`CodecError::OtherService`] for an up-/download job, [`CodecError::Length`] if there are not 4, 6 or 8 data
    /// bytes.
    #[inline]
    pub const fn decode(payload: &Payload) -> Result<Self, CodecError> {
        let [control, number_low, a, b, c, d, e, f] = payload.padded();
        if control & 0x80 != 0 {
            return Err(CodecError::OtherService { found: "up-/download", expected: "parameter" });
        }
        let (access, sub_slave) = match payload.len() {
            4 => (Access::Read, u16::from_le_bytes([a, b])),
            6 => (Access::WriteWord(u16::from_le_bytes([a, b])), u16::from_le_bytes([c, d])),
            8 => (Access::WriteDoubleword(u32::from_le_bytes([a, b, c, d])), u16::from_le_bytes([e, f])),
            _ => return Err(CodecError::length("parameter job", payload, "4, 6 or 8")),
        };
        let number = u16::from_le_bytes([number_low, control & 0x0F]);
        Ok(ParameterJob { number, element: control >> 4, sub_slave, access })
    }

    const fn text(&self) -> &'static str {
        match self.access {
            Access::Read => "a read job",
            Access::WriteWord(_) | Access::WriteDoubleword(_) => "a write job",
        }
    }
}

/// Result of a parameter job in the answer of a slave.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum ParameterResult {
    /// Read: the value, a word.
    Word(u16),
    /// Read: the value, a doubleword.
    Doubleword(u32),
    /// The value was written.
    Done,
    /// The slave has refused the job with this error number, see
    /// [`par_error`](crate::devices::cansync::registers::values::par_error).
    Error(u16),
    /// The slave is not ready; the master repeats the job.
    Busy,
}

/// A slave's answer to a parameter job, created by [`ParameterJob::answer`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct ParameterResponse {
    number: u16,
    sub_slave: u16,
    result: ParameterResult,
}

const BUSY: u8 = 0x40;
const ERR: u8 = 0x20;

impl ParameterResponse {
    /// Parameter number, 0 to 4095.
    #[inline]
    pub const fn number(&self) -> u16 {
        self.number
    }

    /// Sub-slave address; 0 is the slave itself.
    #[inline]
    pub const fn sub_slave(&self) -> u16 {
        self.sub_slave
    }

    /// Returns the result: value, done, error or BUSY.
    #[inline]
    pub const fn result(&self) -> ParameterResult {
        self.result
    }

    /// Returns the frame of slave `slave` (0 to 127, on a bus 0 to 31).
    ///
    /// The manual does not give the layout of a BUSY answer. The emulator sends four bytes as for a finished write:
    /// status, number, sub-slave address.
    #[inline]
    pub const fn frame(&self, slave: u8) -> Frame {
        let [number_low, number_high] = self.number.to_le_bytes();
        let [sub_low, sub_high] = self.sub_slave.to_le_bytes();
        let payload = match self.result {
            ParameterResult::Word(value) => {
                let [a, b] = value.to_le_bytes();
                Payload::from_padded([number_high, number_low, a, b, sub_low, sub_high, 0, 0], 6)
            }
            ParameterResult::Doubleword(value) => {
                let [a, b, c, d] = value.to_le_bytes();
                Payload::from_padded([number_high, number_low, a, b, c, d, sub_low, sub_high], 8)
            }
            ParameterResult::Done => {
                Payload::from_padded([number_high, number_low, sub_low, sub_high, 0, 0, 0, 0], 4)
            }
            ParameterResult::Error(error) => {
                let [a, b] = error.to_le_bytes();
                Payload::from_padded([ERR | number_high, number_low, a, b, sub_low, sub_high, 0, 0], 6)
            }
            ParameterResult::Busy => {
                Payload::from_padded([BUSY | number_high, number_low, sub_low, sub_high, 0, 0, 0, 0], 4)
            }
        };
        Frame::of(FrameKind::Response(slave), payload)
    }

    /// Decodes the data field of an answer to `job`.
    ///
    /// # Errors
    /// Returns the errors of [`ParameterResponse::decode_alone`]; also [`CodecError::OtherParameter`],
    /// [`CodecError::OtherSubSlave`] or [`CodecError::Mismatch`] if the answer does not fit `job`.
    #[inline]
    pub fn decode(job: &ParameterJob, payload: &Payload) -> Result<Self, CodecError> {
        let response = Self::decode_alone(payload)?;
        if response.number != job.number {
            return Err(CodecError::OtherParameter { asked: job.number, found: response.number });
        }
        let write = !matches!(job.access, Access::Read);
        match response.result {
            // The position of the sub-slave address in a BUSY answer is defined by this emulator only, so it
            // is not checked.
            ParameterResult::Busy => return Ok(job.answer(ParameterResult::Busy)),
            ParameterResult::Word(_) | ParameterResult::Doubleword(_) if write => {
                return Err(CodecError::Mismatch { answer: "a value", job: job.text() });
            }
            ParameterResult::Done if !write => {
                return Err(CodecError::Mismatch { answer: "no value", job: job.text() });
            }
            _ => {}
        }
        if response.sub_slave != job.sub_slave {
            return Err(CodecError::OtherSubSlave { asked: job.sub_slave, found: response.sub_slave });
        }
        Ok(response)
    }

    /// Decodes the data field of an answer without its job, as a trace requires. An answer of 4 bytes counts
    /// as a finished write, an answer of 6 or 8 bytes as a value.
    ///
    /// If BUSY is set, any length from 2 bytes on is accepted and ERR is ignored. If the length is not 4, the
    /// sub-slave address counts as 0.
    ///
    /// # Errors
    /// [`CodecError::OtherService`] for an answer to an up-/download job, [`CodecError::Length`].
    #[inline]
    pub const fn decode_alone(payload: &Payload) -> Result<Self, CodecError> {
        let [status, number_low, a, b, c, d, e, f] = payload.padded();
        if status & 0x80 != 0 {
            return Err(CodecError::OtherService { found: "up-/download", expected: "parameter" });
        }
        let word = u16::from_le_bytes([a, b]);
        let next = u16::from_le_bytes([c, d]);
        let (result, sub_slave) = match (status & BUSY != 0, status & ERR != 0, payload.len()) {
            (true, _, 4) => (ParameterResult::Busy, word),
            (true, _, 2..=8) => (ParameterResult::Busy, 0),
            (false, true, 6) => (ParameterResult::Error(word), next),
            (false, false, 4) => (ParameterResult::Done, word),
            (false, false, 6) => (ParameterResult::Word(word), next),
            (false, false, 8) => {
                (ParameterResult::Doubleword(u32::from_le_bytes([a, b, c, d])), u16::from_le_bytes([e, f]))
            }
            (true, ..) => return Err(CodecError::length("BUSY answer", payload, "4")),
            (false, true, _) => return Err(CodecError::length("parameter error answer", payload, "6")),
            (false, false, _) => return Err(CodecError::length("parameter answer", payload, "4, 6 or 8")),
        };
        Ok(ParameterResponse { number: u16::from_le_bytes([number_low, status & 0x0F]), sub_slave, result })
    }
}

#[cfg(test)]
#[path = "parameter_tests.rs"]
mod tests;
