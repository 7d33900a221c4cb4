//! Errors of a received frame, or of a job before it is sent.

use crate::can::Payload;

/// A frame with a wrong format, or a job that does not fit the format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CodecError {
    /// The identifier is not a CANsync identifier.
    #[error("identifier 16#{0:03X} is none of CANsync (16#010, 16#100-1FF, 16#300-3FF, 16#500-5FF)")]
    ForeignIdentifier(u16),
    /// The number of data bytes does not fit the kind of frame.
    #[error("{frame} with {found} data bytes, {expected} would be right")]
    Length {
        /// Name of the kind of frame, for example "parameter job".
        frame: &'static str,
        /// Number of data bytes in the frame.
        found: u8,
        /// Permitted numbers of data bytes.
        expected: &'static str,
    },
    /// Bits 5-4 (MODE) of data byte 0 of an up-/download job are 00.
    #[error("up-/download job with MODE 00, which is reserved (01 init, 10 body, 11 last block)")]
    ReservedMode,
    /// Bit 7 of data byte 0 selects "parameter" although an up-/download is expected, or vice versa.
    #[error("{found} frame where {expected} is expected (bit 7 of data byte 0)")]
    OtherService {
        /// Name of the service that bit 7 of the frame indicates.
        found: &'static str,
        /// Name of the expected service.
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
    /// The answer has another parameter number than the job.
    #[error("answer for parameter {found} to a job for parameter {asked}")]
    OtherParameter {
        /// Parameter number in the job.
        asked: u16,
        /// Parameter number in the answer.
        found: u16,
    },
    /// The answer has another sub-slave address than the job.
    #[error("answer of sub-slave {found} to a job for sub-slave {asked}")]
    OtherSubSlave {
        /// Sub-slave address in the job.
        asked: u16,
        /// Sub-slave address in the answer.
        found: u16,
    },
    /// The answer acknowledges another block than the block of the job.
    #[error("answer for offset {found} to an up-/download job for offset {asked}")]
    OtherOffset {
        /// Offset in the job, in bytes.
        asked: u16,
        /// Offset in the answer, in bytes.
        found: u16,
    },
    /// The answer does not fit the job: it contains data that the job has not requested, or lacks data.
    #[error("{answer} as answer to {job}")]
    Mismatch {
        /// Name of the kind of answer.
        answer: &'static str,
        /// Name of the kind of job.
        job: &'static str,
    },
}

impl CodecError {
    pub(super) const fn length(frame: &'static str, payload: &Payload, expected: &'static str) -> Self {
        CodecError::Length { frame, found: payload.len() as u8, expected }
    }
}
