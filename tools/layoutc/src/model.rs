//! The checked layout: every offset, width and reference has passed the checks of this crate.

pub(crate) use crate::gsd::Gsd;
pub(crate) use crate::objects::Object;
pub use crate::raw::{Letter, Owner, Provenance, Role, Unit};

/// A whole device, or a family: structures without areas.
pub struct Device {
    /// Name, letter for letter as in the manual.
    pub name: String,
    /// The vendor's name of the device.
    pub title: String,
    /// Number of the manual that pages refer to.
    pub manual: String,
    /// Facts that the manual does not state about the whole device; empty if none.
    pub undocumented: String,
    /// Name of the family to which the `shared` structures and meanings belong.
    pub family: Option<String>,
    /// Lowest number of the switches.
    pub dip_first: u8,
    /// Highest number of the switches.
    pub dip_last: u8,
    /// Meanings of values and bits.
    pub meanings: Vec<Meaning>,
    /// Types of registers that are structures.
    pub substructures: Vec<Structure>,
    /// Structures of registers.
    pub structures: Vec<Structure>,
    /// Address spaces in the order of the files; they do not overlap in the image.
    pub spaces: Vec<Space>,
    /// Areas in ascending order.
    pub areas: Vec<Area>,
    /// The area with a size that each plant sets, and its default size in bytes.
    pub retain: Option<(Area, u32)>,
    /// Object dictionary of the device, in ascending order.
    pub(crate) objects: Vec<Object>,
    /// Properties of a PROFIBUS-DP slave that masters need.
    pub(crate) gsd: Option<Gsd>,
    /// Words of the front panel in the header page, in ascending order.
    pub front: Vec<FrontWord>,
    /// Ports in the order of their numbers.
    pub ports: Vec<Port>,
    /// The area of the device's own interface, index into [`Device::areas`].
    pub own: Option<usize>,
    pub(crate) baud_rates: Vec<BaudRate>,
    /// Phases, if structures overlay each other.
    pub phases: Option<Phases>,
}

/// The phases: which of the structures that overlay each other is valid.
pub struct Phases {
    /// Name of the register that shows the phase.
    pub register: String,
    /// Source of the fact.
    pub source: Provenance,
    /// True if the family declares the phases.
    pub shared: bool,
    /// The phases in ascending order of their values. Phase number n is entry n - 1.
    pub values: Vec<Phase>,
}

/// One of the phases.
pub struct Phase {
    /// Name, letter for letter as in the manual.
    pub name: String,
    /// First value of the register; the phase ends before the first value of the next one.
    pub from: u32,
    /// End of the names of variables that the manual does not name.
    pub variable: String,
    /// Purpose, as text for the documentation.
    pub doc: String,
}

impl Device {
    /// Returns the name of a phase. The name of phase 0 is `always`.
    pub(crate) fn phase_name(&self, number: usize) -> &str {
        let phase = self.phases.as_ref().and_then(|phases| phases.values.get(number.checked_sub(1)?));
        phase.map_or(ALWAYS, |phase| &phase.name)
    }
}

/// Name of phase 0, in which structures without a phase are valid.
pub(crate) const ALWAYS: &str = "always";

/// A word of the front panel in the header page.
pub struct FrontWord {
    /// Name, letter for letter as in the manual.
    pub name: String,
    /// Data type of the register.
    pub scalar: Scalar,
    /// First byte in the front panel.
    pub offset: u32,
    /// Owner of the word: the side that writes it.
    pub owner: Owner,
    /// Index into [`Device::meanings`].
    pub meaning: Option<usize>,
    /// True if the word contains four characters of a text.
    pub is_text: bool,
    /// Source of the fact.
    pub source: Provenance,
    /// Pages of the manual.
    pub page: String,
    /// Purpose, as text for the documentation.
    pub doc: String,
}

/// The device's connection to a medium.
pub struct Port {
    /// Name, letter for letter as in the manual.
    pub name: String,
    /// Number of the port, from 1.
    pub number: u8,
    /// Kind of the medium.
    pub medium: String,
    /// Possible roles at the medium.
    pub roles: Vec<Role>,
    /// Index of the area of its registers in [`Device::areas`]; `None` for a port of a device in a folder, which has no
    /// registers.
    pub area: Option<usize>,
}

/// One line of the timing table as Rust source: names and values of its fields.
pub(crate) struct BaudRate {
    pub numbers: Vec<(&'static str, u32)>,
    pub deadlines: Vec<(&'static str, Deadline)>,
}

/// Limits of a time in microseconds after the start of the event task. Both are equal for a single time.
pub(crate) struct Deadline {
    pub earliest: u32,
    pub latest: u32,
    pub source: Provenance,
}

/// A range of addresses with one notation.
pub struct Space {
    /// Name, letter for letter as in the manual.
    pub name: String,
    /// Letter after the `%` of an address.
    pub letter: Letter,
    /// Number between the width and the address, if the notation has one.
    pub segment: Option<u16>,
    /// Unit of the number in an address.
    pub unit: Unit,
    /// Number of the first byte or word.
    pub first: u32,
    /// Offset in the image in bytes.
    pub offset: u32,
    /// Length in bytes.
    pub bytes: u32,
    /// Pages of the manual.
    pub page: String,
    /// Purpose, as text for the documentation.
    pub doc: String,
}

impl Space {
    /// Returns the number of bytes between two consecutive numbers of addresses.
    pub(crate) fn unit_bytes(&self) -> u32 {
        match self.unit {
            Unit::Byte => 1,
            Unit::Word => 2,
        }
    }

    /// Returns the byte of the image at address number `number`. `None` if the space begins after this number.
    pub(crate) fn place(&self, number: u32) -> Option<u32> {
        let bytes = number.checked_sub(self.first)?.checked_mul(self.unit_bytes())?;
        self.offset.checked_add(bytes)
    }

    /// Returns the end of the space in the image: the offset after its last byte.
    pub(crate) fn end(&self) -> u64 {
        u64::from(self.offset) + u64::from(self.bytes)
    }
}

/// A range of addresses with a purpose.
pub struct Area {
    /// Name, letter for letter as in the manual.
    pub name: String,
    /// Source of the name.
    pub name_from: Provenance,
    /// Index into [`Device::spaces`].
    pub space: usize,
    /// First byte in the image.
    pub first: u32,
    /// Length in bytes.
    pub bytes: u32,
    /// First and last CPU address, if the manual gives them.
    pub cpu: Option<(u32, u32)>,
    /// Pages of the manual.
    pub page: String,
    /// Purpose, as text for the documentation.
    pub doc: String,
    /// Structures of registers.
    pub structures: Vec<AreaStructure>,
}

/// A structure in an area.
pub struct AreaStructure {
    /// Index into [`Device::structures`].
    pub structure: usize,
    /// Number of the phase in which the structure is valid, from 1; 0 if it is always valid.
    pub live: usize,
    /// Role that the port of this area must have; `None` for any role.
    pub role: Option<Role>,
    /// Name of the variable that the application declares for the structure.
    pub variable: String,
    /// Source of the variable's name.
    pub variable_from: Provenance,
    /// Names of the structure's registers that are unused in this area.
    pub unused: Vec<String>,
}

/// A structure or sub-structure: fields in ascending order that cover `0..size` without a gap.
pub struct Structure {
    /// Name, letter for letter as in the manual.
    pub name: String,
    /// Source of the name.
    pub name_from: Provenance,
    /// Length in bytes.
    pub size: u32,
    /// Alignment in bytes.
    pub align: u32,
    /// Pages of the manual.
    pub page: String,
    /// Purpose, as text for the documentation.
    pub doc: String,
    /// True if the meaning belongs to the family.
    pub shared: bool,
    /// The family's structure as which this structure can be viewed: an index into [`Device::structures`].
    pub view: Option<usize>,
    /// Fields in ascending order.
    pub fields: Vec<Field>,
}

/// A register, an array of registers, or padding.
pub struct Field {
    /// Name, letter for letter as in the manual.
    pub name: String,
    /// Name in the structure of `view`.
    pub view_name: String,
    /// First byte in the structure.
    pub offset: u32,
    /// Data type, or padding.
    pub kind: FieldType,
    /// Bounds of the array; empty for a single register.
    pub dims: Vec<u32>,
    /// One index for each dimension in `dims`: elements below this index are used, the elements from it on are
    /// reserved.
    pub used: Vec<u32>,
    /// The manual's name of the type of the whole array; empty if the name follows the pattern.
    pub array_type: String,
    /// Another name of the register in the manual; empty if none.
    pub also: String,
    /// True if the manual reserves the bits.
    pub reserved: bool,
    /// Owner of the register: the side that writes it.
    pub owner: Owner,
    /// Value after power-on, in two's complement.
    pub reset: u32,
    /// Pages of the manual.
    pub page: String,
    /// Purpose, as text for the documentation.
    pub doc: String,
    /// Index into [`Device::meanings`].
    pub meaning: Option<usize>,
    /// Source of the name.
    pub name_from: Provenance,
    /// Source of the offset.
    pub offset_from: Provenance,
    /// Source of the data type.
    pub type_from: Provenance,
    /// Source of the owner.
    pub owner_from: Provenance,
    /// Source of the reset value.
    pub reset_from: Provenance,
}

impl Field {
    /// Sources of the name, the offset and the type of a register. The register is this field of a structure or, with `group`, of
    /// the sub-structure that is the field `group` of a structure.
    #[must_use]
    pub fn sources(&self, group: Option<&Field>) -> [Provenance; 3] {
        let own = [&self.name_from, &self.offset_from, &self.type_from];
        let Some(group) = group else { return own.map(Clone::clone) };
        let of_group = [&group.name_from, &group.offset_from, &group.type_from];
        [0, 1, 2].map(|fact| of_group[fact].and(own[fact]))
    }
}

/// A dimension of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dim {
    /// Number of elements of the array.
    pub count: u32,
    /// Elements from this index on are reserved.
    pub used: u32,
    /// Distance from element to element in bytes.
    pub stride: u32,
}

/// Data type of a field.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum FieldType {
    /// An elementary data type.
    Scalar(Scalar),
    /// Index into [`Device::substructures`].
    Sub(usize),
    /// Bytes without a register.
    Padding(u32),
}

/// The elementary data types (manual 5.00005.03a p. 144).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Scalar {
    /// 8 bits.
    Byte,
    /// 16 bits.
    Word,
    /// 32 bits.
    Dword,
    /// 8 bits, signed.
    Sint,
    /// 16 bits, signed.
    Int,
    /// 32 bits, signed.
    Dint,
    /// 8 bits, unsigned.
    Usint,
    /// 16 bits, unsigned.
    Uint,
    /// 32 bits, unsigned.
    Udint,
}

impl Scalar {
    /// For each type: its name, the short name before register names, the width in bytes.
    const TABLE: [(Scalar, &'static str, &'static str, u32); 9] = [
        (Scalar::Byte, "BYTE", "b", 1),
        (Scalar::Word, "WORD", "w", 2),
        (Scalar::Dword, "DWORD", "d", 4),
        (Scalar::Sint, "SINT", "si", 1),
        (Scalar::Int, "INT", "i", 2),
        (Scalar::Dint, "DINT", "di", 4),
        (Scalar::Usint, "USINT", "us", 1),
        (Scalar::Uint, "UINT", "u", 2),
        (Scalar::Udint, "UDINT", "ud", 4),
    ];

    pub(crate) fn named(name: &str) -> Option<Self> {
        Self::TABLE.iter().find(|row| row.1 == name).map(|row| row.0)
    }

    fn row(self) -> &'static (Scalar, &'static str, &'static str, u32) {
        &Self::TABLE[self as usize]
    }

    pub(crate) fn name(self) -> &'static str {
        self.row().1
    }

    /// Returns the short names of all types.
    pub(crate) fn prefixes() -> impl Iterator<Item = &'static str> {
        Self::TABLE.iter().map(|row| row.2)
    }

    pub(crate) fn prefix(self) -> &'static str {
        self.row().2
    }

    /// Returns the width in bytes, which is also the alignment.
    pub(crate) fn width(self) -> u32 {
        self.row().3
    }

    pub(crate) fn signed(self) -> bool {
        matches!(self, Scalar::Sint | Scalar::Int | Scalar::Dint)
    }

    /// Returns the type of a cell's content in generated code: bits, without a sign.
    pub(crate) fn content(self) -> &'static str {
        match self.width() {
            1 => "u8",
            2 => "u16",
            _ => "u32",
        }
    }

    /// Returns the name of the type in generated code.
    pub(crate) fn variant(self) -> String {
        format!("{self:?}")
    }
}

/// Meanings of the values and bits of a register.
pub struct Meaning {
    /// Name, letter for letter as in the manual.
    pub name: String,
    /// Manuals with the pages on which they state the meaning; empty if no manual states it.
    pub pages: Vec<(String, String)>,
    /// True if the meaning belongs to the family.
    pub shared: bool,
    /// Type of the constants for values and bits with an `id`; `None` if there are no constants.
    pub scalar: Option<Scalar>,
    /// Values of a request and of its answer.
    pub handshake: Option<(u32, u32)>,
    /// Meanings of values as a whole.
    pub values: Vec<Value>,
    /// Meanings of bits, in ascending order.
    pub bits: Vec<Bit>,
}

impl Meaning {
    /// Returns the pages of this manual that state the meaning; empty if it does not.
    pub fn page_in(&self, manual: &str) -> &str {
        self.pages.iter().find(|(known, _)| known == manual).map_or("", |(_, pages)| pages)
    }

    /// True if a manual states a part of the meaning.
    pub(crate) fn is_documented(&self) -> bool {
        self.sources().any(|source| *source == Provenance::Manual)
    }

    /// Returns the sources of all values and bits.
    pub(crate) fn sources(&self) -> impl Iterator<Item = &Provenance> {
        let of_bits = self
            .bits
            .iter()
            .flat_map(|bit| bit.values.iter().map(|value| &value.source).chain([&bit.source]));
        self.values.iter().map(|value| &value.source).chain(of_bits)
    }
}

/// A value, or a range of values, with its meaning.
pub struct Value {
    /// Name in generated code.
    pub id: Option<String>,
    /// Lowest bit.
    pub first: u32,
    /// Highest bit.
    pub last: u32,
    /// Text of the meaning; `{}` stands for the value.
    pub text: String,
    /// True if the manual reserves the bits.
    pub reserved: bool,
    /// Source of the fact.
    pub source: Provenance,
}

/// A bit, or a field of bits, with its meaning.
pub struct Bit {
    /// Name in generated code.
    pub id: Option<String>,
    /// Lowest bit.
    pub first: u8,
    /// Highest bit.
    pub last: u8,
    /// Name, letter for letter as in the manual.
    pub name: String,
    /// Meaning of a single bit with value 0.
    pub zero: String,
    /// Meaning of a single bit with value 1.
    pub one: String,
    /// Text of the meaning; `{}` stands for the value.
    pub text: String,
    /// Meanings of values as a whole.
    pub values: Vec<Value>,
    /// True if the text continues the text of the previous field without a comma.
    pub joined: bool,
    /// True if the manual reserves the bits.
    pub reserved: bool,
    /// Source of the fact.
    pub source: Provenance,
}

impl Device {
    /// Structures and sub-structures that become types of the device's own module.
    pub(crate) fn own_types(&self) -> impl Iterator<Item = &Structure> {
        self.substructures.iter().chain(&self.structures).filter(|structure| !structure.shared)
    }

    /// Returns the structures and sub-structures of the family that the device uses.
    pub(crate) fn used_shared_types(&self) -> impl Iterator<Item = &Structure> {
        self.used_types().filter(|structure| structure.shared)
    }

    /// Returns the structures in the areas with their sub-structures; for a family, all structures.
    pub fn used_types(&self) -> impl Iterator<Item = &Structure> {
        let in_areas = |index: usize| {
            self.areas.iter().flat_map(|area| &area.structures).any(|placed| placed.structure == index)
        };
        let counts = move |index: usize| !self.structures[index].shared || in_areas(index);
        let has = move |sub: usize| {
            let used = self.structures.iter().enumerate().filter(move |(index, _)| counts(*index));
            used.flat_map(|(_, structure)| &structure.fields).any(|field| field.kind == FieldType::Sub(sub))
        };
        let subs = self.substructures.iter().enumerate();
        let subs = subs.filter(move |(index, sub)| !sub.shared || has(*index)).map(|(_, sub)| sub);
        let structures = self.structures.iter().enumerate();
        subs.chain(structures.filter(move |(index, _)| counts(*index)).map(|(_, structure)| structure))
    }

    /// Returns the dimensions of `field` alone, outermost first.
    #[must_use]
    pub fn dims(&self, field: &Field) -> Vec<Dim> {
        let mut stride = self.size(field);
        let rows = field.dims.iter().zip(&field.used);
        rows.map(|(&count, &used)| {
            stride /= count;
            Dim { count, used, stride }
        })
        .collect()
    }

    /// Returns the number of bytes of `field` with all its elements.
    pub(crate) fn size(&self, field: &Field) -> u32 {
        field.size(&self.substructures)
    }
}

impl Field {
    pub(crate) fn is_padding(&self) -> bool {
        matches!(self.kind, FieldType::Padding(_))
    }

    pub(crate) fn size(&self, subs: &[Structure]) -> u32 {
        // The sum saturates: the structure then refuses the size, because it is too large.
        self.dims.iter().fold(element_size(self.kind, subs), |size, n| size.saturating_mul(*n))
    }

    pub(crate) fn align(&self, subs: &[Structure]) -> u32 {
        match self.kind {
            FieldType::Scalar(scalar) => scalar.width(),
            FieldType::Sub(index) => subs[index].align,
            FieldType::Padding(_) => 1,
        }
    }
}

fn element_size(kind: FieldType, subs: &[Structure]) -> u32 {
    match kind {
        FieldType::Scalar(scalar) => scalar.width(),
        FieldType::Sub(index) => subs[index].size,
        FieldType::Padding(bytes) => bytes,
    }
}
