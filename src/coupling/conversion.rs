//! Converts numbers of other simulators to values of registers.

use crate::fmi::{Value, VariableType};

/// Converts a number to the nearest value of the given kind (decision D-577).
///
/// # Errors
/// The kind has no such value. The text gives the reason.
pub(super) fn convert(kind: VariableType, number: f64) -> Result<Value, String> {
    if !number.is_finite() {
        return Err(format!("{number} is no value"));
    }
    let (least, most) = match kind {
        VariableType::F64 => return Ok(Value::Float(number)),
        VariableType::Bool => return Ok(Value::Boolean(number != 0.0)),
        VariableType::U8 => (0, i64::from(u8::MAX)),
        VariableType::U16 => (0, i64::from(u16::MAX)),
        VariableType::U32 => (0, i64::from(u32::MAX)),
        VariableType::I8 => (i64::from(i8::MIN), i64::from(i8::MAX)),
        VariableType::I16 => (i64::from(i16::MIN), i64::from(i16::MAX)),
        VariableType::I32 => (i64::from(i32::MIN), i64::from(i32::MAX)),
    };
    // A number that an i64 cannot represent becomes the smallest or largest i64, which is outside the range of every
    // kind.
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
        assert_eq!(convert(VariableType::U8, 255.4), Ok(Value::Integer(255)));
        assert_eq!(convert(VariableType::U8, -0.4), Ok(Value::Integer(0)));
        assert_eq!(convert(VariableType::U8, 255.5), Err("255.5 is not 0 to 255".to_owned()));
        assert_eq!(convert(VariableType::I16, -32_768.0), Ok(Value::Integer(-32_768)));
        assert_eq!(convert(VariableType::Bool, -0.1), Ok(Value::Boolean(true)));
        assert_eq!(convert(VariableType::F64, f64::NAN), Err("NaN is no value".to_owned()));
        assert!(convert(VariableType::U32, f64::INFINITY).is_err());
    }

    proptest! {
        #![proptest_config(crate::property_tests())]

        #[test]
        fn any_number_is_accepted_exactly_or_refused(number: f64) {
            for kind in [VariableType::U8, VariableType::U16, VariableType::U32, VariableType::I8, VariableType::I16, VariableType::I32] {
                if let Ok(Value::Integer(value)) = convert(kind, number) {
                    prop_assert!((value as f64 - number).abs() <= 0.5);
                }
            }
        }
    }
}
