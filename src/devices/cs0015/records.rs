//! What the journal tells of a CS0015.

use super::registers::DEVICE;
use crate::devices::canopen::records::NODE_STATE;
use crate::event_kinds;
use crate::journal::{EventCodec, EventText, Fields, Kind, Reader};

/// All kinds.
pub static KINDS: &[&Kind] =
    &[ControllerState::KIND, NODE_STATE, CommandRefused::KIND, JobRefused::KIND, Watchdog::KIND];

event_kinds! {
    /// The controller is in another operating state (p. 13).
    ControllerState = 60, "controller_state", Rare, at plc {
        /// As `state` of the front.
        to: u8,
    }
    /// A command of the programming system was not carried out.
    CommandRefused = 62, "command_refused", Rare, at plc {
        /// As `program` of the front.
        command: u8,
        /// A [`Refused`].
        why: u8,
    }
    /// What the program asked of the operating system was not carried out.
    JobRefused = 63, "job_refused", Rare, at plc {
        /// As `a_FUNCTION` of the job block.
        function: u16,
        /// As `a_ERROR` of the job block.
        error: u8,
    }
    /// The program has not ended its cycle in time, and the watchdog resets the device (p. 7).
    Watchdog = 93, "watchdog", Rare, at plc {}
}

/// Why a command of the programming system is not carried out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::CheckedBitPattern)]
#[repr(u8)]
pub enum Refused {
    /// There is no program.
    NoProgram = 0,
    /// S1 stands at LOCK.
    Locked = 1,
    /// It is not for this operating state.
    State = 2,
    /// The device needs a reset first.
    NeedsReset = 3,
}

impl Refused {
    /// The reason for people.
    pub(super) const fn reason(self) -> &'static str {
        match self {
            Refused::NoProgram => "there is no program",
            Refused::Locked => "S1 stands at LOCK",
            Refused::State => "not in this operating state",
            Refused::NeedsReset => "the device needs a reset first",
        }
    }

    fn text(code: u8) -> &'static str {
        bytemuck::checked::try_cast(code).map_or("unknown", Refused::reason)
    }
}

/// What a value of a word of the front is called.
fn called(word: &str, value: u8) -> String {
    let word = DEVICE.front.iter().find(|known| known.name == word);
    word.map_or_else(|| value.to_string(), |word| word.called(value.into()))
}

impl EventText for ControllerState {
    fn text(&self, _: &mut Reader) -> String {
        format!("controller: {}", called("state", self.to))
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        Fields::new().with("to", called("state", self.to))
    }
}

impl EventText for CommandRefused {
    fn text(&self, _: &mut Reader) -> String {
        let why = Refused::text(self.why);
        format!("command of the programming system refused ({}): {why}", called("program", self.command))
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        Fields::new().with("command", called("program", self.command)).with("why", Refused::text(self.why))
    }
}

impl EventText for JobRefused {
    fn text(&self, _: &mut Reader) -> String {
        let [function, error] = self.called();
        format!("job refused: {function}: {error}")
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        let [function, error] = self.called();
        Fields::new().with("function", function).with("error", error)
    }
}

impl EventText for Watchdog {
    fn text(&self, _: &mut Reader) -> String {
        "watchdog: the program has not ended its cycle within 200 ms; the device is reset".to_owned()
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        Fields::new()
    }
}

impl JobRefused {
    /// Function and error as the layout names them.
    fn called(&self) -> [String; 2] {
        let jobs = DEVICE.area("jobs").ok().into_iter().flat_map(|area| area.structures);
        let registers: Vec<_> = jobs.flat_map(|placed| placed.structure.registers).collect();
        [("a_FUNCTION", u32::from(self.function)), ("a_ERROR", u32::from(self.error))].map(|(name, value)| {
            let register = registers.iter().find(|register| register.name == name);
            let known = register.and_then(|register| register.meaning?.value(value));
            // The arguments of a function stand behind it.
            known.map_or_else(
                || format!("16#{value:04X}"),
                |it| it.text.split(" (").next().unwrap_or(it.text).to_owned(),
            )
        })
    }
}
