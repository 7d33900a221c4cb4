//! The board's front panel, its power, and the start of the PLC program (manual 5.00005.03a p. 22, 38-40, 51).

use super::{FRONT, Header};
use crate::identity::PortNumber;
use crate::memory::struct_tables::publish;
use crate::memory::{Bell, Cell32, SharedRegs};
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

/// The board's front panel. Clients write the switches and LEDs, the firmware writes the display.
#[derive(FromBytes, IntoBytes, KnownLayout, Debug)]
#[repr(C)]
pub struct Board {
    /// DIP switch S33, switches 1 to 5: 0 to 31. The firmware reads it at power-on and reset only.
    pub dip: Cell32,
    /// The four LEDs in bits 0 to 3, red top, green top, red bottom, green bottom: function block `LED`
    /// (manual p. 51) of the PLC. The firmware clears them at reset.
    pub leds: Cell32,
    /// The character on the seven-segment display (ASCII) in bits 0 to 7, the decimal point in bit 8; 0 is dark.
    pub display: Cell32,
    /// Position of the switch RUN/STOP/RESET, a [`RunSwitch`].
    pub switch: Cell32,
}

/// The PLC program, its starts, and the power switch.
#[derive(FromBytes, IntoBytes, KnownLayout, Debug)]
#[repr(C)]
pub struct Program {
    /// A [`ProgramState`], written by the PLC; also by the firmware, if a project is loaded or deleted without the PLC.
    pub state: Cell32,
    /// Request of a client: a [`Start`]; the firmware sets it back to 0.
    pub start_request: Cell32,
    /// Rung by the firmware when the PLC program must start or stop; `start_kind` selects which.
    pub start: Bell,
    /// A [`Start`], stored before `start` rings.
    pub start_kind: Cell32,
    /// A [`Power`], written by clients.
    pub power: Cell32,
    /// Counts power-ons and resets of this PLC, from 1. The registers then have their start values, no event is
    /// enabled, and `OPT_INIT` may run again.
    pub restarts: Cell32,
    /// The DIP number in effect, which is that of the switches at the last power-on or reset.
    pub dip_latched: Cell32,
}

codes! {
    /// The RUN/STOP/RESET switch (manual p. 40).
    RunSwitch {
        /// The PLC program may run.
        Run = 0,
        /// The PLC program is stopped.
        Stop = 1,
        /// The switch is held in RESET. When it is released, it springs back to STOP.
        Reset = 2,
    }
}
codes! {
    /// State of the PLC program, which the seven-segment display shows (manual p. 40).
    ProgramState {
        /// No project is loaded.
        None = 0,
        /// A project is loaded, and its program does not run.
        Stopped = 1,
        /// The start task of a cold or warm start runs.
        Initializing = 2,
        /// The cyclic tasks run.
        Cyclic = 3,
        /// The boot project is being erased.
        ErasingBootProject = 4,
        /// A boot project is being copied to the flash memory.
        CopyingBootProject = 5,
        /// The boot project has been copied.
        BootProjectCopied = 6,
    }
}
codes! {
    /// The loaded project. Its kind decides whether it survives power-off and reset (manual p. 37).
    Project {
        /// The program is not started.
        None = 0,
        /// The boot project. A copy is in the flash memory, so it survives power-off.
        Boot = 1,
        /// A project that was only sent to the RAM. It is lost at the next power-off or reset.
        Sent = 2,
    }
}
codes! {
    /// Kind of the start of a PLC program (manual p. 38).
    Start {
        /// No start or stop is requested.
        None = 0,
        /// All variables get their initial values, retain ones too.
        Cold = 1,
        /// Retain variables keep their values.
        Warm = 2,
        /// The start initializes no variables.
        Hot = 3,
        /// The program must stop.
        Stop = 4,
    }
}
codes! {
    /// The supply of one PLC.
    Power {
        /// The supply is on.
        On = 0,
        /// The supply is off.
        Off = 1,
    }
}

// SAFETY: every field is a cell or a struct of cells; IntoBytes proves that there is no padding and FromBytes
// that any bit pattern is valid.
unsafe impl SharedRegs for Board {}
// SAFETY: as above.
unsafe impl SharedRegs for Program {}

publish! { Board: 0 => dip, 4 => leds, 8 => display, 12 => switch }
publish! { Program:
    0 => state, 4 => start_request, 8 => start, 16 => start_kind, 20 => power, 24 => restarts, 28 => dip_latched,
}
const _: () = assert!(size_of::<Board>() == 16 && size_of::<Program>() == 32);

impl Board {
    /// Sets the front panel to its state before power-on: LEDs and display dark, all switches 0.
    pub fn clear(&self) {
        [&self.dip, &self.leds, &self.display, &self.switch].iter().for_each(|cell| cell.store(0));
    }
}

impl Program {
    /// State before power-on: no program, power on, no start requested.
    pub(super) fn clear(&self) {
        let cells = [
            &self.state,
            &self.start_request,
            &self.start_kind,
            &self.power,
            &self.restarts,
            &self.dip_latched,
        ];
        cells.iter().for_each(|cell| cell.store(0));
    }
}

/// State of the board, for tools. Numbers are those of the header page.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[cfg_attr(feature = "emulator", derive(serde::Serialize))]
#[repr(C)]
pub struct BoardState {
    /// Present position of DIP switch S33.
    pub dip: u32,
    /// The DIP number in effect, which is that of the switches at the last power-on or reset.
    pub dip_latched: u32,
    /// Value of the cell for the LEDs.
    pub leds: u32,
    /// Character on the seven-segment display.
    pub display: u32,
    /// Position of the switch RUN/STOP/RESET, a [`RunSwitch`].
    pub switch: u32,
    /// State of the supply, a [`Power`].
    pub power: u32,
    /// State of the PLC program, a [`ProgramState`].
    pub program: u32,
    /// The last requested [`Start`].
    pub start_kind: u32,
    /// Number of power-ons and resets.
    pub restarts: u32,
    /// Project on the board, a [`Project`].
    pub project: u32,
}

impl BoardState {
    /// Reads a header page.
    pub fn of(header: &Header) -> Self {
        let Header { board, program, .. } = header;
        BoardState {
            project: header.project.load(),
            dip: board.dip.load(),
            dip_latched: program.dip_latched.load(),
            leds: board.leds.load(),
            display: board.display.load(),
            switch: board.switch.load(),
            power: program.power.load(),
            program: program.state.load(),
            start_kind: program.start_kind.load(),
            restarts: program.restarts.load(),
        }
    }

    /// True if a program can be started or stopped: one is loaded, the switch is at RUN, and the power is on (manual
    /// p. 38).
    pub fn takes_starts(&self) -> bool {
        self.switch == RunSwitch::Run.code()
            && self.power == Power::On.code()
            && self.program != ProgramState::None.code()
    }

    /// Returns the display as text: a character, followed by a point if it is lit; a blank if it is dark.
    pub fn display_text(&self) -> String {
        let character = match self.display as u8 {
            0 => ' ',
            code => char::from(code),
        };
        let point = if self.display & 0x100 != 0 { "." } else { "" };
        format!("{character}{point}")
    }
}

/// Action of a tool on a board.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BoardSetting {
    /// Sets the DIP switch, 0 to 31.
    Dip(u8),
    /// Sets the LEDs, four bits.
    Leds(u8),
    /// Turns the RUN/STOP/RESET switch.
    Switch(RunSwitch),
    /// Switches the supply on or off.
    Power(Power),
    /// Requests a start or a stop of the program.
    Start(Start),
    /// Loads a project, or deletes the loaded one.
    Project(Project),
    /// Presses RESET and releases it.
    Reset,
    /// Switches the supply off and on.
    PowerCycle,
    /// Sets the DIP switches of a module.
    ModuleDip {
        /// Number of the port with the module.
        port: PortNumber,
        /// Number on the DIP switches, 0 to 31.
        dip: u8,
    },
    /// Sets a word of the front panel that clients write.
    Front {
        /// Index of the word in [`Header::front`].
        word: u8,
        /// New value of the word.
        value: u32,
    },
}

/// Settings from this number on are words of the front panel.
const FRONT_SETTINGS: u32 = 0x100;

impl BoardSetting {
    /// Encodes the setting as two numbers: its kind and its value.
    pub fn numbers(self) -> (u32, u32) {
        match self {
            BoardSetting::Dip(number) => (1, number.into()),
            BoardSetting::Leds(leds) => (2, leds.into()),
            BoardSetting::Switch(switch) => (3, switch.code()),
            BoardSetting::Power(power) => (4, power.code()),
            BoardSetting::Start(start) => (5, start.code()),
            BoardSetting::Reset => (6, 0),
            BoardSetting::PowerCycle => (7, 0),
            BoardSetting::Project(project) => (8, project.code()),
            BoardSetting::ModuleDip { port, dip } => (9, u32::from(port.0) << 8 | u32::from(dip)),
            BoardSetting::Front { word, value } => (FRONT_SETTINGS + u32::from(word), value),
        }
    }

    /// Decodes a setting; `None` for numbers without meaning.
    pub fn from_numbers(which: u32, value: u32) -> Option<Self> {
        let up_to = |value: u32, limit: u8| u8::try_from(value).ok().filter(|value| *value <= limit);
        Some(match (which, value) {
            (1, _) => BoardSetting::Dip(up_to(value, 31)?),
            (2, _) => BoardSetting::Leds(up_to(value, 15)?),
            (3, _) => BoardSetting::Switch(RunSwitch::from_code(value)?),
            (4, _) => BoardSetting::Power(Power::from_code(value)?),
            (5, _) => BoardSetting::Start(Start::from_code(value).filter(|start| *start != Start::None)?),
            (6, 0) => BoardSetting::Reset,
            (7, 0) => BoardSetting::PowerCycle,
            (8, _) => BoardSetting::Project(Project::from_code(value)?),
            (9, _) => BoardSetting::ModuleDip {
                port: PortNumber(up_to(value >> 8, u8::MAX)?),
                dip: up_to(value & 0xFF, 31)?,
            },
            (FRONT_SETTINGS.., _) => {
                let word = up_to(which - FRONT_SETTINGS, (FRONT - 1) as u8)?;
                BoardSetting::Front { word, value }
            }
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use zerocopy::FromZeros;

    #[test]
    fn a_start_takes_run_power_and_a_program() {
        let ready = BoardState {
            switch: RunSwitch::Run.code(),
            power: Power::On.code(),
            program: ProgramState::Stopped.code(),
            ..BoardState::of(&Header::new_zeroed())
        };
        assert!(ready.takes_starts());
        for missing in [
            BoardState { switch: RunSwitch::Stop.code(), ..ready },
            BoardState { power: Power::Off.code(), ..ready },
            BoardState { program: ProgramState::None.code(), ..ready },
        ] {
            assert!(!missing.takes_starts(), "{missing:?}");
        }
    }
}
