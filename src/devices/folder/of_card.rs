//! Facts about the registers of an option card, in the layout of its controller. The pages and decisions of a layout are
//! those of the controller's manual, so the facts of a card name the card's manual and folder: `1 of encoder-1.0`.

use super::tables::leaked;
use crate::layout::{
    Area, AreaStructure, BitField, DeviceLayout, Meaning, Phases, Provenance, Register, Structure,
    ValueMeaning,
};

/// The name of an area of a card in its controller is the name in the card, with the number of the interface.
const NAME: Provenance = Provenance::Inferred("D-815");

/// Copies the facts of a card. The copies are never freed, as all layouts.
pub(super) struct CardFacts {
    card: &'static DeviceLayout,
    structures: Vec<(&'static Structure, &'static Structure)>,
    meanings: Vec<(&'static Meaning, &'static Meaning)>,
}

impl CardFacts {
    pub(super) const fn of(card: &'static DeviceLayout) -> Self {
        CardFacts { card, structures: Vec::new(), meanings: Vec::new() }
    }

    pub(super) fn is_of(&self, card: &DeviceLayout) -> bool {
        core::ptr::eq(self.card, card)
    }

    /// Returns an area at the option interface `number`. Its place is that in the card.
    pub(super) fn area(&mut self, area: &Area, number: u8) -> Area {
        let structures = area.structures.iter().map(|placed| self.placed(placed, number)).collect();
        Area {
            name: text(format!("{}{number}", area.name)),
            name_from: NAME,
            page: self.page(area.page),
            phases: area.phases.map(|phases| self.phases(phases)),
            structures: leaked(structures),
            ..*area
        }
    }

    /// Two equal cards have different variables, too.
    fn placed(&mut self, placed: &AreaStructure, number: u8) -> AreaStructure {
        AreaStructure {
            structure: self.structure(placed.structure),
            variable: text(format!("{}{number}", placed.variable)),
            variable_from: NAME,
            ..*placed
        }
    }

    fn structure(&mut self, structure: &'static Structure) -> &'static Structure {
        let known = self.structures.iter().find(|(known, _)| core::ptr::eq(*known, structure));
        if let Some((_, copy)) = known {
            return copy;
        }
        let registers = structure.registers.iter().map(|register| self.register(register)).collect();
        let copy: &'static Structure = Box::leak(Box::new(Structure {
            page: self.page(structure.page),
            name_from: self.from(structure.name_from),
            registers: leaked(registers),
            ..*structure
        }));
        self.structures.push((structure, copy));
        copy
    }

    fn register(&mut self, register: &Register) -> Register {
        Register {
            group_type_from: self.from(register.group_type_from),
            page: self.page(register.page),
            meaning: register.meaning.map(|meaning| self.meaning(meaning)),
            name_from: self.from(register.name_from),
            offset_from: self.from(register.offset_from),
            type_from: self.from(register.type_from),
            owner_from: self.from(register.owner_from),
            reset_from: self.from(register.reset_from),
            ..*register
        }
    }

    fn meaning(&mut self, meaning: &'static Meaning) -> &'static Meaning {
        let known = self.meanings.iter().find(|(known, _)| core::ptr::eq(*known, meaning));
        if let Some((_, copy)) = known {
            return copy;
        }
        let bits = meaning.bits.iter().map(|bits| BitField {
            values: self.values(bits.values),
            source: self.from(bits.source),
            ..*bits
        });
        let copy: &'static Meaning = Box::leak(Box::new(Meaning {
            page: self.page(meaning.page),
            values: self.values(meaning.values),
            bits: leaked(bits.collect()),
            ..*meaning
        }));
        self.meanings.push((meaning, copy));
        copy
    }

    fn values(&self, values: &[ValueMeaning]) -> &'static [ValueMeaning] {
        let value = |value: &ValueMeaning| ValueMeaning { source: self.from(value.source), ..*value };
        leaked(values.iter().map(value).collect())
    }

    fn phases(&self, phases: &'static Phases) -> &'static Phases {
        Box::leak(Box::new(Phases { source: self.from(phases.source), ..*phases }))
    }

    /// Pages are numbers and ranges; a fact without a page stays so.
    fn page(&self, page: &'static str) -> &'static str {
        if page.is_empty() { page } else { text(format!("{page} of {}", self.card.manual)) }
    }

    /// The decisions of a folder have numbers of their own.
    fn from(&self, from: Provenance) -> Provenance {
        match from {
            Provenance::Inferred(decision) => {
                Provenance::Inferred(text(format!("{decision} of {}", self.card.name)))
            }
            documented => documented,
        }
    }
}

fn text(text: String) -> &'static str {
    Box::leak(text.into_boxed_str())
}
