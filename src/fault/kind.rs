//! Kinds of faults. The definition of a kind in its family contains everything about it: number, name, target, fields,
//! end, and the effect of the values.

use super::field::{Field, Form};
use super::{Effect, Fault, MAX_AT_US, MAX_DURATION_US};
use crate::layout::DeviceFit;
use core::fmt;
use core::hash::{Hash, Hasher};

/// Maximum number of fields of a kind, without the fields for target and time.
pub const MAX_FIELDS: usize = 5;
/// Maximum number of bits of all values of a fault. A fault with more bits would not fit into an operation of the
/// channel.
pub const MAX_BITS: u32 = 88;
/// Highest number of a participant that a fault can name.
pub const MAX_PARTICIPANT: u8 = 31;

/// Number of the first kind that a device in a folder declares. The kinds of a folder have consecutive numbers, so
/// the number identifies a kind only together with the device.
pub(crate) const FIRST_DECLARED: u8 = 100;
/// Maximum number of kinds that a device in a folder declares.
pub(crate) const MOST_DECLARED: usize = 16;
/// Maximum number of bits of all values of a declared kind. The operation of the channel needs the other bits for
/// [`Declaration::id`].
pub(crate) const DECLARED_BITS: u32 = MAX_BITS - u32::BITS;

/// Origin of a kind that a device in a folder declares (D-827).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Declaration {
    /// Name of the device, as in its layout.
    pub(crate) device: &'static str,
    /// Hash of the declaration. The same declaration has the same hash in each process.
    pub(crate) id: u32,
}

/// True if a device in a folder declares the kind with this number.
pub(crate) fn is_declared(number: u8) -> bool {
    (usize::from(FIRST_DECLARED)..usize::from(FIRST_DECLARED) + MOST_DECLARED).contains(&number.into())
}

/// A kind of fault. Kinds are equal if their numbers and declarations are.
pub struct FaultKind {
    number: u8,
    declaration: Option<Declaration>,
    /// Number of all declarations of the folder that declares this kind; 0 for a kind of commram.
    declarations: u64,
    name: &'static str,
    place: TargetKind,
    about: &'static str,
    fields: &'static [Field],
    example: &'static str,
    families: &'static [&'static str],
    happens_once: bool,
    has_hits: bool,
    agree: fn(&Fault) -> Result<(), String>,
    effect: fn(&Fault) -> Effect,
}

/// Kind of target on which a kind of fault acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TargetKind {
    /// A bus as a whole.
    Bus,
    /// A participant of a bus.
    Participant,
    /// A port of a device, connected to a bus.
    Port,
    /// A device itself, not one of its ports.
    Device,
}

/// The fields for the target.
static BUS: Field = Field::new("bus", Form::Name, "Name of the bus");
static PLC: Field = Field::new("plc", Form::Name, "Name of the PLC").or("device");
/// The port of a PLC.
pub(super) static NODE: Field = Field::new("node", Form::Port, "Port of the PLC, which must be on a bus");
/// The participant of a bus.
pub(super) static SLAVE: Field =
    Field::new("slave", Form::Number { least: 0, most: MAX_PARTICIPANT as u64 }, "Slave number")
        .required("give the slave number, 0 to 31");

/// Time at which the fault begins.
pub(super) static AT_US: Field = Field::new(
    "at_us",
    Form::Time { least: 0, most: MAX_AT_US },
    "Emulated time since power-on at which the fault begins; at once if left out or in the past",
);
/// Number of hits after which the fault ends.
pub(super) static COUNT: Field = Field::new(
    "count",
    Form::Number { least: 1, most: u32::MAX as u64 },
    "The fault ends after this number of hits",
);
/// Time after which the fault ends.
pub(super) static DURATION_US: Field = Field::new(
    "duration_us",
    Form::Time { least: 1, most: MAX_DURATION_US as u64 },
    "The fault ends after this emulated time; not possible together with `count`",
)
.or("for_us");

impl TargetKind {
    /// Returns the fields for the target.
    pub fn fields(self) -> &'static [&'static Field] {
        match self {
            TargetKind::Bus => const { &[&BUS] },
            TargetKind::Participant => const { &[&BUS, &SLAVE] },
            TargetKind::Port => const { &[&PLC, &NODE] },
            TargetKind::Device => const { &[&PLC] },
        }
    }
}

impl FaultKind {
    /// The fields for time and limit, which every kind has.
    pub const COMMON: [&'static Field; 3] = [&AT_US, &COUNT, &DURATION_US];

    /// Creates a kind without fields. Faults of the kind last until they are cleared. Number and name are unique.
    /// `effect` converts the values of a fault to the data that the bus or device uses while the fault is active.
    #[must_use]
    pub const fn new(
        number: u8,
        name: &'static str,
        place: TargetKind,
        about: &'static str,
        effect: fn(&Fault) -> Effect,
    ) -> Self {
        FaultKind {
            number,
            declaration: None,
            declarations: 0,
            name,
            place,
            about,
            fields: &[],
            example: "",
            happens_once: false,
            has_hits: true,
            families: &[],
            agree: |_| Ok(()),
            effect,
        }
    }

    /// Limits the kind to ports that connect to buses of these families. If a device has only one such port, `node` may
    /// be omitted.
    #[must_use]
    pub const fn at_ports_to(self, families: &'static [&'static str]) -> Self {
        FaultKind { families, ..self }
    }

    /// Adds the fields that only this kind has, at most [`MAX_FIELDS`]. The values are at most 32 bits wide.
    ///
    /// # Panics
    /// If the values do not fit into an operation of the channel. Kinds are constants, so the compiler reports this
    /// error.
    #[must_use]
    pub const fn with(self, fields: &'static [Field]) -> Self {
        assert!(fields.len() <= MAX_FIELDS, "a fault has five values at most");
        let (mut bits, mut index) = (0, 0);
        while index < fields.len() {
            let (_, most) = fields[index].range();
            assert!(most <= u32::MAX as u64, "a value has 32 bits");
            bits += fields[index].bits();
            index += 1;
        }
        assert!(bits <= MAX_BITS, "the values do not fit into an operation of the channel");
        FaultKind { fields, ..self }
    }

    /// Creates a kind without hits that a device in a folder declares; it acts on this device. The caller must have
    /// checked that the fields do not exceed [`MAX_FIELDS`] and [`DECLARED_BITS`]. `declarations` is the number of all
    /// declarations of the folder.
    pub(crate) fn declared(
        index: u8,
        declaration: Declaration,
        declarations: u64,
        name: &'static str,
        about: &'static str,
        fields: &'static [Field],
        effect: fn(&Fault) -> Effect,
    ) -> Self {
        let number = FIRST_DECLARED + index;
        let kind = FaultKind::new(number, name, TargetKind::Device, about, effect).without_hits();
        FaultKind { declaration: Some(declaration), declarations, fields, ..kind }
    }

    /// True if the device declares this kind in its folder.
    pub(crate) fn is_declared_by(&self, device: &DeviceFit) -> bool {
        self.declaration.is_some() && self.declarations == device.declarations()
    }

    /// Returns the declaration of the kind, if a device in a folder declares it.
    pub(crate) fn declaration(&self) -> Option<Declaration> {
        self.declaration
    }

    /// Returns the number of the declarations of a device with these kinds; 0 if it declares none.
    pub(crate) fn declarations_of(kinds: &[&'static FaultKind]) -> u64 {
        kinds.iter().map(|kind| kind.declarations).find(|number| *number != 0).unwrap_or(0)
    }

    /// Gives the kind an example for the help.
    #[must_use]
    pub const fn shown(self, example: &'static str) -> Self {
        FaultKind { example, ..self }
    }

    /// Sets the default end: a fault of this kind ends after one hit if its description has neither `count` nor
    /// `duration_us`.
    #[must_use]
    pub const fn once(self) -> Self {
        FaultKind { happens_once: true, ..self }
    }

    /// Makes the kind a permanent condition that does not hit single frames or events. So a fault of the kind has no
    /// `count`.
    #[must_use]
    pub const fn without_hits(self) -> Self {
        FaultKind { has_hits: false, ..self }
    }

    /// Sets a function that checks whether the values of a fault fit together.
    #[must_use]
    pub const fn agreeing(self, agree: fn(&Fault) -> Result<(), String>) -> Self {
        FaultKind { agree, ..self }
    }

    /// Returns the number of the kind. It identifies the kind in journal and channel, and defines the order of lists.
    #[must_use]
    pub const fn number(&self) -> u8 {
        self.number
    }

    /// This kind acts only on ports to buses of certain families. Returns the names of these families.
    pub(super) const fn families(&self) -> &'static [&'static str] {
        self.families
    }

    /// Returns the name of the kind in plant files, on the command line and in the journal.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        self.name
    }

    /// Kind of target on which the kind acts.
    #[must_use]
    pub const fn place(&self) -> TargetKind {
        self.place
    }

    /// Description of the fault in a sentence.
    #[must_use]
    pub const fn about(&self) -> &'static str {
        self.about
    }

    /// Fields of the kind, in the order of the values.
    #[must_use]
    pub const fn fields(&self) -> &'static [Field] {
        self.fields
    }

    /// Fields for an example.
    #[must_use]
    pub const fn example(&self) -> &'static str {
        self.example
    }

    /// The default end of a fault whose description has neither `count` nor `duration_us`: true if the fault ends after
    /// one hit, false if it lasts until it is cleared.
    #[must_use]
    pub const fn happens_once(&self) -> bool {
        self.happens_once
    }

    /// True if faults of the kind have hits and can end by `count`.
    #[must_use]
    pub const fn has_hits(&self) -> bool {
        self.has_hits
    }

    /// Returns all fields in this order: target, own fields, time and limit. A kind without hits also has `count` here,
    /// because its error says what to give instead.
    pub fn all_fields(&'static self) -> impl Iterator<Item = &'static Field> {
        self.place.fields().iter().copied().chain(self.fields).chain(Self::COMMON)
    }

    /// Returns the fields that a fault of this kind can have: a kind without hits has no `count`.
    pub(crate) fn usable_fields(&'static self) -> impl Iterator<Item = &'static Field> {
        self.all_fields().filter(move |field| self.has_hits || **field != COUNT)
    }

    /// Checks that the values of a fault fit together.
    pub(super) fn agree(&self, fault: &Fault) -> Result<(), String> {
        (self.agree)(fault)
    }

    /// Returns the effect that the values of a fault of this kind describe.
    pub(super) fn effect(&self, fault: &Fault) -> Effect {
        (self.effect)(fault)
    }
}

impl PartialEq for FaultKind {
    fn eq(&self, other: &Self) -> bool {
        self.number == other.number && self.declaration == other.declaration
    }
}

impl Eq for FaultKind {}

impl Hash for FaultKind {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.number.hash(state);
    }
}

impl fmt::Debug for FaultKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}
