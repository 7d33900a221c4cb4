//! Errors in a layout, with their places.

use std::fmt;
use std::path::PathBuf;

/// A layout error: place and reason. Printed as `file:line:column: reason`.
#[derive(Debug, thiserror::Error)]
#[error("{at}: {reason}")]
pub struct Error {
    /// Place of the error in the layout.
    pub at: Location,
    /// Reason of the error, with the correct form.
    pub reason: Box<Reason>,
}

/// A place in a layout file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Location {
    /// Path of the file, which can be opened.
    pub file: PathBuf,
    /// Number of the line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}:{}", self.file.display(), self.line, self.column)
    }
}

/// The kinds of layout errors.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "each message says it all")]
pub enum Reason {
    #[error("cannot read this file: {0}")]
    Unreadable(String),
    #[error("`{0}` leads out of the folder; all files of a device in a folder lie in it")]
    OutsideFolder(String),
    #[error("{0} is a link; a device in a folder has its own files")]
    LinkInFolder(String),
    #[error("a device in a folder has no `{0}`; a device in a crate can have it")]
    NotInFolder(&'static str),
    #[error("{0}")]
    Syntax(String),
    #[error("`{0}` is not a name (letters, digits and `_`, not starting with a digit)")]
    BadName(String),
    #[error("`{0}` is already in use here; names must be unique")]
    DuplicateName(String),
    #[error(
        "`{0}` differs from `{1}` only in upper and lower case, which not all languages distinguish; rename it"
    )]
    DiffersInCase(String, String),
    #[error("the variable `{0}` is at another structure, too; give each structure its own `variable`")]
    VariableTwice(String),
    #[error("register without `{0}`")]
    MissingKey(&'static str),
    #[error("a type needs `name_from`: where its own name comes from")]
    UnnamedSource,
    #[error("meaning `{0}` needs the `page` of the manual or a `source`")]
    MeaningWithoutSource(String),
    #[error("meaning `{0}` has values or bits from the manual; they need its `page`")]
    MeaningWithoutPage(String),
    #[error("`{0}` is reserved and so has the owner that `reserved` of device.toml names")]
    ReservedWithOwner(String),
    #[error("padding takes no `name`, `type` or `array`")]
    PaddingWithKeys,
    #[error("unknown type `{0}`; known are BYTE, WORD, DWORD, SINT, INT, DINT, USINT, UINT, UDINT{1}")]
    UnknownType(String, String),
    #[error("`{name}` starts like {expected}, but its type is {found}")]
    Prefix { name: String, expected: String, found: String },
    #[error("unknown structure `{0}`; `structures` of device.toml lists the known ones")]
    UnknownStructure(String),
    #[error("`{structure}` has no register `{name}` that could be unused")]
    UnknownRegister { structure: String, name: String },
    #[error("a layout has 1 to 255 phases")]
    PhaseCount,
    #[error("phase `{0}`: phases are listed in ascending order of `from`, and the first one begins at 0")]
    PhaseOrder(String),
    #[error("the family of this device declares the phases; the device has no others")]
    PhasesTwice,
    #[error(
        "unknown phase `{name}`; known are `always`{known}; `[phase]` of device.toml or family.toml declares phases"
    )]
    UnknownPhase { name: String, known: String },
    #[error(
        "`{structure}` has no register `{register}`, which shows the phase; a structure that is valid in one phase \
         has it, as a single register"
    )]
    NoPhaseRegister { structure: String, register: String },
    #[error(
        "`{register}` shows the phase, and so has one offset in `{structure}` and in `{other}`, which lies over it"
    )]
    PhaseRegisterMoved { structure: String, other: String, register: String },
    #[error(
        "the areas `{0}` and `{1}` have structures that overlay each other; a device in a folder has at most one such area"
    )]
    PhasesOfAreas(String, String),
    #[error(
        "area `{area}`: `{structure}` and `{other}` are valid in the phase `{phase}`; in a device in a folder, one \
         structure is valid in each phase"
    )]
    PhaseTaken { area: String, structure: String, other: String, phase: String },
    #[error("`{0}` shows the phase, so in a device in a folder it has 8 or 16 bits")]
    WidePhaseRegister(String),
    #[error("unknown block `{0}`; blocks are defined in the files that `parts` of device.toml lists")]
    UnknownBlock(String),
    #[error("unknown meaning `{0}`; meanings are defined in the files that `parts` of device.toml lists")]
    UnknownMeaning(String),
    #[error(
        "`{name}` at offset {offset} overlaps `{previous}`, which ends at {end}; \
         the first free offset is {end}"
    )]
    Overlap { name: String, offset: u32, previous: String, end: u32 },
    #[error(
        "{bytes} byte(s) before {name} are not described; \
         write {{ offset = {start}, padding = {bytes} }} if that is meant"
    )]
    Gap { name: String, start: u32, bytes: u32 },
    #[error("`{name}` ({ty}) at offset {offset} needs an offset divisible by {align}")]
    Misaligned { name: String, ty: String, offset: u32, align: u32 },
    #[error("`{name}` ends at {end}, past the end of `{structure}` ({size} bytes)")]
    PastStructureEnd { name: String, end: u32, structure: String, size: u32 },
    #[error("`{structure}` has {size} bytes, but `{area}` ends after {bytes}")]
    PastAreaEnd { structure: String, size: u32, area: String, bytes: u32 },
    #[error("the structures of all areas up to `{structure}` in `{area}` have more than {most} bytes")]
    PlacedTooMuch { structure: String, area: String, most: u32 },
    #[error("the files of the layout up to this one have more than {most} MiB")]
    LayoutTooLong { most: usize },
    #[error("the size of `{structure}` is {size}; it must be a multiple of {align}")]
    OddSize { structure: String, size: u32, align: u32 },
    #[error("area `{name}` starts at {first}; it must be divisible by {by}")]
    AreaMisaligned { name: String, first: u32, by: u32 },
    #[error(
        "area `{name}` ({first} to {last}) does not lie in space `{space}`, which has {space_first} to {space_last}"
    )]
    AreaOutside { name: String, first: u32, last: u32, space: String, space_first: u32, space_last: u64 },
    #[error("unknown space `{0}`; spaces are defined under [[space]] of device.toml")]
    UnknownSpace(String),
    #[error("space `{0}` has no area that defines its end; give its `bytes`")]
    SpaceWithoutEnd(String),
    #[error(
        "space `{name}` begins at byte {offset} of the image; the first {header} bytes are the header page"
    )]
    SpaceInHeader { name: String, offset: u32, header: u32 },
    #[error(
        "`{key}` of space `{name}` is {value}; it must be divisible by {by}, so that data aligned in the space are aligned in the image"
    )]
    SpaceMisaligned { key: &'static str, name: String, value: u32, by: u32 },
    #[error("space `{0}` does not end within the 4 GiB that an address can name")]
    SpaceTooLong(String),
    #[error("space `{name}` has bytes {first} to {last} of the image, which space `{other}` has, too")]
    SpaceOverlap { name: String, first: u32, last: u64, other: String },
    #[error("addresses of space `{name}` are written like those of `{other}`, which has the same numbers")]
    SpaceAmbiguous { name: String, other: String },
    #[error("`{0}` is the retain area already; a device has one")]
    RetainTwice(String),
    #[error("retain area `{name}` takes no structures, and a `retain` of 4 to {most} bytes, divisible by 4")]
    BadRetain { name: String, most: u32 },
    #[error("area `{name}` ends at {last}, before its first byte {first}")]
    AreaReversed { name: String, first: u32, last: u32 },
    #[error("area `{name}` ({first} to {last}) overlaps area `{other}`, which ends at {other_last}")]
    AreaOverlap { name: String, first: u32, last: u32, other: String, other_last: u32 },
    #[error("unknown structure `{name}`; a view is one of the structures of the family: {known}")]
    UnknownView { name: String, known: String },
    #[error("a structure with `view` takes offsets, paddings and size from the family's; leave them out")]
    OwnPlace,
    #[error("`{view}` has no register `{name}`; give its name there as `view_name`")]
    NotInView { name: String, view: String },
    #[error("`{name}` must have the type and the bounds that it has in `{view}`")]
    UnlikeView { name: String, view: String },
    #[error("meaning `{meaning}` has values or bits from a manual, but no `pages` of manual {manual}")]
    MeaningWithoutPagesOf { meaning: String, manual: String },
    #[error("`cpu_first` and `cpu_last` are given together or not at all")]
    HalfCpu,
    #[error("`{name}` is {ty}; the front has words of 32 bits: DWORD, DINT, UDINT")]
    FrontType { name: String, ty: String },
    #[error("`{name}` at offset {offset}: offsets in the front are 0 to 252, divisible by 4")]
    FrontOffset { name: String, offset: u32 },
    #[error("`{name}` at offset {offset} lies over `{other}`")]
    FrontTwice { name: String, offset: u32, other: String },
    #[error("port number 0 is the device itself; ports are 1 to 255")]
    PortZero,
    #[error("port number {0} is already in use")]
    PortNumberTwice(u8),
    #[error("`roles` lists the roles of a port at its medium, each once: \"master\", \"slave\", \"peer\"")]
    PortRoles,
    #[error("port `{0}` names no `area` of its registers")]
    PortWithoutArea(String),
    #[error("the port of a device in a folder: {0}")]
    PortInFolder(&'static str),
    #[error("unknown area `{0}`; areas are defined under [[area]] of device.toml")]
    UnknownArea(String),
    #[error("an array has one or two dimensions of 1 to 65535 elements, this one is {0:?}")]
    BadArray(Vec<u32>),
    #[error("`{0}`: arrays of sub-structures have one dimension, and so have arrays inside of them")]
    NestedArray(String),
    #[error("`{0}` has an `array_type` but is no array")]
    ArrayTypeWithoutArray(String),
    #[error("`used` is {used:?} but `array` is {array:?}: as many numbers, none of them greater")]
    BadUsed { used: Vec<u32>, array: Vec<u32> },
    #[error("an array needs a name that starts with `a_`, and `a_` needs `array`; this is `{0}`")]
    ArrayPrefix(String),
    #[error("{what} {value} does not fit `{name}` ({ty}, {bits} bits)")]
    ValueTooWide { what: &'static str, value: String, name: String, ty: &'static str, bits: u32 },
    #[error("bit {bit} of meaning `{meaning}` does not fit `{name}` ({ty}, {bits} bits)")]
    BitTooWide { bit: u8, meaning: String, name: String, ty: &'static str, bits: u32 },
    #[error("meaning `{0}` has an `id` and so needs the `type` of its registers")]
    IdWithoutType(String),
    #[error("a value of a field of bits that has an `id` is a single one (`is`)")]
    IdOfRange,
    #[error("`{name}` is {ty}, but meaning `{meaning}` has the type {expected}, which is of another width")]
    UnlikeMeaning { name: String, ty: &'static str, meaning: String, expected: &'static str },
    #[error("value {value} does not fit bits {first} to {last}")]
    ValueBesideBits { value: String, first: u8, last: u8 },
    #[error("bit {0} is described twice")]
    BitTwice(u8),
    #[error("a {0} needs either `{1}`, or `from` and `to` in ascending order")]
    BadRange(&'static str, &'static str),
    #[error("`handshake` has {0}, which is no single value (`is`) of the meaning")]
    HandshakeValue(String),
    #[error("value {0} has two meanings")]
    ValueTwice(String),
    #[error("a value has either a `text` or is `reserved`")]
    TextOrReserved,
    #[error("a `reset` makes no sense for sub-structure `{0}`; its registers carry their own")]
    ResetOfSubstructure(String),
    #[error("a second name, `also`, makes no sense for sub-structure `{0}`; its registers carry their own")]
    AlsoOfSubstructure(String),
    #[error(
        "`{structure}` has a register of {width} bytes at offset {offset} where `{other}`, \
         which lies over it in area `{area}`, has one of {other_width}: \
         a byte of the RAM must always be accessed at one width; list the unused one in `unused`"
    )]
    MixedWidth { structure: String, other: String, area: String, offset: u32, width: u32, other_width: u32 },
    #[error("object {0}: objects are listed in the order of index and sub-index, each once")]
    ObjectOrder(String),
    #[error("object {0} has a `type` unless its `access` is \"none\"")]
    ObjectType(String),
    #[error(
        "`default` of object {0} is a number that fits its type, \"node\" or \"0x... + node\"; a string's is a text, a \
         domain has none"
    )]
    ObjectDefault(String),
    #[error("area `{area}` has no register `{register}`")]
    NoSuchRegister { area: String, register: String },
    #[error("register `{0}` lies before the first octet that counts")]
    RegisterBefore(String),
    #[error("`{0}` is no keyword (letters, digits, `_` and `.`), or occurs twice")]
    BadKeyword(String),
    #[error(
        "a parameter of a device description file has either a `bit`, 0 to 7, or a `name`, and `from`, `default`, `to` in ascending order"
    )]
    GsdParameter,
    #[error("the octets of parameter `{0}` are past the end of the constants")]
    GsdBehind(String),
    #[error("parameter number {0}: numbers are 1 to 4095")]
    ParameterNumber(u16),
    #[error(
        "parameter {number} after {last}: parameters are listed in the order of their numbers, each once"
    )]
    ParameterOrder { number: u16, last: u16 },
    #[error("`{0}` is no id (capital letters, digits and `_`, starting with a letter)")]
    BadId(String),
    #[error("`{what}` of parameter {number} is {value}; its format holds {first} to {last}")]
    ParameterValue { what: &'static str, number: u16, value: i64, first: i64, last: i64 },
    #[error("`default` of parameter {number} lies outside its limits {first} to {last}")]
    ParameterDefault { number: u16, first: i64, last: i64 },
    #[error("parameter {0} needs either `page`, or `inferred` with the decision")]
    ParameterSource(u16),
}
