//! Descriptors: what the layout files say about areas, structures and registers, as static data.

use super::error::LayoutError;
use super::space::{Retain, Space};
use core::fmt;
use core::ops::RangeInclusive;

/// A device: its areas and what lies in them.
pub struct Device {
    /// Name of the layout, `omega-drive-line-2`.
    pub name: &'static str,
    /// The vendor's name of the device.
    pub title: &'static str,
    /// Number of the manual that the pages refer to.
    pub manual: &'static str,
    /// Hash over everything that affects addresses or widths.
    pub layout_hash: u64,
    /// The spaces of addresses.
    pub spaces: &'static [Space],
    /// The areas in ascending order.
    pub areas: &'static [Area],
    /// The area whose size each plant sets, if there is one.
    pub retain: Option<&'static Retain>,
    /// The ports in the order of their numbers.
    pub ports: &'static [Port],
    /// The area of its own interface, by whose name the device itself goes where ports go by theirs.
    pub own: Option<&'static Area>,
}

/// The same registers at the same places.
impl PartialEq for Device {
    fn eq(&self, other: &Self) -> bool {
        (self.name, self.layout_hash) == (other.name, other.layout_hash)
    }
}

impl Eq for Device {}

impl Device {
    /// A device that nothing is known about: without areas, so that none of its registers has a name.
    pub const UNKNOWN: Device = Device {
        name: "unknown",
        title: "unknown device",
        manual: "",
        layout_hash: 0,
        spaces: &[],
        areas: &[],
        retain: None,
        ports: &[],
        own: None,
    };

    /// The port called `name`.
    #[must_use]
    pub fn port(&self, name: &str) -> Option<&'static Port> {
        self.ports.iter().find(|port| port.name == name)
    }

    /// The port that a user calls `name`.
    ///
    /// # Errors
    /// [`LayoutError::UnknownPort`] with all ports.
    pub fn port_named(&self, name: &str) -> Result<&'static Port, LayoutError> {
        self.port(name).ok_or_else(|| {
            let known: Vec<_> = self.ports.iter().map(|port| port.name).collect();
            LayoutError::UnknownPort { port: name.to_owned(), known: known.join(", ") }
        })
    }

    /// The first port that can be the master of its medium: the one meant where none is named.
    #[must_use]
    pub fn first_master(&self) -> Option<&'static Port> {
        self.ports.iter().find(|port| port.roles.contains(&Role::Master))
    }

    /// The port with this number, from 1.
    #[must_use]
    pub fn port_numbered(&self, number: u8) -> Option<&'static Port> {
        self.ports.iter().find(|port| port.number == number)
    }
}

/// The device's end of a medium.
pub struct Port {
    /// Its name, for example `node2`.
    pub name: &'static str,
    /// Its number in journals and on the channel, from 1; 0 stands for the device itself.
    pub number: u8,
    /// Kind of medium, for example `cansync`.
    pub medium: &'static str,
    /// What the port can be there.
    pub roles: &'static [Role],
    /// Where its registers lie.
    pub area: &'static Area,
}

impl Port {
    /// What the port is at its medium, if it can be one thing only.
    #[must_use]
    pub const fn role(&self) -> Option<Role> {
        match self.roles {
            [role] => Some(*role),
            _ => None,
        }
    }
}

/// What a port is at its medium.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Role {
    /// It governs the medium.
    Master,
    /// It answers a master.
    Slave,
    /// One of several with equal rights.
    Peer,
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Role::Master => "master",
            Role::Slave => "slave",
            Role::Peer => "peer",
        })
    }
}

/// A stretch of addresses with a purpose.
pub struct Area {
    /// Name in register names, for example `node2`.
    pub name: &'static str,
    /// Where the name is from.
    pub name_from: Provenance,
    /// The space that it is in.
    pub space: &'static Space,
    /// First byte in the image.
    pub first: u32,
    /// Size in bytes.
    pub bytes: u32,
    /// First and last CPU address, if the manual gives them.
    pub cpu: Option<(u32, u32)>,
    /// What the area is for.
    pub doc: &'static str,
    /// Page of the manual.
    pub page: &'static str,
    /// The structures, all starting at the area's first byte. None: plain RAM.
    pub structures: &'static [Placed],
}

impl Area {
    /// Last byte in the image.
    #[must_use]
    pub const fn last(&self) -> u32 {
        self.first + (self.bytes - 1)
    }

    /// The address that it begins at: `%MB3.200000`, `%MW2000`.
    #[must_use]
    pub fn begin(&self) -> String {
        self.space.named(self.first)
    }

    /// The address of its last byte, or of the word that it is in.
    #[must_use]
    pub fn end(&self) -> String {
        self.space.named(self.last())
    }

    /// The numbers of its bytes, or of its words where those are counted.
    #[must_use]
    pub const fn numbers(&self) -> RangeInclusive<u32> {
        self.space.numbers(self.first, self.last())
    }

    /// Where the CPU finds byte `offset` of the image, one of this area's: `16#B414A004`; empty if the manual does not say.
    #[must_use]
    pub fn cpu_address(&self, offset: u32) -> String {
        self.cpu.map_or(String::new(), |(first, _)| format!("16#{:08X}", first + (offset - self.first)))
    }

    /// Whether the area has byte `offset` of the image.
    #[must_use]
    pub const fn contains(&self, offset: u32) -> bool {
        self.first <= offset && offset <= self.last()
    }
}

/// Only the names: the tables are long.
macro_rules! short_debug {
    ($($ty:ident),*) => {$(
        impl fmt::Debug for $ty {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.debug_struct(stringify!($ty)).field("name", &self.name).finish_non_exhaustive()
            }
        }
    )*};
}
short_debug!(Device, Area, Port, Structure);

/// A structure in an area.
#[derive(Debug)]
pub struct Placed {
    /// The structure.
    pub structure: &'static Structure,
    /// When the structure is the valid one of those that overlay each other.
    pub live: Live,
    /// What the port of this area must be for the structure to lie there; `None`: anything.
    pub role: Option<Role>,
    /// Name of the variable that the application declares there, the manual's where it has one.
    pub variable: &'static str,
    /// Where the name of the variable is from.
    pub variable_from: Provenance,
    /// Registers of the structure that nobody uses in this area: other structures may have registers of
    /// another width there, and theirs is the one that counts.
    pub unused: &'static [&'static str],
}

/// When a structure is valid: INIT and cyclic structure of a CANsync node overlay the same RAM.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Live {
    /// Always.
    Always,
    /// Until the node has taken over its initialization data.
    Init,
    /// From then on.
    Cyclic,
}

impl Live {
    /// Which structure of a CANsync node is valid while its `w_OPTION_STATUS` is `status`: INIT before
    /// 16#0003, the cyclic one from then on (decision D-03).
    #[must_use]
    pub const fn of_option_status(status: u16) -> Self {
        if status < 0x0003 { Live::Init } else { Live::Cyclic }
    }

    /// Whether a structure marked `self` is valid in phase `now`.
    #[must_use]
    pub fn is_valid_in(self, now: Live) -> bool {
        self == Live::Always || self == now
    }
}

/// A structure of registers. Bytes between registers are padding.
pub struct Structure {
    /// The vendor's type name, for example `CANsync_INIT_BMSTRUCT`.
    pub name: &'static str,
    /// Size in bytes.
    pub bytes: u32,
    /// What the structure is for.
    pub doc: &'static str,
    /// Pages of the manual.
    pub page: &'static str,
    /// Source of the name.
    pub name_from: Provenance,
    /// The registers in ascending order of their first elements; those of one sub-structure in a row.
    pub registers: &'static [Register],
}

/// A register, or an array of registers.
#[derive(Debug)]
pub struct Register {
    /// Sub-structure the register belongs to, for example `a_DATA_PARAMETER`, else empty.
    pub group: &'static str,
    /// Type name of the sub-structure, else empty.
    pub group_type: &'static str,
    /// Source of that type name.
    pub group_type_from: Provenance,
    /// Size of one sub-structure in bytes, else 0.
    pub group_bytes: u32,
    /// The vendor's name, for example `w_CPU_CONTROL`.
    pub name: &'static str,
    /// Data type.
    pub ty: RegType,
    /// Offset of the (first) register in the structure, in bytes.
    pub offset: u32,
    /// Array bounds of the sub-structure, then those of the register itself; two at most.
    pub dims: &'static [Dim],
    /// How many of `dims` are those of the sub-structure.
    pub group_dims: usize,
    /// Who writes the register.
    pub owner: Owner,
    /// Value after power-on, in two's complement of the register's width.
    pub reset: u32,
    /// Whether the manual reserves the register.
    pub reserved: bool,
    /// What the register is for.
    pub doc: &'static str,
    /// Pages of the manual; in a sub-structure those where this structure uses it.
    pub page: &'static str,
    /// What its values mean; `None` for plain numbers.
    pub meaning: Option<&'static Meaning>,
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

impl Register {
    /// Every fact about the register itself with its source; those of its meaning have their own.
    #[must_use]
    pub const fn facts(&self) -> [(&'static str, Provenance); 5] {
        [
            ("name", self.name_from),
            ("offset", self.offset_from),
            ("type", self.type_from),
            ("owner", self.owner_from),
            ("reset", self.reset_from),
        ]
    }

    /// `manual`, or which facts follow from which decision: `offset D-02, reset D-320`.
    #[must_use]
    pub fn provenance(&self) -> String {
        Provenance::summary(&self.facts())
    }
}

/// One dimension of an array.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Dim {
    /// Number of elements; indices run from 0.
    pub count: u16,
    /// Elements from this index on are reserved.
    pub used: u16,
    /// Bytes from element to element.
    pub stride: u32,
}

/// Who writes a register. Reading is open to all.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Owner {
    /// The application.
    Plc,
    /// The firmware.
    Firmware,
    /// Both, in a handshake.
    Both,
}

impl fmt::Display for Owner {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Owner::Plc => "PLC",
            Owner::Firmware => "firmware",
            Owner::Both => "both",
        })
    }
}

/// Where a fact of the layout comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Provenance {
    /// The manual states it, on the page that stands beside it.
    Manual,
    /// Another document states it: a manual with its page, or the vendor's type library.
    Documented(&'static str),
    /// The manual is silent; the named decision of the project says how it was chosen.
    Inferred(&'static str),
}

impl Provenance {
    /// The decision that the fact follows from; `None` if it is documented.
    #[must_use]
    pub const fn decision(self) -> Option<&'static str> {
        match self {
            Provenance::Manual | Provenance::Documented(_) => None,
            Provenance::Inferred(decision) => Some(decision),
        }
    }

    /// `manual`, or which facts follow from which decision: `offset D-02, reset D-320`.
    #[must_use]
    pub fn summary(facts: &[(&str, Self)]) -> String {
        let inferred: Vec<_> =
            facts.iter().filter_map(|(fact, from)| Some(format!("{fact} {}", from.decision()?))).collect();
        if inferred.is_empty() { Self::Manual.to_string() } else { inferred.join(", ") }
    }
}

impl fmt::Display for Provenance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Provenance::Manual => f.pad("manual"),
            Provenance::Documented(document) => f.pad(&format!("manual: {document}")),
            Provenance::Inferred(decision) => f.pad(&format!("inferred {decision}")),
        }
    }
}

/// The elementary data types (manual 5.00005.03a p. 144).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum RegType {
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

impl RegType {
    /// Width in bytes: 1, 2 or 4. Also the alignment.
    #[must_use]
    pub const fn width(self) -> u32 {
        match self {
            RegType::Byte | RegType::Sint | RegType::Usint => 1,
            RegType::Word | RegType::Int | RegType::Uint => 2,
            RegType::Dword | RegType::Dint | RegType::Udint => 4,
        }
    }

    /// Name in IEC 61131-3.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            RegType::Byte => "BYTE",
            RegType::Word => "WORD",
            RegType::Dword => "DWORD",
            RegType::Sint => "SINT",
            RegType::Int => "INT",
            RegType::Dint => "DINT",
            RegType::Usint => "USINT",
            RegType::Uint => "UINT",
            RegType::Udint => "UDINT",
        }
    }

    /// Largest value as a bit pattern.
    #[must_use]
    pub const fn mask(self) -> u32 {
        u32::MAX >> (32 - 8 * self.width())
    }

    /// `value`, a bit pattern of this type, as the number it stands for.
    #[must_use]
    pub const fn number(self, value: u32) -> i64 {
        match self {
            RegType::Sint => value as i8 as i64,
            RegType::Int => value as i16 as i64,
            RegType::Dint => value as i32 as i64,
            _ => (value & self.mask()) as i64,
        }
    }
}

impl fmt::Display for RegType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// What the values and bits of a register mean.
#[derive(Debug)]
pub struct Meaning {
    /// Name in the layout files.
    pub name: &'static str,
    /// Pages of the manual; empty if it states none of it.
    pub page: &'static str,
    /// Values with a meaning as a whole; they go before the bits.
    pub values: &'static [ValueMeaning],
    /// Fields of bits, described in ascending order.
    pub bits: &'static [BitField],
}

/// A value, or a range of values, with its meaning.
#[derive(Debug)]
pub struct ValueMeaning {
    /// First value.
    pub first: u32,
    /// Last value; equal to `first` for a single one.
    pub last: u32,
    /// The meaning; `{}` stands for the value.
    pub text: &'static str,
    /// Source of the meaning.
    pub source: Provenance,
}

impl ValueMeaning {
    /// The meaning with `{}` replaced by `value` and the decision that it follows from behind it.
    #[must_use]
    pub fn told(&self, value: impl fmt::Display) -> String {
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
    /// Lowest bit.
    pub first: u8,
    /// Highest bit; equal to `first` for a single one.
    pub last: u8,
    /// Short name.
    pub name: &'static str,
    /// Meaning of a single bit that is 0; empty: not worth mentioning.
    pub zero: &'static str,
    /// Meaning of a single bit that is 1.
    pub one: &'static str,
    /// Meaning of a field; `{}` stands for its value.
    pub text: &'static str,
    /// Meanings of single values of a field.
    pub values: &'static [ValueMeaning],
    /// Whether the meaning continues the one before, without a comma.
    pub joined: bool,
    /// Whether the manual reserves the bits.
    pub reserved: bool,
    /// Source of the meaning.
    pub source: Provenance,
}

impl BitField {
    /// The field's bits in place.
    #[must_use]
    pub const fn mask(&self) -> u32 {
        (u32::MAX >> (31 - (self.last - self.first))) << self.first
    }

    /// The field's part of a register value.
    #[must_use]
    pub const fn of(&self, value: u32) -> u32 {
        (value & self.mask()) >> self.first
    }
}
