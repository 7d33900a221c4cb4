//! Values and times in the form that scenarios use.

use super::ScenarioError;
use crate::layout::place::BadValue;
use crate::layout::value::ValueError;
use crate::layout::{NamedLocation, RegType};
use crate::time;
use std::time::Duration;

/// A value for a register.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Value {
    /// A number of the register's type, or its bit pattern.
    Number(i64),
    /// A number in the notation of PLC languages: `67`, `16#43`, `2#100_0011`.
    Text(String),
}

impl Value {
    /// Returns the value as the bits of the register at `place`.
    ///
    /// # Errors
    /// The register cannot hold the value.
    pub fn bits(&self, place: &NamedLocation) -> Result<u32, BadValue> {
        match self {
            Value::Text(text) => place.parse_value(text),
            Value::Number(number)
                if place.bit().is_none() && is_of(place.ty(place.last_phase()), *number) =>
            {
                Ok(*number as u32 & place.ty(place.last_phase()).mask())
            }
            Value::Number(number) => place.parse_value(&number.to_string()).or_else(|error| {
                // A number outside of the type may be a bit pattern: 16#FFFF is too large as a number of an INT, but is
                // a pattern of 16 bits.
                let pattern = u32::try_from(*number).ok();
                let pattern = pattern.filter(|_| place.bit().is_none());
                pattern
                    .filter(|bits| *bits <= place.ty(place.last_phase()).mask())
                    .ok_or_else(|| both(error, *number))
            }),
        }
    }

    /// Returns the value as a bit pattern for the register at `place`, for example a mask. A number in a text needs not be
    /// a number of the register's type.
    ///
    /// # Errors
    /// The pattern has more bits than the register.
    pub(super) fn pattern(&self, place: &NamedLocation) -> Result<u32, BadValue> {
        match self {
            Value::Text(text) => place.parse_pattern(text),
            // `bits` accepts patterns, too.
            Value::Number(_) => self.bits(place),
        }
    }
}

/// Shows the number in decimal and hexadecimal, because a script may have written it in either base.
fn both(error: BadValue, number: i64) -> BadValue {
    match error.source {
        ValueError::Range { ty, least, most, mask, .. } if number > 9 => {
            let text = format!("{number} (16#{number:X})");
            BadValue { source: ValueError::Range { text, ty, least, most, mask }, ..error }
        }
        _ => error,
    }
}

/// True if the type has this number.
fn is_of(ty: RegType, number: i64) -> bool {
    ty.number(number as u32) == number
}

macro_rules! value_from {
    ($($number:ty)*) => {$(
        impl From<$number> for Value {
            fn from(number: $number) -> Self {
                Value::Number(number.into())
            }
        }
    )*};
}

value_from!(bool u8 u16 u32 i8 i16 i32 i64);

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Value::Text(text.to_owned())
    }
}

/// A span of emulated time.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Span {
    /// A number of microseconds.
    Us(u64),
    /// A text with a unit: `500us`, `2ms`, `1.5s`.
    Text(String),
}

impl Span {
    /// Returns a number of microseconds.
    ///
    /// # Errors
    /// The text is not a time.
    pub fn us(&self) -> Result<u64, ScenarioError> {
        match self {
            Span::Us(us) => Ok(*us),
            Span::Text(text) => {
                time::parse(text).map_err(|source| ScenarioError::Time { text: text.clone(), source })
            }
        }
    }
}

impl From<u64> for Span {
    fn from(us: u64) -> Self {
        Span::Us(us)
    }
}

impl From<&str> for Span {
    fn from(text: &str) -> Self {
        Span::Text(text.to_owned())
    }
}

impl From<Duration> for Span {
    fn from(duration: Duration) -> Self {
        Span::Us(u64::try_from(duration.as_micros()).unwrap_or(u64::MAX))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::samples::tables::NODES as DEVICE;
    use crate::layout::DeviceFit;

    fn bits(register: &str, value: impl Into<Value>) -> Result<u32, String> {
        value
            .into()
            .bits(&NamedLocation::parse(&DeviceFit::unknown(&DEVICE), register).unwrap())
            .map_err(|error| error.to_string())
    }

    #[test]
    fn numbers_are_numbers_of_the_type_or_patterns_of_its_bits() {
        assert_eq!(bits("node2.w_CPU_CONTROL", 0x40), Ok(0x40));
        assert_eq!(bits("node2.w_CPU_CONTROL", "16#0040"), Ok(0x40));
        assert_eq!(bits("node2.a_WR_VALUE[0]", -1), Ok(0xFFFF_FFFF));
        assert_eq!(bits("node2.a_WR_VALUE[0]", 0xFFFF_FFFE_u32), Ok(0xFFFF_FFFE));
        let refused = bits("node2.w_CPU_CONTROL", 0x1_0000).unwrap_err();
        assert!(refused.contains("`65536 (16#10000)` is out of range, a WORD holds 0 to 65535"), "{refused}");
        assert!(bits("node2.w_CPU_CONTROL", -1).is_err());
        assert!(bits("node2.a_WR_VALUE[0]", 1_i64 << 32).is_err());
    }

    #[test]
    fn patterns_have_no_sign() {
        let place = NamedLocation::parse(&DeviceFit::unknown(&DEVICE), "node2.i_SW1_NR").unwrap();
        for given in [Value::from(0x8000), "32768".into(), "16#8000".into(), "-32768".into(), (-32768).into()]
        {
            assert_eq!(given.pattern(&place), Ok(0x8000), "{given:?}");
        }
        assert!(Value::from("32768").bits(&place).is_err());
        assert!(Value::from("65536").pattern(&place).is_err() && Value::from(65536).pattern(&place).is_err());
    }

    #[test]
    fn a_single_bit_is_0_or_1() {
        assert_eq!(bits("%MX3.200000.3", true), Ok(1));
        assert!(bits("%MX3.200000.3", 2).is_err());
    }

    #[test]
    fn spans_have_units_or_are_microseconds() {
        let us = |span: Span| span.us().map_err(|error| error.to_string());
        assert_eq!(us("2ms".into()), Ok(2_000));
        assert_eq!(us(2_000_u64.into()), Ok(2_000));
        assert_eq!(us(Duration::from_millis(2).into()), Ok(2_000));
        assert_eq!(us("2".into()), Err("`2`: a time needs a unit: 2us, 2ms or 2s".to_owned()));
    }
}
