//! Configuration example C of the manual (5.00005.03a p. 67-70): one event task on the SYNC signal of CANsync, in
//! which the master exchanges process data with its slaves and then with its own drive. The SYNC signal triggers the
//! drive and the option cards. The drive follows an angle, the slaves a reference value.
//!
//!     commram with -- cargo run --example baps_cansync

#![allow(non_snake_case, reason = "the manual's names, letter for letter")]

mod common;

use common::drive::SynchronousDrive;
use common::{Arguments, HIGH, SYNC, VALUES, check};
use commram::devices::omega_drive_line_2::blocks::*;
use commram::devices::omega_drive_line_2::registers::{
    CANsync_INIT_BMSTRUCT, CANsync_MA_CTRL_BMSTRUCT, NODE2,
};
use commram::memory::MemoryError;
use commram::memory::header::Start;

/// The drives on the bus of the built-in plant.
const SLAVES: [usize; 3] = [1, 2, 3];
/// State of a slave that responds and is synchronized.
const SYNCHRONIZED: u8 = 0x03;
/// Reference value for all slaves.
const REFERENCE: i32 = 5000;
/// SYNC interval in ms, and the SYNC slot of the drive in us.
const INTERVAL_MS: u8 = 2;
const SLOT_US: u16 = 2000;
/// Value of `w_COMMAND_REG`: two reference and two actual values in every communication, and a communication every 2
/// ms.
const COMMAND_REG: u16 = 0x0044;
/// Mask of the angle reference value for a SYNC slot (P167) of 2000 us and a PWM frequency (P103) of 4 kHz (p. 74).
const MASK: u32 = 0xFFFF_FFF0;

/// The PLC program of the example.
pub(crate) struct Master {
    ram: Ram,
    _CANsync_INIT_MA: Base<CANsync_INIT_BMSTRUCT>,
    _CANsync_CTRL_MA: Base<CANsync_MA_CTRL_BMSTRUCT>,
    a_RD_ARRAY: CANsync_RD_BMARRAY,
    init: CANsync_INIT,
    triggers: OPT_INIT,
    event: INTR_SET,
    mode: CANsync_MODE_MA,
    comm: CANsync_PD_COMM_MA,
    drive: SynchronousDrive,
}

impl Master {
    /// Makes the program on the RAM of a PLC.
    pub(crate) fn new(ram: Ram) -> Result<Self, MemoryError> {
        let mut init = CANsync_INIT { us_BAUDRATE: 5, us_SYNC_INTERVAL: INTERVAL_MS, ..Default::default() };
        SLAVES.iter().for_each(|slave| init.a_SL_TYP[*slave] = 1);
        Ok(Master {
            _CANsync_INIT_MA: ram.at(NODE2)?,
            _CANsync_CTRL_MA: ram.at(NODE2)?,
            a_RD_ARRAY: [[0; 16]; 32],
            init,
            triggers: OPT_INIT {
                us_MODE_TRIGGER_1: 3,
                us_MODE_TRIGGER_2: 3,
                us_MODE_TRIGGER_CONTROLLER: 1,
                ..Default::default()
            },
            event: INTR_SET { i_EVENT: SYNC as i8, x_EN: true, ..Default::default() },
            mode: CANsync_MODE_MA { x_SYNC_MODE: true, ..Default::default() },
            comm: CANsync_PD_COMM_MA {
                a_WR_VALUES_SEND: [REFERENCE, 0, 0, 0, 0, 0, 0, 0],
                si_WRC1_SEND: 5,
                si_MAX_SL_NR: SLAVES[SLAVES.len() - 1] as i8,
                x_COPY_TO_RD_ARRAY: true,
                ..Default::default()
            },
            drive: SynchronousDrive::new(&ram, SLOT_US, COMMAND_REG, MASK)?,
            ram,
        })
    }

    fn configure(&self) {
        CANsync_PD_CFG_MA { a_WRC1: VALUES, a_HL_WRC1: HIGH, ..Default::default() }
            .call(&self._CANsync_CTRL_MA);
        for slave in SLAVES {
            let (si_SL_NR, a_RDC1, a_HL_RDC1) = (slave as i8, VALUES, HIGH);
            CANsync_PD_CFG_READ_MA { si_SL_NR, a_RDC1, a_HL_RDC1, ..Default::default() }
                .call(&self._CANsync_CTRL_MA);
        }
    }
}

impl Program for Master {
    type Error = String;

    fn initialize(&mut self, _: Start) {
        if let Ok(new) = Master::new(self.ram.clone()) {
            *self = new;
        }
    }

    /// Follows the order of p. 132: CANsync, triggers, event, set-up mode, active operation.
    fn cold_start(&mut self) -> Result<Progress, String> {
        if !self.init.x_OK {
            self.init.call(&self._CANsync_INIT_MA);
            check(self.init.x_ERR, "CANsync_INIT", self.init.w_ERR)?;
            if self.init.x_OK {
                self.configure();
            }
            return Ok(Progress::Again);
        }
        if !self.triggers.x_OK {
            self.triggers.call(&self.ram);
            return check(self.triggers.x_ERR, "OPT_INIT", 0).map(|()| Progress::Again);
        }
        self.event.call(&self.ram);
        check(self.event.x_ERR, "INTR_SET", 0)?;
        let states = &self._CANsync_CTRL_MA.a_STAT_SL;
        self.mode.x_CANsync_RUN = SLAVES.iter().all(|slave| states[*slave].load() == SYNCHRONIZED);
        self.mode.call(&self._CANsync_CTRL_MA);
        Ok(Progress::done_if(self.mode.x_CANsync_ACTIV && self.event.is_answered()))
    }

    /// Handles the bus first, because its frames have a deadline. The drive needs its values later: with SYNC offset 0
    /// it takes them over at the next edge (p. 70).
    fn event(&mut self, _number: usize, _missed: u32) -> Result<(), String> {
        self.comm.call(&self._CANsync_CTRL_MA, &mut self.a_RD_ARRAY);
        self.drive.exchange()
    }

    fn cyclic(&mut self) -> Result<Progress, String> {
        let drive = self.drive.cyclic()?;
        let reached = SLAVES.iter().all(|slave| self.a_RD_ARRAY[*slave][0] == REFERENCE);
        let end = drive == Progress::Done && reached;
        if end {
            println!("the drive has followed SYNC to angle 16#{:08X}", self.drive.end());
            println!("slaves {SLAVES:?} have reached reference value {REFERENCE}");
        }
        Ok(Progress::done_if(end))
    }
}

fn main() -> std::process::ExitCode {
    common::run(Arguments::parse("line"), SYNC, |ram, _| Master::new(ram))
}
