//! The display: five digits of 7 segments, three letters of 14 segments, decimal points, eight fixed texts
//! (p. 12, 100-105).

use serde::{Deserialize, Serialize};

/// Number of digits and letters together.
pub(crate) const PLACES: usize = 8;
/// Number of digits, which come first.
pub(crate) const DIGITS: usize = 5;
/// Number of letters on the display, after the digits.
pub(crate) const LETTERS: usize = PLACES - DIGITS;
/// Character for a lit digit that shows no readable character, and for any lit letter (D-473).
const UNREADABLE: u8 = b'*';

/// Readable characters on 7 segments. From bit 0 on, the bits are e, f, d, g, a, unused, c, b (p. 101).
const READABLE: [(u8, u8); 25] = [
    (0b1101_0111, b'0'),
    (0b1100_0000, b'1'),
    (0b1001_1101, b'2'),
    (0b1101_1100, b'3'),
    (0b1100_1010, b'4'),
    (0b0101_1110, b'5'),
    (0b0101_1111, b'6'),
    (0b1101_0000, b'7'),
    (0b1101_1111, b'8'),
    (0b1101_1110, b'9'),
    (0b1101_1011, b'A'),
    (0b0100_1111, b'b'),
    (0b0001_0111, b'C'),
    (0b0000_1101, b'c'),
    (0b1100_1101, b'd'),
    (0b0001_1111, b'E'),
    (0b0001_1011, b'F'),
    (0b1100_1011, b'H'),
    (0b0100_1011, b'h'),
    (0b0000_0111, b'L'),
    (0b0100_1001, b'n'),
    (0b0100_1101, b'o'),
    (0b1001_1011, b'P'),
    (0b0000_1000, b'-'),
    (0b0000_0000, b' '),
];
/// Mask of the segments of a digit. Bit 5 is not used.
const SEGMENTS: u8 = !(1 << 5);

/// Content of the display.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Lcd {
    /// Characters in ASCII; 0 and blank are dark.
    pub text: [u8; PLACES],
    /// Segments of the digits, as in `LCD_SEGMENTS`.
    pub digits: [u8; DIGITS],
    /// Segments of the letters.
    pub letters: [u16; LETTERS],
    /// Digits and letters that blink: bit 0 is digit 1, bit 5 is letter 1.
    pub blink: u8,
    /// The fixed texts; from bit 0 on: CH1, CH2, CH3, CH4, RUN, PRG, TST, KEY.
    pub states: u8,
    /// Decimal points, digit 1 in bit 0.
    pub points: u8,
}

impl Lcd {
    /// Returns the content for `LCD_SEGMENTS` with CHANGE (p. 101).
    pub(crate) fn segments(digits: [u8; DIGITS], letters: [u16; LETTERS]) -> Self {
        let mut text = [b' '; PLACES];
        for (place, segments) in text.iter_mut().zip(digits) {
            let known = READABLE.iter().find(|(known, _)| *known == segments & SEGMENTS);
            *place = known.map_or(UNREADABLE, |(_, character)| *character);
        }
        for (place, segments) in text[DIGITS..].iter_mut().zip(letters) {
            *place = if segments == 0 { b' ' } else { UNREADABLE };
        }
        Lcd { text, digits, letters, ..Lcd::default() }
    }

    /// Returns the content for `LCD_TEXT` with CHANGE (p. 103): at most eight characters, filled up with blanks.
    pub(crate) fn text(characters: &[u8]) -> Self {
        let mut text = [b' '; PLACES];
        text.iter_mut().zip(characters).for_each(|(place, character)| *place = *character);
        Lcd { text, ..Lcd::default() }
    }

    /// Adds blinking, fixed texts and decimal points.
    pub(crate) fn with(self, blink: u8, states: u8, points: u8) -> Self {
        // Only digits can have points.
        Lcd { blink, states, points: points & ((1 << DIGITS) - 1), ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readable_segments_are_shown_as_characters() {
        // 1 consists of b and c, 8 of all segments, 7 of a, b and c. Bit 5 is not used.
        let lcd = Lcd::segments([0xC0, 0xDF, 0xD0 | 0x20, 0, 0x04], [0, 0x4000, 0]);
        assert_eq!(&lcd.text, b"187 * * ");
        assert_eq!((lcd.digits[2], lcd.letters[1]), (0xF0, 0x4000));
    }

    #[test]
    fn no_two_characters_look_alike() {
        for (index, (segments, _)) in READABLE.iter().enumerate() {
            assert!(READABLE[..index].iter().all(|(other, _)| other != segments), "{segments:08b}");
            assert_eq!(segments & SEGMENTS, *segments);
        }
    }

    #[test]
    fn a_text_has_eight_places_and_points_after_digits() {
        let lcd = Lcd::text(b"12345ABCDE").with(0x81, 0x10, 0xFF);
        assert_eq!((&lcd.text, lcd.points, lcd.blink, lcd.states), (b"12345ABC", 0x1F, 0x81, 0x10));
        assert_eq!(&Lcd::text(b"ON").text, b"ON      ");
    }
}
