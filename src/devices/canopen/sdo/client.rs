//! SDO client: reads or writes one entry of a server, expedited or in segments.

use super::{Abort, Data, EXPEDITED, EntryAddress, SIZED, TOGGLE, first};
use serde::{Deserialize, Serialize};

/// Result of an answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Step {
    /// The transfer continues: this frame is to be sent.
    Send(Data),
    /// The transfer is complete. After a read, the field contains the data; after a write, it is empty.
    Done(Vec<u8>),
    /// The server has aborted the transfer, with this code.
    Aborted(u32),
    /// The answer is wrong and the transfer has ended. The frame, an abort, must be sent to the server.
    Failed(Abort, Data),
    /// The answer belongs to another transfer.
    Ignored,
}

/// Phase of a transfer.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum ClientPhase {
    /// The client waits for the first answer to a read.
    Read,
    /// Segments of a read.
    ReadSegments { data: Vec<u8>, announced: Option<usize> },
    /// The client waits for the answer to a write with all of its data.
    Write,
    /// Segments of a write. `rest` contains the bytes that follow the present segment.
    WriteSegments { rest: Vec<u8>, is_first: bool },
}

/// Client side of a transfer.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Client {
    /// Index and sub-index of the entry.
    at: EntryAddress,
    /// Maximum number of bytes that can be read.
    most: usize,
    /// Toggle bit of the next segment.
    toggle: bool,
    transfer: ClientPhase,
}

impl Client {
    /// Starts to read an entry of at most `most` bytes: returns the transfer and its first frame.
    #[must_use]
    pub(crate) fn read(at: EntryAddress, most: usize) -> (Self, Data) {
        (Client { at, most, toggle: false, transfer: ClientPhase::Read }, first(0x40, at, [0; 4]))
    }

    /// Starts to write an entry: returns the transfer and its first frame.
    #[must_use]
    pub(crate) fn write(at: EntryAddress, data: &[u8]) -> (Self, Data) {
        let of = |transfer| Client { at, most: 0, toggle: false, transfer };
        let mut four = [0; 4];
        if let (1..=4, Some(place)) = (data.len(), four.get_mut(..data.len())) {
            place.copy_from_slice(data);
            let unused = (4 - data.len()) as u8;
            return (of(ClientPhase::Write), first(0x20 | unused << 2 | EXPEDITED | SIZED, at, four));
        }
        let length = (data.len() as u32).to_le_bytes();
        let transfer = ClientPhase::WriteSegments { rest: data.to_vec(), is_first: true };
        (of(transfer), first(0x20 | SIZED, at, length))
    }

    /// Returns the frame to send if the server does not answer.
    #[must_use]
    pub(crate) fn give_up(&self) -> Data {
        self.abort(Abort::TimeOut)
    }

    fn abort(&self, abort: Abort) -> Data {
        first(0x80, self.at, abort.code().to_le_bytes())
    }

    /// Handles an answer of the server.
    pub(crate) fn answered(&mut self, answer: Data) -> Step {
        let [command, low, high, sub, rest @ ..] = answer;
        let is_of_this = EntryAddress { index: u16::from_le_bytes([low, high]), sub } == self.at;
        let step = match (command >> 5, &mut self.transfer) {
            (4, _) => return Step::Aborted(u32::from_le_bytes(rest)),
            (2, ClientPhase::Read)
            | (3, ClientPhase::Write | ClientPhase::WriteSegments { is_first: true, .. })
                if !is_of_this =>
            {
                return Step::Ignored;
            }
            (2, ClientPhase::Read) => self.begin(command, rest),
            (0, ClientPhase::ReadSegments { .. }) => self.segment(answer),
            (3, ClientPhase::Write) => Ok(Step::Done(Vec::new())),
            (3, ClientPhase::WriteSegments { is_first, .. }) if *is_first => {
                *is_first = false;
                Ok(self.next_segment())
            }
            (1, ClientPhase::WriteSegments { is_first: false, .. }) => self.segment_taken(command),
            _ => Err(Abort::Command),
        };
        step.unwrap_or_else(|abort| Step::Failed(abort, self.abort(abort)))
    }

    /// Handles the first answer to a read: the data, or their length.
    fn begin(&mut self, command: u8, data: [u8; 4]) -> Result<Step, Abort> {
        let is_sized = command & SIZED != 0;
        if command & EXPEDITED != 0 {
            let unused = if is_sized { usize::from(command >> 2 & 3) } else { 0 };
            let value = data[..data.len() - unused].to_vec();
            return if value.len() > self.most { Err(Abort::Memory) } else { Ok(Step::Done(value)) };
        }
        let announced = is_sized.then(|| u32::from_le_bytes(data) as usize);
        if announced.is_some_and(|bytes| bytes > self.most) {
            return Err(Abort::Memory);
        }
        self.transfer = ClientPhase::ReadSegments { data: Vec::new(), announced };
        Ok(Step::Send([0x60, 0, 0, 0, 0, 0, 0, 0]))
    }

    fn segment(&mut self, answer: Data) -> Result<Step, Abort> {
        let [command, segment @ ..] = answer;
        let ClientPhase::ReadSegments { data, announced } = &mut self.transfer else {
            return Err(Abort::Command);
        };
        if (command & TOGGLE != 0) != self.toggle {
            return Err(Abort::Toggle);
        }
        data.extend_from_slice(&segment[..segment.len() - usize::from(command >> 1 & 7)]);
        if data.len() > announced.unwrap_or(self.most) {
            return Err(Abort::TooLong);
        }
        if command & 1 != 0 {
            let is_short = announced.is_some_and(|announced| announced != data.len());
            return if is_short { Err(Abort::TooShort) } else { Ok(Step::Done(core::mem::take(data))) };
        }
        self.toggle = !self.toggle;
        Ok(Step::Send([0x60 | u8::from(self.toggle) << 4, 0, 0, 0, 0, 0, 0, 0]))
    }

    /// Returns the next segment of a write, with its toggle bit.
    fn next_segment(&mut self) -> Step {
        let ClientPhase::WriteSegments { rest, .. } = &mut self.transfer else { return Step::Ignored };
        let count = rest.len().min(7);
        let mut request = [0; 8];
        request[1..=count].copy_from_slice(&rest[..count]);
        rest.drain(..count);
        let is_last = u8::from(rest.is_empty());
        request[0] = u8::from(self.toggle) << 4 | ((7 - count) as u8) << 1 | is_last;
        Step::Send(request)
    }

    fn segment_taken(&mut self, command: u8) -> Result<Step, Abort> {
        if (command & TOGGLE != 0) != self.toggle {
            return Err(Abort::Toggle);
        }
        let ClientPhase::WriteSegments { rest, .. } = &self.transfer else { return Err(Abort::Command) };
        if rest.is_empty() {
            return Ok(Step::Done(Vec::new()));
        }
        self.toggle = !self.toggle;
        Ok(self.next_segment())
    }
}
