//! Converts numbers of other simulators to values of registers.

use crate::fmi::{Kind, Value};

/// Converts a number to a value of this kind, rounded to the nearest one (decision D-577).
///
/// # Errors
/// The kind has no such value; the text gives the reason.
pub(super) fn convert(kind: Kind, number: f64) -> Result<Value, String> {
    if !number.is_finite() {
        return Err(format!("{number} is no value"));
    }
    let (least, most) = match kind {
        Kind::F64 => return Ok(Value::Float(number)),
        Kind::Bool => return Ok(Value::Boolean(number != 0.0)),
        Kind::U8 => (0, i64::from(u8::MAX)),
        Kind::U16 => (0, i64::from(u16::MAX)),
        Kind::U32 => (0, i64::from(u32::MAX)),
        Kind::I8 => (i64::from(i8::MIN), i64::from(i8::MAX)),
        Kind::I16 => (i64::from(i16::MIN), i64::from(i16::MAX)),
        Kind::I32 => (i64::from(i32::MIN), i64::from(i32::MAX)),
    };
    // Saturates, far outside the range of every kind.
    let whole = number.round() as i64;
    if (least..=most).contains(&whole) {
        Ok(Value::Integer(whole))
    } else {
        Err(format!("{number} is not {least} to {most}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn numbers_are_rounded_and_checked_against_the_range() {
        assert_eq!(convert(Kind::U8, 255.4), Ok(Value::Integer(255)));
        assert_eq!(convert(Kind::U8, -0.4), Ok(Value::Integer(0)));
        assert_eq!(convert(Kind::U8, 255.5), Err("255.5 is not 0 to 255".to_owned()));
        assert_eq!(convert(Kind::I16, -32_768.0), Ok(Value::Integer(-32_768)));
        assert_eq!(convert(Kind::Bool, -0.1), Ok(Value::Boolean(true)));
        assert_eq!(convert(Kind::F64, f64::NAN), Err("NaN is no value".to_owned()));
        assert!(convert(Kind::U32, f64::INFINITY).is_err());
    }

    proptest! {
        #![proptest_config(crate::property_tests())]

        #[test]
        fn any_number_is_accepted_exactly_or_refused(number: f64) {
            for kind in [Kind::U8, Kind::U16, Kind::U32, Kind::I8, Kind::I16, Kind::I32] {
                if let Ok(Value::Integer(value)) = convert(kind, number) {
                    prop_assert!((value as f64 - number).abs() <= 0.5);
                }
            }
        }
    }
}
