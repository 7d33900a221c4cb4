//! The block that converts a number to a text (p. 104-105).

use super::memory;
use crate::plc::{Ram, function_block};

/// Characters of a STRING.
const LENGTH: usize = 80;

function_block! {
    /// Converts a variable to a text (p. 104-105, D-447).
    pub struct STR(ram: Ram) {
        in {
            /// Address of the variable.
            A: i32;
            /// Format: a text with one of %d %u %o %x %X %f %e %E %g %G %C. A 0 must follow the last
            /// character.
            F: [u8; 80] = [0; 80];
        }
        out {
            /// The text. A 0 follows its last character. The text is empty if `F` or `A` is wrong.
            STR: [u8; 80] = [0; 80];
        }
    }
}

impl STR {
    /// Runs one PLC cycle.
    pub fn call(&mut self, ram: &Ram) {
        let form = self.F.split(|byte| *byte == 0).next().unwrap_or_default();
        let variable = |bytes| memory::read(ram, u32::try_from(self.A).ok()?, bytes);
        let text = formatted(form, variable).unwrap_or_default();
        let text = text.into_iter().chain(core::iter::repeat(0));
        self.STR.iter_mut().take(LENGTH).zip(text).for_each(|(to, byte)| *to = byte);
    }
}

/// Returns the text of a variable. `variable` returns as many bytes of the variable as its argument requests.
fn formatted(form: &[u8], variable: impl Fn(u32) -> Option<Vec<u8>>) -> Option<Vec<u8>> {
    let Some(at) = form.iter().position(|byte| *byte == b'%') else { return Some(form.to_vec()) };
    let (before, rest) = form.split_at(at);
    let [_, kind, following @ ..] = rest else { return None };
    if following.contains(&b'%') {
        return None;
    }
    let word = || Some(u16::from_le_bytes(variable(2)?.try_into().ok()?));
    let real = || Some(f32::from_le_bytes(variable(4)?.try_into().ok()?));
    let value = match kind {
        b'd' => word()?.cast_signed().to_string(),
        b'u' => word()?.to_string(),
        b'o' => format!("{:o}", word()?),
        b'x' => format!("{:x}", word()?),
        b'X' => format!("{:X}", word()?),
        b'f' => format!("{:.4}", real()?),
        b'e' | b'E' => exponential(real()?, 3, char::from(*kind)),
        b'g' => general(real()?, 'e'),
        b'G' => general(real()?, 'E'),
        b'C' => return Some([before, &variable(1)?, following].concat()),
        _ => return None,
    };
    Some([before, value.as_bytes(), following].concat())
}

/// `[-]d.ddde[-]dd`.
fn exponential(value: f32, decimals: usize, letter: char) -> String {
    let text = format!("{value:.decimals$e}");
    let Some((digits, exponent)) = text.split_once('e') else { return text };
    let (sign, exponent) = exponent.strip_prefix('-').map_or(("", exponent), |exponent| ("-", exponent));
    format!("{digits}{letter}{sign}{exponent:0>2}")
}

/// Formats a number with six digits and without trailing zeros. A very small or large number gets an
/// exponent.
fn general(value: f32, letter: char) -> String {
    const DIGITS: i32 = 6;
    let text = exponential(value, 5, letter);
    let Some((digits, exponent)) = text.split_once(letter) else { return text };
    let exponent: i32 = exponent.parse().unwrap_or_default();
    if (-4..DIGITS).contains(&exponent) {
        let decimals = (DIGITS - 1 - exponent) as usize;
        return without_zeros(&format!("{value:.decimals$}")).to_owned();
    }
    text.replacen(digits, without_zeros(digits), 1)
}

fn without_zeros(digits: &str) -> &str {
    if digits.contains('.') { digits.trim_end_matches('0').trim_end_matches('.') } else { digits }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::cs0015::registers::{DEVICE, FUNCTION};
    use crate::memory::Segment;

    fn text(form: &str, variable: &[u8]) -> String {
        let variable = |bytes| variable.get(..bytes as usize).map(<[u8]>::to_vec);
        String::from_utf8(formatted(form.as_bytes(), variable).unwrap_or_default()).unwrap()
    }

    /// The table of p. 105.
    #[test]
    fn each_form_of_the_table_is_known() {
        for (form, value, expected) in [
            ("%d", 0xFFFE_u16, "-2"),
            ("%u", 0xFFFE, "65534"),
            ("%o", 8, "10"),
            ("%x", 0xBEEF, "beef"),
            ("n = %X!", 0xBEEF, "n = BEEF!"),
            ("%C", 0x41, "A"),
            ("none", 1, "none"),
            ("%", 1, ""),
            ("%s", 1, ""),
            ("%d%d", 1, ""),
        ] {
            assert_eq!(text(form, &value.to_le_bytes()), expected, "{form}");
        }
        for (form, value, expected) in [
            ("%f", -12.5_f32, "-12.5000"),
            ("%e", 1234.5, "1.234e03"),
            ("%E", -0.0125, "-1.250E-02"),
            ("%g", 1234.5, "1234.5"),
            ("%g", 0.0, "0"),
            ("%g", 1e-5, "1e-05"),
            ("%G", 2.5e10, "2.5E10"),
            ("%g", 1e6, "1e06"),
            ("%f", f32::INFINITY, "inf"),
            ("%g", f32::NAN, "NaN"),
        ] {
            assert_eq!(text(form, &value.to_le_bytes()), expected, "{form} {value}");
        }
        assert_eq!(text("%f", &[0, 0]), "", "a REAL has four bytes");
    }

    #[test]
    fn the_variable_is_read_from_the_image() {
        let ram = Ram::of(&Segment::of(&DEVICE)).unwrap();
        ram.segment().store(FUNCTION, crate::layout::Width::Word, 0x1234).unwrap();
        let mut block = STR { A: FUNCTION as i32, ..Default::default() };
        block.F[..2].copy_from_slice(b"%x");
        block.call(&ram);
        assert_eq!(block.STR[..5], *b"1234\0");
        block.A = 0;
        block.call(&ram);
        assert_eq!(block.STR, [0; LENGTH]);
        block.F = [b'x'; LENGTH];
        block.call(&ram);
        assert_eq!(block.STR, [b'x'; LENGTH]);
    }
}
