//! A CANsync cluster: the PLC is a slave on the upper bus and the master of the lower bus, and both buses have the same
//! SYNC signal. The program passes the reference value to its drive, and the actual value of the drive back.
//!
//!     commram run tools/examples/plant.toml --detach
//!     cargo run --example cluster &
//!     cargo run --example master -- line 1 5
//!     wait
//!     commram stop

#![allow(non_snake_case, reason = "the manual's names, letter for letter")]

mod common;

use common::{Application, Arguments, END, HIGH, SYNC, VALUES, check, map_slave};
use commram::devices::omega_drive_line_2::blocks::*;
use commram::devices::omega_drive_line_2::registers::{
    CANsync_INIT_BMSTRUCT, CANsync_MA_CTRL_BMSTRUCT, CANsync_SL_CTRL_BMSTRUCT, NODE1, NODE2,
};
use commram::memory::MemoryError;
use commram::memory::header::Start;

/// The drive on the lower bus.
const DRIVE: usize = 7;
/// State of a slave that responds and is synchronized.
const SYNCHRONIZED: u8 = 0x03;

struct Cluster {
    ram: Ram,
    _CANsync_INIT_SL: Base<CANsync_INIT_BMSTRUCT>,
    _CANsync_INIT_MA: Base<CANsync_INIT_BMSTRUCT>,
    _CANsync_CTRL_SL: Base<CANsync_SL_CTRL_BMSTRUCT>,
    _CANsync_CTRL_MA: Base<CANsync_MA_CTRL_BMSTRUCT>,
    a_RD_ARRAY_SL: CANsync_RD_BMARRAY,
    a_RD_ARRAY_MA: CANsync_RD_BMARRAY,
    init_sl: CANsync_INIT,
    init_ma: CANsync_INIT,
    event: INTR_SET,
    mode_sl: CANsync_MODE_SL,
    mode_ma: CANsync_MODE_MA,
    comm_sl: CANsync_PD_COMM_SL,
    comm_ma: CANsync_PD_COMM_MA,
    command: CANsync_BC_SL,
    application: Application,
}

impl Cluster {
    fn new(ram: Ram) -> Result<Self, MemoryError> {
        let init = || CANsync_INIT { us_BAUDRATE: 5, us_SYNC_INTERVAL: 2, ..Default::default() };
        let mut types = CANsync_SL_TYP_INIT { us_SL_TYP7: 1, ..Default::default() };
        types.call();
        Ok(Cluster {
            _CANsync_INIT_SL: ram.at(NODE1)?,
            _CANsync_INIT_MA: ram.at(NODE2)?,
            _CANsync_CTRL_SL: ram.at(NODE1)?,
            _CANsync_CTRL_MA: ram.at(NODE2)?,
            a_RD_ARRAY_SL: [[0; 16]; 32],
            a_RD_ARRAY_MA: [[0; 16]; 32],
            init_sl: CANsync_INIT { x_SL: true, ..init() },
            init_ma: CANsync_INIT { x_SYNC_IN: true, a_SL_TYP: types.a_SL_TYP, ..init() },
            event: INTR_SET { i_EVENT: SYNC as i8, x_EN: true, ..Default::default() },
            mode_sl: CANsync_MODE_SL { x_SYNC_MODE: true, x_CANsync_RUN: true, ..Default::default() },
            mode_ma: CANsync_MODE_MA { x_SYNC_MODE: true, ..Default::default() },
            comm_sl: CANsync_PD_COMM_SL { si_RDC1_SEND: 5, ..Default::default() },
            comm_ma: CANsync_PD_COMM_MA {
                si_RD_SL_NR1_RECEIVE: DRIVE as i8,
                x_COPY_TO_RD_ARRAY: true,
                ..Default::default()
            },
            command: CANsync_BC_SL::default(),
            application: Application::default(),
            ram,
        })
    }

    fn configure(&self) {
        map_slave(&self._CANsync_CTRL_SL);
        CANsync_PD_CFG_MA { a_WRC1: VALUES, a_HL_WRC1: HIGH, ..Default::default() }
            .call(&self._CANsync_CTRL_MA);
        let (si_SL_NR, a_RDC1, a_HL_RDC1) = (DRIVE as i8, VALUES, HIGH);
        CANsync_PD_CFG_READ_MA { si_SL_NR, a_RDC1, a_HL_RDC1, ..Default::default() }
            .call(&self._CANsync_CTRL_MA);
    }
}

impl Program for Cluster {
    type Error = String;

    fn initialize(&mut self, _: Start) {
        if let Ok(new) = Cluster::new(self.ram.clone()) {
            *self = new;
        }
    }

    /// Starts node 1 first, then node 2 (manual p. 132).
    fn cold_start(&mut self) -> Result<Progress, String> {
        for (init, base) in
            [(&mut self.init_sl, &self._CANsync_INIT_SL), (&mut self.init_ma, &self._CANsync_INIT_MA)]
        {
            if !init.x_OK {
                init.call(base);
                check(init.x_ERR, "CANsync_INIT", init.w_ERR)?;
                return Ok(Progress::Again);
            }
        }
        self.configure();
        self.event.call(&self.ram);
        check(self.event.x_ERR, "INTR_SET", 0)?;
        self.mode_sl.call(&self._CANsync_CTRL_SL);
        self.mode_ma.x_CANsync_RUN = self._CANsync_CTRL_MA.a_STAT_SL[DRIVE].load() == SYNCHRONIZED;
        self.mode_ma.call(&self._CANsync_CTRL_MA);
        let active = self.mode_sl.x_CANsync_ACTIV && self.mode_ma.x_CANsync_ACTIV;
        Ok(Progress::done_if(active && self.event.is_answered()))
    }

    /// Calls the block of the slave before that of the master, directly after the SYNC edge (manual p. 133).
    fn event(&mut self, _number: usize, _missed: u32) -> Result<(), String> {
        self.comm_sl.a_RD_VALUES_SEND[0] = self.a_RD_ARRAY_MA[DRIVE][0];
        self.comm_sl.call(&self._CANsync_CTRL_SL, &mut self.a_RD_ARRAY_SL);
        self.comm_ma.a_WR_VALUES_SEND[0] = self.comm_sl.a_WR_VALUES_RECEIVED[0];
        self.comm_ma.si_WRC1_SEND = 5;
        self.comm_ma.call(&self._CANsync_CTRL_MA, &mut self.a_RD_ARRAY_MA);
        self.application.cycle(&self._CANsync_CTRL_SL);
        Ok(())
    }

    fn cyclic(&mut self) -> Result<Progress, String> {
        self.command.call(&self._CANsync_CTRL_SL);
        let end = self.command.si_BC_RECEIVED == 2 && self.command.us_BC_CMD_NR == END;
        if end {
            println!("the master ends it; the drive was at {}", self.a_RD_ARRAY_MA[DRIVE][0]);
        }
        Ok(Progress::done_if(end))
    }
}

fn main() -> std::process::ExitCode {
    common::run(Arguments::parse("cell"), SYNC, |ram, _| Cluster::new(ram))
}
