//! A CAN data frame with 11-bit identifier and 0 to 8 data bytes.

use super::ident::FrameKind;
use crate::can;
use crate::can::Payload;
use embedded_can::{Id, StandardId};
use serde::{Deserialize, Serialize};

/// A data frame on the simulated bus. Remote frames and identifiers of 29 bits do not occur in CANsync, so this is smaller
/// than a [`can::Frame`], which it can become: journals hold many.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Frame {
    id: u16,
    payload: Payload,
}

impl Frame {
    /// A frame with identifier `id` (0..=0x7FF) and `data` (0..=8 bytes); `None` outside these ranges.
    pub fn new(id: u16, data: &[u8]) -> Option<Self> {
        if id > 0x7FF {
            return None;
        }
        Some(Frame { id, payload: Payload::new(data)? })
    }

    /// A CANsync frame.
    #[inline]
    pub const fn of(kind: FrameKind, payload: Payload) -> Self {
        Frame { id: kind.id(), payload }
    }

    /// The 11-bit identifier.
    #[inline]
    pub const fn id(&self) -> u16 {
        self.id
    }

    /// What the identifier says; `None` if it is none of CANsync.
    #[inline]
    pub const fn kind(&self) -> Option<FrameKind> {
        FrameKind::from_id(self.id)
    }

    /// The data field.
    #[inline]
    pub const fn payload(&self) -> &Payload {
        &self.payload
    }

    /// The data bytes, as many as the frame carries.
    #[inline]
    pub fn data(&self) -> &[u8] {
        self.payload.data()
    }

    /// All eight bytes of the data field; bytes behind the length are 0.
    #[inline]
    pub const fn padded(&self) -> [u8; 8] {
        self.payload.padded()
    }
}

/// Length of the process data frames of a bus (decision D-10). Jobs and answers are as long as they need to be in
/// any case.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
#[serde(expecting = "a length of frames, as a word")]
pub enum FrameLength {
    /// Eight data bytes; words that are not in use are 0.
    #[default]
    Fixed,
    /// Up to the last word in use.
    Variable,
}

impl FrameLength {
    /// A process data frame as it goes out, made from one that ends with its last word in use.
    #[inline]
    pub const fn of(self, frame: Frame) -> Frame {
        match self {
            FrameLength::Fixed => Frame { id: frame.id, payload: Payload::from_padded(frame.padded(), 8) },
            FrameLength::Variable => frame,
        }
    }
}

impl From<Frame> for can::Frame {
    #[inline]
    fn from(frame: Frame) -> Self {
        can::Frame::standard(frame.id, frame.payload)
    }
}

impl embedded_can::Frame for Frame {
    fn new(id: impl Into<Id>, data: &[u8]) -> Option<Self> {
        match id.into() {
            Id::Standard(id) => Frame::new(id.as_raw(), data),
            Id::Extended(_) => None,
        }
    }

    fn new_remote(_id: impl Into<Id>, _dlc: usize) -> Option<Self> {
        None
    }

    fn is_extended(&self) -> bool {
        false
    }

    fn is_remote_frame(&self) -> bool {
        false
    }

    fn id(&self) -> Id {
        // The constructors admit 11-bit identifiers only.
        Id::Standard(StandardId::new(self.id).unwrap_or(StandardId::MAX))
    }

    fn dlc(&self) -> usize {
        self.payload.len()
    }

    fn data(&self) -> &[u8] {
        Frame::data(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::cansync::bus::Channel;

    #[test]
    fn refuses_what_is_no_standard_data_frame() {
        assert_eq!(Frame::new(0x800, &[]), None);
        assert_eq!(Frame::new(0x100, &[0; 9]), None);
        assert_eq!(<Frame as embedded_can::Frame>::new_remote(StandardId::ZERO, 0), None);
    }

    #[test]
    fn keeps_identifier_and_data() {
        let frame = Frame::new(0x585, &[1, 2, 3]).unwrap();
        assert_eq!((frame.id(), frame.data()), (0x585, &[1, 2, 3][..]));
        assert_eq!(frame.padded(), [1, 2, 3, 0, 0, 0, 0, 0]);
        assert_eq!(frame.kind(), Some(FrameKind::Response(5)));
    }

    #[test]
    fn it_is_a_can_frame() {
        let frame = Frame::new(0x585, &[1, 2, 3]).unwrap();
        let general = can::Frame::from(frame);
        assert_eq!(embedded_can::Frame::id(&general), embedded_can::Frame::id(&frame));
        assert_eq!((general.payload(), general.arbitration().is_remote()), (*frame.payload(), false));
    }

    #[test]
    fn a_kind_gives_its_identifier() {
        let frame = Frame::of(FrameKind::ActualValue(Channel::Two, 3), Payload::EMPTY);
        assert_eq!(frame.id(), 0x383);
    }
}
