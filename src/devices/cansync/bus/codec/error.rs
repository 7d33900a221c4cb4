//! What can be wrong with a received frame, or with a job before it is sent.

use crate::can::Payload;

/// A frame that does not keep to the grammar, or a job that cannot be expressed in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CodecError {
    /// The identifier is none of CANsync.
    #[error("identifier 16#{0:03X} is none of CANsync (16#010, 16#100-1FF, 16#300-3FF, 16#500-5FF)")]
    ForeignIdentifier(u16),
    /// The number of data bytes does not fit the kind of frame.
    #[error("{frame} with {found} data bytes, {expected} would be right")]
    Length {
        /// Kind of frame.
        frame: &'static str,
        /// Data bytes found.
        found: u8,
        /// Data bytes that would be right.
        expected: &'static str,
    },
    /// An up-/download job has bits 5-4 (MODE) of data byte 0 at 00.
    #[error("up-/download job with MODE 00, which is reserved (01 init, 10 body, 11 last block)")]
    ReservedMode,
    /// Bit 7 of data byte 0 says "parameter" where up-/download is due, or the other way round.
    #[error("{found} frame where {expected} is due (bit 7 of data byte 0)")]
    OtherService {
        /// What the frame is.
        found: &'static str,
        /// What it should be.
        expected: &'static str,
    },
    /// The parameter number does not fit the 12 bits of the frame.
    #[error("parameter number {0} is above 4095")]
    ParameterNumber(u16),
    /// The element selection does not fit the 3 bits of the frame.
    #[error("element {0} is above 7 (7 is the parameter's value)")]
    Element(u8),
    /// A block length or offset does not fit the 12 bits of the frame.
    #[error("block length or offset {0} is above 4095 bytes")]
    Offset(u16),
    /// The answer is about another parameter than the job.
    #[error("answer for parameter {found} to a job for parameter {asked}")]
    OtherParameter {
        /// Number in the job.
        asked: u16,
        /// Number in the answer.
        found: u16,
    },
    /// The answer names another sub-slave than the job.
    #[error("answer of sub-slave {found} to a job for sub-slave {asked}")]
    OtherSubSlave {
        /// Sub-slave address in the job.
        asked: u16,
        /// Sub-slave address in the answer.
        found: u16,
    },
    /// The answer acknowledges another block than the one of the job.
    #[error("answer for offset {found} to an up-/download job for offset {asked}")]
    OtherOffset {
        /// Offset in the job.
        asked: u16,
        /// Offset in the answer.
        found: u16,
    },
    /// The answer cannot be one to this job: data where none was asked for, or none where it was.
    #[error("{answer} as answer to {job}")]
    Mismatch {
        /// What the answer is.
        answer: &'static str,
        /// What was asked.
        job: &'static str,
    },
}

impl CodecError {
    pub(super) const fn length(frame: &'static str, payload: &Payload, expected: &'static str) -> Self {
        CodecError::Length { frame, found: payload.len() as u8, expected }
    }
}
