//! Inputs and outputs of function blocks as values, for scripts and other languages.

use crate::time;
use core::fmt;
use core::time::Duration;
use thiserror::Error;

/// Direction of a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// The value goes from the program to the block.
    In,
    /// The value goes from the block to the program.
    Out,
    /// Data of the program that the block reads or writes.
    InOut,
}

/// An input or output of a function block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pin {
    /// Name of the pin, letter for letter as in the manual.
    pub name: &'static str,
    /// Direction of the value.
    pub direction: Direction,
}

impl Pin {
    pub(crate) const fn input(name: &'static str) -> Self {
        Pin { name, direction: Direction::In }
    }

    pub(crate) const fn output(name: &'static str) -> Self {
        Pin { name, direction: Direction::Out }
    }

    pub(crate) const fn in_out(name: &'static str) -> Self {
        Pin { name, direction: Direction::InOut }
    }
}

/// The value of a pin.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PinValue {
    /// A value of type BOOL.
    Bool(bool),
    /// Any of the types with 8, 16 or 32 bits.
    Int(i64),
    /// TIME, of emulated time.
    Time(Duration),
    /// A text: the value of a STRING, or a TIME such as `2ms`.
    Text(String),
    /// A value of type ARRAY.
    Array(Vec<PinValue>),
}

impl fmt::Display for PinValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            PinValue::Bool(value) => value.fmt(f),
            PinValue::Int(value) => value.fmt(f),
            PinValue::Time(value) => value.as_micros().fmt(f),
            PinValue::Text(text) => text.fmt(f),
            PinValue::Array(items) => {
                for (index, item) in items.iter().enumerate() {
                    write!(f, "{}{item}", if index == 0 { "[" } else { ", " })?;
                }
                f.write_str(if items.is_empty() { "[]" } else { "]" })
            }
        }
    }
}

/// The reason why a pin cannot have a value.
#[derive(Debug, PartialEq, Eq, Error)]
pub enum PinError {
    /// The value has another type, or is out of range.
    #[error("`{given}` is not {right}")]
    Wrong {
        /// Value that the pin cannot have.
        given: String,
        /// Description of a correct value.
        right: String,
    },
    /// The text is not a time.
    #[error("`{text}` is no time: {source}")]
    Time {
        /// Text that should be a time.
        text: String,
        /// Error of the parser of times.
        source: time::TimeError,
    },
}

fn wrong(given: &PinValue, right: impl Into<String>) -> PinError {
    PinError::Wrong { given: given.to_string(), right: right.into() }
}

/// The type of an input or output.
pub trait PinType {
    /// Returns the value of the pin.
    fn get(&self) -> PinValue;

    /// Sets the pin to a given value.
    ///
    /// # Errors
    /// The value has another type or is out of range; the error names a correct value.
    fn set(&mut self, given: &PinValue) -> Result<(), PinError>;

    /// Returns the elements of a STRING with this text; `None` if this type is not the type of characters.
    fn characters(text: &str) -> Option<Vec<Self>>
    where
        Self: Sized,
    {
        let _ = text;
        None
    }
}

impl PinType for bool {
    fn get(&self) -> PinValue {
        PinValue::Bool(*self)
    }

    fn set(&mut self, given: &PinValue) -> Result<(), PinError> {
        let PinValue::Bool(value) = given else { return Err(wrong(given, "a BOOL is true or false")) };
        *self = *value;
        Ok(())
    }
}

macro_rules! integers {
    ($($type:ty $({ $characters:item })?)*) => {$(
        impl PinType for $type {
            $($characters)?

            fn get(&self) -> PinValue {
                PinValue::Int(i64::from(*self))
            }

            fn set(&mut self, given: &PinValue) -> Result<(), PinError> {
                let fitting = match given {
                    PinValue::Int(number) => <$type>::try_from(*number).ok(),
                    _ => None,
                };
                let right = || format!("an integer from {} to {}", <$type>::MIN, <$type>::MAX);
                *self = fitting.ok_or_else(|| wrong(given, right()))?;
                Ok(())
            }
        }
    )*};
}

integers!(u8 {
    fn characters(text: &str) -> Option<Vec<u8>> {
        Some(text.bytes().collect())
    }
} i8 u16 i16 u32 i32);

/// A TIME. It can also be set by a number of microseconds, or by a text with a unit.
impl PinType for Duration {
    fn get(&self) -> PinValue {
        PinValue::Time(*self)
    }

    fn set(&mut self, given: &PinValue) -> Result<(), PinError> {
        let micros = match given {
            PinValue::Time(time) => {
                *self = *time;
                return Ok(());
            }
            PinValue::Int(micros) => u64::try_from(*micros).ok(),
            PinValue::Text(text) => {
                let time = time::parse(text);
                Some(time.map_err(|source| PinError::Time { text: text.clone(), source })?)
            }
            PinValue::Bool(_) | PinValue::Array(_) => None,
        };
        let right = "a time is a text with a unit such as \"2ms\", or a number of microseconds";
        *self = Duration::from_micros(micros.ok_or_else(|| wrong(given, right))?);
        Ok(())
    }
}

impl<T: PinType, const N: usize> PinType for [T; N] {
    fn get(&self) -> PinValue {
        PinValue::Array(self.iter().map(PinType::get).collect())
    }

    fn set(&mut self, given: &PinValue) -> Result<(), PinError> {
        match given {
            PinValue::Array(items) if items.len() == N => {
                self.iter_mut().zip(items).try_for_each(|(element, item)| element.set(item))
            }
            PinValue::Text(text) => {
                let Some(characters) = T::characters(text) else {
                    return Err(wrong(given, format!("an array of {N} elements")));
                };
                if characters.len() > N || text.contains('\0') {
                    return Err(wrong(given, format!("a text of at most {N} characters")));
                }
                // 0 follows the last character.
                let zeros = core::iter::repeat(PinValue::Int(0));
                let items = characters.iter().map(PinType::get).chain(zeros);
                self.iter_mut().zip(items).try_for_each(|(element, item)| element.set(&item))
            }
            _ => Err(wrong(given, format!("an array of {N} elements"))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pin_shows_the_value_that_was_set() {
        let mut array = [0_i8; 2];
        let given = PinValue::Array(vec![PinValue::Int(-128), PinValue::Int(127)]);
        array.set(&given).unwrap();
        assert_eq!((array, array.get()), ([-128, 127], given));
        for given in [PinValue::Int(2500), PinValue::Text("2500us".into()), PinValue::Text("2.5ms".into())] {
            let (mut time, mut same) = (Duration::ZERO, Duration::ZERO);
            time.set(&given).unwrap();
            same.set(&time.get()).unwrap();
            assert_eq!([time, same], [Duration::from_micros(2500); 2]);
        }
    }

    #[test]
    fn a_string_takes_a_text_and_ends_with_zeros() {
        let mut string = [b'x'; 4];
        string.set(&PinValue::Text("%d".into())).unwrap();
        assert_eq!(string, *b"%d\0\0");
        string.set(&PinValue::Text("full".into())).unwrap();
        assert_eq!(string, *b"full");
        let refused = string.set(&PinValue::Text("longer".into())).unwrap_err().to_string();
        assert_eq!(refused, "`longer` is not a text of at most 4 characters");
        let refused = [1_u16; 2].set(&PinValue::Text("a".into())).unwrap_err().to_string();
        assert_eq!(refused, "`a` is not an array of 2 elements");
    }

    #[test]
    fn other_types_and_numbers_out_of_range_are_refused_and_change_nothing() {
        let refused = |pin: &mut dyn PinType, given: PinValue| {
            let before = pin.get();
            let error = pin.set(&given).unwrap_err();
            assert_eq!(pin.get(), before);
            error.to_string()
        };
        assert_eq!(refused(&mut true, PinValue::Int(0)), "`0` is not a BOOL is true or false");
        assert_eq!(refused(&mut 5_u8, PinValue::Int(256)), "`256` is not an integer from 0 to 255");
        assert_eq!(
            refused(&mut 5_i16, PinValue::Bool(true)),
            "`true` is not an integer from -32768 to 32767"
        );
        assert_eq!(
            refused(&mut [1_u8; 3], PinValue::Array(vec![PinValue::Int(1); 2])),
            "`[1, 1]` is not an array of 3 elements"
        );
        let mut time = Duration::from_secs(3);
        assert!(refused(&mut time, PinValue::Int(-1)).contains("a number of microseconds"));
        assert!(refused(&mut time, PinValue::Text("2".into())).contains("needs a unit"));
    }
}
