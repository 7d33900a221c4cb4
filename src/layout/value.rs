//! Register values as text.

use super::nearest::nearest;
use super::{Meaning, RegType, decode};
use thiserror::Error;

/// A text that is not a value of the register.
#[derive(Debug, PartialEq, Eq, Error)]
pub enum ValueError {
    /// The text is not a number.
    #[error(
        "`{text}` is no number; write it decimal (67), hexadecimal (16#43 or 0x43) or binary (2#100_0011)"
    )]
    Notation {
        /// Text that should be a number.
        text: String,
    },
    /// The text is not a value of a single bit.
    #[error("`{text}` is no value of a single bit; write 0 or 1, or FALSE or TRUE")]
    Bit {
        /// Text that should be 0 or 1.
        text: String,
    },
    /// The text is neither a number nor the name of a value of the register.
    #[error("`{text}` is no number and no value of this register; its values are {known}{hint}")]
    Unknown {
        /// Text that should be a number or the name of a value.
        text: String,
        /// The names of the register's values.
        known: String,
        /// The value that may be meant.
        hint: String,
    },
    /// The text is the name of several values of the register.
    #[error("`{text}` is more than one value of this register: {values}; write the number")]
    Ambiguous {
        /// Text that matches several values of the register.
        text: String,
        /// Numbers of the values that match the text.
        values: String,
    },
    /// The number is outside the range of the data type.
    #[error("`{text}` is out of range, {} {ty} holds {least} to {most} (16#0 to 16#{mask:X})", article(.ty.name()))]
    Range {
        /// Number outside the range of the data type, as the user wrote it.
        text: String,
        /// Data type of the register.
        ty: RegType,
        /// Smallest number that the data type can hold.
        least: i64,
        /// Largest number that the data type can hold.
        most: i64,
        /// Largest bit pattern of the data type, as an unsigned number.
        mask: u32,
    },
}

/// Parses a value of a register of type `ty`, and returns its bit pattern. A decimal number is a number of the type,
/// and can be negative for signed types. A number with a base is a bit pattern.
///
/// # Errors
/// [`ValueError`], which gives a correct notation or the range.
pub(crate) fn parse(text: &str, ty: RegType) -> Result<u32, ValueError> {
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
    // The digits were checked before, so the conversion fails only if the number is too large.
    let size = i64::from_str_radix(&digits, base).map_err(|_| range())?;
    let number = if negative { -size } else { size };
    let allowed = if base == 10 { least..=most } else { 0..=i64::from(ty.mask()) };
    // The cast keeps the low bits of the two's complement, which is the bit pattern.
    if allowed.contains(&number) { Ok(number as u32 & ty.mask()) } else { Err(range()) }
}

/// Parses a value of a single bit: 0 or 1 in any notation of a number, FALSE or TRUE in any case.
///
/// # Errors
/// [`ValueError::Bit`].
pub(crate) fn parse_bit(text: &str) -> Result<u32, ValueError> {
    let word = text.trim();
    let truth = [("false", 0), ("true", 1)].into_iter().find(|(name, _)| word.eq_ignore_ascii_case(name));
    let number = || parse(word, RegType::Byte).ok().filter(|value| *value <= 1);
    truth.map(|(_, value)| value).or_else(number).ok_or_else(|| ValueError::Bit { text: text.to_owned() })
}

/// Returns the value with the name `text` in a register with this meaning. `text` can be the whole meaning as
/// `commram peek` prints it, the value's name in the layout (`restart`, `START_SYNCHRONOUS`), its text ("start
/// synchronous operation"), or the name of a single bit (`enable`), for the value with only this bit set. Case is
/// ignored, and blanks, `-` and `_` are equal.
///
/// # Errors
/// `otherwise` if the register has no names or `text` was meant as a number, [`ValueError::Unknown`] if the register
/// has other names, [`ValueError::Ambiguous`] if several values match.
pub(crate) fn named(
    text: &str,
    meaning: Option<&'static Meaning>,
    otherwise: ValueError,
) -> Result<u32, ValueError> {
    let names = meaning.map(names).unwrap_or_default();
    let is_word = text.trim().starts_with(|letter: char| letter.is_ascii_alphabetic());
    if !matches!(otherwise, ValueError::Notation { .. }) {
        return Err(otherwise);
    }
    if let Some(value) = meaning.and_then(|meaning| decode::value_of(meaning, text)) {
        return Ok(value);
    }
    if names.is_empty() || !is_word {
        return Err(otherwise);
    }
    let wanted = folded(text);
    let mut found: Vec<u32> =
        names.iter().filter(|(name, _)| folded(name) == wanted).map(|(_, value)| *value).collect();
    found.sort_unstable();
    found.dedup();
    match found.as_slice() {
        [value] => Ok(*value),
        [] => {
            let all = || names.iter().map(|(name, _)| name.as_str());
            let near = nearest(text, all());
            let hint = if near.is_empty() {
                String::new()
            } else {
                format!("; did you mean {}?", near.join(" or "))
            };
            let known = all().filter(|name| !name.contains(' ')).collect::<Vec<_>>();
            let known = if known.is_empty() { all().collect() } else { known };
            Err(ValueError::Unknown { text: text.to_owned(), known: known.join(", "), hint })
        }
        several => {
            let values = several.iter().map(|value| format!("16#{value:X}")).collect::<Vec<_>>();
            Err(ValueError::Ambiguous { text: text.to_owned(), values: values.join(", ") })
        }
    }
}

/// Returns the names of values and single bits, each with its bit pattern.
#[must_use]
pub(crate) fn names(meaning: &'static Meaning) -> Vec<(String, u32)> {
    let singles = meaning.values.iter().filter(|value| value.first == value.last && !value.reserved);
    let values = singles.flat_map(|value| [value.id, value.text].map(|name| (name, value.first)));
    let bits = meaning.bits.iter().filter(|field| field.first == field.last && !field.reserved);
    let bits = bits.flat_map(|field| [field.id, field.name].map(|name| (name, 1 << field.first)));
    let named = values.chain(bits).filter(|(name, _)| !name.is_empty());
    let mut names: Vec<_> = named.map(|(name, value)| (name.to_ascii_lowercase(), value)).collect();
    let mut seen = Vec::new();
    names.retain(|(name, value)| {
        let key = (folded(name), *value);
        let is_new = !seen.contains(&key);
        seen.push(key);
        is_new
    });
    names
}

fn folded(name: &str) -> String {
    name.trim().to_ascii_lowercase().replace(['-', ' '], "_")
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
        signed if signed.is_signed() => [-(mask / 2) - 1, mask / 2],
        _ => [0, mask],
    }
}

pub(super) fn article(name: &str) -> &'static str {
    // The letter U of UINT is spoken as a consonant.
    if name.starts_with('I') { "an" } else { "a" }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::samples::tables::NODES as DEVICE;
    use crate::layout::format_value;

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

    proptest::proptest! {
        #![proptest_config(crate::property_tests())]

        /// Tests both notations: as a number of the type, and as a bit pattern.
        #[test]
        fn a_shown_value_is_read_as_the_same_value(value in proptest::num::u32::ANY) {
            use RegType::{Byte, Dint, Dword, Int, Sint, Udint, Uint, Usint, Word};
            for ty in [Byte, Word, Dword, Sint, Int, Dint, Usint, Uint, Udint] {
                let value = value & ty.mask();
                proptest::prop_assert_eq!(parse(&format_value(ty, value), ty), Ok(value));
                proptest::prop_assert_eq!(parse(&ty.number(value).to_string(), ty), Ok(value));
            }
        }
    }

    #[test]
    fn a_value_out_of_range_is_refused_with_the_range() {
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

    fn of_register(register: &str, text: &str) -> Result<u32, String> {
        let meaning = DEVICE.register(register).unwrap().register.meaning;
        named(text, meaning, ValueError::Notation { text: text.to_owned() })
            .map_err(|error| error.to_string())
    }

    #[test]
    fn values_have_names() {
        for (name, value) in [("restart", 0), ("START_SYNCHRONOUS", 0x20), ("start-synchronous", 0x20)] {
            assert_eq!(of_register("node2.w_CPU_CONTROL", name), Ok(value), "{name}");
        }
        assert_eq!(of_register("node2.w_CPU_CONTROL", "start synchronous operation"), Ok(0x20));
        assert_eq!(of_register("node2.w_CPU_CONTROL", "enable"), Ok(0x40), "a bit alone");
        assert_eq!(of_register("node2.b_BT_0", "250 kbit/s"), Ok(1));
        assert_eq!(of_register("node2.b_BT_0", "300 kbit/s"), Err("`300 kbit/s` is no number; write it decimal (67), hexadecimal (16#43 or 0x43) or binary (2#100_0011)".to_owned()));
    }

    #[test]
    fn unknown_names_are_refused_with_the_known_ones() {
        let message = of_register("node2.w_CPU_CONTROL", "restrt").unwrap_err();
        assert!(
            message.starts_with(
                "`restrt` is no number and no value of this register; its values are restart, handshake, "
            ),
            "{message}"
        );
        assert!(message.ends_with("; did you mean restart or reset?"), "{message}");
        assert!(
            of_register("node2.a_WR_VALUE[0]", "restart").unwrap_err().contains("is no number; write it")
        );
    }

    #[test]
    fn an_invalid_number_is_refused_with_the_notation() {
        for text in ["", "16#", "0x", "abc", "4 3", "1.5", "16#G", "--1", "16#-1", "_1", "1_", "1__2", "+1"] {
            assert!(matches!(parse(text, RegType::Dint), Err(ValueError::Notation { .. })), "{text}");
        }
    }
}
