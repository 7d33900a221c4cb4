//! Checks of settings in a plant file that several devices and buses use: ranges and times.

pub(crate) mod keys;

use crate::memory::MemoryError;
use core::convert::Infallible;
use core::fmt;
use core::ops::{Range, RangeInclusive};
use serde::Deserializer;
use serde::de::{DeserializeSeed, Visitor};
use toml::Spanned;
use toml::de::{DeValue, ValueDeserializer};

const HOUR_US: u64 = 3_600_000_000;

/// A number out of its range.
#[derive(Clone, Debug, thiserror::Error, PartialEq, Eq)]
#[error("{what} of '{name}' is {value}; it must be {right}")]
pub struct SettingError {
    /// Key of the setting in the plant file.
    pub what: &'static str,
    /// Name of the device or bus.
    pub name: String,
    /// Value of the setting in the plant file.
    pub value: u64,
    /// Description of a correct value.
    pub right: &'static str,
}

/// The reason why a device or bus cannot be built.
#[derive(Debug, thiserror::Error)]
pub enum BuildError {
    /// The RAM of the device is too small or read-only.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// A port and its bus are of different families.
    #[error("the port does not fit the medium")]
    OtherFamily,
    /// A number out of its range.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// Settings that the device or bus itself refuses.
    #[error("{reason}")]
    Own {
        /// Name of the device or bus in the plant file.
        name: String,
        /// Path in the section, such as `zk.zk_0`; empty if the error is not about a particular path.
        at: String,
        /// Description of the error and of a correct value.
        reason: String,
    },
}

impl BuildError {
    /// Creates an error that the device or bus `name` itself has found. `at` is the path in its section.
    pub(crate) fn own(name: &str, at: &str, reason: String) -> Self {
        Self::Own { name: name.to_owned(), at: at.to_owned(), reason }
    }
}

/// Checks that `value` is in `allowed`. `right` describes a correct value.
///
/// # Errors
/// [`SettingError`] with the key `what` of the device or bus `name`.
pub(crate) fn range(
    what: &'static str,
    name: &str,
    value: u64,
    allowed: RangeInclusive<u64>,
    right: &'static str,
) -> Result<(), SettingError> {
    if allowed.contains(&value) {
        return Ok(());
    }
    Err(SettingError { what, name: name.to_owned(), value, right })
}

/// Checks a time in us. It may be 0, and is at most one hour.
///
/// # Errors
/// Returns the errors of [`range`].
pub(crate) fn time(what: &'static str, name: &str, us: u64) -> Result<(), SettingError> {
    range(what, name, us, 0..=HOUR_US, "at most one hour")
}

/// Checks a time in us. The time may be omitted, but must not be 0.
///
/// # Errors
/// Returns the errors of [`range`].
pub(crate) fn time_or_none(what: &'static str, name: &str, us: Option<u64>) -> Result<(), SettingError> {
    us.map_or(Ok(()), |us| range(what, name, us, 1..=HOUR_US, "1 to 3600000000"))
}

/// Creates an error about the text at `span` of the plant file; the message contains the line.
pub(crate) fn refused_at(span: Range<usize>, text: String) -> toml::de::Error {
    // The reader sets the position of an error only while it reads a value. So this code reads a value at
    // `span` and fails.
    let value = ValueDeserializer::from(Spanned::new(span, DeValue::Boolean(false)));
    match (Refusal { text }).deserialize(value) {
        Err(error) => error,
        Ok(never) => match never {},
    }
}

/// A deserializer that accepts no value. Its error is the text.
struct Refusal {
    text: String,
}

impl<'de> DeserializeSeed<'de> for Refusal {
    type Value = Infallible;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Infallible, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl Visitor<'_> for Refusal {
    type Value = Infallible;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }

    fn visit_bool<E: serde::de::Error>(self, _: bool) -> Result<Infallible, E> {
        Err(E::custom(self.text))
    }
}
