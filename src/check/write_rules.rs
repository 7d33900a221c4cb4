//! The rules for writes of a register, from the register map.

use super::rules;
use crate::journal::Rule;
use crate::layout::{BitField, Meaning, Owner, RegisterRef};

/// What a program must not do with a register.
#[derive(Clone, Copy, Debug)]
pub(crate) enum WriteRule {
    /// Each write breaks this rule.
    Never(&'static Rule),
    /// The manual reserves bits or values.
    Reserved(&'static Meaning),
}

impl WriteRule {
    /// Returns the rule of a register; `None` if a program may write any value.
    pub(crate) fn of(register: &RegisterRef) -> Option<Self> {
        if register.is_reserved() {
            return Some(WriteRule::Never(&rules::RESERVED_REGISTER));
        }
        if register.owner() == Owner::Firmware {
            return Some(WriteRule::Never(&rules::OWNER));
        }
        register.register.meaning.filter(|meaning| has_reserved(meaning)).map(WriteRule::Reserved)
    }

    /// Returns the rule that a write of `value` breaks.
    pub(crate) fn broken_by(self, value: u32) -> Option<&'static Rule> {
        match self {
            WriteRule::Never(rule) => Some(rule),
            WriteRule::Reserved(meaning) => reserved(meaning, value),
        }
    }
}

fn has_reserved(meaning: &Meaning) -> bool {
    let of_bits = |bits: &BitField| bits.reserved || bits.values.iter().any(|it| it.reserved);
    meaning.values.iter().any(|value| value.reserved) || meaning.bits.iter().any(of_bits)
}

/// Returns the rule for reserved bits or values that `value` breaks. A meaning of the whole value has priority over
/// the bits.
fn reserved(meaning: &Meaning, value: u32) -> Option<&'static Rule> {
    if let Some(whole) = meaning.value(value) {
        return whole.reserved.then_some(&rules::RESERVED_VALUE);
    }
    if meaning.bits.iter().any(|bits| bits.reserved && bits.of(value) != 0) {
        return Some(&rules::RESERVED_BIT);
    }
    let of_field = |bits: &BitField| bits.value(bits.of(value)).is_some_and(|it| it.reserved);
    meaning.bits.iter().any(of_field).then_some(&rules::RESERVED_VALUE)
}
