//! The parts of the device outside its CAN port: supply, retained data, and faults of the hardware.

use super::command::Readiness;
use super::events::{self, Pulses};
use super::retained::{Retained, area};
use crate::devices::cs0015::emulation::faults::{Effect, SupplyFault};
use crate::devices::cs0015::emulation::records::RefusalReason;
use crate::devices::cs0015::registers::values::{bool, program, s1, state};
use crate::devices::cs0015::registers::{CS0015_FLAGS, FLAGS, FRONT_PROGRAM, FRONT_S1, FRONT_STATE};
use crate::devices::{Context, Events, Firmware};
use crate::fault::{self, Faults, Hit, Owner};
use crate::layout::Area;
use crate::memory::header::BoardSetting;
use crate::memory::{FirmwareHeader, MemoryError, Segment, View};
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use serde::{Deserialize, Serialize};
use std::sync::{Arc, Mutex, PoisonError};

/// Faults of the hardware that the firmware at the port can detect.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Defects {
    /// Outputs with a short circuit, bit n for output n.
    pub short_circuits: u16,
    /// Outputs with a broken wire, bit n for output n.
    pub wire_breaks: u16,
    /// True if the supply is too low or too high.
    pub has_wrong_voltage: bool,
    /// True if the temperature is above 85 degrees.
    pub is_hot: bool,
    /// True if the firmware has found an error after which the device cannot continue.
    pub is_fatal: bool,
    /// True if the CAN controller cannot be initialised.
    pub has_no_can: bool,
    /// True if the program does not reach the end of a cycle.
    pub is_hanging: bool,
    /// True if the supply is off.
    pub has_dropped: bool,
    /// True if the firmware requests to switch the supply off and on.
    pub wants_restart: bool,
    /// True if the operating system was erased since the last reset.
    pub has_been_erased: bool,
}

/// State that the device and the firmware at its port share.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shared(Arc<Mutex<Defects>>);

impl Shared {
    /// Returns the present faults.
    pub(crate) fn defects(&self) -> Defects {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, change: impl FnOnce(&mut Defects)) {
        change(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner));
    }

    /// Requests a restart of the device, as after switching the supply off and on.
    pub(crate) fn restart(&self) {
        self.change(|defects| defects.wants_restart = true);
    }

    /// Notes that the operating system was erased.
    pub(crate) fn erased(&self) {
        self.change(|defects| defects.has_been_erased = true);
    }
}

/// The parts of the device outside its port.
pub(crate) struct Hardware {
    retained: Retained,
    shared: Shared,
    flags: View<CS0015_FLAGS>,
    face: FirmwareHeader,
    has_program: bool,
    pulses: Pulses,
    events: Events,
}

impl Hardware {
    pub(crate) fn new(
        segment: &Segment,
        has_program: bool,
        shared: Shared,
        pulses: Pulses,
    ) -> Result<Self, MemoryError> {
        let (flags, face) = (segment.view(FLAGS)?, segment.firmware_header()?);
        let (retained, events) = (Retained::new(segment)?, Events::default());
        Ok(Hardware { retained, shared, flags, face, has_program, pulses, events })
    }

    /// Returns the operating state: a value of the register `front.state`.
    fn state(&self) -> u32 {
        self.face.front[FRONT_STATE].load()
    }

    /// True if an operating system is running, so that faults can be found.
    fn is_at_work(&self) -> bool {
        matches!(self.state(), state::RESET | state::RUN | state::STOP)
    }
}

impl SnapshotFields for Hardware {
    fn save(&self, to: &mut Saving) {
        let Self { retained, shared, flags: _, face: _, has_program: _, pulses, events } = self;
        retained.save(to);
        to.value(&(shared.defects(), pulses.waiting()));
        events.save(to);
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        self.retained.restore(from)?;
        let (defects, pulses) = from.value()?;
        self.shared.change(|now| *now = defects);
        self.pulses.replace(pulses);
        self.events.restore(from)
    }
}

impl Firmware for Hardware {
    fn start(&mut self, _: &mut Context) {
        // The port will read the parameters, so they must be stored first.
        self.retained.keep();
        self.shared.change(|defects| (defects.is_fatal, defects.has_been_erased) = (false, false));
    }

    fn stop(&mut self, _: &mut Context) {
        self.retained.keep();
        self.shared.change(|defects| defects.wants_restart = false);
    }

    fn look(&mut self, _: &mut Context) {
        self.retained.keep();
    }

    fn kept(&self) -> Option<&'static Area> {
        area()
    }

    fn starts_program(&self) -> bool {
        true
    }

    fn novram(&self) -> (&[u8], u32) {
        self.retained.novram()
    }

    fn keep(&mut self) {
        self.retained.keep();
    }

    fn fire(&mut self, _: u64, effect: &fault::Effect) -> Option<Hit> {
        if !self.is_at_work() {
            return None;
        }
        match effect.get()? {
            Effect::Memory => {
                let is_new = self.flags.ERROR_MEMORY.load() == bool::FALSE;
                is_new.then(|| self.flags.ERROR_MEMORY.store(bool::TRUE))?;
            }
            Effect::Fatal => {
                let is_new = !self.shared.defects().is_fatal;
                is_new.then(|| self.shared.change(|defects| defects.is_fatal = true))?;
            }
            // While such a fault is active, its effect is a condition. Nothing has to be done at its start.
            Effect::ShortCircuit(_)
            | Effect::WireBreak(_)
            | Effect::Supply(_)
            | Effect::Hot
            | Effect::NoCan
            | Effect::Hang => {
                return None;
            }
        }
        Some(Hit::Plain)
    }

    fn faults_changed(&mut self, _: u64, faults: &Faults, owner: Owner) {
        let mut found = Defects::default();
        for (_, effect) in faults.acting(owner) {
            match *effect {
                Effect::ShortCircuit(output) => found.short_circuits |= 1 << output,
                Effect::WireBreak(output) => found.wire_breaks |= 1 << output,
                Effect::Supply(SupplyFault::Voltage) => found.has_wrong_voltage = true,
                Effect::Supply(SupplyFault::Gone) => found.has_dropped = true,
                Effect::Hot => found.is_hot = true,
                Effect::NoCan => found.has_no_can = true,
                Effect::Hang => found.is_hanging = true,
                Effect::Memory | Effect::Fatal => {}
            }
        }
        self.shared.change(|defects| {
            let Defects { is_fatal, wants_restart, has_been_erased, .. } = *defects;
            *defects = Defects { is_fatal, wants_restart, has_been_erased, ..found };
        });
    }

    fn refusal(&self, setting: BoardSetting) -> Option<&'static str> {
        let BoardSetting::Front { word, value } = setting else { return None };
        if usize::from(word) != FRONT_PROGRAM || value == program::NOTHING {
            return None;
        }
        let asked = self.face.requested();
        if asked.front[FRONT_PROGRAM].load() != program::NOTHING {
            return Some("the previous command waits until the clock advances");
        }
        let readiness = Readiness {
            is_unlocked: asked.front[FRONT_S1].load() == s1::UNLOCK,
            has_program: self.has_program,
            has_been_erased: self.shared.defects().has_been_erased,
            state: self.state(),
        };
        readiness.check(value).err().map(RefusalReason::reason)
    }

    fn is_fed(&self) -> bool {
        let defects = self.shared.defects();
        !defects.has_dropped && !defects.wants_restart
    }

    fn event_level(&self, event: usize) -> Option<u8> {
        events::level(event)
    }

    /// Event 1 occurs in each cycle of the program, and needs no enabling.
    fn answers_interrupts(&mut self) -> bool {
        false
    }

    fn events(&mut self) -> Option<&mut Events> {
        self.pulses.pass_to(&mut self.events);
        Some(&mut self.events)
    }
}
