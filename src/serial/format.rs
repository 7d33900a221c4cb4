//! The settings of a serial line: baud rate, data bits, parity, stop bits, wires.

use super::TICKS_PER_SECOND;
use core::fmt;
use serde::{Deserialize, Serialize};

/// The permitted baud rates in bit/s. The manual gives only the highest one (5.00005.03a p. 10); decision D-855 adds the
/// others.
pub const BAUD_RATES: [u16; 8] = [300, 600, 1200, 2400, 4800, 9600, 19_200, 38_400];

/// Parity bit of a character.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[serde(expecting = "a parity: \"none\", \"odd\" or \"even\"")]
pub enum Parity {
    /// Characters have no parity bit.
    None,
    /// The number of ones, including the parity bit, is odd.
    Odd,
    /// The number of ones, including the parity bit, is even.
    #[default]
    Even,
}

impl Parity {
    /// All parities, in the order of their codes.
    pub const ALL: [Parity; 3] = [Parity::None, Parity::Odd, Parity::Even];

    /// Returns the name of the parity, as plant files have it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Parity::None => "none",
            Parity::Odd => "odd",
            Parity::Even => "even",
        }
    }
}

/// Number of wires of a line, without the ground wire.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Wires {
    /// One pair for both directions: only one participant may send at a time.
    Two,
    /// One pair for each direction.
    Four,
}

impl Wires {
    /// Returns the number of wires.
    #[must_use]
    pub const fn count(self) -> u8 {
        match self {
            Wires::Two => 2,
            Wires::Four => 4,
        }
    }

    /// Returns the variant with this number of wires.
    #[must_use]
    pub const fn of_count(count: u8) -> Option<Self> {
        match count {
            2 => Some(Wires::Two),
            4 => Some(Wires::Four),
            _ => None,
        }
    }
}

/// The format of characters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CharacterFormat {
    baud_rate: u16,
    data_bits: u8,
    parity: Parity,
    stop_bits: u8,
}

impl CharacterFormat {
    /// 9600 baud, 8 data bits, even parity, 1 stop bit: the format that 3964R and USS require, apart from the baud rate.
    pub const DEFAULT: Self =
        CharacterFormat { baud_rate: 9600, data_bits: 8, parity: Parity::Even, stop_bits: 1 };

    /// Returns the format with these settings: a baud rate of [`BAUD_RATES`], 7 or 8 data bits, 1 or 2 stop bits; `None`
    /// for other values.
    #[must_use]
    pub fn new(baud_rate: u32, data_bits: u8, parity: Parity, stop_bits: u8) -> Option<Self> {
        let baud_rate = BAUD_RATES.into_iter().find(|known| u32::from(*known) == baud_rate)?;
        let is_valid = matches!(data_bits, 7 | 8) && matches!(stop_bits, 1 | 2);
        is_valid.then_some(CharacterFormat { baud_rate, data_bits, parity, stop_bits })
    }

    /// Returns the baud rate in bit/s.
    #[must_use]
    pub const fn baud_rate(self) -> u16 {
        self.baud_rate
    }

    /// Returns the number of data bits: 7 or 8.
    #[must_use]
    pub const fn data_bits(self) -> u8 {
        self.data_bits
    }

    /// Returns the parity.
    #[must_use]
    pub const fn parity(self) -> Parity {
        self.parity
    }

    /// Returns the number of stop bits: 1 or 2.
    #[must_use]
    pub const fn stop_bits(self) -> u8 {
        self.stop_bits
    }

    /// Returns the number of bits of a character, with start bit, parity bit and stop bits: 9 to 12.
    #[must_use]
    pub const fn bits(self) -> u8 {
        let parity = if matches!(self.parity, Parity::None) { 0 } else { 1 };
        1 + self.data_bits + parity + self.stop_bits
    }

    /// Returns the duration of a character in ticks ([`TICKS_PER_SECOND`]).
    #[must_use]
    pub const fn ticks(self) -> u64 {
        self.bits() as u64 * (TICKS_PER_SECOND / self.baud_rate as u32) as u64
    }

    /// Returns the data bits of `octet` that a character has.
    #[must_use]
    pub const fn cut(self, octet: u8) -> u8 {
        if self.data_bits == 7 { octet & 0x7F } else { octet }
    }
}

/// `9600 baud, 8 data bits, parity even, 1 stop bit`
impl fmt::Display for CharacterFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let CharacterFormat { baud_rate, data_bits, parity, stop_bits } = *self;
        let s = if stop_bits == 1 { "" } else { "s" };
        write!(
            f,
            "{baud_rate} baud, {data_bits} data bits, parity {}, {stop_bits} stop bit{s}",
            parity.name()
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bit_of_each_baud_rate_is_a_whole_number_of_ticks() {
        for rate in BAUD_RATES {
            assert_eq!(TICKS_PER_SECOND % u32::from(rate), 0, "{rate}");
        }
    }

    #[test]
    fn characters_have_a_start_bit_and_the_chosen_bits() {
        let bits =
            |data, parity, stop| CharacterFormat::new(9600, data, parity, stop).map(CharacterFormat::bits);
        assert_eq!(bits(8, Parity::Even, 1), Some(11));
        assert_eq!(bits(8, Parity::None, 1), Some(10));
        assert_eq!(bits(7, Parity::Odd, 2), Some(11));
        assert_eq!((bits(9, Parity::None, 1), bits(8, Parity::None, 3)), (None, None));
        assert_eq!(CharacterFormat::new(9601, 8, Parity::None, 1), None);
        let format = CharacterFormat::new(9600, 8, Parity::Even, 1).unwrap();
        assert_eq!((format.ticks(), format.cut(0xFF)), (44, 0xFF));
        assert_eq!(format.to_string(), "9600 baud, 8 data bits, parity even, 1 stop bit");
        let format = CharacterFormat::new(38_400, 7, Parity::None, 2).unwrap();
        assert_eq!((format.ticks(), format.cut(0xFF)), (10, 0x7F));
        assert_eq!(format.to_string(), "38400 baud, 7 data bits, parity none, 2 stop bits");
    }
}
