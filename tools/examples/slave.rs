//! A CANsync slave: reports every reference value as its own actual value, until the master signals the end.
//!
//!     commram run tools/examples/plant.toml --detach
//!     cargo run --example slave &
//!     cargo run --example master -- line 1 4
//!     wait
//!     commram stop

#![allow(non_snake_case, reason = "the manual's names, letter for letter")]

mod common;

use common::{Application, Arguments, END, SYNC, check, map_slave};
use commram::devices::omega_drive_line_2::blocks::*;
use commram::devices::omega_drive_line_2::registers::{
    CANsync_INIT_BMSTRUCT, CANsync_SL_CTRL_BMSTRUCT, NODE1,
};
use commram::memory::MemoryError;
use commram::memory::header::Start;

struct Slave {
    ram: Ram,
    _CANsync_INIT_SL: Base<CANsync_INIT_BMSTRUCT>,
    _CANsync_CTRL_SL: Base<CANsync_SL_CTRL_BMSTRUCT>,
    a_RD_ARRAY: CANsync_RD_BMARRAY,
    init: CANsync_INIT,
    event: INTR_SET,
    mode: CANsync_MODE_SL,
    comm: CANsync_PD_COMM_SL,
    command: CANsync_BC_SL,
    application: Application,
}

impl Slave {
    fn new(ram: Ram) -> Result<Self, MemoryError> {
        Ok(Slave {
            _CANsync_INIT_SL: ram.at(NODE1)?,
            _CANsync_CTRL_SL: ram.at(NODE1)?,
            a_RD_ARRAY: [[0; 16]; 32],
            init: CANsync_INIT { x_SL: true, us_BAUDRATE: 5, us_SYNC_INTERVAL: 2, ..Default::default() },
            event: INTR_SET { i_EVENT: SYNC as i8, x_EN: true, ..Default::default() },
            mode: CANsync_MODE_SL { x_SYNC_MODE: true, x_CANsync_RUN: true, ..Default::default() },
            comm: CANsync_PD_COMM_SL { si_RDC1_SEND: 5, ..Default::default() },
            command: CANsync_BC_SL::default(),
            application: Application::default(),
            ram,
        })
    }
}

impl Program for Slave {
    type Error = String;

    fn initialize(&mut self, _: Start) {
        if let Ok(new) = Slave::new(self.ram.clone()) {
            *self = new;
        }
    }

    /// Calls the blocks in the order of the manual, p. 132.
    fn cold_start(&mut self) -> Result<Progress, String> {
        if !self.init.x_OK {
            self.init.call(&self._CANsync_INIT_SL);
            check(self.init.x_ERR, "CANsync_INIT", self.init.w_ERR)?;
            if !self.init.x_OK {
                return Ok(Progress::Again);
            }
            map_slave(&self._CANsync_CTRL_SL);
            println!("initialized as slave {}", self._CANsync_CTRL_SL.w_OMEGA_NR.load());
        }
        self.event.call(&self.ram);
        check(self.event.x_ERR, "INTR_SET", 0)?;
        self.mode.call(&self._CANsync_CTRL_SL);
        Ok(Progress::done_if(self.mode.x_CANsync_ACTIV && self.event.is_answered()))
    }

    /// Sends the reference value of the last interval back in this interval, directly after the SYNC edge.
    fn event(&mut self, _number: usize, _missed: u32) -> Result<(), String> {
        self.comm.call(&self._CANsync_CTRL_SL, &mut self.a_RD_ARRAY);
        self.comm.a_RD_VALUES_SEND[0] = self.comm.a_WR_VALUES_RECEIVED[0];
        self.application.cycle(&self._CANsync_CTRL_SL);
        Ok(())
    }

    fn cyclic(&mut self) -> Result<Progress, String> {
        self.command.call(&self._CANsync_CTRL_SL);
        let end = self.command.si_BC_RECEIVED == 2 && self.command.us_BC_CMD_NR == END;
        if end {
            println!("the master ends it; last reference value {}", self.comm.a_WR_VALUES_RECEIVED[0]);
        }
        Ok(Progress::done_if(end))
    }
}

fn main() -> std::process::ExitCode {
    common::run(Arguments::parse("station"), SYNC, |ram, _| Slave::new(ram))
}
