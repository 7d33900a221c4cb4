//! The data field of a CAN frame.

use serde::{Deserialize, Serialize};

/// 0 to 8 data bytes. Bytes after the length are always 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(from = "(u8, [u8; 8])", into = "(u8, [u8; 8])")]
pub struct Payload {
    len: u8,
    bytes: [u8; 8],
}

impl From<(u8, [u8; 8])> for Payload {
    fn from((len, bytes): (u8, [u8; 8])) -> Self {
        Payload::from_padded(bytes, len.into())
    }
}

impl From<Payload> for (u8, [u8; 8]) {
    fn from(payload: Payload) -> Self {
        (payload.len, payload.bytes)
    }
}

impl Payload {
    /// A payload without data bytes.
    pub const EMPTY: Payload = Payload { len: 0, bytes: [0; 8] };

    /// Creates a payload of these bytes; `None` if there are more than eight.
    #[inline]
    pub fn new(data: &[u8]) -> Option<Self> {
        let mut bytes = [0; 8];
        bytes.get_mut(..data.len())?.copy_from_slice(data);
        Some(Payload { len: data.len() as u8, bytes })
    }

    /// Creates a payload of the first `len` of `bytes` (at most 8).
    #[inline]
    pub const fn from_padded(bytes: [u8; 8], len: usize) -> Self {
        let len = if len > 8 { 8 } else { len };
        // The bytes after the length must be 0, because equality and hash use all eight bytes.
        let keep = if len == 0 { 0 } else { u64::MAX >> (64 - 8 * len) };
        Payload { len: len as u8, bytes: (u64::from_le_bytes(bytes) & keep).to_le_bytes() }
    }

    /// Creates a payload of the first `count` words (at most 4), low byte first.
    #[inline]
    pub const fn from_words(words: [u16; 4], count: usize) -> Self {
        let [a, b, c, d] = words;
        let bits = (a as u64) | (b as u64) << 16 | (c as u64) << 32 | (d as u64) << 48;
        Self::from_padded(bits.to_le_bytes(), 2 * if count > 4 { 4 } else { count })
    }

    /// Returns the number of data bytes, 0 to 8.
    #[inline]
    pub const fn len(&self) -> usize {
        self.len as usize
    }

    /// True if there is no data byte.
    #[inline]
    pub const fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Returns the data bytes.
    #[inline]
    pub fn data(&self) -> &[u8] {
        // The length never exceeds 8; `min` makes this visible to the compiler.
        &self.bytes[..self.len().min(8)]
    }

    /// Returns all eight bytes; the bytes after the length are 0.
    #[inline]
    pub const fn padded(&self) -> [u8; 8] {
        self.bytes
    }

    /// Word `index`, if both its bytes are in the frame: data byte 2 x `index`, and the next data byte as the high
    /// byte.
    #[inline]
    pub const fn word(&self, index: usize) -> Option<u16> {
        if index < self.len() / 2 {
            Some((u64::from_le_bytes(self.bytes) >> (16 * index)) as u16)
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refuses_nine_bytes() {
        assert_eq!(Payload::new(&[0; 9]), None);
        assert_eq!(Payload::new(&[]), Some(Payload::EMPTY));
    }

    #[test]
    fn bytes_after_the_length_are_cleared() {
        for len in 0..=8 {
            let payload = Payload::from_padded([0xAA; 8], len);
            assert_eq!(Some(payload), Payload::new(&[0xAA; 8][..len]));
            assert_eq!(payload.padded().iter().filter(|b| **b == 0xAA).count(), len);
        }
        assert_eq!(Payload::from_padded([1; 8], 9).len(), 8);
    }

    #[test]
    fn words_lie_low_byte_first() {
        let payload = Payload::from_words([0x3344, 0x1122, 0x5566, 0x7788], 3);
        assert_eq!(payload.data(), [0x44, 0x33, 0x22, 0x11, 0x66, 0x55]);
        assert_eq!(
            [0, 1, 2, 3, 4].map(|i| payload.word(i)),
            [Some(0x3344), Some(0x1122), Some(0x5566), None, None]
        );
        assert_eq!(Payload::from_words([1; 4], 5).len(), 8);
    }

    #[test]
    fn half_a_word_is_no_word() {
        let payload = Payload::new(&[1, 2, 3]).unwrap();
        assert_eq!((payload.word(0), payload.word(1)), (Some(0x0201), None));
    }
}
