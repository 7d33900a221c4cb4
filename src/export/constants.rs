//! Names for the values and bits of registers, derived from their meanings (decision D-221).

use super::Scope;
use super::names::UsedNames;
use crate::layout::{BitField, Meaning, RegType, ValueMeaning};

/// A number with the name that generated code uses.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Constant {
    /// `OPTION_STATUS_WAITING_FOR_START`.
    pub name: String,
    /// The value or the mask of bits, at its position in the register.
    pub value: u32,
    /// Meaning of the value or the bits.
    pub text: String,
    pub kind: NumberKind,
}

/// What the number of a constant is.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum NumberKind {
    /// The value of a whole register.
    Value,
    /// The mask of bits, or the value of a field at its position.
    Bits,
    /// The number of the lowest bit of a field.
    Shift,
}

impl Constant {
    fn new(name: String, value: u32, text: impl Into<String>) -> Self {
        Self { name, value, text: text.into(), kind: NumberKind::Bits }
    }

    /// Returns the number that programs compare with a register of type `ty`. It is negative for a value with the sign bit of a
    /// signed register.
    pub(crate) fn number(&self, ty: RegType) -> i64 {
        if self.kind == NumberKind::Value { ty.number(self.value) } else { self.value.into() }
    }
}

/// Named numbers of all registers with the same meaning, for languages that have enumerations.
#[derive(Debug, PartialEq, Eq)]
pub struct Enumeration {
    /// `OPTION_STATUS`.
    pub name: String,
    /// True if the members are bits, which can be combined.
    pub is_flags: bool,
    /// The members of the enumeration: for each, the name without the prefix of the enumeration, the value, and the
    /// meaning.
    pub members: Vec<(String, i64, String)>,
    /// Constants for the number of a field's lowest bit, with their full names. They are not members of the
    /// enumeration.
    pub shifts: Vec<(String, u32)>,
}

impl Enumeration {
    /// Returns the enumeration of a meaning of registers of type `ty`.
    pub(crate) fn of(meaning: &Meaning, ty: RegType) -> Self {
        let prefix = upper(meaning.name);
        let (shifts, members): (Vec<_>, Vec<_>) =
            of(meaning).into_iter().partition(|it| it.kind == NumberKind::Shift);
        let is_flags = !meaning.bits.is_empty();
        let mut used = UsedNames::default();
        let mut member = |it: Constant| {
            // Python inverts a negative flag.
            let number = if is_flags { it.value.into() } else { it.number(ty) };
            (used.add(own_name(&prefix, &it.name)), number, it.text)
        };
        Self {
            members: members.into_iter().map(&mut member).collect(),
            shifts: shifts.into_iter().map(|it| (own_name("", &it.name), it.value)).collect(),
            is_flags,
            name: own_name("", &prefix),
        }
    }
}

/// Returns the enumerations of all registers in a scope, in the order of the registers. No two enumerations or constants
/// outside of them have the same name.
pub fn enumerations(scope: &Scope) -> Vec<Enumeration> {
    let mut all: Vec<_> =
        scope.meanings().iter().map(|(meaning, register)| Enumeration::of(meaning, register.ty)).collect();
    let mut used = UsedNames::default();
    all.iter_mut().for_each(|of| used.reserve(&mut of.name));
    all.iter_mut().flat_map(|of| &mut of.shifts).for_each(|(name, _)| used.reserve(name));
    all
}

/// Returns the bits and fields of a meaning that are not reserved, with names that differ from each other.
pub(crate) fn fields(meaning: &Meaning) -> Vec<(&'static BitField, String)> {
    let fields: Vec<_> = meaning.bits.iter().filter(|field| !field.reserved).collect();
    let mut names: Vec<_> =
        fields.iter().map(|field| Constant::new(field_words(field), field.mask(), "")).collect();
    tell_apart(&mut names);
    fields.into_iter().zip(names.into_iter().map(|constant| constant.name)).collect()
}

/// Returns the constants of a meaning: first for its values, then for its bits. Reserved values and bits have no
/// constants.
pub(crate) fn of(meaning: &Meaning) -> Vec<Constant> {
    let mut constants = values(&upper(meaning.name), meaning.values, 0);
    constants.iter_mut().for_each(|constant| constant.kind = NumberKind::Value);
    for field in meaning.bits.iter().filter(|field| !field.reserved) {
        bits(&mut constants, meaning, field);
    }
    tell_apart(&mut constants);
    constants
}

/// Returns the constants for single values, named by their meaning alone. Ranges and reserved values have none.
pub(crate) fn singles(known: &[ValueMeaning]) -> Vec<Constant> {
    let alone = known.iter().filter(|value| value.first == value.last);
    let mut constants: Vec<_> = alone.flat_map(|value| values("", core::slice::from_ref(value), 0)).collect();
    for constant in &mut constants {
        constant.name = own_name("", &constant.name);
    }
    tell_apart(&mut constants);
    constants
}

/// Returns a constant's name without `prefix`. The result is a valid name.
pub(crate) fn own_name(prefix: &str, name: &str) -> String {
    let own = name.strip_prefix(prefix).map_or(name, |rest| rest.trim_start_matches('_'));
    if own.starts_with(|c: char| c.is_ascii_digit()) { format!("VALUE_{own}") } else { own.to_owned() }
}

/// Returns a short description of a field of bits, and the decision if the field is inferred.
pub(crate) fn about(field: &BitField) -> String {
    let text = [field.one, field.text, field.name].into_iter().find(|text| !text.is_empty());
    let text = text.unwrap_or_default().replace("{}", "n");
    match field.source.decision() {
        Some(decision) => format!("{text} ({decision})"),
        None => text,
    }
}

fn bits(constants: &mut Vec<Constant>, meaning: &Meaning, field: &BitField) {
    let name = format!("{}_{}", upper(meaning.name), field_words(field));
    if field.first == field.last {
        constants.push(Constant::new(name, field.mask(), about(field)));
        return;
    }
    constants.push(Constant::new(format!("{name}_MASK"), field.mask(), about(field)));
    let shift = Constant::new(format!("{name}_SHIFT"), field.first.into(), "lowest bit of it");
    constants.push(Constant { kind: NumberKind::Shift, ..shift });
    constants.extend(values(&name, field.values, field.first));
}

fn values(prefix: &str, values: &[ValueMeaning], shift: u8) -> Vec<Constant> {
    let mut constants = Vec::new();
    for known in values {
        let ValueMeaning { first, last, text, reserved, .. } = known;
        let mut words = upper(gist(text));
        if words.is_empty() && text.contains(char::is_alphabetic) {
            words = format!("VALUE_{first:02X}");
        }
        // A plain number is not a name.
        if *reserved || words.is_empty() {
            continue;
        }
        let name = format!("{prefix}_{words}");
        let name = name.trim_end_matches('_').to_owned();
        let text = known.text_for("n");
        if first == last {
            constants.push(Constant::new(name, first << shift, text));
        } else {
            constants.push(Constant::new(format!("{name}_FIRST"), first << shift, text.clone()));
            constants.push(Constant::new(format!("{name}_LAST"), last << shift, text));
        }
    }
    constants
}

/// Returns the part of the text before its details or the placeholder for the value. Details begin with a colon or
/// bracket.
fn gist(text: &str) -> &str {
    let details = [":", " (", "{}"].into_iter().filter_map(|sign| text.find(sign)).min();
    details.and_then(|end| text.get(..end)).filter(|gist| !gist.is_empty()).unwrap_or(text)
}

/// Returns the words of a field's name in capitals. If the name has no ASCII letter or digit, returns the place of the field.
fn field_words(field: &BitField) -> String {
    let BitField { first, last, name, .. } = field;
    match upper(name) {
        words if !words.is_empty() => words,
        _ if first == last => format!("BIT_{first}"),
        _ => format!("BITS_{first}_TO_{last}"),
    }
}

/// Appends the value to names that occur more than once. If names are still equal, appends a number.
fn tell_apart(constants: &mut [Constant]) {
    let names: Vec<String> = constants.iter().map(|constant| constant.name.clone()).collect();
    let mut used = UsedNames::default();
    for constant in constants {
        if names.iter().filter(|name| **name == constant.name).count() > 1 {
            constant.name = format!("{}_{:02X}", constant.name, constant.value);
        }
        used.reserve(&mut constant.name);
    }
}

/// Converts to upper case, and replaces all other characters between letters and digits by a single `_`.
pub(crate) fn upper(text: &str) -> String {
    let words = text.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    words.map(str::to_ascii_uppercase).collect::<Vec<_>>().join("_")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::samples::tables::NODES as DEVICE;
    use crate::export::Scope;
    use crate::layout::Provenance;
    use std::collections::BTreeSet;

    fn constants(meaning: &str) -> Vec<(String, u32)> {
        let scope = Scope::new(&DEVICE, None).unwrap();
        let (meaning, _) = *scope.meanings().iter().find(|(known, _)| known.name == meaning).unwrap();
        of(meaning).into_iter().map(|constant| (constant.name, constant.value)).collect()
    }

    #[test]
    fn values_and_bits_are_named_by_their_meaning() {
        let pair = |name: &str, value| (name.to_owned(), value);
        let send = constants("send");
        assert!(send.contains(&pair("SEND_DATA_WRITTEN_TO_BE_SENT", 0x05)), "{send:?}");
        let error = constants("updown_error");
        assert!(!error.is_empty() && !error.iter().any(|(name, _)| name.contains("RESERVED")), "{error:?}");
        let word = constants("cfg_word");
        assert!(word.contains(&pair("CFG_WORD_NUMBER_MASK", 0x3C)), "{word:?}");
        assert!(word.contains(&pair("CFG_WORD_NUMBER_SHIFT", 2)), "{word:?}");
    }

    #[test]
    fn values_of_signed_registers_have_a_sign_and_bits_have_none() {
        let source = Provenance::Manual;
        let value = |first, text| ValueMeaning { id: "", first, last: first, text, reserved: false, source };
        let numbers = |bits| {
            let values = Box::leak(Box::new([value(0, "no error"), value(0xFFFF, "data error")]));
            let meaning = Meaning { name: "result", page: "1", handshake: None, values, bits };
            let of = Enumeration::of(&meaning, RegType::Int);
            of.members.into_iter().map(|(.., number, _)| number).collect::<Vec<_>>()
        };
        assert_eq!(numbers(&[]), [0, -1]);
        let upper = BitField {
            id: "",
            first: 8,
            last: 15,
            name: "upper",
            zero: "",
            one: "",
            text: "",
            values: &[],
            joined: false,
            reserved: false,
            source,
        };
        assert_eq!(numbers(Box::leak(Box::new([upper]))), [0, 0xFFFF, 0xFF00]);
    }

    #[test]
    fn names_have_no_prefix() {
        assert_eq!(own_name("SEND", "SEND_IDLE"), "IDLE");
        assert_eq!(own_name("TIME_PATTERN", "TIME_PATTERN_8_MS"), "VALUE_8_MS");
    }

    #[test]
    fn no_name_is_given_twice() {
        let mut names = BTreeSet::new();
        for (meaning, _) in Scope::new(&DEVICE, None).unwrap().meanings() {
            for constant in of(meaning) {
                assert!(names.insert(constant.name.clone()), "{}", constant.name);
            }
        }
        assert!(names.len() > 50);
    }
}
