//! Inputs and outputs of function blocks as values of scripts.

use crate::script::ScenarioError;
use crate::script::engine::arguments::span;
use core::time::Duration;
use rhai::{Array, Dynamic, INT};

/// The type of an input or output.
pub(super) trait Pin: Sized {
    /// As the script sees it.
    fn show(&self) -> Dynamic;

    /// From what the script gives.
    ///
    /// # Errors
    /// It is not of this type or out of its range; the error says what would be right.
    fn take(&mut self, given: &Dynamic) -> Result<(), ScenarioError>;
}

fn wrong(given: &Dynamic, right: &str) -> ScenarioError {
    ScenarioError::argument(&given.to_string(), right)
}

impl Pin for bool {
    fn show(&self) -> Dynamic {
        (*self).into()
    }

    fn take(&mut self, given: &Dynamic) -> Result<(), ScenarioError> {
        *self = given.as_bool().map_err(|_| wrong(given, "a BOOL is true or false"))?;
        Ok(())
    }
}

macro_rules! integers {
    ($($type:ty)*) => {$(
        impl Pin for $type {
            fn show(&self) -> Dynamic {
                INT::from(*self).into()
            }

            fn take(&mut self, given: &Dynamic) -> Result<(), ScenarioError> {
                let fitting = given.as_int().ok().and_then(|number| <$type>::try_from(number).ok());
                *self = fitting.ok_or_else(|| {
                    wrong(given, &format!("an integer from {} to {}", <$type>::MIN, <$type>::MAX))
                })?;
                Ok(())
            }
        }
    )*};
}

integers!(u8 i8 u16 i16 u32 i32);

/// In microseconds; a script may also give a text with a unit.
impl Pin for Duration {
    fn show(&self) -> Dynamic {
        INT::try_from(self.as_micros()).unwrap_or(INT::MAX).into()
    }

    fn take(&mut self, given: &Dynamic) -> Result<(), ScenarioError> {
        *self = Duration::from_micros(span(given)?.us()?);
        Ok(())
    }
}

impl<T: Pin, const N: usize> Pin for [T; N] {
    fn show(&self) -> Dynamic {
        self.iter().map(Pin::show).collect::<Array>().into()
    }

    fn take(&mut self, given: &Dynamic) -> Result<(), ScenarioError> {
        let items = given.as_array_ref().ok().filter(|items| items.len() == N);
        let items = items.ok_or_else(|| wrong(given, &format!("an array of {N} elements")))?;
        self.iter_mut().zip(items.iter()).try_for_each(|(element, item)| element.take(item))
    }
}
