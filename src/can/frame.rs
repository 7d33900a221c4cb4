//! Frames. A frame has data or requests data.

use super::{Arbitration, Payload};
use embedded_can::{ExtendedId, Id, StandardId};
use serde::{Deserialize, Serialize};

/// Marks beside an identifier, as in SocketCAN, for 29 bits and for a remote frame.
const EXTENDED: u32 = 1 << 31;
const REMOTE: u32 = 1 << 30;

/// A frame of the standard format (identifier of 11 bits) or the extended format (29 bits), with up to eight data
/// bytes. A remote frame has no data, but the number of requested bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Frame {
    arbitration: Arbitration,
    /// For a remote frame, the payload has the length of the requested data, and all bytes are 0.
    payload: Payload,
}

impl Frame {
    /// Returns a data frame.
    #[inline]
    pub fn new(id: impl Into<Id>, payload: Payload) -> Self {
        Frame { arbitration: Arbitration::new(id, false), payload }
    }

    /// Returns a data frame of the standard format. Only the lower 11 bits of `id` are used.
    #[inline]
    pub fn standard(id: u16, payload: Payload) -> Self {
        Frame::new(StandardId::new(id & 0x7FF).unwrap_or(StandardId::MAX), payload)
    }

    /// Returns a frame that requests `length` bytes of data (0..=8); `None` for more.
    #[inline]
    pub fn remote(id: impl Into<Id>, length: usize) -> Option<Self> {
        let payload = Payload::new([0; 8].get(..length)?)?;
        Some(Frame { arbitration: Arbitration::new(id, true), payload })
    }

    /// Identifier, format and kind.
    #[inline]
    pub const fn arbitration(&self) -> Arbitration {
        self.arbitration
    }

    /// Returns the length field, 0..=8: the number of bytes that the frame has or requests.
    #[inline]
    pub const fn length(&self) -> usize {
        self.payload.len()
    }

    /// Returns the frame as numbers: the identifier, the length and the data. The identifier has SocketCAN's marks for
    /// 29 bits (bit 31) and for a remote frame (bit 30). The first data byte is the lowest byte.
    #[must_use]
    pub fn numbers(&self) -> (u32, u8, u64) {
        let field = self.arbitration;
        let extended = if field.is_extended() { EXTENDED } else { 0 };
        let remote = if field.is_remote() { REMOTE } else { 0 };
        let data = u64::from_le_bytes(self.payload().padded());
        (field.number() | extended | remote, self.payload.len() as u8, data)
    }

    /// Converts the result of [`Frame::numbers`] back; `None` for a length above 8. Bits above the identifier and bytes
    /// after the length are ignored.
    #[must_use]
    pub fn of_numbers(id: u32, length: u8, data: u64) -> Option<Self> {
        let is_remote = id & REMOTE != 0;
        let id = if id & EXTENDED != 0 {
            Id::Extended(ExtendedId::new(id & ExtendedId::MAX.as_raw())?)
        } else {
            Id::Standard(StandardId::new(id as u16 & StandardId::MAX.as_raw())?)
        };
        if is_remote {
            return Frame::remote(id, length.into());
        }
        Some(Frame::new(id, Payload::new(data.to_le_bytes().get(..length.into())?)?))
    }

    /// Returns the data of the frame; empty for a remote frame.
    #[inline]
    pub const fn payload(&self) -> Payload {
        if self.arbitration.is_remote() { Payload::EMPTY } else { self.payload }
    }
}

impl embedded_can::Frame for Frame {
    fn new(id: impl Into<Id>, data: &[u8]) -> Option<Self> {
        Some(Frame::new(id, Payload::new(data)?))
    }

    fn new_remote(id: impl Into<Id>, dlc: usize) -> Option<Self> {
        Frame::remote(id, dlc)
    }

    fn is_extended(&self) -> bool {
        self.arbitration.is_extended()
    }

    fn is_remote_frame(&self) -> bool {
        self.arbitration.is_remote()
    }

    fn id(&self) -> Id {
        self.arbitration.id()
    }

    fn dlc(&self) -> usize {
        self.length()
    }

    fn data(&self) -> &[u8] {
        if self.arbitration.is_remote() { &[] } else { self.payload.data() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(crate::property_tests())]

        #[test]
        fn numbers_lead_back(frame in crate::can::reference::frame()) {
            let (id, length, data) = frame.numbers();
            prop_assert_eq!(Frame::of_numbers(id, length, data), Some(frame));
            prop_assert_eq!(Frame::of_numbers(id, 9, data), None);
        }
    }

    #[test]
    fn no_more_than_eight_bytes() {
        let id = StandardId::ZERO;
        assert!(<Frame as embedded_can::Frame>::new(id, &[0; 9]).is_none());
        assert_eq!((Frame::remote(id, 9), Frame::remote(id, usize::MAX)), (None, None));
    }

    #[test]
    fn a_remote_frame_has_a_length_and_no_data() {
        let frame = Frame::remote(ExtendedId::MAX, 5).unwrap();
        assert_eq!((frame.length(), frame.payload()), (5, Payload::EMPTY));
        assert!(embedded_can::Frame::data(&frame).is_empty());
        assert_ne!(frame, Frame::remote(ExtendedId::MAX, 4).unwrap());
    }

    #[test]
    fn frames_made_by_the_traits_of_embedded_can_are_read_by_them() {
        use embedded_can::Frame as Common;
        for id in [Id::Standard(StandardId::MAX), Id::Extended(ExtendedId::ZERO)] {
            let data = <Frame as Common>::new(id, &[1, 2, 3]).unwrap();
            assert_eq!((data.id(), data.dlc(), data.data()), (id, 3, &[1, 2, 3][..]));
            assert!(data.is_data_frame() && data.is_standard() == matches!(id, Id::Standard(_)));
            let remote = <Frame as Common>::new_remote(id, 3).unwrap();
            assert_eq!((remote.id(), remote.dlc(), remote.is_remote_frame()), (id, 3, true));
        }
    }

    #[test]
    fn a_standard_identifier_has_eleven_bits() {
        assert_eq!(Frame::standard(0xF923, Payload::EMPTY), Frame::standard(0x123, Payload::EMPTY));
    }
}
