//! Journal events of a CS0015.

use crate::devices::canopen::records::NODE_STATE;
use crate::devices::cs0015::registers::DEVICE;
use crate::event_kinds;
use crate::journal::{EventCodec, EventKind, EventText, Fields, Reader};

/// All event kinds of this module.
pub(crate) static KINDS: &[&EventKind] =
    &[ControllerState::KIND, NODE_STATE, CommandRefused::KIND, JobRefused::KIND, Watchdog::KIND];

event_kinds! {
    /// The operating state of the controller has changed (p. 13).
    ControllerState = 60, "controller_state", Rare, at plc {
        /// Operating state: a value of the register `front.state`.
        to: u8,
    }
    /// A command of the programming system was not carried out.
    CommandRefused = 62, "command_refused", Rare, at plc {
        /// Command: a value of the register `front.program`.
        command: u8,
        /// Reason for the refusal, a [`RefusalReason`].
        why: u8,
    }
    /// An order of the program to the operating system was not carried out.
    JobRefused = 63, "job_refused", Rare, at plc {
        /// Function, as in `a_FUNCTION` of the job block.
        function: u16,
        /// Error, as in `a_ERROR` of the job block.
        error: u8,
    }
    /// The program has not ended its cycle in time, and the watchdog resets the device (p. 7).
    Watchdog = 93, "watchdog", Rare, at plc {}
}

/// Reason for which a command of the programming system is not carried out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::CheckedBitPattern)]
#[repr(u8)]
pub(crate) enum RefusalReason {
    /// No program is loaded.
    NoProgram = 0,
    /// S1 is at LOCK.
    Locked = 1,
    /// The operating state does not permit the command.
    State = 2,
    /// The device needs a reset first.
    NeedsReset = 3,
}

impl RefusalReason {
    /// Returns the reason as a text.
    pub(super) const fn reason(self) -> &'static str {
        match self {
            RefusalReason::NoProgram => "there is no program",
            RefusalReason::Locked => "S1 is at LOCK",
            RefusalReason::State => "not in this operating state",
            RefusalReason::NeedsReset => "the device needs a reset first",
        }
    }

    fn text(code: u8) -> &'static str {
        bytemuck::checked::try_cast(code).map_or("unknown", RefusalReason::reason)
    }
}

/// Returns the name of a value of a front panel word.
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
        let why = RefusalReason::text(self.why);
        format!("command of the programming system refused ({}): {why}", called("program", self.command))
    }

    fn fields(&self, _: &mut Reader) -> Fields {
        Fields::new()
            .with("command", called("program", self.command))
            .with("why", RefusalReason::text(self.why))
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
    /// Returns function and error as in the layout.
    fn called(&self) -> [String; 2] {
        let jobs = DEVICE.area("jobs").ok().into_iter().flat_map(|area| area.structures);
        let registers: Vec<_> = jobs.flat_map(|placed| placed.structure.registers).collect();
        [("a_FUNCTION", u32::from(self.function)), ("a_ERROR", u32::from(self.error))].map(|(name, value)| {
            let register = registers.iter().find(|register| register.name == name);
            let known = register.and_then(|register| register.meaning?.value(value));
            // In the text of the layout, the arguments follow the name of the function. Only the name is
            // used.
            known.map_or_else(
                || format!("16#{value:04X}"),
                |it| it.text.split(" (").next().unwrap_or(it.text).to_owned(),
            )
        })
    }
}
