//! The program `tests/matiec/blocks.st` with the Rust blocks: the same calls in the same order, the same sums.
#![allow(non_snake_case, reason = "the manual's names, letter for letter")]

mod drive;

use commram::devices::omega_drive_line_2::blocks::*;
use commram::devices::omega_drive_line_2::registers::{
    BAPS, BAPS_CTRL_BMSTRUCT, CANsync_INIT_BMSTRUCT, CANsync_MA_CTRL_BMSTRUCT, CANsync_SL_CTRL_BMSTRUCT,
    NODE1, NODE2,
};
use commram::memory::{Cell8, Cell32, MemoryError};
use std::time::Duration;

/// Byte offset of the first retain flag in the image.
const FLAGS: u32 = 8192;

/// Mapping of reference values: 0 and 1 as doublewords in frame 1, low words of 7 to 4 in frame 2.
const HALVES: [i8; 4] = [0, 0, 1, 1];
const HIGH: [bool; 4] = [false, true, false, true];
const REVERSED: [i8; 4] = [7, 6, 5, 4];

/// A sum over the values of outputs.
#[derive(Default)]
struct Sum(u32);

impl Sum {
    fn mix(&mut self, what: u32) -> &mut Self {
        self.0 = self.0.wrapping_mul(31).wrapping_add(what);
        self
    }

    fn all(&mut self, flags: &[bool]) -> &mut Self {
        flags.iter().for_each(|flag| {
            self.mix((*flag).into());
        });
        self
    }

    fn si(&mut self, what: i8) -> &mut Self {
        self.mix(u32::from(what as u8))
    }

    fn i(&mut self, what: i16) -> &mut Self {
        self.mix(u32::from(what as u16))
    }
}

pub(crate) struct Main {
    ram: Ram,
    _CANsync_INIT_SL: Base<CANsync_INIT_BMSTRUCT>,
    _CANsync_CTRL_SL: Base<CANsync_SL_CTRL_BMSTRUCT>,
    _CANsync_INIT_MA: Base<CANsync_INIT_BMSTRUCT>,
    _CANsync_CTRL_MA: Base<CANsync_MA_CTRL_BMSTRUCT>,
    _baps: Base<BAPS_CTRL_BMSTRUCT>,
    flags: Base<[Cell32; 9]>,
    is_slave: Base<Cell8>,
    scans: u32,
    starts: Sum,
    process_data: Sum,
    commands: Sum,
    parameters: Sum,
    transfers: Sum,
    baps_pd: Sum,
    baps_sd: Sum,
    board: Sum,
    down_ma: Box<CANsync_UPDOWN_BMARRAY>,
    pub(crate) up_ma: Box<CANsync_UPDOWN_BMARRAY>,
    pub(crate) down_sl: Box<CANsync_UPDOWN_BMARRAY>,
    up_sl: Box<CANsync_UPDOWN_BMARRAY>,
    pub(crate) own: Own,
}

/// Variables of the program, with their presets.
#[derive(Default)]
pub(crate) struct Own {
    configured: bool,
    a: i32,
    init_sl: CANsync_INIT,
    init_ma: CANsync_INIT,
    mode_sl: CANsync_MODE_SL,
    mode_ma: CANsync_MODE_MA,
    comm_ma: CANsync_PD_COMM_MA,
    comm_sl: CANsync_PD_COMM_SL,
    read_ma: CANsync_PD_COMM_READ_MA,
    read_sl: CANsync_PD_COMM_READ_SL,
    heard_ma: CANsync_RD_BMARRAY,
    heard_sl: CANsync_RD_BMARRAY,
    bc: (CANsync_BC_MA0, CANsync_BC_MA1, CANsync_BC_MA2),
    bc_sl: CANsync_BC_SL,
    word_ma: CANsync_CONTROLWORD_MA,
    word_sl: CANsync_CONTROLWORD_SL,
    pub(crate) par_read: CANsync_PAR_READ_MA,
    pub(crate) par_write: CANsync_PAR_WRITE_MA,
    par_sl: CANsync_PAR_SL,
    pub(crate) par_lost: CANsync_PAR_READ_MA,
    pub(crate) par_gone: CANsync_PAR_READ_MA,
    /// The slave's block has shown that a job was withdrawn.
    pub(crate) job_was_reset: bool,
    pub(crate) load_lost: CANsync_UPDOWNLOAD_MA,
    pub(crate) load_ma: CANsync_UPDOWNLOAD_MA,
    load_sl: CANsync_UPDOWNLOAD_SL,
    b_init: BAPS_INIT,
    b_two: BAPS_PD_COMM2,
    b_eight: BAPS_PD_COMM8,
    pub(crate) b_four: BAPS_PD_COMM24,
    b_watch: BAPS_PD_CONTROL,
    b_read: BAPS_PAR_READ,
    b_write: BAPS_PAR_WRITE,
    b_control: BAPS_SD_CONTROL,
    b_data: BAPS_BMSTRUCT,
    option: OPT_INIT,
    timer: INTR_SET,
    no_event: INTR_SET,
}

impl Main {
    pub(crate) fn new(ram: &Ram) -> Result<Self, MemoryError> {
        let values = || Box::new([0; UPDOWN_VALUES]);
        let (us_BAUDRATE, us_SYNC_INTERVAL) = (5, 2);
        let init_sl = CANsync_INIT { x_SL: true, us_BAUDRATE, us_SYNC_INTERVAL, ..Default::default() };
        let init_ma = CANsync_INIT { us_SYNC_INTERVAL, ..Default::default() };
        Ok(Main {
            _CANsync_INIT_SL: ram.at(NODE1)?,
            _CANsync_CTRL_SL: ram.at(NODE1)?,
            _CANsync_INIT_MA: ram.at(NODE2)?,
            _CANsync_CTRL_MA: ram.at(NODE2)?,
            _baps: ram.at(BAPS)?,
            flags: ram.at(FLAGS)?,
            is_slave: ram.at(FLAGS + 36)?,
            ram: ram.clone(),
            scans: 0,
            starts: Sum::default(),
            process_data: Sum::default(),
            commands: Sum::default(),
            parameters: Sum::default(),
            transfers: Sum::default(),
            baps_pd: Sum::default(),
            baps_sd: Sum::default(),
            board: Sum::default(),
            down_ma: values(),
            up_ma: values(),
            down_sl: values(),
            up_sl: values(),
            own: Own { init_sl, init_ma, ..Own::default() },
        })
    }

    pub(crate) fn scan(&mut self) {
        self.scans += 1;
        let is_slave = self.is_slave.load() == 1;
        self.start(is_slave);
        if self.own.mode_sl.x_CANsync_ACTIV || self.own.mode_ma.x_CANsync_ACTIV {
            self.own.a += 1;
        }
        if self.own.a == 1 {
            for k in 0..2048 {
                (self.down_ma[k], self.up_sl[k]) = (k as i32 * 7, -(k as i32) - 1);
            }
        }
        if self.own.mode_sl.x_CANsync_ACTIV {
            self.slave();
        }
        if self.own.mode_ma.x_CANsync_ACTIV {
            self.exchange();
            self.command();
            self.parameters();
            self.transfer();
        }
        self.baps();
        self.service_data();
        self.board();
        let sums = [
            self.scans,
            self.starts.0,
            self.process_data.0,
            self.commands.0,
            self.parameters.0,
            self.transfers.0,
            self.baps_pd.0,
            self.baps_sd.0,
            self.board.0,
        ];
        self.flags.iter().zip(sums).for_each(|(cell, sum)| cell.store(sum));
    }

    fn start(&mut self, is_slave: bool) {
        let mut types = CANsync_SL_TYP_INIT { us_SL_TYP1: 1, us_SL_TYP4: 1, ..Default::default() };
        types.call();
        if is_slave && !self.own.init_sl.x_OK {
            self.own.init_sl.call(&self._CANsync_INIT_SL);
        }
        if !is_slave && !self.own.init_ma.x_OK {
            self.own.init_ma.a_SL_TYP = types.a_SL_TYP;
            self.own.init_ma.call(&self._CANsync_INIT_MA);
            self.starts.mix(self.own.init_ma.w_ERR.into()).all(&[self.own.init_ma.x_ERR]);
            if self.own.init_ma.x_ERR {
                self.own.init_ma.b_BIT_TIMING1 = 0x1C;
            }
        }
        self.starts.all(&[self.own.init_sl.x_OK, self.own.init_ma.x_OK]);
        if (self.own.init_sl.x_OK || self.own.init_ma.x_OK) && !self.own.configured {
            self.own.configured = true;
            if is_slave { self.configure_slave() } else { self.configure_master() }
        }
        let scans = self.scans;
        if self.own.configured && is_slave {
            let runs = scans > 500 && !(2600..=2602).contains(&scans);
            (self.own.mode_sl.x_SYNC_MODE, self.own.mode_sl.x_CANsync_RUN) = (true, runs);
            self.own.mode_sl.x_RESET_CANsync_CONTROLLER = scans == 300 || scans == 1500;
            self.own.mode_sl.call(&self._CANsync_CTRL_SL);
        } else if self.own.configured {
            let states = &self._CANsync_CTRL_MA.a_STAT_SL;
            let ready = scans > 500 && states[1].load() & states[4].load() == 0x03;
            (self.own.mode_ma.x_SYNC_MODE, self.own.mode_ma.x_CANsync_RUN) = (true, ready);
            self.own.mode_ma.call(&self._CANsync_CTRL_MA);
        }
        let (sl, ma) = (&self.own.mode_sl, &self.own.mode_ma);
        self.starts.all(&[sl.x_WAIT, ma.x_WAIT, sl.x_PREPARE_ACTIV, ma.x_PREPARE_ACTIV]).all(&[
            sl.x_SL,
            ma.x_MA,
            sl.x_CANsync_ACTIV,
            ma.x_SYNC_MODE_ACTIV,
        ]);
    }

    fn configure_slave(&self) {
        CANsync_PD_CFG_SL {
            a_WRC1: HALVES,
            a_HL_WRC1: HIGH,
            a_WRC2: REVERSED,
            a_RDC1: [0, 1, 2, 3],
            a_RDC2: [3, 4, 5, 6],
            ..Default::default()
        }
        .call(&self._CANsync_CTRL_SL);
        CANsync_PD_CFG_READ_SL { si_SL_NR: 1, a_RDC1: [0, 1, 2, 3], ..Default::default() }
            .call(&self._CANsync_CTRL_SL);
    }

    /// Lets the command channel poll all slaves, and selects this slave for transfers.
    fn open_channel(&self, si_SL_NR_UDL: i8) {
        let (x_EN_CTRL, x_EN_PAR, x_EN_UDL, si_MAX_SL_NR) = (true, true, true, 4);
        CANsync_COMM_CONTROL_MA {
            x_EN_CTRL,
            x_EN_PAR,
            x_EN_UDL,
            si_SL_NR_UDL,
            si_MAX_SL_NR,
            ..Default::default()
        }
        .call(&self._CANsync_CTRL_MA);
    }

    fn configure_master(&self) {
        let base = &self._CANsync_CTRL_MA;
        self.open_channel(4);
        CANsync_PD_CFG_MA { a_WRC1: HALVES, a_HL_WRC1: HIGH, a_WRC2: REVERSED, ..Default::default() }
            .call(base);
        for si_SL_NR in [4, 1, 32] {
            let (a_RDC1, a_RDC2) = ([0, 1, 2, 3], [4, 5, 6, 7]);
            CANsync_PD_CFG_READ_MA { si_SL_NR, a_RDC1, a_RDC2, ..Default::default() }.call(base);
        }
    }

    fn slave(&mut self) {
        let (a, scans, base) = (self.own.a, self.scans, &self._CANsync_CTRL_SL);
        let comm = &mut self.own.comm_sl;
        comm.a_RD_VALUES_SEND = std::array::from_fn(|k| a * (k as i32 + 1));
        (comm.si_RDC1_SEND, comm.si_RDC2_SEND, comm.x_COPY_TO_RD_ARRAY) = (5, 5, a < 200);
        comm.call(base, &mut self.own.heard_sl);
        if a >= 200 {
            self.own.read_sl.si_SL_NR = 1;
            self.own.read_sl.call(base);
        }
        let sum = self.process_data.si(comm.si_WRC1_RECEIVED).si(comm.si_WRC2_RECEIVED);
        sum.si(comm.si_RD_SL_NR1_RECEIVED).si(comm.si_RD_SL_NR2_RECEIVED);
        sum.si(self.own.read_sl.si_RD_SL_NR1_RECEIVED);
        for k in 0..8 {
            let values =
                [comm.a_WR_VALUES_RECEIVED[k], self.own.read_sl.a_RD_VALUES[k], self.own.heard_sl[1][k]];
            values.into_iter().for_each(|value| {
                sum.mix(value as u32);
            });
        }

        self.own.bc_sl.call(base);
        self.own.word_sl.call(base);
        let sum = self.commands.si(self.own.bc_sl.si_BC_RECEIVED).mix(self.own.bc_sl.us_BC_CMD_NR.into());
        sum.si(self.own.bc_sl.si_BC_BYTE).i(self.own.bc_sl.i_BC_WORD);
        sum.si(self.own.word_sl.si_RECEIVED).mix(self.own.word_sl.w_CONTROLWORD.into());

        let jobs = &mut self.own.par_sl;
        (jobs.x_EN, jobs.ud_PAR_VALUE_READ, jobs.x_PAR_FORMAT_READ, jobs.i_ERR) = (true, 70_000, true, -5);
        let has_value = jobs.u_PAR_NR != 11 || (2300..2350).contains(&scans);
        jobs.x_OK_IN = jobs.x_ACTIV && jobs.u_PAR_NR != 9 && has_value;
        jobs.x_ERR_IN = jobs.x_ACTIV && jobs.u_PAR_NR == 9;
        jobs.x_RESET = scans == 2350;
        jobs.call(base);
        let sum = self.parameters.all(&[jobs.x_ACTIV, jobs.x_BUSY, jobs.x_RESET_JOB, jobs.x_READ, jobs.x_OK]);
        sum.mix(jobs.u_PAR_NR.into());
        self.own.job_was_reset |= jobs.x_RESET_JOB;

        let load = &mut self.own.load_sl;
        load.x_EN = true;
        load.call(base, &mut self.down_sl, &self.up_sl);
        let sum = self.transfers.all(&[load.x_BUSY, load.x_OK, load.x_UPDOWN]);
        sum.mix(load.u_LENGTH.into()).mix((self.down_sl[74] + self.down_sl[79]) as u32);
    }

    fn exchange(&mut self) {
        let (a, base) = (self.own.a, &self._CANsync_CTRL_MA);
        let comm = &mut self.own.comm_ma;
        comm.a_WR_VALUES_SEND = std::array::from_fn(|k| -a * (k as i32 + 3));
        (comm.si_WRC1_SEND, comm.si_WRC2_SEND, comm.x_COPY_TO_RD_ARRAY) = (5, 5, a < 200);
        comm.call(base, &mut self.own.heard_ma);
        if a == 100 {
            (comm.si_RD_SL_NR1_RECEIVE, comm.si_RD_SL_NR2_RECEIVE) = (4, -1);
        }
        if a >= 200 {
            self.own.read_ma.si_SL_NR = 4;
            self.own.read_ma.call(base);
        }
        let sum = self.process_data.si(comm.si_RD_SL_NR1_RECEIVED).si(comm.si_RD_SL_NR2_RECEIVED);
        sum.si(self.own.read_ma.si_RD_SL_NR1_RECEIVED).si(self.own.read_ma.si_RD_SL_NR2_RECEIVED);
        for k in 0..8 {
            sum.mix(self.own.read_ma.a_RD_VALUES[k] as u32).mix(self.own.heard_ma[4][k] as u32);
        }
    }

    fn command(&mut self) {
        let (a, base) = (self.own.a, &self._CANsync_CTRL_MA);
        macro_rules! broadcast {
            ($block:expr, $number:literal, $byte:literal, $word:literal, $slaves:literal) => {
                ($block.us_BC_CMD_NR, $block.si_BC_BYTE) = ($number, $byte);
                ($block.i_BC_WORD, $block.d_SL_MASK, $block.x_EN) = ($word, $slaves, a == 50);
                $block.call(base);
            };
        }
        broadcast!(self.own.bc.0, 128, -5, -300, 0xFFFF_FFFF);
        broadcast!(self.own.bc.1, 200, 7, 1234, 0x10);
        broadcast!(self.own.bc.2, 255, 1, 1, 0x02);
        (self.own.word_ma.si_SL_NR_CTRL, self.own.word_ma.w_CONTROLWORD) = (4, 0x0006);
        self.own.word_ma.x_EN = a == 60 || a == 70;
        self.own.word_ma.call(base);
        self.commands.all(&[
            self.own.bc.0.x_OK,
            self.own.bc.1.x_OK,
            self.own.bc.2.x_OK,
            self.own.word_ma.x_OK,
        ]);
    }

    fn parameters(&mut self) {
        let (a, scans, base) = (self.own.a, self.scans, &self._CANsync_CTRL_MA);
        let read = &mut self.own.par_read;
        (read.si_SL_NR, read.u_PAR_NR) = (4, if a > 400 { 9 } else { 7 });
        read.x_EN = a > 100 && a < 300 || a > 500 && a < 700;
        read.x_RESET = a == 450;
        read.call(base);
        let write = &mut self.own.par_write;
        (write.si_SL_NR, write.u_PAR_NR) = (1, 1000);
        write.ud_PAR_VALUE = if a > 450 { 501 } else { 321 };
        write.x_EN = a > 120 && a < 400 || a > 500;
        write.call(base);
        let lost = &mut self.own.par_lost;
        (lost.si_SL_NR, lost.u_PAR_NR, lost.t_TIME) = (3, 1, Duration::from_millis(50));
        (lost.x_EN, lost.x_RESET) = (a > 150, a == 300 || a == 800);
        lost.call(base);
        let sum = self.parameters.all(&[read.x_BUSY, read.x_OK]);
        sum.mix(read.ud_PAR_VALUE).all(&[read.x_PAR_FORMAT_READ]).mix(read.b_ERR.into()).i(read.i_ERR);
        sum.all(&[write.x_BUSY, write.x_OK]).mix(write.b_ERR.into()).i(write.i_ERR);
        sum.all(&[lost.x_BUSY]).mix(lost.b_ERR.into());
        let gone = &mut self.own.par_gone;
        (gone.si_SL_NR, gone.u_PAR_NR) = (4, if (2401..2540).contains(&scans) { 7 } else { 11 });
        gone.x_EN = [2201..2250, 2401..2500, 2551..2700].iter().any(|it| it.contains(&scans));
        gone.x_RESET = scans == 2260 || scans == 2710;
        gone.call(base);
        sum.all(&[gone.x_BUSY, gone.x_OK]).mix(gone.ud_PAR_VALUE).mix(gone.b_ERR.into());
    }

    fn transfer(&mut self) {
        let (a, load) = (self.own.a, &mut self.own.load_ma);
        match a {
            1 | 1400 => (load.u_LENGTH, load.x_UPDOWN) = (80, true),
            1000 => (load.u_LENGTH, load.x_UPDOWN) = (1, false),
            1200 => load.u_LENGTH = 2049,
            _ => {}
        }
        (load.si_SL_NR, load.us_MAX_NR_OF_COMM, load.t_TIME) = (4, 2, Duration::from_secs(2));
        load.x_EN = [10..990, 1010..1190, 1210..1300, 1410..1500].iter().any(|it| a > it.start && a < it.end);
        load.x_RESET = a == 1350 || a == 1600;
        load.call(&self._CANsync_CTRL_MA, &self.down_ma, &mut self.up_ma);
        let sum = self.transfers.all(&[load.x_BUSY, load.x_OK]).mix(load.b_ERR.into());
        sum.mix(load.w_ERR_SL.into()).mix(self.up_ma[0] as u32);
        let scans = self.scans;
        if scans == 2230 {
            self.open_channel(1);
        }
        let lost = &mut self.own.load_lost;
        lost.si_SL_NR = if scans > 2240 { 1 } else { 4 };
        (lost.x_UPDOWN, lost.u_LENGTH, lost.t_TIME) = (true, 75, Duration::from_millis(50));
        lost.x_EN = [2221..2230, 2251..2350, 2361..u32::MAX].iter().any(|it| it.contains(&scans));
        lost.x_RESET = scans == 2240 || scans == 2355;
        lost.call(&self._CANsync_CTRL_MA, &self.down_ma, &mut self.up_ma);
        let sum = self.transfers.all(&[lost.x_BUSY, lost.x_OK]).mix(lost.b_ERR.into());
        sum.mix(lost.w_ERR_SL.into());
    }
}
