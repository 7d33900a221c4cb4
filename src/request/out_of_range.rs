//! Error of an operation with a field outside its range.

use super::{Code, Refused};

/// A field of an operation with a value above its range.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{field}` of `{operation}` is {value}; it may be 0 to {most}")]
pub(crate) struct OutOfRange {
    /// Name of the operation with the field.
    operation: &'static str,
    /// Name of the field with the value.
    field: &'static str,
    /// Value that the client gave to the field.
    value: u64,
    /// Largest value that the field may have.
    most: u64,
    /// Code of the refusal that the client receives.
    code: Code,
}

impl OutOfRange {
    /// Checks the value of a field.
    ///
    /// # Errors
    /// The value is above `most`.
    pub(super) fn check<N: Into<u64>>(
        [operation, field]: [&'static str; 2],
        value: N,
        most: N,
        code: Code,
    ) -> Result<(), Self> {
        let (value, most) = (value.into(), most.into());
        if value <= most { Ok(()) } else { Err(OutOfRange { operation, field, value, most, code }) }
    }
}

impl From<OutOfRange> for Refused {
    fn from(error: OutOfRange) -> Self {
        Self::new(error.code, error)
    }
}
