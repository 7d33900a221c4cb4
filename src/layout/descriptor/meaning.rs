//! Meanings of values and bits of a register.

use super::Provenance;
use core::fmt;

/// The meanings of the values and bits of a register.
#[derive(Debug)]
pub struct Meaning {
    /// Name in the layout files.
    pub name: &'static str,
    /// Pages of the manual; empty if the manual states no meaning.
    pub page: &'static str,
    /// The values of a request and of its answer, if the registers are handshakes.
    pub handshake: Option<Handshake>,
    /// Meanings of whole values. They have priority over the meanings of bits.
    pub values: &'static [ValueMeaning],
    /// Bits and fields of bits with a meaning, in ascending order.
    pub bits: &'static [BitField],
}

/// Two values of a handshake register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Handshake {
    /// Value that a program writes as a request.
    pub request: u32,
    /// Value that the firmware writes as the answer.
    pub answer: u32,
}

/// A value, or a range of values, with its meaning.
#[derive(Debug)]
pub struct ValueMeaning {
    /// Name in the layout files, as in generated code: `START_SYNCHRONOUS`; empty if it has none.
    pub id: &'static str,
    /// First value of the range that has the meaning.
    pub first: u32,
    /// Last value; equal to `first` for a single value.
    pub last: u32,
    /// Text of the meaning. `{}` is replaced by the value.
    pub text: &'static str,
    /// True if the manual reserves the value.
    pub reserved: bool,
    /// Source of the meaning.
    pub source: Provenance,
}

impl Meaning {
    /// Returns the meaning of `value` as a whole, if it is known.
    #[must_use]
    pub fn value(&self, value: u32) -> Option<&'static ValueMeaning> {
        ValueMeaning::find(self.values, value)
    }
}

impl ValueMeaning {
    pub(in crate::layout) fn find(known: &'static [Self], value: u32) -> Option<&'static Self> {
        known.iter().find(|known| known.first <= value && value <= known.last)
    }

    /// Returns the meaning with `{}` replaced by `value`, followed by the decision on which it is based.
    #[must_use]
    pub fn text_for(&self, value: impl fmt::Display) -> String {
        let text = self.text.replace("{}", &value.to_string());
        match self.source.decision() {
            Some(decision) => format!("{text} ({decision})"),
            None => text,
        }
    }
}

/// A bit, or a field of bits.
#[derive(Debug)]
pub struct BitField {
    /// Name in the layout files, as in generated code: `ENABLE_ACTIVE`; empty if it has none.
    pub id: &'static str,
    /// Number of the lowest bit of the field.
    pub first: u8,
    /// Highest bit; equal to `first` for a single bit.
    pub last: u8,
    /// Short name of the field of bits.
    pub name: &'static str,
    /// Meaning of a single bit with value 0; empty if descriptions omit a bit with the value 0.
    pub zero: &'static str,
    /// Meaning of a single bit with value 1.
    pub one: &'static str,
    /// Meaning of a field. `{}` is replaced by the value of the field.
    pub text: &'static str,
    /// Meanings of single values of a field.
    pub values: &'static [ValueMeaning],
    /// True if the text continues the text of the previous field without a comma.
    pub joined: bool,
    /// True if the manual reserves the bits.
    pub reserved: bool,
    /// Source of the meaning.
    pub source: Provenance,
}

impl BitField {
    /// Mask of the field's bits.
    #[must_use]
    pub const fn mask(&self) -> u32 {
        (u32::MAX >> (31 - (self.last - self.first))) << self.first
    }

    /// Returns the value of the field in a register value.
    #[must_use]
    pub const fn of(&self, value: u32) -> u32 {
        (value & self.mask()) >> self.first
    }

    /// Returns the meaning of the field's value `part`, if it is known.
    #[cfg(feature = "emulator")]
    pub(crate) fn value(&self, part: u32) -> Option<&'static ValueMeaning> {
        ValueMeaning::find(self.values, part)
    }
}
