//! Common part of all example programs: attach to a PLC of a running emulator, and run their tasks.

#![allow(dead_code, reason = "each example uses a part of it")]

pub(crate) mod drive;

use commram::devices::omega_drive_line_2::blocks::{
    Base, CANsync_PAR_SL, CANsync_PD_CFG_SL, Program, Ram, Tasks,
};
use commram::devices::omega_drive_line_2::registers::{CANsync_SL_CTRL_BMSTRUCT, LAYOUT_HASH};
use commram::memory::{AttachMode, Image, MemoryError};
use std::process::ExitCode;
use std::time::Duration;

/// Number of the event "SYNC of the network".
pub(crate) const SYNC: usize = 12;
/// Command number with which the master ends the example programs of its slaves.
pub(crate) const END: u8 = 128;
/// For each word of frame 1, the number of the value in the word: value 0 is a doubleword in words 0 and 1.
pub(crate) const VALUES: [i8; 4] = [0, 0, -1, -1];
/// For each word of frame 1, true if it is the high word of its value.
pub(crate) const HIGH: [bool; 4] = [false, true, false, false];
/// Maximum time without progress.
const PATIENCE: Duration = Duration::from_secs(60);

/// Instance and PLC of a program, from the command line: `[-i INSTANCE] [PLC [NUMBERS...]]`. The variable COMMRAM_INSTANCE also
/// names the instance, as for all commands of commram.
pub(crate) struct Arguments {
    instance: String,
    plc: String,
    /// Numbers that follow the PLC on the command line.
    pub numbers: Vec<u8>,
}

impl Arguments {
    /// Reads the command line; `plc` is the default PLC.
    pub(crate) fn parse(plc: &str) -> Result<Self, String> {
        let mut words = std::env::args().skip(1).peekable();
        let mut instance = std::env::var("COMMRAM_INSTANCE").unwrap_or_else(|_| "default".to_owned());
        if words.next_if(|word| word == "-i").is_some() {
            instance = words.next().ok_or("-i needs the name of an instance")?;
        }
        let plc = words.next().unwrap_or_else(|| plc.to_owned());
        let number = |word: String| {
            let number = word.parse().ok().filter(|number| *number < 32);
            number.ok_or_else(|| format!("'{word}' is no slave number: 0 to 31"))
        };
        Ok(Arguments { instance, plc, numbers: words.map(number).collect::<Result<_, _>>()? })
    }
}

/// Runs a program until it ends: the cyclic task every 10 ms, and a task for one event.
pub(crate) fn run<P: Program<Error = String>>(
    arguments: Result<Arguments, String>,
    event: usize,
    program: impl FnOnce(Ram, &Arguments) -> Result<P, MemoryError>,
) -> ExitCode {
    let result = arguments.and_then(|arguments| {
        let (instance, plc) = (&arguments.instance, &arguments.plc);
        let attached = Image::attach(instance, plc, AttachMode::ReadWrite, Some(LAYOUT_HASH));
        let attached = attached.map_err(|error| error.to_string())?;
        let ram = Ram::of(attached.segment()).map_err(|error| error.to_string())?;
        let program = program(ram.clone(), &arguments).map_err(|error| error.to_string())?;
        let mut tasks = Tasks::load(&ram, program, Duration::from_millis(10), &[event]);
        tasks.run(&attached, PATIENCE).map_err(|error| error.to_string())
    });
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

/// Returns an error if a block has failed.
pub(crate) fn check(failed: bool, block: &str, error: u16) -> Result<(), String> {
    if failed { Err(format!("{block} has failed: 16#{error:04X}")) } else { Ok(()) }
}

/// Maps the process data of a slave.
pub(crate) fn map_slave(_BASE: &Base<CANsync_SL_CTRL_BMSTRUCT>) {
    let (a_WRC1, a_HL_WRC1, a_RDC1, a_HL_RDC1) = (VALUES, HIGH, VALUES, HIGH);
    CANsync_PD_CFG_SL { a_WRC1, a_HL_WRC1, a_RDC1, a_HL_RDC1, ..Default::default() }.call(_BASE);
}

/// Error number "no such parameter".
const NOT_PRESENT: i16 = -5;

/// The application of a slave without parameters: refuses every parameter job. (The firmware answers for its status
/// word, D-06.)
pub(crate) struct Application {
    jobs: CANsync_PAR_SL,
}

impl Default for Application {
    fn default() -> Self {
        Application { jobs: CANsync_PAR_SL { x_EN: true, i_ERR: NOT_PRESENT, ..Default::default() } }
    }
}

impl Application {
    /// Runs one PLC cycle.
    pub(crate) fn cycle(&mut self, _BASE: &Base<CANsync_SL_CTRL_BMSTRUCT>) {
        self.jobs.call(_BASE);
        self.jobs.x_ERR_IN = self.jobs.x_ACTIV;
    }
}
