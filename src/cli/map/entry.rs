//! Entries of the register map.

use crate::cli::table::Row;
use crate::layout::{
    Address, Area, BitField, DeviceFit, Meaning, Provenance, Register, RegisterRef, format_value,
};
use serde::Serialize;
use std::collections::BTreeMap;

/// A register, an array of registers, or an area of plain RAM.
#[derive(Serialize)]
pub(crate) struct Entry {
    /// Name with the block; the name of an array contains the index range.
    pub name: String,
    pub area: &'static str,
    /// Name of the structure; empty in plain RAM.
    pub structure: &'static str,
    /// The elements in use; all other elements are reserved. Empty if all elements are in use.
    pub used: String,
    /// Address of the (first) register.
    pub address: String,
    /// CPU address of the (first) register.
    pub cpu_address: String,
    /// Data type of the register.
    #[serde(rename = "type")]
    pub ty: String,
    /// The side that writes the register.
    pub owner: String,
    /// Value of the register after power-on.
    pub reset: String,
    /// True if the manual reserves the register.
    pub reserved: bool,
    /// Pages of the manual.
    pub page: &'static str,
    /// The sources of the facts.
    pub provenance: Sources,
    /// Purpose of the register.
    pub meaning: &'static str,
    /// Pages of the manual for values and bits; empty if the manual states none of them.
    pub meaning_page: &'static str,
    /// Values with a meaning.
    pub values: Vec<Value>,
    /// Bits with a meaning.
    pub bits: Vec<Bit>,
    /// The name of the variable in the manual; empty in plain RAM.
    pub variable: &'static str,
    #[serde(skip)]
    pub area_ref: &'static Area,
}

/// The source of each fact.
#[derive(Serialize)]
pub(crate) struct Sources {
    #[serde(flatten)]
    facts: BTreeMap<&'static str, String>,
    /// The source of each fact, in display order.
    #[serde(skip)]
    ordered: Vec<(&'static str, String)>,
    /// The sources of the inferred facts only.
    #[serde(skip)]
    short: String,
}

/// A value, or a range of values, with its meaning.
#[derive(Serialize)]
pub(crate) struct Value {
    /// Smallest value of the range that has the meaning.
    pub first: u32,
    /// Largest value of the range that has the meaning.
    pub last: u32,
    /// The values in IEC notation.
    pub hex: String,
    /// Meaning of the values; n is a placeholder for the value.
    pub meaning: String,
    /// The source of the meaning.
    pub provenance: String,
}

/// A bit, or a field of bits, with its meaning.
#[derive(Serialize)]
pub(crate) struct Bit {
    /// Number of the lowest bit of the field.
    pub first: u8,
    /// Number of the highest bit of the field.
    pub last: u8,
    /// Short name of the field of bits.
    pub name: &'static str,
    /// Meaning of the bit or field.
    pub meaning: String,
    /// The source of the meaning.
    pub provenance: String,
}

impl Row for Entry {
    const COLUMNS: &'static [&'static str] = &[
        "name",
        "structure",
        "address",
        "cpu_address",
        "type",
        "owner",
        "reset",
        "reserved",
        "page",
        "provenance",
        "meaning",
    ];

    fn cells(&self) -> Vec<String> {
        vec![
            self.name.clone(),
            self.structure.to_owned(),
            self.address.clone(),
            self.cpu_address.clone(),
            self.ty.clone(),
            self.owner.clone(),
            self.reset.clone(),
            self.reserved.to_string(),
            self.page.to_owned(),
            self.provenance.short.clone(),
            self.meaning.to_owned(),
        ]
    }
}

impl Entry {
    /// Returns the columns that fit on a terminal.
    pub(crate) fn text_cells(&self) -> Vec<String> {
        let page = if self.page.is_empty() { String::new() } else { format!("p. {}", self.page) };
        let meaning = self.meaning.to_owned();
        let texts = [&self.name, &self.address, &self.ty, &self.owner].map(Clone::clone);
        texts.into_iter().chain([page, self.provenance.short.clone(), meaning]).collect()
    }
}

impl Value {
    /// Returns the meaning, with its source if it is not the manual.
    pub(crate) fn described(&self) -> String {
        described(&self.meaning, &self.provenance)
    }
}

impl Bit {
    /// Returns the meaning, with its source if it is not the manual.
    pub(crate) fn described(&self) -> String {
        described(&self.meaning, &self.provenance)
    }
}

fn described(meaning: &str, source: &str) -> String {
    if source == "manual" { meaning.to_owned() } else { format!("{meaning} ({source})") }
}

impl Sources {
    fn of(of: &RegisterRef) -> Self {
        let RegisterRef { area, placed, register, .. } = *of;
        let names = [("area", area.name_from), ("structure", placed.structure.name_from)];
        let mut ordered = names.map(|(fact, from)| (fact, from.to_string())).to_vec();
        ordered.extend(register.facts().map(|(fact, from)| (fact, from.to_string())));
        if !register.group.is_empty() {
            ordered.push(("group_type", register.group_type_from.to_string()));
        }
        Self { facts: ordered.iter().cloned().collect(), ordered, short: register.provenance() }
    }

    pub(crate) fn all(&self) -> &[(&'static str, String)] {
        &self.ordered
    }

    /// Returns `manual`, or the inferred facts about the register with their decisions.
    pub(crate) fn short(&self) -> &str {
        &self.short
    }
}

/// Returns all entries of an area; a register that several structures of the area share is listed once.
pub(crate) fn of_area(fitted: &DeviceFit, area: &'static Area) -> Vec<Entry> {
    if area.structures.is_empty() {
        return vec![plain(area)];
    }
    firsts(fitted, area).iter().map(of_array).collect()
}

/// Returns the registers of an area, only the first element of each array; a register that several structures share is
/// listed once.
pub(crate) fn firsts(fitted: &DeviceFit, area: &'static Area) -> Vec<RegisterRef> {
    let mut firsts: Vec<RegisterRef> = Vec::new();
    let role = fitted.area(area).role();
    for placed in fitted.placed(area) {
        for register in placed.structure.registers {
            let same = |known: &RegisterRef| {
                (known.register.name, known.register.offset) == (register.name, register.offset)
            };
            if !firsts.iter().any(same) {
                firsts.push(RegisterRef { area, placed, register, index: [0; 2], role });
            }
        }
    }
    firsts
}

/// Returns the entries of registers; the registers of a whole array become one entry.
pub(crate) fn of_registers(registers: &[RegisterRef]) -> Vec<Entry> {
    let mut entries = Vec::new();
    let mut rest = registers;
    while let Some(first) = rest.first() {
        let same = |other: &&RegisterRef| core::ptr::eq(other.register, first.register);
        let count = registers.iter().filter(same).count();
        let whole: usize = first.register.dims.iter().map(|dim| usize::from(dim.count)).product();
        let is_first = registers.iter().position(|other| same(&other)) == Some(registers.len() - rest.len());
        if count < whole || count == 1 {
            entries.push(of_register(first));
        } else if is_first {
            entries.push(of_array(&RegisterRef { index: [0; 2], ..*first }));
        }
        rest = rest.get(1..).unwrap_or_default();
    }
    entries
}

/// Returns the entry of bit `bit` of a register, at this address.
pub(crate) fn of_bit(register: &RegisterRef, bit: u32, address: &Address) -> Entry {
    let whole = of_register(register);
    let reset = register.reset() >> bit & 1;
    let is_own = |own: &Bit| (u32::from(own.first)..=u32::from(own.last)).contains(&bit);
    Entry {
        name: format!("{}.{bit}", whole.name),
        address: address.to_string(),
        cpu_address: register.area.cpu_address(address.offset()),
        ty: "BOOL".to_owned(),
        reset: reset.to_string(),
        values: Vec::new(),
        bits: whole.bits.into_iter().filter(is_own).collect(),
        ..of_register(register)
    }
}

/// Returns the entry of a single register.
pub(crate) fn of_register(register: &RegisterRef) -> Entry {
    Entry {
        name: register.name(),
        address: register.address().to_string(),
        cpu_address: register.area.cpu_address(register.offset()),
        reserved: register.is_reserved(),
        used: String::new(),
        ..of_array(register)
    }
}

/// Returns the entry of a register, or of the whole array that begins with `first`.
pub(crate) fn of_array(first: &RegisterRef) -> Entry {
    let RegisterRef { area, register, .. } = *first;
    Entry {
        name: format!("{}.{}", first.front(), register.pattern()),
        area: area.name,
        structure: first.structure().name,
        variable: first.placed.variable,
        used: used(register),
        address: first.address().to_string(),
        cpu_address: area.cpu_address(first.offset()),
        ty: register.ty.name().to_owned(),
        owner: register.owner.to_string(),
        reset: format_value(register.ty, register.reset),
        reserved: register.reserved,
        page: register.page,
        provenance: Sources::of(first),
        meaning: register.doc,
        meaning_page: register.meaning.map_or("", |meaning| meaning.page),
        values: values(register),
        bits: register.meaning.map(bits).unwrap_or_default(),
        area_ref: area,
    }
}

fn plain(area: &'static Area) -> Entry {
    // The manual documents the address of plain RAM, but not its content.
    let ours = Provenance::Inferred("D-330");
    let facts = [("offset", Provenance::Manual), ("type", ours), ("owner", ours), ("reset", ours)];
    let named: Vec<_> = [("area", area.name_from)].into_iter().chain(facts).collect();
    let ordered: Vec<_> = named.into_iter().map(|(fact, from)| (fact, from.to_string())).collect();
    Entry {
        name: area.name.to_owned(),
        area: area.name,
        structure: "",
        variable: "",
        used: String::new(),
        address: area.begin(),
        cpu_address: area.cpu_address(area.first),
        ty: format!("BYTE[{}]", area.bytes),
        owner: "both".to_owned(),
        reset: "16#00".to_owned(),
        reserved: false,
        page: area.page,
        provenance: Sources {
            facts: ordered.iter().cloned().collect(),
            ordered,
            short: Provenance::summary(&facts),
        },
        meaning: area.doc,
        meaning_page: area.page,
        values: Vec::new(),
        bits: Vec::new(),
        area_ref: area,
    }
}

fn used(register: &Register) -> String {
    if register.dims.iter().all(|dim| dim.used == dim.count) {
        return String::new();
    }
    register.dims.iter().map(|dim| format!("[0..{}]", dim.used.saturating_sub(1))).collect()
}

fn values(register: &Register) -> Vec<Value> {
    let known = register.meaning.map(|meaning| meaning.values).unwrap_or_default();
    let value = |known: &crate::layout::ValueMeaning| {
        let [first, last] = [known.first, known.last].map(|value| format_value(register.ty, value));
        let hex = if first == last { first } else { format!("{first}-{last}") };
        let meaning = known.text.replace("{}", "n");
        Value { first: known.first, last: known.last, hex, meaning, provenance: known.source.to_string() }
    };
    known.iter().map(value).collect()
}

fn bits(meaning: &'static Meaning) -> Vec<Bit> {
    let bit = |field: &'static BitField| {
        let mut texts = field.texts();
        if field.reserved {
            texts.push("reserved".to_owned());
        }
        let BitField { first, last, name, source, .. } = *field;
        Bit { first, last, name, meaning: texts.join("; "), provenance: source.to_string() }
    };
    meaning.bits.iter().map(bit).collect()
}
