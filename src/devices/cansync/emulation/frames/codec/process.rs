//! Process data: the four words of a reference or actual value frame and the registers that assign them.
//!
//! Manual 5.00005.03a p. 152-153 (master, reference values), p. 156-157 (master, actual values). The slave's
//! chapters from p. 176 on define the byte in the same way.

use crate::can::Payload;
use crate::devices::cansync::registers::values::{cfg_word, cfg_wrc_master};
use serde::{Deserialize, Serialize};

/// Lowest bit of the value number.
const NUMBER_AT: u32 = cfg_word::NUMBER.trailing_zeros();
// The bytes of `cfg_wrc_master` and `cfg_word` differ only in the length of the number.
const _: () = assert!(
    cfg_wrc_master::NUMBER.trailing_zeros() == NUMBER_AT
        && cfg_wrc_master::ASSIGNED == cfg_word::ASSIGNED
        && cfg_wrc_master::HIGH_WORD == cfg_word::HIGH_WORD
);

/// One configuration byte (`b_CFG_WRCx_WORDy`, `b_CFG_RDCx_WORDy`). It selects the value, and the half of the
/// value, that a word carries.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct WordConfig(pub u8);

impl WordConfig {
    /// Creates the byte for the low or high word of value `number` (0..=31; higher bits are dropped).
    #[inline]
    pub const fn new(number: u8, high_word: bool) -> Self {
        let half = if high_word { cfg_word::HIGH_WORD } else { 0 };
        WordConfig(cfg_word::ASSIGNED | half | number << NUMBER_AT & cfg_wrc_master::NUMBER)
    }

    /// Returns true if the word is in use: the byte is not 0. This is also true if bit 0 ("assigned") is
    /// clear, because the manual calls a word unused only if number, half and bit 0 are all 0.
    #[inline]
    pub const fn is_used(self) -> bool {
        self.0 != 0
    }

    /// Returns bit 0.
    #[inline]
    pub const fn is_assigned(self) -> bool {
        self.0 & cfg_word::ASSIGNED != 0
    }

    /// Returns bit 1: true if the word is the high word of the value, false for the low word.
    #[inline]
    pub const fn is_high_word(self) -> bool {
        self.0 & cfg_word::HIGH_WORD != 0
    }
}

/// The configuration bytes of words 0 to 3 of one frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct FrameConfig {
    words: [u8; 4],
    /// Mask of the value number.
    number: u8,
}

/// A process data frame built by [`FrameConfig::build`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Built {
    /// Data field of the frame, with its words.
    pub payload: Payload,
    /// Number of used words, 0 to 4. The time to build the frame depends on it (p. 153).
    pub used_words: u8,
}

impl FrameConfig {
    /// Creates the configuration of a master's reference value frame, with 5-bit value numbers (bits 2 to 6).
    #[inline]
    pub const fn master_reference(words: [u8; 4]) -> Self {
        FrameConfig { words, number: cfg_wrc_master::NUMBER }
    }

    /// Creates the configuration of any other frame (actual values at the master, all frames at the slave), with 4-bit
    /// value numbers (bits 2 to 5).
    #[inline]
    pub const fn new(words: [u8; 4]) -> Self {
        FrameConfig { words, number: cfg_word::NUMBER }
    }

    /// Returns true if no word is in use.
    #[inline]
    pub const fn is_unused(self) -> bool {
        u32::from_ne_bytes(self.words) == 0
    }

    /// Returns the number of used words, 0 to 4.
    #[inline]
    pub fn used_words(self) -> u8 {
        self.words.iter().map(|&byte| u8::from(WordConfig(byte).is_used())).sum()
    }

    /// Builds a frame; `values` returns the doubleword with the given number.
    ///
    /// The data field ends with the last used word. Unused words before it are 0. Without a used word the frame has no
    /// data. The bus may make the frame longer ([`FrameLength`](crate::devices::cansync::frames::FrameLength), decision
    /// D-10).
    #[inline]
    pub fn build(self, mut values: impl FnMut(u8) -> u32) -> Built {
        let (mut words, mut used_words, mut len) = ([0; 4], 0, 0);
        for (index, (word, byte)) in words.iter_mut().zip(self.words).enumerate() {
            let config = WordConfig(byte);
            if config.is_used() {
                let value = values((byte & self.number) >> NUMBER_AT);
                *word = (value >> (16 * u32::from(config.is_high_word()))) as u16;
                used_words += 1;
                len = index + 1;
            }
        }
        Built { payload: Payload::from_words(words, len), used_words }
    }

    /// Extracts the words of a received frame. For each used word that the frame carries completely, calls
    /// `sink` with value number, "high word" and word.
    #[inline]
    pub fn scatter(self, payload: &Payload, mut sink: impl FnMut(u8, bool, u16)) {
        for (index, byte) in self.words.into_iter().enumerate() {
            let config = WordConfig(byte);
            if let (true, Some(word)) = (config.is_used(), payload.word(index)) {
                sink((byte & self.number) >> NUMBER_AT, config.is_high_word(), word);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn scattered(config: FrameConfig, payload: &Payload) -> Vec<(u8, bool, u16)> {
        let mut out = Vec::new();
        config.scatter(payload, |number, high, word| out.push((number, high, word)));
        out
    }

    #[test]
    fn example_of_page_153() {
        // 16#0D: the low word of value 3.
        assert_eq!(WordConfig::new(3, false), WordConfig(0x0D));
        let config = FrameConfig::master_reference([0x0D, 0, 0, 0]);
        let built = config.build(|number| if number == 3 { 0x1122_3344 } else { 0 });
        assert_eq!((built.payload.data(), built.used_words), (&[0x44, 0x33][..], 1));
        assert_eq!(scattered(FrameConfig::new([0x0D, 0, 0, 0]), &built.payload), [(3, false, 0x3344)]);
    }

    #[test]
    fn example_of_pages_127_and_128() {
        // The configuration maps value 0 as a doubleword, then one word of value 2 and one word of value 3.
        let config = FrameConfig::master_reference([0x01, 0x03, 0x09, 0x0D]);
        let values = [0x1122_3344, 0, 0x5566, 0x7788];
        let built = config.build(|number| values[usize::from(number)]);
        assert_eq!(built.payload.data(), [0x44, 0x33, 0x22, 0x11, 0x66, 0x55, 0x88, 0x77]);
        assert_eq!(built.used_words, 4);
    }

    #[test]
    fn length_reaches_to_the_last_used_word() {
        for mask in 0..16u8 {
            let words = [0, 1, 2, 3].map(|i| if mask & (1 << i) != 0 { 0x05 } else { 0 });
            let built = FrameConfig::new(words).build(|_| 0xFFFF_FFFF);
            assert_eq!(u32::from(built.used_words), mask.count_ones());
            assert_eq!(built.used_words, FrameConfig::new(words).used_words());
            assert_eq!(built.payload.len(), 2 * (8 - mask.leading_zeros() as usize));
            for i in 0..4 {
                let expected = if mask & (1 << i) != 0 { 0xFFFF } else { 0 };
                assert_eq!(built.payload.word(i).unwrap_or(0), expected, "mask {mask:04b} word {i}");
            }
            assert_eq!(FrameConfig::new(words).is_unused(), mask == 0);
        }
    }

    #[test]
    fn every_byte_but_zero_uses_the_word() {
        let payload = Payload::from_words([0xABCD; 4], 4);
        for byte in 0..=u8::MAX {
            let got = scattered(FrameConfig::new([byte, 0, 0, 0]), &payload);
            let expected = if byte == 0 { vec![] } else { vec![(byte >> 2 & 0x0F, byte & 2 != 0, 0xABCD)] };
            assert_eq!(got, expected, "16#{byte:02X}");
            let mut asked = None;
            FrameConfig::master_reference([byte, 0, 0, 0]).build(|number| {
                asked = Some(number);
                0
            });
            assert_eq!(asked, (byte != 0).then_some(byte >> 2 & 0x1F), "16#{byte:02X}");
            assert_eq!(WordConfig(byte).is_assigned(), byte & 1 != 0);
        }
    }

    #[test]
    fn a_short_frame_delivers_only_its_complete_words() {
        let config = FrameConfig::new([0x01, 0x03, 0x05, 0x07]);
        for len in 0..=8 {
            let payload = Payload::from_padded([0x11; 8], len);
            assert_eq!(scattered(config, &payload).len(), len / 2, "{len} bytes");
        }
    }

    proptest! {
        #![proptest_config(crate::property_tests())]

        #[test]
        fn a_built_frame_returns_its_values(words: [u8; 4], values: [u32; 32]) {
            let config = FrameConfig::master_reference(words);
            let built = config.build(|number| values[usize::from(number)]);
            let got = scattered(config, &built.payload);
            prop_assert_eq!(got.len(), usize::from(built.used_words));
            for (number, high, word) in got {
                let value = values[usize::from(number)];
                prop_assert_eq!(word, (if high { value >> 16 } else { value & 0xFFFF }) as u16);
            }
        }
    }
}
