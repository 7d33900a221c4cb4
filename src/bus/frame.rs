//! A CAN data frame with 11-bit identifier and 0 to 8 data bytes.

use embedded_can::{Id, StandardId};

/// A data frame on the simulated bus. Remote frames do not occur in CANsync.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Frame {
    id: u16,
    len: u8,
    data: [u8; 8],
}

impl Frame {
    /// A frame with identifier `id` (0..=0x7FF) and `data` (0..=8 bytes); `None` outside these ranges.
    pub fn new(id: u16, data: &[u8]) -> Option<Self> {
        if id > 0x7FF || data.len() > 8 {
            return None;
        }
        let mut bytes = [0; 8];
        bytes[..data.len()].copy_from_slice(data);
        Some(Frame { id, len: data.len() as u8, data: bytes })
    }

    /// The 11-bit identifier.
    #[inline]
    pub fn id(&self) -> u16 {
        self.id
    }

    /// The data bytes, as many as the frame carries.
    #[inline]
    pub fn data(&self) -> &[u8] {
        &self.data[..usize::from(self.len)]
    }

    /// All eight bytes of the data field; bytes behind the length are 0.
    #[inline]
    pub fn padded(&self) -> [u8; 8] {
        self.data
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
        // The constructor admits 11-bit identifiers only.
        Id::Standard(StandardId::new(self.id).unwrap_or(StandardId::MAX))
    }

    fn dlc(&self) -> usize {
        usize::from(self.len)
    }

    fn data(&self) -> &[u8] {
        Frame::data(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
    }
}
