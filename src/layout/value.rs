//! Register values as text.

use super::RegType;
use thiserror::Error;

/// A text that is no value of a register.
#[derive(Debug, PartialEq, Eq, Error)]
pub enum ValueError {
    /// Not a number.
    #[error(
        "`{text}` is no number; write it decimal (67), hexadecimal (16#43 or 0x43) or binary (2#100_0011)"
    )]
    Notation {
        /// As given.
        text: String,
    },
    /// A number that the data type does not have.
    #[error("`{text}` is out of range, {} {ty} holds {least} to {most} (16#0 to 16#{mask:X})", article(*.ty))]
    Range {
        /// As given.
        text: String,
        /// The data type.
        ty: RegType,
        /// Its smallest number.
        least: i64,
        /// Its largest number.
        most: i64,
        /// Its largest bit pattern.
        mask: u32,
    },
}

/// Parses a value of a register of type `ty` into its bit pattern. Decimal numbers are numbers of the type,
/// negative ones for signed types; with a base in front they are bit patterns.
///
/// # Errors
/// [`ValueError`] with the notation or the range that would be right.
pub fn parse(text: &str, ty: RegType) -> Result<u32, ValueError> {
    let wrong = || ValueError::Notation { text: text.to_owned() };
    let (base, digits) = split_base(text.trim());
    let (negative, digits) = match digits.strip_prefix('-') {
        Some(digits) if base == 10 => (true, digits),
        _ => (false, digits),
    };
    let digits = without_separators(digits).ok_or_else(wrong)?;
    let [least, most] = limits(ty);
    let range = || ValueError::Range { text: text.to_owned(), ty, least, most, mask: ty.mask() };
    if digits.is_empty() || !digits.chars().all(|digit| digit.is_digit(base)) {
        return Err(wrong());
    }
    // All digits are valid, so all that can be wrong is the size.
    let size = i64::from_str_radix(&digits, base).map_err(|_| range())?;
    let number = if negative { -size } else { size };
    let allowed = if base == 10 { least..=most } else { 0..=i64::from(ty.mask()) };
    // The cast keeps the low bits of the two's complement, which is the bit pattern.
    if allowed.contains(&number) { Ok(number as u32 & ty.mask()) } else { Err(range()) }
}

fn split_base(text: &str) -> (u32, &str) {
    let bases = [("16#", 16), ("8#", 8), ("2#", 2), ("0x", 16), ("0X", 16), ("10#", 10)];
    let found = bases.iter().find_map(|(prefix, base)| Some((*base, text.strip_prefix(prefix)?)));
    found.unwrap_or((10, text))
}

/// IEC 61131-3 allows single underscores between digits.
fn without_separators(digits: &str) -> Option<String> {
    let misplaced = digits.starts_with('_') || digits.ends_with('_') || digits.contains("__");
    (!misplaced).then(|| digits.replace('_', ""))
}

fn limits(ty: RegType) -> [i64; 2] {
    let mask = i64::from(ty.mask());
    match ty {
        RegType::Sint | RegType::Int | RegType::Dint => [-(mask / 2) - 1, mask / 2],
        _ => [0, mask],
    }
}

fn article(ty: RegType) -> &'static str {
    if matches!(ty, RegType::Int | RegType::Usint | RegType::Uint | RegType::Udint) { "an" } else { "a" }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bases_and_separators() {
        for text in ["67", "16#43", "16#0043", "0x43", "0X43", "2#100_0011", "8#103", "10#67", " 67 "] {
            assert_eq!(parse(text, RegType::Word), Ok(0x43), "{text}");
        }
        assert_eq!(parse("16#1122_3344", RegType::Dint), Ok(0x1122_3344));
        assert_eq!(parse("16#dead_BEEF", RegType::Dword), Ok(0xDEAD_BEEF));
    }

    #[test]
    fn signed_types_take_negative_numbers_and_all_bit_patterns() {
        assert_eq!(parse("-1", RegType::Sint), Ok(0xFF));
        assert_eq!(parse("-32768", RegType::Int), Ok(0x8000));
        assert_eq!(parse("-2147483648", RegType::Dint), Ok(0x8000_0000));
        assert_eq!(parse("16#FFFFFFFF", RegType::Dint), Ok(0xFFFF_FFFF));
        assert!(parse("2147483648", RegType::Dint).is_err());
        assert!(parse("-129", RegType::Sint).is_err());
        assert!(parse("-1", RegType::Word).is_err());
    }

    #[test]
    fn what_does_not_fit_is_refused_with_the_range() {
        let message = |text, ty| parse(text, ty).unwrap_err().to_string();
        assert_eq!(
            message("256", RegType::Byte),
            "`256` is out of range, a BYTE holds 0 to 255 (16#0 to 16#FF)"
        );
        assert_eq!(
            message("40000", RegType::Int),
            "`40000` is out of range, an INT holds -32768 to 32767 (16#0 to 16#FFFF)"
        );
        assert!(message("16#10000", RegType::Word).contains("a WORD holds 0 to 65535"));
        assert!(message("99999999999999999999999", RegType::Dword).contains("out of range"));
    }

    #[test]
    fn what_is_no_number_is_refused_with_the_notation() {
        for text in ["", "16#", "0x", "abc", "4 3", "1.5", "16#G", "--1", "16#-1", "_1", "1_", "1__2", "+1"] {
            assert!(matches!(parse(text, RegType::Dint), Err(ValueError::Notation { .. })), "{text}");
        }
    }
}
