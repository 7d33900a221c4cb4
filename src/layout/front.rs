//! The front panel of a device, such as switches and displays: words in the header page, different for each device.

use super::decode;
use super::descriptor::{Meaning, Owner, Provenance, RegType, ValueMeaning};
use super::value;
use core::fmt;

/// A word of the front panel in the header page.
pub struct FrontWord {
    /// Name in the layout.
    pub name: &'static str,
    /// Data type, 32 bits wide.
    pub ty: RegType,
    /// First byte in the front panel.
    pub offset: u32,
    /// Writer of the word.
    pub owner: Owner,
    /// Meanings of the word's values; `None` for plain numbers.
    pub meaning: Option<&'static Meaning>,
    /// True if the word contains four characters of the text on the device's display. The first character is in the low
    /// byte.
    pub is_text: bool,
    /// Source that says that the device has this word.
    pub source: Provenance,
    /// Pages of the manual.
    pub page: &'static str,
    /// Description of the word.
    pub doc: &'static str,
}

impl FrontWord {
    /// Returns the position of the word in the front panel, from 0.
    #[must_use]
    pub const fn index(&self) -> usize {
        self.offset as usize / 4
    }

    /// Formats `value` for [`FrontWord::parse`]: its name, or a decimal number.
    #[must_use]
    pub fn called(&self, value: u32) -> String {
        self.named()
            .find(|(known, _)| *known == value)
            .map_or_else(|| self.ty.number(value).to_string(), |(_, name)| name.to_owned())
    }

    /// Returns values that have names.
    fn named(&self) -> impl Iterator<Item = (u32, &'static str)> {
        let values = self.meaning.map_or(&[][..], |meaning| meaning.values);
        values.iter().filter(|value| value.first == value.last).map(|value| (value.first, value.text))
    }

    /// Returns the value with the name or number `text`, if the word can have this value.
    #[must_use]
    pub fn parse(&self, text: &str) -> Option<u32> {
        if let Some((value, _)) = self.named().find(|(_, name)| *name == text) {
            return Some(value);
        }
        let number = value::parse(text, self.ty).ok()?;
        self.takes(number).then_some(number)
    }

    /// True if the word can have this value. If the layout has no names of values, it can have any value.
    #[must_use]
    pub fn takes(&self, value: u32) -> bool {
        let known = |meaning: &Meaning| {
            meaning.values.iter().any(|known| (known.first..=known.last).contains(&value))
        };
        self.meaning.is_none_or(|meaning| meaning.values.is_empty() || known(meaning))
    }

    /// Returns the values that the word can have, for messages: `lock, unlock`, `0 to 15`.
    #[must_use]
    pub fn choices(&self) -> String {
        let values = self.meaning.map_or(&[][..], |meaning| meaning.values);
        let choice = |value: &ValueMeaning| match value.first == value.last {
            true => value.text.to_owned(),
            false => format!("{} to {}", value.first, value.last),
        };
        if values.is_empty() {
            "a number".to_owned()
        } else {
            values.iter().map(choice).collect::<Vec<_>>().join(", ")
        }
    }

    /// Returns the meaning of `value`. A plain number is shown in decimal.
    #[must_use]
    pub fn decode(&self, value: u32) -> String {
        decode::decode(self.ty, self.meaning, value)
    }
}

/// Returns the text on the display of a front panel, without blanks at its end; `None` if no word contains such a text.
#[must_use]
pub fn shown_text(front: &[(&FrontWord, u32)]) -> Option<String> {
    let words: Vec<_> = front.iter().filter(|(word, _)| word.is_text).map(|(_, value)| value).collect();
    let characters = words.iter().flat_map(|value| value.to_le_bytes()).take_while(|byte| *byte != 0);
    let text: String = characters.map(char::from).collect();
    (!words.is_empty()).then(|| text.trim_end().to_owned())
}

impl fmt::Debug for FrontWord {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("FrontWord").field("name", &self.name).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::{Owner, Provenance, RegType};

    #[test]
    fn values_of_signed_words_have_a_sign() {
        let word = |ty| FrontWord {
            name: "i_TEMPERATURE",
            ty,
            offset: 0,
            owner: Owner::Plc,
            meaning: None,
            is_text: false,
            source: Provenance::Manual,
            page: "1",
            doc: "Temperature",
        };
        for (ty, value, text) in [(RegType::Dint, u32::MAX - 4, "-5"), (RegType::Udint, 7, "7")] {
            let word = word(ty);
            assert_eq!(word.called(value), text);
            assert_eq!(word.parse(text).map(|value| value & ty.mask()), Some(value));
        }
    }
}
