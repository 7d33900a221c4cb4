//! Configuration example A of the manual (5.00005.03a p. 62-63): the event task exchanges process data over the BAPS,
//! and the drive itself starts the task. Brings the drive into operation, waits until it runs at the requested speed,
//! and reads its speed limit.
//!
//!     commram with -- cargo run --example baps

#![allow(non_snake_case, reason = "the manual's names, letter for letter")]

mod common;

use common::drive::{CYCLES_BEFORE_INIT, control_word};
use common::{Arguments, check};
use commram::devices::omega_drive_line_2::blocks::*;
use commram::devices::omega_drive_line_2::registers::{BAPS, BAPS_CTRL_BMSTRUCT};
use commram::memory::MemoryError;
use commram::memory::header::Start;

/// Event "BAPS process data" with high priority.
const PROCESS_DATA: usize = 8;
/// Value of `w_COMMAND_REG`: two reference and two actual values in every communication, and a communication every 2
/// ms.
const COMMAND_REG: u16 = 0x0044;
/// Parameters of the drive: speed reference value, speed actual value, speed limit.
const SPEED_REFERENCE: u16 = 300;
const SPEED_ACTUAL: u16 = 301;
const SPEED_LIMIT: u16 = 305;
const SPEED: u32 = 5000;

/// The PLC program of the example.
pub(crate) struct Drive {
    ram: Ram,
    cycles: u32,
    _BAPS: Base<BAPS_CTRL_BMSTRUCT>,
    _BAPS_SD_DATA: BAPS_BMSTRUCT,
    init: BAPS_INIT,
    comm: BAPS_PD_COMM2,
    watch: BAPS_PD_CONTROL,
    read: BAPS_PAR_READ,
    service: BAPS_SD_CONTROL,
}

impl Drive {
    /// Makes the program on the RAM of a PLC.
    pub(crate) fn new(ram: Ram) -> Result<Self, MemoryError> {
        Ok(Drive {
            _BAPS: ram.at(BAPS)?,
            _BAPS_SD_DATA: BAPS_BMSTRUCT::default(),
            init: BAPS_INIT {
                i_EVENT: PROCESS_DATA as i16,
                w_COMMAND_REG: COMMAND_REG,
                u_WR_PAR_NR0: SPEED_REFERENCE,
                u_RD_PAR_NR0: SPEED_ACTUAL,
                ..Default::default()
            },
            comm: BAPS_PD_COMM2 {
                us_MODE: 1,
                w_COMMAND_REG: COMMAND_REG,
                ud_WR_VALUE0: SPEED,
                ..Default::default()
            },
            watch: BAPS_PD_CONTROL::default(),
            read: BAPS_PAR_READ { u_PAR_NR: SPEED_LIMIT, ..Default::default() },
            service: BAPS_SD_CONTROL::default(),
            cycles: 0,
            ram,
        })
    }
}

impl Program for Drive {
    type Error = String;

    fn initialize(&mut self, _: Start) {
        if let Ok(new) = Drive::new(self.ram.clone()) {
            *self = new;
        }
    }

    /// Does nothing, because the cyclic task starts the event.
    fn cold_start(&mut self) -> Result<Progress, String> {
        Ok(Progress::Done)
    }

    /// Reads the values that the drive has transferred.
    fn event(&mut self, _number: usize, _missed: u32) -> Result<(), String> {
        self.comm.w_CONTROLWORD = control_word(self.comm.w_STATUSWORD);
        self.comm.call(&self._BAPS);
        check(self.comm.x_ERR, "BAPS_PD_COMM2", self.comm.b_SL_QUIT.into())
    }

    /// Calls `BAPS_INIT` once, and not before the sixth cycle (p. 63). This block enables the event as well.
    fn cyclic(&mut self) -> Result<Progress, String> {
        self.cycles += 1;
        if !self.init.x_OK {
            if self.cycles > CYCLES_BEFORE_INIT {
                self.init.call(&self._BAPS);
            }
            return check(self.init.x_ERR, "BAPS_INIT", self.init.b_ERR.into()).map(|()| Progress::Again);
        }
        self.watch.call(&self._BAPS);
        check(self.watch.x_ERR, "BAPS_PD_CONTROL", 0)?;
        if self.comm.ud_RD_VALUE0 == SPEED && !self.read.x_EN {
            println!("the drive runs at {SPEED}");
            self.read.x_EN = true;
        }
        self.read.call(&mut self._BAPS_SD_DATA);
        self.service.call(&self._BAPS, &mut self._BAPS_SD_DATA);
        check(self.read.x_ERR, "BAPS_PAR_READ", self.read.i_ERR_DETAIL as u16)?;
        if self.read.x_OK {
            println!("parameter {SPEED_LIMIT}: {}", self.read.ud_PAR_VALUE);
        }
        Ok(Progress::done_if(self.read.x_OK))
    }
}

fn main() -> std::process::ExitCode {
    common::run(Arguments::parse("line"), PROCESS_DATA, |ram, _| Drive::new(ram))
}
