//! The TOML files in the form in which they are written: their structure, before any check.

use serde::Deserialize;
use toml::Spanned;

/// `family.toml`: the common part of devices.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Family {
    pub name: Spanned<String>,
    pub title: String,
    /// The manual that the pages in the family's files refer to.
    pub manual: String,
    pub reserved: Reserved,
    /// The phases of its devices, if structures overlay each other.
    pub phase: Option<Spanned<Phases>>,
    #[serde(default)]
    pub parts: Vec<Spanned<String>>,
    pub structures: Vec<Spanned<String>>,
}

/// Content of the file `device.toml`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Device {
    pub name: Spanned<String>,
    pub title: String,
    pub manual: String,
    /// Facts that the manual does not state, for the heads of exported files. The text completes the sentence "it does
    /// not state ...".
    #[serde(default)]
    pub undocumented: String,
    /// The vendor's library of types, whose declarations have the real offsets. Omitted if the device has no library.
    #[cfg_attr(not(feature = "import"), expect(dead_code, reason = "only an import reads it"))]
    pub library: Option<String>,
    /// Directory of the family next to that of the device, if the device shares structures with others.
    pub family: Option<Spanned<String>>,
    /// Area of the device's own interface.
    pub own: Option<Spanned<String>>,
    /// Lowest and highest number of the DIP switches; without this key the device has no switches.
    #[serde(default)]
    pub dip: Range,
    pub reserved: Reserved,
    /// Source of the names of areas, and of variable names made from them.
    pub names: Provenance,
    /// The phases of the device, if structures overlay each other and its family has none.
    pub phase: Option<Spanned<Phases>>,
    #[serde(default)]
    pub parts: Vec<Spanned<String>>,
    pub structures: Vec<Spanned<String>>,
    pub space: Vec<Space>,
    pub area: Vec<Area>,
    /// File with the object dictionary of a CANopen device.
    pub objects: Option<Spanned<String>>,
    /// File with the properties of a PROFIBUS-DP slave that masters need.
    pub gsd: Option<Spanned<String>>,
    #[serde(default)]
    pub front: Vec<Front>,
    #[serde(default)]
    pub port: Vec<Port>,
    #[serde(default)]
    pub baud_rate: Vec<BaudRate>,
}

/// Writer of the registers that the manual reserves.
#[derive(Deserialize, Clone)]
#[serde(deny_unknown_fields)]
pub(crate) struct Reserved {
    pub owner: Owner,
    pub source: Provenance,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub(crate) struct Range {
    pub first: u8,
    pub last: u8,
}

/// Addresses that have one spelling in the application, and their position in the image.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Space {
    pub name: Spanned<String>,
    pub letter: Letter,
    /// Number between width and address, as in `%MB3.0`.
    pub segment: Option<u16>,
    pub unit: Unit,
    /// Number of the first byte or word.
    pub first: Spanned<u32>,
    /// Offset in the image in bytes.
    pub offset: Spanned<u32>,
    /// Length in bytes. Default: up to the end of the space's last area.
    pub bytes: Option<Spanned<u32>>,
    pub page: String,
    pub doc: String,
}

/// The letters after the `%` of an address.
#[derive(Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
pub enum Letter {
    /// Space of inputs.
    I,
    /// Space of outputs.
    Q,
    /// Space of flags.
    M,
    /// The letter of the front panel. A layout cannot use it, because the compiler places the front panel.
    #[serde(skip)]
    F,
}

/// Unit of the number in an address.
#[derive(Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(rename_all = "lowercase")]
pub enum Unit {
    /// The number counts bytes, for every width.
    Byte,
    /// The number counts accesses of the address's own width. For bits, it counts the words that contain them.
    Word,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Area {
    pub name: Spanned<String>,
    /// Name of the space. Default: the first space.
    pub space: Option<Spanned<String>>,
    /// Number of the area's first byte or word in the space.
    pub first: Spanned<u32>,
    /// Default size in bytes, if the plant sets none. Only the area of the retain flags has this key.
    pub retain: Option<Spanned<u32>>,
    /// Number of the last byte or word. Default: the end of the area's largest structure.
    pub last: Option<Spanned<u32>>,
    pub cpu_first: Option<u32>,
    pub cpu_last: Option<u32>,
    pub page: String,
    pub doc: String,
    #[serde(default)]
    pub structure: Vec<AreaStructure>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct AreaStructure {
    pub name: Spanned<String>,
    /// `always`, or the name of a phase.
    pub live: Spanned<String>,
    pub role: Option<Role>,
    pub variable: Option<Spanned<String>>,
    #[serde(default)]
    pub unused: Vec<Spanned<String>>,
}

/// A word of the device's front panel in the header page.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Front {
    pub name: Spanned<String>,
    #[serde(rename = "type")]
    pub ty: Spanned<String>,
    /// First byte in the front panel.
    pub offset: Spanned<u32>,
    pub owner: Owner,
    pub meaning: Option<Spanned<String>>,
    /// True if the word contains four characters of a text.
    #[serde(default)]
    pub text: bool,
    /// Source for the existence of this word; its place in the header page is commram's own.
    pub source: Provenance,
    pub page: String,
    pub doc: String,
}

/// A port: the connection of the device to a medium.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Port {
    pub name: Spanned<String>,
    pub number: Spanned<u8>,
    pub medium: Spanned<String>,
    pub roles: Spanned<Vec<Role>>,
    /// Area of the port's registers. A port of a device in a folder has none.
    pub area: Option<Spanned<String>>,
}

/// The role of a port at its medium.
#[derive(Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// The port governs the medium.
    Master,
    /// The port answers a master.
    Slave,
    /// The port has the same rights as the other stations.
    Peer,
}

/// The phases: which of the structures that overlay each other is valid.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Phases {
    /// Name of the register that shows the phase, in every structure that is valid in one phase only.
    pub register: Spanned<String>,
    /// Source of the values.
    pub source: Provenance,
    /// The phases in ascending order of their values.
    pub values: Spanned<Vec<Phase>>,
}

/// A phase: the values of the register from `from` up to the next phase.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Phase {
    pub name: Spanned<String>,
    pub from: Spanned<u32>,
    /// End of the names of variables that the manual does not name.
    pub variable: String,
    /// The end of a sentence that begins "Valid".
    pub doc: String,
}

/// One line of the timing table; times in microseconds.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(non_snake_case)]
pub(crate) struct BaudRate {
    pub kbit_per_s: u16,
    pub us_BAUDRATE: u8,
    pub b_BT_0: u8,
    pub b_BT_1: u8,
    pub b_TIME_PATTERN: u8,
    pub t_WRC1: u32,
    pub t_RDC1: u32,
    pub t_WRC2: u32,
    pub t_RDC2: u32,
    pub t_CC: u32,
    pub t_RC: u32,
    pub t_RSPTO: u32,
    pub deadline_WRC: Spanned<Deadline>,
    pub deadline_RDC1: Spanned<Deadline>,
    pub deadline_RDC2: Spanned<Deadline>,
    pub max_bus_m: u16,
}

/// A time (`at`), or the limits of a time (`from`, `to`), in microseconds after the start of the event task.
#[derive(Deserialize, Clone)]
#[serde(deny_unknown_fields)]
pub(crate) struct Deadline {
    pub at: Option<u32>,
    pub from: Option<u32>,
    pub to: Option<u32>,
    pub source: Provenance,
}

/// A parts file: the common parts of several structures.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Parts {
    #[serde(default)]
    pub meaning: Vec<Meaning>,
    #[serde(default)]
    pub substructure: Vec<Structure>,
    #[serde(default)]
    pub block: Vec<Structure>,
}

/// A structure, a sub-structure or a block of registers shared by structures.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Structure {
    pub name: Spanned<String>,
    /// Length in bytes. Default: the size of the structure of `view`.
    pub size: Option<Spanned<u32>>,
    pub page: String,
    pub doc: String,
    /// Source of the type's own name. A block has no type name.
    pub name_from: Option<Provenance>,
    /// Name of the family's structure through which firmware and function blocks view this structure.
    pub view: Option<Spanned<String>>,
    pub offsets: Provenance,
    pub names: Provenance,
    pub types: Provenance,
    pub owners: Provenance,
    pub resets: Provenance,
    #[serde(default)]
    pub blocks: Vec<Spanned<String>>,
    pub register: Vec<Spanned<Entry>>,
}

/// A register or, with `padding`, the bytes between two registers.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Entry {
    /// Offset of a register; by default the offset in the structure of `view`.
    pub offset: Option<Spanned<u32>>,
    pub padding: Option<Spanned<u32>>,
    pub name: Option<Spanned<String>>,
    /// Name in the structure of `view`, if it differs.
    pub view_name: Option<Spanned<String>>,
    #[serde(rename = "type")]
    pub ty: Option<Spanned<String>>,
    pub array: Option<Spanned<Vec<u32>>>,
    pub used: Option<Spanned<Vec<u32>>>,
    /// The manual's name of the whole array's type, if it is not made of the element's name and the number of elements.
    pub array_type: Option<Spanned<String>>,
    /// Another name of the register in the manual.
    pub also: Option<Spanned<String>>,
    #[serde(default)]
    pub reserved: bool,
    pub owner: Option<Owner>,
    pub reset: Option<Spanned<i64>>,
    pub reset_from: Option<Provenance>,
    pub page: Option<String>,
    pub meaning: Option<Spanned<String>>,
    pub doc: Option<String>,
    pub offset_from: Option<Provenance>,
    pub name_from: Option<Provenance>,
    pub type_from: Option<Provenance>,
    pub owner_from: Option<Provenance>,
}

/// The writer of a register.
#[derive(Deserialize, Clone, Copy, PartialEq, Eq, Debug)]
#[serde(rename_all = "lowercase")]
pub enum Owner {
    /// The application (a PLC program) writes the register.
    Plc,
    /// The firmware of the device writes the register.
    Firmware,
    /// Application and firmware, in a handshake.
    Both,
}

/// Source of a fact. `"manual"`: the given page of the manual. `"manual: WHICH"`: another document. `"inferred D-02"`:
/// a decision that explains the fact.
#[derive(Deserialize, Clone, PartialEq, Eq, Debug)]
#[serde(try_from = "String")]
pub enum Provenance {
    /// The manual states the fact, on the page given.
    Manual,
    /// Another document states the fact.
    Documented(String),
    /// The fact follows from this decision.
    Inferred(String),
}

impl Provenance {
    /// Returns the source of a fact that follows from two facts with these sources, such as the name `channel.w_STATE`. It is
    /// inferred if one of them is. If both are, it names both decisions.
    #[must_use]
    pub fn and(&self, other: &Self) -> Self {
        match (self, other) {
            (Provenance::Inferred(one), Provenance::Inferred(two)) if one != two => {
                Provenance::Inferred(format!("{one} {two}"))
            }
            (Provenance::Inferred(_), _) | (_, Provenance::Manual) => self.clone(),
            (Provenance::Documented(_), Provenance::Documented(_)) => self.clone(),
            (_, Provenance::Documented(_) | Provenance::Inferred(_)) => other.clone(),
        }
    }
}

impl TryFrom<String> for Provenance {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        match text.split_once(' ') {
            None if text == "manual" => Ok(Provenance::Manual),
            Some(("manual:", document)) if !document.trim().is_empty() => {
                Ok(Provenance::Documented(document.trim().to_owned()))
            }
            Some(("inferred", decision)) if is_decision(decision) => {
                Ok(Provenance::Inferred(decision.to_owned()))
            }
            _ => Err(format!(
                "`{text}` is no provenance; write \"manual\", \"manual: DOCUMENT\" or \"inferred D-nn\""
            )),
        }
    }
}

/// True if `text` is the number of a decision, such as `D-02`.
fn is_decision(text: &str) -> bool {
    text.strip_prefix("D-").is_some_and(|number| {
        (2..=3).contains(&number.len()) && number.bytes().all(|digit| digit.is_ascii_digit())
    })
}

/// Meanings of the values and bits of a register; registers refer to it by name.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Meaning {
    pub name: Spanned<String>,
    /// Page of the manual.
    pub page: Option<String>,
    /// Pages of other devices' manuals.
    #[serde(default)]
    pub pages: std::collections::BTreeMap<String, String>,
    /// Source of values and bits without an own source; the manual, if there is a page.
    pub source: Option<Provenance>,
    /// Elementary type of the registers, for the constants that values and bits with an `id` become.
    #[serde(rename = "type")]
    pub ty: Option<Spanned<String>>,
    /// The values of a request and of its answer, if the registers are handshakes.
    pub handshake: Option<Spanned<Handshake>>,
    #[serde(default)]
    pub value: Vec<Spanned<Value>>,
    #[serde(default)]
    pub bit: Vec<Spanned<Bit>>,
}

/// Two values of a meaning: a request, and its answer by the firmware.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Handshake {
    pub request: u32,
    pub answer: u32,
}

/// One value (`is`), or a range of values (`from`, `to`). In the text, `{}` is replaced by the value.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Value {
    /// Name of the constant, if the code needs it.
    pub id: Option<Spanned<String>>,
    pub is: Option<u32>,
    pub from: Option<u32>,
    pub to: Option<u32>,
    /// Text of the meaning; omitted for reserved values and bits.
    pub text: Option<String>,
    #[serde(default)]
    pub reserved: bool,
    pub source: Option<Provenance>,
}

/// One bit (`at`) or a field of bits (`from`, `to`).
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Bit {
    /// Name of the constant, if the code needs it.
    pub id: Option<Spanned<String>>,
    pub at: Option<u8>,
    pub from: Option<u8>,
    pub to: Option<u8>,
    pub name: String,
    #[serde(default)]
    pub zero: String,
    #[serde(default)]
    pub one: String,
    #[serde(default)]
    pub text: String,
    #[serde(default)]
    pub value: Vec<Spanned<Value>>,
    #[serde(default)]
    pub joined: bool,
    #[serde(default)]
    pub reserved: bool,
    pub source: Option<Provenance>,
}
