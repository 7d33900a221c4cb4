//! Kinds of faults. A family defines each of its kinds in one place: number, name, target, fields, end, and the effect
//! of the values.

use super::field::{Field, Form};
use super::{Effect, Fault, MAX_AT_US, MAX_DURATION_US};
use core::fmt;
use core::hash::{Hash, Hasher};

/// Maximum number of fields of a kind, without the fields for target and time.
pub const MAX_FIELDS: usize = 5;
/// Bits that the values of a fault may take, so that it fits into an operation of the channel.
pub const MAX_BITS: u32 = 88;
/// Highest number of a participant of a bus in a fault.
pub const MAX_PARTICIPANT: u8 = 31;

/// A kind of fault. Kinds are equal if their numbers are.
pub struct FaultKind {
    number: u8,
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
    /// A device itself.
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

/// Begin of a fault.
pub(super) static AT_US: Field = Field::new(
    "at_us",
    Form::Time { least: 0, most: MAX_AT_US },
    "Begin, emulated time since power-on. Left out or past: at once",
);
/// Its end by hits.
pub(super) static COUNT: Field =
    Field::new("count", Form::Number { least: 1, most: u32::MAX as u64 }, "Ends after this number of hits");
/// Its end by time.
pub(super) static DURATION_US: Field = Field::new(
    "duration_us",
    Form::Time { least: 1, most: MAX_DURATION_US as u64 },
    "Ends after this emulated time. Not together with `count`",
)
.or("for_us");

impl TargetKind {
    /// The fields for the target.
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
    /// The fields of every kind for time and limit.
    pub const COMMON: [&'static Field; 3] = [&AT_US, &COUNT, &DURATION_US];

    /// Creates a kind without fields, which lasts until it is cleared. Number and name are unique; `effect` converts
    /// the values to data for the bus or device while the fault is active.
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

    /// Returns the same kind, limited to ports to buses of these families: if a device has one such port, `node` may
    /// be left out.
    #[must_use]
    pub const fn at_ports_to(self, families: &'static [&'static str]) -> Self {
        FaultKind { families, ..self }
    }

    /// Returns the same kind with fields, [`MAX_FIELDS`] at most. Their values are 32 bits wide.
    ///
    /// # Panics
    /// If the values do not fit into an operation of the channel; as kinds are constants, at compile time.
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

    /// Returns the same kind with an example for the help.
    #[must_use]
    pub const fn shown(self, example: &'static str) -> Self {
        FaultKind { example, ..self }
    }

    /// Returns the same kind, which occurs once if no repetition is given.
    #[must_use]
    pub const fn once(self) -> Self {
        FaultKind { happens_once: true, ..self }
    }

    /// Returns the same kind as a condition without hits: it cannot end by `count`.
    #[must_use]
    pub const fn without_hits(self) -> Self {
        FaultKind { has_hits: false, ..self }
    }

    /// Returns the same kind, with a check that the values agree with each other.
    #[must_use]
    pub const fn agreeing(self, agree: fn(&Fault) -> Result<(), String>) -> Self {
        FaultKind { agree, ..self }
    }

    /// Its number, which identifies the kind in journal and channel and defines the order of lists.
    #[must_use]
    pub const fn number(&self) -> u8 {
        self.number
    }

    /// The families of buses to which its ports belong.
    pub(super) const fn families(&self) -> &'static [&'static str] {
        self.families
    }

    /// Its name in plant files, on the command line and in the journal.
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

    /// Whether the fault occurs once if no repetition is given. All others last until they are cleared.
    #[must_use]
    pub const fn happens_once(&self) -> bool {
        self.happens_once
    }

    /// Whether the kind has hits and can end by `count`.
    #[must_use]
    pub const fn has_hits(&self) -> bool {
        self.has_hits
    }

    /// All fields: target, own fields, time and limit.
    pub fn all_fields(&'static self) -> impl Iterator<Item = &'static Field> {
        self.place.fields().iter().copied().chain(self.fields).chain(Self::COMMON)
    }

    /// Checks that the values agree with each other.
    pub(super) fn agree(&self, fault: &Fault) -> Result<(), String> {
        (self.agree)(fault)
    }

    /// Returns the effect of the values of a fault of this kind.
    pub(super) fn effect(&self, fault: &Fault) -> Effect {
        (self.effect)(fault)
    }
}

impl PartialEq for FaultKind {
    fn eq(&self, other: &Self) -> bool {
        self.number == other.number
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
