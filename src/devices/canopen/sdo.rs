//! Service data objects: a master reads and writes the object dictionary through them, expedited or in
//! segments. This module has a server and a client.

mod abort;
mod client;
#[cfg(test)]
mod tests;

pub(crate) use abort::Abort;
pub(crate) use client::{Client, Step};
use serde::{Deserialize, Serialize};

/// Data of an SDO frame.
pub(crate) type Data = [u8; 8];

/// Length of an entry's value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) enum Length {
    /// Exactly the given number of bytes.
    Exactly(usize),
    /// The entry has at most the given number of bytes.
    UpTo(usize),
}

/// Address of an entry: index and sub-index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct EntryAddress {
    /// Index of the object.
    pub index: u16,
    /// Sub-index of the entry.
    pub sub: u8,
}

/// The object dictionary that a server serves.
pub(crate) trait Dictionary {
    /// Returns the length of an entry's value, if it can be written.
    ///
    /// # Errors
    /// The entry does not exist or cannot be written.
    fn writable(&self, at: EntryAddress) -> Result<Length, Abort>;

    /// Returns the value of an entry.
    ///
    /// # Errors
    /// The entry does not exist or cannot be read.
    fn read(&self, at: EntryAddress) -> Result<Vec<u8>, Abort>;

    /// Writes a whole entry. The caller has checked the length.
    ///
    /// # Errors
    /// The entry does not accept the value.
    fn write(&mut self, at: EntryAddress, value: &[u8]) -> Result<(), Abort>;
}

/// A transfer in progress.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
enum ServerTransfer {
    #[default]
    None,
    /// `rest`: bytes still to be sent.
    Upload { at: EntryAddress, rest: Vec<u8>, toggle: bool },
    /// `data` are the bytes that the server has received so far.
    Download { at: EntryAddress, length: Length, announced: Option<usize>, data: Vec<u8>, toggle: bool },
}

/// A server, which serves one transfer at a time.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct Server {
    transfer: ServerTransfer,
}

const TOGGLE: u8 = 1 << 4;
/// Bits in the first byte of a transfer's first frame. `EXPEDITED`: the frame contains the data. `SIZED`: the
/// frame contains the number of bytes.
const EXPEDITED: u8 = 1 << 1;
const SIZED: u8 = 1;

impl Server {
    /// Drops a transfer in progress without an abort.
    pub(crate) fn reset(&mut self) {
        self.transfer = ServerTransfer::None;
    }

    /// Returns the answer to a request. Only an abort from the client has no answer.
    pub(crate) fn request(&mut self, request: Data, dictionary: &mut impl Dictionary) -> Option<Data> {
        let [command, low, high, sub, rest @ ..] = request;
        let at = EntryAddress { index: u16::from_le_bytes([low, high]), sub };
        let answer = match command >> 5 {
            0 => self.download_segment(request, dictionary),
            1 => self.download(command, at, rest, dictionary),
            2 => self.upload(at, dictionary),
            3 => self.upload_segment(command),
            4 => {
                self.reset();
                return None;
            }
            _ => Err((at, Abort::Command)),
        };
        Some(answer.unwrap_or_else(|(at, abort)| {
            self.reset();
            first(0x80, at, abort.code().to_le_bytes())
        }))
    }

    fn download(
        &mut self,
        command: u8,
        at: EntryAddress,
        data: [u8; 4],
        dictionary: &mut impl Dictionary,
    ) -> Result<Data, (EntryAddress, Abort)> {
        // A new transfer ends the transfer in progress.
        self.reset();
        let fail = |abort| (at, abort);
        let length = dictionary.writable(at).map_err(fail)?;
        let is_sized = command & SIZED != 0;
        if command & EXPEDITED != 0 {
            let unused = if is_sized { usize::from(command >> 2 & 3) } else { 0 };
            let bytes = match (is_sized, length) {
                // If the request contains no number of bytes, the data have the length of the entry.
                (false, Length::Exactly(bytes)) => bytes.min(data.len()),
                _ => data.len() - unused,
            };
            fits(length, bytes).map_err(fail)?;
            dictionary.write(at, &data[..bytes]).map_err(fail)?;
        } else {
            let announced = is_sized.then(|| u32::from_le_bytes(data) as usize);
            if let Some(bytes) = announced {
                fits(length, bytes).map_err(fail)?;
            }
            self.transfer =
                ServerTransfer::Download { at, length, announced, data: Vec::new(), toggle: false };
        }
        Ok(first(0x60, at, [0; 4]))
    }

    fn download_segment(
        &mut self,
        request: Data,
        dictionary: &mut impl Dictionary,
    ) -> Result<Data, (EntryAddress, Abort)> {
        let [command, segment @ ..] = request;
        let ServerTransfer::Download { at, length, announced, data, toggle } = &mut self.transfer else {
            return Err((EntryAddress { index: 0, sub: 0 }, Abort::Command));
        };
        let at = *at;
        let fail = |abort| (at, abort);
        if (command & TOGGLE != 0) != *toggle {
            return Err((at, Abort::Toggle));
        }
        let used = segment.len() - usize::from(command >> 1 & 7);
        data.extend_from_slice(&segment[..used]);
        let most = match *length {
            Length::Exactly(most) | Length::UpTo(most) => announced.unwrap_or(most),
        };
        if data.len() > most {
            return Err((at, Abort::TooLong));
        }
        *toggle = !*toggle;
        if command & 1 != 0 {
            if announced.is_some_and(|announced| announced != data.len()) {
                return Err((at, Abort::TooShort));
            }
            fits(*length, data.len()).map_err(fail)?;
            let data = core::mem::take(data);
            self.reset();
            dictionary.write(at, &data).map_err(fail)?;
        }
        Ok([0x20 | command & TOGGLE, 0, 0, 0, 0, 0, 0, 0])
    }

    fn upload(
        &mut self,
        at: EntryAddress,
        dictionary: &impl Dictionary,
    ) -> Result<Data, (EntryAddress, Abort)> {
        self.reset();
        let value = dictionary.read(at).map_err(|abort| (at, abort))?;
        let mut data = [0; 4];
        if let (1..=4, Some(place)) = (value.len(), data.get_mut(..value.len())) {
            place.copy_from_slice(&value);
            let unused = (4 - value.len()) as u8;
            return Ok(first(0x40 | unused << 2 | EXPEDITED | SIZED, at, data));
        }
        let length = u32::try_from(value.len()).map_err(|_| (at, Abort::Memory))?;
        self.transfer = ServerTransfer::Upload { at, rest: value, toggle: false };
        Ok(first(0x40 | SIZED, at, length.to_le_bytes()))
    }

    fn upload_segment(&mut self, command: u8) -> Result<Data, (EntryAddress, Abort)> {
        let ServerTransfer::Upload { at, rest, toggle } = &mut self.transfer else {
            return Err((EntryAddress { index: 0, sub: 0 }, Abort::Command));
        };
        if (command & TOGGLE != 0) != *toggle {
            return Err((*at, Abort::Toggle));
        }
        *toggle = !*toggle;
        let count = rest.len().min(7);
        let is_last = count == rest.len();
        let mut answer = [0; 8];
        answer[0] = command & TOGGLE | ((7 - count) as u8) << 1 | u8::from(is_last);
        answer[1..=count].copy_from_slice(&rest[..count]);
        rest.drain(..count);
        if is_last {
            self.reset();
        }
        Ok(answer)
    }
}

/// Returns a frame with the address of an entry.
fn first(command: u8, at: EntryAddress, data: [u8; 4]) -> Data {
    let [low, high] = at.index.to_le_bytes();
    let [a, b, c, d] = data;
    [command, low, high, at.sub, a, b, c, d]
}

fn fits(length: Length, bytes: usize) -> Result<(), Abort> {
    match length {
        Length::Exactly(right) | Length::UpTo(right) if bytes > right => Err(Abort::TooLong),
        Length::Exactly(right) if bytes < right => Err(Abort::TooShort),
        _ => Ok(()),
    }
}
