//! Phases. The phase decides which of several overlaid structures is valid.

use super::{Area, Provenance};

/// The phase in which a structure is valid. Structures may overlay each other, for example the structure for the
/// initialization of a port and the structure for its operation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "emulator", derive(serde::Serialize, serde::Deserialize))]
pub struct RegisterPhase(u8);

impl RegisterPhase {
    /// The phase of structures that are always valid, because no other structure overlays them.
    pub const ALWAYS: Self = Self(0);

    /// Returns phase `number` of the layout's phases, from 1; 0 is [`ALWAYS`](Self::ALWAYS).
    #[must_use]
    pub const fn numbered(number: u8) -> Self {
        Self(number)
    }

    /// Returns the number of the phase, from 1; 0 is [`ALWAYS`](Self::ALWAYS).
    #[must_use]
    pub const fn number(self) -> u8 {
        self.0
    }

    /// True if a structure marked `self` is valid in phase `now`.
    #[must_use]
    pub fn is_valid_in(self, now: RegisterPhase) -> bool {
        self == Self::ALWAYS || self == now
    }
}

/// The phases of a layout, and the register that shows them.
pub struct Phases {
    /// Name of the register. Each structure with a phase has it at the same offset.
    pub register: &'static str,
    /// Source of the values.
    pub source: Provenance,
    /// The phases in ascending order of their values; entry n is phase number n + 1.
    pub phases: &'static [Phase],
}

/// A phase of a device, in which one of several overlaid structures is valid.
pub struct Phase {
    /// Name of the phase in layouts and exported files.
    pub name: &'static str,
    /// First value of the register in this phase. The phase ends before the first value of the next phase.
    pub from: u32,
    /// The end of a sentence that begins "Valid".
    pub doc: &'static str,
}

impl Area {
    /// Returns the phase if the register that shows the phase has the value `status`. If the value is not known
    /// (`None`), returns the last phase, in which a device is operated.
    #[must_use]
    pub fn phase(&self, status: Option<u32>) -> RegisterPhase {
        let Some(phases) = self.phases else { return RegisterPhase::ALWAYS };
        let status = status.unwrap_or(u32::MAX);
        RegisterPhase::numbered(phases.phases.partition_point(|phase| phase.from <= status) as u8)
    }

    /// Returns the first phase. A device is in this phase at power-on.
    #[must_use]
    pub fn first_phase(&self) -> RegisterPhase {
        self.phase(Some(0))
    }

    /// Returns all phases in their order; only [`RegisterPhase::ALWAYS`] if no structure has a phase.
    pub fn all_phases(&self) -> impl DoubleEndedIterator<Item = RegisterPhase> + use<> {
        (self.first_phase().number()..=self.phase(None).number()).map(RegisterPhase::numbered)
    }

    /// Facts about a phase of this area; `None` for [`RegisterPhase::ALWAYS`].
    #[must_use]
    pub fn phase_facts(&self, phase: RegisterPhase) -> Option<&'static Phase> {
        self.phases?.phases.get(usize::from(phase.number()).checked_sub(1)?)
    }

    /// Source of the statement that a structure marked `phase` is valid in this phase only.
    #[must_use]
    pub fn phase_source(&self, phase: RegisterPhase) -> Provenance {
        let phases = self.phases.filter(|_| phase != RegisterPhase::ALWAYS);
        phases.map_or(Provenance::Manual, |phases| phases.source)
    }
}
