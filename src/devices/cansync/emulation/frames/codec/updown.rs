//! Up- and download frames (manual 5.00005.03a p. 141-143).
//!
//! An init frame announces address and length. Then the data travel in blocks of six bytes at the offsets 0, 6, 12 ...;
//! the last block has a separate mode. This module does not check the sequence of the blocks.

use super::CodecError;
use super::parameter::application_error;
use crate::can::Payload;
use crate::devices::cansync::frames::{Frame, FrameKind};
use crate::devices::cansync::registers::descriptor;
use crate::devices::cansync::registers::values::updown_error;
use serde::{Deserialize, Serialize};

/// Data bytes of one frame.
pub(crate) const BLOCK: usize = 6;
/// Highest block length or offset: 12 bits.
pub(crate) const MAX_OFFSET: u16 = 4095;

const SERVICE: u8 = 0x80;
const DOWNLOAD: u8 = 0x40;
const MODE: u8 = 0x30;
const INIT: u8 = 0x10;
const BODY: u8 = 0x20;
const LAST: u8 = 0x30;
const BUSY: u8 = 0x40;
const ERR: u8 = 0x20;

/// Returns the meaning of an error number of an up-/download.
pub(crate) fn error_text(number: u16) -> &'static str {
    application_error(&descriptor::MEANING_UPDOWN_ERROR, number)
}

/// Direction of a transfer from the master's point of view.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Direction {
    /// Upload: the data travel from the slave to the master.
    Upload,
    /// Download: the data travel from the master to the slave.
    Download,
}

/// Step of a transfer in a job frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum UpDownStep {
    /// MODE 01: starts a transfer, or cancels it (see [`UpDownJob::cancel`]).
    Init {
        /// Returns the direction: upload or download.
        direction: Direction,
        /// Start address in the slave.
        address: u32,
        /// Sub-slave address, valid for the whole transfer; 0 is the slave itself.
        sub_slave: u16,
    },
    /// MODE 10 or 11: requests six bytes.
    Upload {
        /// True for the last block (MODE 11).
        last: bool,
    },
    /// MODE 10 or 11: carries six bytes.
    Download {
        /// True for the last block (MODE 11). The slave uses only its bytes within the announced length.
        last: bool,
        /// The six bytes of the block.
        data: [u8; BLOCK],
    },
}

/// An up-/download job of the master.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct UpDownJob {
    offset: u16,
    step: UpDownStep,
}

impl UpDownJob {
    /// Creates a job. In an init job, `offset` is the block length; in other jobs it is the offset of the
    /// block, 0 to 4095 bytes. If the length of an upload is 0, the slave selects the length.
    ///
    /// # Errors
    /// [`CodecError::Offset`] above 4095.
    pub const fn new(offset: u16, step: UpDownStep) -> Result<Self, CodecError> {
        if offset > MAX_OFFSET {
            return Err(CodecError::Offset(offset));
        }
        Ok(UpDownJob { offset, step })
    }

    /// Creates the job that cancels any transfer: an init job of an upload with address 0 and length 0.
    pub const fn cancel() -> Self {
        let step = UpDownStep::Init { direction: Direction::Upload, address: 0, sub_slave: 0 };
        UpDownJob { offset: 0, step }
    }

    /// Returns true if the job cancels a transfer: an init job of either direction with address 0 and length 0.
    pub const fn is_cancel(&self) -> bool {
        matches!(self.step, UpDownStep::Init { address: 0, .. }) && self.offset == 0
    }

    /// Returns the block length of an init job, otherwise the offset of the block, in bytes, 0 to 4095.
    #[inline]
    pub const fn offset(&self) -> u16 {
        self.offset
    }

    /// Returns the step of the job.
    #[inline]
    pub const fn step(&self) -> UpDownStep {
        self.step
    }

    /// Returns the direction: upload or download.
    pub const fn direction(&self) -> Direction {
        match self.step {
            UpDownStep::Init { direction, .. } => direction,
            UpDownStep::Upload { .. } => Direction::Upload,
            UpDownStep::Download { .. } => Direction::Download,
        }
    }

    /// Returns the usual answer to this job. The answer has the job's offset; only the answer to an init job
    /// has offset 0.
    pub const fn answer(&self, result: UpDownResult) -> UpDownResponse {
        let offset = match self.step {
            UpDownStep::Init { .. } => 0,
            _ => self.offset,
        };
        UpDownResponse { offset, result }
    }

    /// Returns the answer to the init job of an upload, with the length that the slave has set, 0 to 4095
    /// bytes.
    ///
    /// # Errors
    /// [`CodecError::Offset`] above 4095.
    pub const fn answer_with_length(&self, length: u16) -> Result<UpDownResponse, CodecError> {
        if length > MAX_OFFSET {
            return Err(CodecError::Offset(length));
        }
        Ok(UpDownResponse { offset: length, result: UpDownResult::Done })
    }

    /// Returns the refusal (16#0100) with the offset of the block that the slave expects instead, 0 to 4095.
    ///
    /// # Errors
    /// [`CodecError::Offset`] above 4095.
    pub const fn expects_instead(&self, offset: u16) -> Result<UpDownResponse, CodecError> {
        if offset > MAX_OFFSET {
            return Err(CodecError::Offset(offset));
        }
        Ok(UpDownResponse { offset, result: UpDownResult::Error(updown_error::EXPECTS_OTHER_BLOCK) })
    }

    /// Returns the frame to `slave` (0 to 127, on a bus 0 to 31).
    pub const fn frame(&self, slave: u8) -> Frame {
        let [low, high] = self.offset.to_le_bytes();
        let payload = match self.step {
            UpDownStep::Init { direction, address, sub_slave } => {
                let direction = match direction {
                    Direction::Upload => 0,
                    Direction::Download => DOWNLOAD,
                };
                let [a, b, c, d] = address.to_le_bytes();
                let [e, f] = sub_slave.to_le_bytes();
                Payload::from_padded([SERVICE | direction | INIT | high, low, a, b, c, d, e, f], 8)
            }
            UpDownStep::Upload { last } => {
                Payload::from_padded([SERVICE | mode(last) | high, low, 0, 0, 0, 0, 0, 0], 2)
            }
            UpDownStep::Download { last, data: [a, b, c, d, e, f] } => {
                Payload::from_padded([SERVICE | DOWNLOAD | mode(last) | high, low, a, b, c, d, e, f], 8)
            }
        };
        Frame::of(FrameKind::Job(slave), payload)
    }

    /// Decodes the data field of an up-/download job.
    ///
    /// # Errors
    /// [`CodecError::OtherService`] for a parameter job, [`CodecError::ReservedMode`], [`CodecError::Length`].
    pub const fn decode(payload: &Payload) -> Result<Self, CodecError> {
        let [control, low, a, b, c, d, e, f] = payload.padded();
        if payload.is_empty() {
            return Err(CodecError::length("up-/download job", payload, "2 or 8"));
        }
        if control & SERVICE == 0 {
            return Err(CodecError::OtherService { found: "parameter", expected: "up-/download" });
        }
        let direction = if control & DOWNLOAD != 0 { Direction::Download } else { Direction::Upload };
        let last = control & MODE == LAST;
        let step = match (control & MODE, direction, payload.len()) {
            (0, ..) => return Err(CodecError::ReservedMode),
            (INIT, _, 8) => {
                let address = u32::from_le_bytes([a, b, c, d]);
                UpDownStep::Init { direction, address, sub_slave: u16::from_le_bytes([e, f]) }
            }
            (BODY | LAST, Direction::Upload, 2) => UpDownStep::Upload { last },
            (BODY | LAST, Direction::Download, 8) => UpDownStep::Download { last, data: [a, b, c, d, e, f] },
            (INIT, ..) => return Err(CodecError::length("up-/download init job", payload, "8")),
            (_, Direction::Upload, _) => return Err(CodecError::length("upload job", payload, "2")),
            (_, Direction::Download, _) => return Err(CodecError::length("download job", payload, "8")),
        };
        Ok(UpDownJob { offset: u16::from_le_bytes([low, control & 0x0F]), step })
    }
}

const fn mode(last: bool) -> u8 {
    if last { LAST } else { BODY }
}

/// Result in a slave's answer to an up-/download job.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum UpDownResult {
    /// Init or download block accepted.
    Done,
    /// Upload: six bytes. Bytes after the end of the transfer's length have no meaning.
    Data([u8; BLOCK]),
    /// The slave has refused the job with this error number, see [`updown_error`].
    Error(u16),
    /// The slave is not ready; the master repeats the job.
    Busy,
}

/// A slave's answer to an up-/download job, created by [`UpDownJob::answer`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct UpDownResponse {
    offset: u16,
    result: UpDownResult,
}

impl UpDownResponse {
    /// Returns the offset of the block, 0 to 4095. In the answer to the init job of an upload it is the
    /// length that the slave has set, or 0. With error 16#0100 it is the offset that the slave expects.
    #[inline]
    pub const fn offset(&self) -> u16 {
        self.offset
    }

    /// Returns the result: done, data, error or BUSY.
    #[inline]
    pub const fn result(&self) -> UpDownResult {
        self.result
    }

    /// Returns the frame of slave `slave` (0 to 127, on a bus 0 to 31). A BUSY answer has two bytes, because
    /// the manual describes only status and offset for it.
    pub const fn frame(&self, slave: u8) -> Frame {
        let [low, high] = self.offset.to_le_bytes();
        let status = SERVICE | high;
        let payload = match self.result {
            UpDownResult::Done => Payload::from_padded([status, low, 0, 0, 0, 0, 0, 0], 2),
            UpDownResult::Busy => Payload::from_padded([BUSY | status, low, 0, 0, 0, 0, 0, 0], 2),
            UpDownResult::Data([a, b, c, d, e, f]) => {
                Payload::from_padded([status, low, a, b, c, d, e, f], 8)
            }
            UpDownResult::Error(number) => {
                let [a, b] = number.to_le_bytes();
                Payload::from_padded([ERR | status, low, a, b, 0, 0, 0, 0], 4)
            }
        };
        Frame::of(FrameKind::Response(slave), payload)
    }

    /// Decodes the data field of an answer to `job`.
    ///
    /// Returns the errors of [`UpDownResponse::decode_alone`]. Also returns [`CodecError::Mismatch`] if data
    /// are missing or were not requested, and [`CodecError::OtherOffset`] if the answer acknowledges another
    /// block (the master's error 16#0001). The offset of an error answer is not compared, because it may be
    /// the offset that the slave expects.
    pub fn decode(job: &UpDownJob, payload: &Payload) -> Result<Self, CodecError> {
        let response = Self::decode_alone(payload)?;
        let wants_data = matches!(job.step, UpDownStep::Upload { .. });
        match response.result {
            UpDownResult::Error(_) => return Ok(response),
            UpDownResult::Data(_) if !wants_data => {
                return Err(CodecError::Mismatch { answer: "data", job: "an init or download job" });
            }
            UpDownResult::Done if wants_data => {
                return Err(CodecError::Mismatch { answer: "no data", job: "an upload job" });
            }
            _ => {}
        }
        let init = matches!(job.step, UpDownStep::Init { .. });
        if !init && response.offset != job.offset {
            return Err(CodecError::OtherOffset { asked: job.offset, found: response.offset });
        }
        Ok(response)
    }

    /// Decodes the data field of an answer without the job, as a trace requires.
    ///
    /// If BUSY is set, any length from 2 bytes on is accepted and ERR is ignored.
    ///
    /// # Errors
    /// [`CodecError::OtherService`] for an answer to a parameter job, [`CodecError::Length`].
    pub const fn decode_alone(payload: &Payload) -> Result<Self, CodecError> {
        let [status, low, a, b, c, d, e, f] = payload.padded();
        if payload.is_empty() {
            return Err(CodecError::length("up-/download answer", payload, "2, 4 or 8"));
        }
        if status & SERVICE == 0 {
            return Err(CodecError::OtherService { found: "parameter", expected: "up-/download" });
        }
        let result = match (status & BUSY != 0, status & ERR != 0, payload.len()) {
            (true, _, 2..=8) => UpDownResult::Busy,
            (false, true, 4) => UpDownResult::Error(u16::from_le_bytes([a, b])),
            (false, false, 2) => UpDownResult::Done,
            (false, false, 8) => UpDownResult::Data([a, b, c, d, e, f]),
            (true, ..) => return Err(CodecError::length("BUSY answer", payload, "2")),
            (false, true, _) => {
                return Err(CodecError::length("up-/download error answer", payload, "4"));
            }
            (false, false, _) => {
                return Err(CodecError::length("up-/download answer", payload, "2 or 8"));
            }
        };
        Ok(UpDownResponse { offset: u16::from_le_bytes([low, status & 0x0F]), result })
    }
}

#[cfg(test)]
#[path = "updown_tests.rs"]
mod tests;
