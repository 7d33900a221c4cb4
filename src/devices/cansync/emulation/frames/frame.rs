//! A CAN data frame with an 11-bit identifier and 0 to 8 data bytes.

use super::ident::FrameKind;
use crate::can;
use crate::can::Payload;
use embedded_can::{Id, StandardId};
use serde::{Deserialize, Serialize};

/// A data frame on the simulated bus. CANsync has no remote frames and no 29-bit identifiers. So this type is
/// smaller than a [`can::Frame`], to which it can be converted. The size matters because journals contain
/// many frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Frame {
    id: u16,
    payload: Payload,
}

impl Frame {
    /// Creates a frame with identifier `id` (0..=0x7FF) and `data` (0..=8 bytes). `None` if one of them is
    /// out of range.
    pub fn new(id: u16, data: &[u8]) -> Option<Self> {
        if id > 0x7FF {
            return None;
        }
        Some(Frame { id, payload: Payload::new(data)? })
    }

    /// Returns a CANsync frame.
    #[inline]
    pub const fn of(kind: FrameKind, payload: Payload) -> Self {
        Frame { id: kind.id(), payload }
    }

    /// Returns the 11-bit identifier.
    #[inline]
    pub const fn id(&self) -> u16 {
        self.id
    }

    /// Returns the meaning of the identifier; `None` if it is not a CANsync identifier.
    #[inline]
    pub const fn kind(&self) -> Option<FrameKind> {
        FrameKind::from_id(self.id)
    }

    /// Returns the data field.
    #[inline]
    pub const fn payload(&self) -> &Payload {
        &self.payload
    }

    /// Returns the data bytes of the frame.
    #[inline]
    pub fn data(&self) -> &[u8] {
        self.payload.data()
    }

    /// Returns all eight bytes of the data field. Bytes after the length are 0.
    #[inline]
    pub const fn padded(&self) -> [u8; 8] {
        self.payload.padded()
    }
}

/// Length of the process data frames of a bus (decision D-10). Jobs and answers always have the required length.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
#[serde(expecting = "a length of frames, as a word")]
pub enum FrameLength {
    /// Eight data bytes; words that are not in use are 0.
    #[default]
    Fixed,
    /// The frame ends after the last word in use.
    Variable,
}

impl FrameLength {
    /// Returns the process data frame to send. `frame` must end with its last used word.
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
    use crate::devices::cansync::frames::Channel;

    #[test]
    fn only_standard_data_frames_are_accepted() {
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
    fn a_frame_converts_to_a_can_frame() {
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
