//! A CANsync master: brings its slaves into operation, sends a reference value, waits until all of them have
//! reached it, reads a parameter of the first one, and signals the end to them.
//!
//! At the built-in plant, three drives:
//!
//!     commram with -- cargo run --example master
//!
//! With slaves of other numbers: `cargo run --example master -- line 1 4 5`.

#![allow(non_snake_case, reason = "the manual's names, letter for letter")]

mod common;

use common::{Arguments, END, HIGH, SYNC, VALUES, check};
use commram::devices::omega_drive_line_2::blocks::*;
use commram::devices::omega_drive_line_2::registers::{
    CANsync_INIT_BMSTRUCT, CANsync_MA_CTRL_BMSTRUCT, NODE2,
};
use commram::memory::MemoryError;
use commram::memory::header::Start;

/// Reference value for all slaves.
const REFERENCE: i32 = 5000;
/// Parameter "speed actual value" of a drive.
const SPEED: u16 = 301;
/// State of a slave that responds and is synchronized.
const SYNCHRONIZED: u8 = 0x03;

struct Master {
    ram: Ram,
    _CANsync_INIT_MA: Base<CANsync_INIT_BMSTRUCT>,
    _CANsync_CTRL_MA: Base<CANsync_MA_CTRL_BMSTRUCT>,
    slaves: Vec<u8>,
    a_RD_ARRAY: CANsync_RD_BMARRAY,
    init: CANsync_INIT,
    event: INTR_SET,
    mode: CANsync_MODE_MA,
    comm: CANsync_PD_COMM_MA,
    read: CANsync_PAR_READ_MA,
    end: CANsync_BC_MA0,
    /// True if the command that signals the end has been entered.
    ending: bool,
}

impl Master {
    fn new(ram: Ram, slaves: Vec<u8>) -> Result<Self, MemoryError> {
        let slaves = if slaves.is_empty() { vec![1, 2, 3] } else { slaves };
        let highest = slaves.iter().max().map_or(0, |slave| *slave as i8);
        let mut init = CANsync_INIT { us_BAUDRATE: 5, us_SYNC_INTERVAL: 2, ..Default::default() };
        for (number, slave_type) in init.a_SL_TYP.iter_mut().enumerate() {
            *slave_type = u8::from(slaves.iter().any(|slave| usize::from(*slave) == number));
        }
        Ok(Master {
            _CANsync_INIT_MA: ram.at(NODE2)?,
            _CANsync_CTRL_MA: ram.at(NODE2)?,
            a_RD_ARRAY: [[0; 16]; 32],
            init,
            event: INTR_SET { i_EVENT: SYNC as i8, x_EN: true, ..Default::default() },
            mode: CANsync_MODE_MA { x_SYNC_MODE: true, ..Default::default() },
            comm: CANsync_PD_COMM_MA {
                a_WR_VALUES_SEND: [REFERENCE, 0, 0, 0, 0, 0, 0, 0],
                si_WRC1_SEND: 5,
                si_MAX_SL_NR: highest,
                x_COPY_TO_RD_ARRAY: true,
                ..Default::default()
            },
            read: CANsync_PAR_READ_MA { u_PAR_NR: SPEED, si_SL_NR: slaves[0] as i8, ..Default::default() },
            end: CANsync_BC_MA0 { us_BC_CMD_NR: END, d_SL_MASK: u32::MAX, ..Default::default() },
            ending: false,
            slaves,
            ram,
        })
    }

    fn configure(&self) {
        CANsync_PD_CFG_MA { a_WRC1: VALUES, a_HL_WRC1: HIGH, ..Default::default() }
            .call(&self._CANsync_CTRL_MA);
        for slave in &self.slaves {
            let (si_SL_NR, a_RDC1, a_HL_RDC1) = (*slave as i8, VALUES, HIGH);
            CANsync_PD_CFG_READ_MA { si_SL_NR, a_RDC1, a_HL_RDC1, ..Default::default() }
                .call(&self._CANsync_CTRL_MA);
        }
        CANsync_COMM_CONTROL_MA { x_EN_CTRL: true, x_EN_PAR: true, x_EN_UDL: true, ..Default::default() }
            .call(&self._CANsync_CTRL_MA);
    }

    fn actual_values(&self) -> impl Iterator<Item = i32> {
        self.slaves.iter().map(|slave| self.a_RD_ARRAY[usize::from(*slave)][0])
    }
}

impl Program for Master {
    type Error = String;

    fn initialize(&mut self, _: Start) {
        if let Ok(new) = Master::new(self.ram.clone(), self.slaves.clone()) {
            *self = new;
        }
    }

    /// Calls the blocks in the order of the manual, p. 132.
    fn cold_start(&mut self) -> Result<Progress, String> {
        if !self.init.x_OK {
            self.init.call(&self._CANsync_INIT_MA);
            check(self.init.x_ERR, "CANsync_INIT", self.init.w_ERR)?;
            if !self.init.x_OK {
                return Ok(Progress::Again);
            }
            self.configure();
            println!("initialized, waiting for slaves {:?}", self.slaves);
        }
        self.event.call(&self.ram);
        check(self.event.x_ERR, "INTR_SET", 0)?;
        let states = &self._CANsync_CTRL_MA.a_STAT_SL;
        let ready = |slave: &u8| states[usize::from(*slave)].load() == SYNCHRONIZED;
        self.mode.x_CANsync_RUN = self.slaves.iter().all(ready);
        self.mode.call(&self._CANsync_CTRL_MA);
        Ok(Progress::done_if(self.mode.x_CANsync_ACTIV && self.event.is_answered()))
    }

    /// Sends the reference value of this interval and reads the actual values of the last interval, directly after the
    /// SYNC edge.
    fn event(&mut self, _number: usize, _missed: u32) -> Result<(), String> {
        self.comm.call(&self._CANsync_CTRL_MA, &mut self.a_RD_ARRAY);
        Ok(())
    }

    fn cyclic(&mut self) -> Result<Progress, String> {
        let reached = self.actual_values().all(|value| value == REFERENCE);
        if reached && !self.read.x_EN {
            println!("all slaves have reached reference value {REFERENCE}");
            self.read.x_EN = true;
        }
        self.read.call(&self._CANsync_CTRL_MA);
        check(self.read.x_ERR, "CANsync_PAR_READ_MA", self.read.b_ERR.into())?;
        // The command is entered in one cycle. The following cycles wait until it has been sent.
        let read = self.read.x_OK;
        self.end.x_EN = read && !self.ending;
        self.end.call(&self._CANsync_CTRL_MA);
        if self.end.x_EN {
            println!("parameter {SPEED} of slave {}: {}", self.slaves[0], self.read.ud_PAR_VALUE);
            self.ending = true;
            return Ok(Progress::Again);
        }
        Ok(Progress::done_if(self.ending && self.end.x_OK))
    }
}

fn main() -> std::process::ExitCode {
    common::run(Arguments::parse("line"), SYNC, |ram, arguments| Master::new(ram, arguments.numbers.clone()))
}
