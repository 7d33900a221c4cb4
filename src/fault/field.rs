//! Fields that describe a fault. Each field is defined once, and this definition is used to read, check, print and
//! document the field.

use super::Refusal;
use core::fmt;
use core::hash::{Hash, Hasher};

/// A field. Fields are equal if their names are.
#[derive(Clone, Copy)]
pub struct Field {
    name: &'static str,
    other_name: Option<&'static str>,
    about: &'static str,
    form: Form,
    need: Need,
}

/// Type of a field's value.
#[derive(Clone, Copy, Debug)]
pub enum Form {
    /// Name of a bus or PLC.
    Name,
    /// Name or number of a PLC's port.
    Port,
    /// The value is one of these words. The fault stores the index of the word in this list.
    Word(&'static [&'static str]),
    /// The value is a decimal number.
    Number {
        /// Smallest permitted value.
        least: u64,
        /// Largest permitted value.
        most: u64,
    },
    /// A number in hexadecimal notation.
    Hex {
        /// Smallest permitted value.
        least: u64,
        /// Largest permitted value.
        most: u64,
        /// Minimum number of digits.
        digits: usize,
    },
    /// A time in emulated microseconds.
    Time {
        /// Shortest time, in microseconds.
        least: u64,
        /// Longest time, in microseconds.
        most: u64,
    },
}

/// Need for a field in the description of a fault.
#[derive(Clone, Copy, Debug)]
enum Need {
    Optional,
    /// The field may be omitted; then it has this value.
    Default(u32),
    /// The field is required; the text describes a correct value.
    Required(&'static str),
}

impl Field {
    /// Creates a field of this form, which may be omitted.
    #[must_use]
    pub const fn new(name: &'static str, form: Form, about: &'static str) -> Self {
        Field { name, other_name: None, about, form, need: Need::Optional }
    }

    /// Gives the field an alternative name.
    #[must_use]
    pub const fn or(self, other_name: &'static str) -> Self {
        Field { other_name: Some(other_name), ..self }
    }

    /// Makes the field required; `right` describes a correct value.
    #[must_use]
    pub const fn required(self, right: &'static str) -> Self {
        Field { need: Need::Required(right), ..self }
    }

    /// Gives the field a default value.
    #[must_use]
    pub const fn default(self, value: u32) -> Self {
        Field { need: Need::Default(value), ..self }
    }

    /// Returns the name of the field in plant files.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        self.name
    }

    /// Alternative name that is accepted in place of [`Field::name`].
    #[must_use]
    pub const fn other_name(&self) -> Option<&'static str> {
        self.other_name
    }

    /// Description of the field.
    #[must_use]
    pub const fn about(&self) -> &'static str {
        self.about
    }

    /// Returns the type of the value.
    #[must_use]
    pub const fn form(&self) -> Form {
        self.form
    }

    /// Description of a correct value, if the field is required.
    pub(super) const fn missing(&self) -> Option<&'static str> {
        match self.need {
            Need::Required(right) => Some(right),
            Need::Optional | Need::Default(_) => None,
        }
    }

    /// True if the field must not be omitted.
    #[cfg(feature = "cli")]
    pub(crate) const fn is_required(&self) -> bool {
        self.missing().is_some()
    }

    /// Default value of the field.
    pub(super) const fn default_value(&self) -> Option<u32> {
        match self.need {
            Need::Default(value) => Some(value),
            Need::Optional | Need::Required(_) => None,
        }
    }

    /// Smallest and largest value.
    #[must_use]
    pub const fn range(&self) -> (u64, u64) {
        match self.form {
            Form::Number { least, most } | Form::Hex { least, most, .. } | Form::Time { least, most } => {
                (least, most)
            }
            Form::Word(words) => (0, words.len() as u64 - 1),
            Form::Name | Form::Port => (0, 0),
        }
    }

    /// Returns the number of bits of the field's largest value.
    #[must_use]
    pub const fn bits(&self) -> u32 {
        let (_, most) = self.range();
        u64::BITS - most.leading_zeros()
    }

    /// Checks a value. All sources of values use this check.
    ///
    /// # Errors
    /// [`Refusal::Range`].
    pub(super) fn check(&'static self, value: u64) -> Result<u64, Refusal> {
        let (least, most) = self.range();
        if (least..=most).contains(&value) {
            Ok(value)
        } else {
            Err(Refusal::Range { field: self, value, least, most })
        }
    }

    /// Description of the allowed values in messages.
    #[must_use]
    pub fn range_text(&self) -> String {
        let (least, most) = self.range();
        match self.form {
            Form::Name => "name".to_owned(),
            Form::Port => "name or number of a port".to_owned(),
            Form::Word(words) => words.join(", "),
            _ => format!("{} to {}", self.show(least), self.show(most)),
        }
    }

    /// Formats a value in the base of the field.
    pub(super) fn show(&self, value: u64) -> String {
        match self.form {
            Form::Hex { .. } => format!("16#{value:03X}"),
            _ => value.to_string(),
        }
    }

    /// Formats a value like [`Field::show`]. For a long time, the value in a larger unit follows: `5000000 (5 s)`.
    pub(super) fn show_with_unit(&self, value: u64) -> String {
        match self.form {
            Form::Time { .. } if value >= 1_000 && value.is_multiple_of(1_000) => {
                format!("{value} ({})", crate::time::long(value))
            }
            _ => self.show(value),
        }
    }

    /// True if this is the name or the alternative name of the field.
    pub(super) fn is_called(&self, name: &str) -> bool {
        self.name == name || self.other_name == Some(name)
    }
}

impl PartialEq for Field {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Eq for Field {}

impl Hash for Field {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.name.hash(state);
    }
}

impl fmt::Debug for Field {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

impl fmt::Display for Field {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}
