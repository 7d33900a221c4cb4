//! Configuration example B of the manual (5.00005.03a p. 64-66): the event task of board timer A exchanges process data
//! over the BAPS every millisecond. The same timer triggers the drive and the option cards. The drive follows an angle.
//!
//!     commram with -- cargo run --example baps_timer

#![allow(non_snake_case, reason = "the manual's names, letter for letter")]

mod common;

use common::drive::SynchronousDrive;
use common::{Arguments, check};
use commram::devices::omega_drive_line_2::blocks::*;
use commram::memory::MemoryError;
use commram::memory::header::Start;

/// Event "board timer A" with high priority.
const TIMER_A: usize = 5;
/// Divider of board timer A for a period of 1 ms: (2499 + 1) x 2 / 5 MHz.
const DIVIDER: u16 = 2499;
const SLOT_US: u16 = 1000;
/// Value of `w_COMMAND_REG`: two reference and two actual values in every communication, and a communication every 1
/// ms.
const COMMAND_REG: u16 = 0x0024;
/// Mask of the angle reference value for a SYNC slot (P167) of 1000 us and a PWM frequency (P103) of 4 kHz (p. 74).
const MASK: u32 = 0xFFFF_FFF8;

/// The PLC program of the example.
pub(crate) struct Timer {
    ram: Ram,
    triggers: OPT_INIT,
    event: INTR_SET,
    drive: SynchronousDrive,
}

impl Timer {
    /// Makes the program on the RAM of a PLC.
    pub(crate) fn new(ram: Ram) -> Result<Self, MemoryError> {
        Ok(Timer {
            triggers: OPT_INIT {
                us_MODE_TRIGGER_1: 4,
                us_MODE_TRIGGER_2: 4,
                us_MODE_TRIGGER_CONTROLLER: 2,
                u_DIVIDER_TIMER_A: DIVIDER,
                x_EN_TIMER_A: true,
                ..Default::default()
            },
            event: INTR_SET { i_EVENT: TIMER_A as i8, x_EN: true, ..Default::default() },
            drive: SynchronousDrive::new(&ram, SLOT_US, COMMAND_REG, MASK)?,
            ram,
        })
    }
}

impl Program for Timer {
    type Error = String;

    fn initialize(&mut self, _: Start) {
        if let Ok(new) = Timer::new(self.ram.clone()) {
            *self = new;
        }
    }

    /// Sets triggers and timer first, then the event (p. 64-65).
    fn cold_start(&mut self) -> Result<Progress, String> {
        if !self.triggers.x_OK {
            self.triggers.call(&self.ram);
            return check(self.triggers.x_ERR, "OPT_INIT", 0).map(|()| Progress::Again);
        }
        self.event.call(&self.ram);
        check(self.event.x_ERR, "INTR_SET", 0)?;
        Ok(Progress::done_if(self.event.is_answered()))
    }

    fn event(&mut self, _number: usize, _missed: u32) -> Result<(), String> {
        self.drive.exchange()
    }

    fn cyclic(&mut self) -> Result<Progress, String> {
        let progress = self.drive.cyclic()?;
        if progress == Progress::Done {
            println!("the drive has followed timer A to angle 16#{:08X}", self.drive.end());
        }
        Ok(progress)
    }
}

fn main() -> std::process::ExitCode {
    common::run(Arguments::parse("line"), TIMER_A, |ram, _| Timer::new(ram))
}
