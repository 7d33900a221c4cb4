//! Decoding of any frame without information from other frames, and the line of a frame in a trace.

use super::parameter::{self, VALUE_ELEMENT};
use super::updown;
use super::{
    Access, Action, ActionCommand, CodecError, Direction, ParameterJob, ParameterResponse, ParameterResult,
    UpDownJob, UpDownResponse, UpDownResult, UpDownStep,
};
use crate::can::Payload;
use crate::devices::cansync::frames::{Channel, Frame, FrameKind};
use crate::plural::plural;
use core::fmt;

/// A frame of CANsync. Its [`Display`](fmt::Display) is one line for a trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DecodedFrame {
    /// Reference values of the master.
    ReferenceValue {
        /// WRC1 or WRC2.
        channel: Channel,
        /// The slave that must answer with its actual values.
        asked: u8,
        /// Words of the frame. The configuration of the receiver defines their meaning.
        payload: Payload,
    },
    /// Actual values of a slave.
    ActualValue {
        /// RDC1 or RDC2.
        channel: Channel,
        /// Number of the slave that sent the frame.
        slave: u8,
        /// The words of the frame.
        payload: Payload,
    },
    /// An action command for one slave or for all slaves in a mask.
    Action(ActionCommand),
    /// A job that reads or writes a parameter of a slave.
    ParameterJob {
        /// Receiver of the job.
        slave: u8,
        /// The decoded parameter job.
        job: ParameterJob,
    },
    /// Answer to a parameter job.
    ParameterResponse {
        /// Sender of the answer.
        slave: u8,
        /// Answer to a parameter job. It is decoded without the job.
        response: ParameterResponse,
    },
    /// A job of an up- or download.
    UpDownJob {
        /// Receiver of the job.
        slave: u8,
        /// The decoded up-/download job.
        job: UpDownJob,
    },
    /// Answer to an up-/download job.
    UpDownResponse {
        /// Sender of the answer.
        slave: u8,
        /// Answer to an up-/download job. It is decoded without the job.
        response: UpDownResponse,
    },
}

/// Returns true for an up-/download frame. Bit 7 of the first data byte is 1 in up-/download and 0 in parameter frames.
#[inline]
pub const fn is_up_download(payload: &Payload) -> bool {
    payload.padded()[0] & 0x80 != 0
}

/// Decodes a frame.
///
/// # Errors
/// [`CodecError::ForeignIdentifier`], or the error in the data of a known frame.
pub const fn decode(frame: &Frame) -> Result<DecodedFrame, CodecError> {
    let Some(kind) = frame.kind() else {
        return Err(CodecError::ForeignIdentifier(frame.id()));
    };
    let payload = frame.payload();
    match kind {
        FrameKind::ReferenceValue(channel, asked) => {
            Ok(DecodedFrame::ReferenceValue { channel, asked, payload: *payload })
        }
        FrameKind::ActualValue(channel, slave) => {
            Ok(DecodedFrame::ActualValue { channel, slave, payload: *payload })
        }
        FrameKind::Action => match ActionCommand::decode(payload) {
            Ok(command) => Ok(DecodedFrame::Action(command)),
            Err(error) => Err(error),
        },
        FrameKind::Job(slave) if is_up_download(payload) => match UpDownJob::decode(payload) {
            Ok(job) => Ok(DecodedFrame::UpDownJob { slave, job }),
            Err(error) => Err(error),
        },
        FrameKind::Job(slave) => match ParameterJob::decode(payload) {
            Ok(job) => Ok(DecodedFrame::ParameterJob { slave, job }),
            Err(error) => Err(error),
        },
        FrameKind::Response(slave) if is_up_download(payload) => {
            match UpDownResponse::decode_alone(payload) {
                Ok(response) => Ok(DecodedFrame::UpDownResponse { slave, response }),
                Err(error) => Err(error),
            }
        }
        FrameKind::Response(slave) => match ParameterResponse::decode_alone(payload) {
            Ok(response) => Ok(DecodedFrame::ParameterResponse { slave, response }),
            Err(error) => Err(error),
        },
    }
}

impl fmt::Display for DecodedFrame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            DecodedFrame::ReferenceValue { channel, asked, payload } => {
                write!(f, "WRC{} -> answer by slave {asked}: {}", channel.number(), Words(payload))
            }
            DecodedFrame::ActualValue { channel, slave, payload } => {
                write!(f, "RDC{} of slave {slave}: {}", channel.number(), Words(payload))
            }
            DecodedFrame::Action(command) => write!(f, "CC {command}"),
            DecodedFrame::ParameterJob { slave, job } => write!(f, "CC to slave {slave}: {job}"),
            DecodedFrame::ParameterResponse { slave, response } => {
                write!(f, "RC of slave {slave}: {response}")
            }
            DecodedFrame::UpDownJob { slave, job } => write!(f, "CC to slave {slave}: {job}"),
            DecodedFrame::UpDownResponse { slave, response } => write!(f, "RC of slave {slave}: {response}"),
        }
    }
}

/// Formats the words of process data, for example `3344 1122`. If the data end with a single byte, the byte
/// is printed alone.
struct Words<'a>(&'a Payload);

impl fmt::Display for Words<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() {
            return f.write_str("no data");
        }
        for (index, pair) in self.0.data().chunks(2).enumerate() {
            if index > 0 {
                f.write_str(" ")?;
            }
            for byte in pair.iter().rev() {
                write!(f, "{byte:02X}")?;
            }
        }
        Ok(())
    }
}

/// Formats bytes in their order on the bus.
struct Bytes([u8; updown::BLOCK]);

impl fmt::Display for Bytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, byte) in self.0.iter().enumerate() {
            let gap = if index > 0 { " " } else { "" };
            write!(f, "{gap}{byte:02X}")?;
        }
        Ok(())
    }
}

/// Appends the sub-slave address. Appends nothing if the address means the slave itself.
fn sub_slave(f: &mut fmt::Formatter<'_>, address: u16) -> fmt::Result {
    if address != 0 { write!(f, ", sub-slave 16#{address:04X}") } else { Ok(()) }
}

impl fmt::Display for ActionCommand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.slave_group {
            ActionCommand::ALL_SLAVES => f.write_str("to all slaves: ")?,
            0 => f.write_str("to no slave: ")?,
            _ => {
                f.write_str("to slave ")?;
                let mut gap = "";
                for slave in (0..32).filter(|slave| self.concerns(*slave)) {
                    write!(f, "{gap}{slave}")?;
                    gap = ", ";
                }
                f.write_str(": ")?;
            }
        }
        match self.action() {
            Action::ControlWord(word) => write!(f, "control word 16#{word:04X}"),
            Action::SyncMode(true) => f.write_str("SYNC mode on"),
            Action::SyncMode(false) => f.write_str("SYNC mode off"),
            Action::Other => {
                let ActionCommand { command, data_byte, data_word, .. } = self;
                write!(f, "command 16#{command:02X}, DB 16#{data_byte:02X}, DW 16#{data_word:04X}")
            }
        }
    }
}

impl fmt::Display for ParameterJob {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let number = self.number();
        match self.access() {
            Access::Read => write!(f, "read parameter {number}")?,
            Access::WriteWord(value) => write!(f, "write parameter {number} := 16#{value:04X}")?,
            Access::WriteDoubleword(value) => write!(f, "write parameter {number} := 16#{value:08X}")?,
        }
        if self.element() != VALUE_ELEMENT {
            write!(f, ", element {}", self.element())?;
        }
        sub_slave(f, self.sub_slave())
    }
}

impl fmt::Display for ParameterResponse {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "parameter {}", self.number())?;
        match self.result() {
            ParameterResult::Word(value) => write!(f, " = 16#{value:04X}")?,
            ParameterResult::Doubleword(value) => write!(f, " = 16#{value:08X}")?,
            ParameterResult::Done => f.write_str(" written")?,
            ParameterResult::Error(number) => {
                write!(f, ": error 16#{number:04X} ({})", parameter::error_text(number))?;
            }
            ParameterResult::Busy => f.write_str(": BUSY")?,
        }
        sub_slave(f, self.sub_slave())
    }
}

impl fmt::Display for UpDownJob {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_cancel() {
            return f.write_str("cancel up-/download");
        }
        let direction = match self.direction() {
            Direction::Upload => "upload",
            Direction::Download => "download",
        };
        let offset = self.offset();
        match self.step() {
            UpDownStep::Init { address, sub_slave: sub, .. } => {
                write!(f, "{direction} of {} from 16#{address:08X} begins", plural(offset, "byte"))?;
                sub_slave(f, sub)
            }
            UpDownStep::Upload { last } => write!(f, "{direction}, {}block {offset}", last_text(last)),
            UpDownStep::Download { last, data } => {
                write!(f, "{direction}, {}block {offset}: {}", last_text(last), Bytes(data))
            }
        }
    }
}

const fn last_text(last: bool) -> &'static str {
    if last { "last " } else { "" }
}

impl fmt::Display for UpDownResponse {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "up-/download, block {}: ", self.offset())?;
        match self.result() {
            UpDownResult::Done => f.write_str("done"),
            UpDownResult::Data(data) => write!(f, "{}", Bytes(data)),
            UpDownResult::Error(number) => {
                write!(f, "error 16#{number:04X} ({})", updown::error_text(number))
            }
            UpDownResult::Busy => f.write_str("BUSY"),
        }
    }
}

#[cfg(test)]
#[path = "decoded_tests.rs"]
mod tests;
