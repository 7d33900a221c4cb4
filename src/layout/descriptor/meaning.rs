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

    /// Returns the texts of the values: `0: off`, `1: on`; `n` is any value. A value with another source than the field names
    /// its source.
    #[cfg(feature = "export")]
    pub(crate) fn texts(&self) -> Vec<String> {
        let singles = [("0: ", self.zero), ("1: ", self.one), ("", self.text)];
        let singles = singles.into_iter().filter(|(_, text)| !text.is_empty());
        let value = |of: &ValueMeaning| {
            let ValueMeaning { first, last, text, source, .. } = *of;
            let values = if first == last { first.to_string() } else { format!("{first} to {last}") };
            let source = match source.decision() {
                _ if source == self.source => String::new(),
                Some(decision) => format!(" ({decision})"),
                None => format!(" ({source})"),
            };
            format!("{values}: {text}{source}")
        };
        let texts =
            singles.map(|(value, text)| format!("{value}{text}")).chain(self.values.iter().map(value));
        texts.map(|text| text.replace("{}", "n")).collect()
    }
}

#[cfg(all(test, feature = "export"))]
mod tests {
    use super::*;

    #[test]
    fn values_of_a_field_with_another_source_name_it() {
        let value =
            |first, last, source| ValueMeaning { id: "", first, last, text: "v {}", reserved: false, source };
        let field = |source| BitField {
            id: "",
            first: 0,
            last: 3,
            name: "f",
            zero: "",
            one: "",
            text: "",
            values: Box::leak(Box::new([
                value(1, 1, Provenance::Manual),
                value(2, 4, Provenance::Inferred("D-1")),
            ])),
            joined: false,
            reserved: false,
            source,
        };
        assert_eq!(field(Provenance::Manual).texts(), ["1: v n", "2 to 4: v n (D-1)"]);
        assert_eq!(field(Provenance::Inferred("D-1")).texts(), ["1: v n (manual)", "2 to 4: v n"]);
    }
}
