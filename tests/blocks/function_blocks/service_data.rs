//! `BAPS_PAR_READ`, `BAPS_PAR_WRITE`, `BAPS_SD_CONTROL`.

use super::baps::Stage;
use crate::omega::cansync::bench::Dead;
use crate::rig::{BOTH, Memory};
use commram::devices::omega_drive_line_2::blocks::*;
use commram::devices::omega_drive_line_2::registers::*;
use std::time::Duration;

const PARAMETER: &str = "[[plc.drive.parameters]]\nnumber = 1000\nformat = 'word'\ninitial = 100\nmin = 5\nmax = 500\n\
    [[plc.drive.parameters]]\nnumber = 1001\nformat = 'doubleword'\nread_only = true\n";

#[derive(Default)]
struct Blocks {
    data: BAPS_BMSTRUCT,
    read: BAPS_PAR_READ,
    write: BAPS_PAR_WRITE,
    control: BAPS_SD_CONTROL,
}

impl Blocks {
    fn call(&mut self, base: &Base<BAPS_CTRL_BMSTRUCT>) {
        self.read.call(&mut self.data);
        self.write.call(&mut self.data);
        self.control.call(base, &mut self.data);
    }

    #[track_caller]
    fn until(&mut self, stage: &mut Stage, done: impl Fn(&Self) -> bool) -> u64 {
        stage.until(|stage| {
            self.call(&stage.base);
            done(self)
        })
    }

    fn read(&mut self, stage: &mut Stage, number: u16) {
        self.read.x_EN = false;
        self.read.call(&mut self.data);
        (self.read.u_PAR_NR, self.read.x_EN) = (number, true);
        self.call(&stage.base);
        assert!(self.read.x_BUSY && !self.read.x_OK && !self.read.x_ERR);
        self.until(stage, |blocks| !blocks.read.x_BUSY);
    }

    fn write(&mut self, stage: &mut Stage, number: u16, x_PAR_FORMAT: bool, value: u32) {
        self.write.x_EN = false;
        self.write.call(&mut self.data);
        (self.write.u_PAR_NR, self.write.x_PAR_FORMAT) = (number, x_PAR_FORMAT);
        (self.write.ud_PAR_VALUE, self.write.x_EN) = (value, true);
        self.until(stage, |blocks| !blocks.write.x_BUSY);
    }
}

/// Manual p. 93-98, 118-120.
#[test]
fn a_parameter_is_read_and_written() {
    for memory in BOTH {
        let mut stage = Stage::new(memory, PARAMETER);
        let mut blocks = Blocks::default();
        blocks.read(&mut stage, 1000);
        let read = &blocks.read;
        assert_eq!((read.ud_PAR_VALUE, read.x_PAR_FORMAT, read.x_OK, read.x_ERR), (100, false, true, false));
        blocks.write(&mut stage, 1000, false, 321);
        assert_eq!((blocks.write.x_OK, blocks.write.i_ERR_DETAIL), (true, 0));
        blocks.read(&mut stage, 1000);
        assert_eq!(blocks.read.ud_PAR_VALUE, 321, "{memory:?}");
        blocks.read.us_PAR_ELEMENT = 6;
        blocks.read(&mut stage, 1000);
        assert_eq!(blocks.read.ud_PAR_VALUE, 500, "element 6 is the maximum (decision D-160)");
        blocks.read.us_PAR_ELEMENT = 7;
        blocks.read(&mut stage, 1001);
        assert!(blocks.read.x_PAR_FORMAT && blocks.read.x_OK);
        assert_eq!(blocks.control.b_ERR, 0);
    }
}

/// Manual p. 95, 98, 120: every error of the drive appears at the blocks and in bits 5 and 6 of `BAPS_SD_CONTROL`.
#[test]
fn every_error_of_the_drive() {
    let mut stage = Stage::new(Memory::Heap, PARAMETER);
    let mut blocks = Blocks::default();
    blocks.read(&mut stage, 4000);
    assert_eq!((blocks.read.i_ERR_DETAIL, blocks.read.i_ERR_COMM), (-5, 0));
    assert_eq!((blocks.read.x_ERR, blocks.read.x_OK, blocks.control.b_ERR), (true, false, 1 << 5));
    for (number, format, value, detail, bits) in [
        (1000, false, 4, -2, 1 << 5),
        (1000, false, 501, -3, 1 << 5),
        (1001, true, 1, -4, 1 << 5),
        (4000, false, 1, -5, 1 << 5),
        (1000, true, 7, -7, 1 << 6),
    ] {
        blocks.write(&mut stage, number, format, value);
        let write = &blocks.write;
        assert_eq!((write.i_ERR_DETAIL, write.i_ERR_COMM, write.x_ERR, write.x_OK), (detail, 0, true, false));
        assert_eq!((blocks.control.b_ERR, blocks.control.x_ERR), (bits, true));
    }
    // The format error alone can be ignored (p. 97), and no reset is needed.
    blocks.write.x_EN_ERR_FORMAT = false;
    blocks.write(&mut stage, 1000, true, 7);
    let write = &blocks.write;
    assert_eq!((write.i_ERR_DETAIL, write.x_ERR, write.x_OK), (-7, false, true));
    blocks.write(&mut stage, 1000, false, 7);
    assert_eq!((blocks.write.x_OK, blocks.control.b_ERR), (true, 0));
}

/// Manual p. 93, 96: several instances of the blocks can wait. The drive does one job at a time.
#[test]
fn blocks_take_turns() {
    let mut stage = Stage::new(Memory::Heap, PARAMETER);
    let mut blocks = Blocks::default();
    let mut second = BAPS_PAR_READ { u_PAR_NR: 300, x_EN: true, ..Default::default() };
    (blocks.read.u_PAR_NR, blocks.read.x_EN) = (1000, true);
    (blocks.write.u_PAR_NR, blocks.write.ud_PAR_VALUE, blocks.write.x_EN) = (1000, 44, true);
    stage.until(|stage| {
        second.call(&mut blocks.data);
        blocks.call(&stage.base);
        second.x_OK && blocks.read.x_OK && blocks.write.x_OK
    });
    assert!(second.x_PAR_FORMAT && !blocks.read.x_PAR_FORMAT);
}

/// Manual p. 120: tests the timeouts of the three steps of a job, which set bits 2, 3 and 4. After each of them, the
/// blocks need a reset.
#[test]
fn semaphores_that_do_not_move_are_timeouts() {
    for (bit, before, between) in [(2, 1, 1), (3, 0, 0), (4, 0, 1)] {
        let dead = Dead::new();
        let base = dead.ram.at::<BAPS_CTRL_BMSTRUCT>(BAPS).unwrap();
        let mut blocks = Blocks::default();
        blocks.read.x_EN = true;
        base.b_SL_SEMAPHORE.store(before);
        blocks.call(&base);
        base.b_SL_SEMAPHORE.store(between);
        blocks.call(&base);
        dead.pass(2_999_999);
        blocks.call(&base);
        assert_eq!((blocks.control.b_ERR, blocks.read.x_BUSY), (0, true));
        dead.pass(1);
        blocks.call(&base);
        assert_eq!((blocks.control.b_ERR, blocks.control.x_ERR), (1 << bit, true));
        blocks.call(&base);
        let read = &blocks.read;
        assert_eq!((read.i_ERR_COMM, read.i_ERR_DETAIL, read.x_ERR, read.x_BUSY), (-1, 0, true, false));
        assert_eq!(base.b_MA_SEMAPHORE.load(), 0);
        // Every following job fails, too, until all blocks are reset.
        blocks.write.x_EN = true;
        for _ in 0..3 {
            blocks.call(&base);
        }
        assert_eq!((blocks.write.x_ERR, blocks.write.i_ERR_COMM), (true, -1));
        (blocks.read.x_RESET, blocks.write.x_RESET, blocks.control.x_RESET) = (true, true, true);
        blocks.call(&base);
        assert_eq!((blocks.control.b_ERR, blocks.read.x_ERR, blocks.write.x_ERR), (0, false, false));
    }
}

/// The drive takes longer than the monitoring time.
#[test]
fn a_slow_drive_is_a_timeout_and_works_after_a_reset() {
    let mut stage = Stage::new(Memory::Heap, &format!("service_time_us = 50000\n{PARAMETER}"));
    let mut blocks = Blocks::default();
    blocks.control.t_TIME = Duration::from_millis(10);
    blocks.read(&mut stage, 1000);
    assert_eq!((blocks.read.i_ERR_COMM, blocks.control.b_ERR), (-1, 1 << 3));
    (blocks.read.x_RESET, blocks.control.x_RESET) = (true, true);
    blocks.call(&stage.base);
    (blocks.read.x_RESET, blocks.control.x_RESET) = (false, false);
    blocks.control.t_TIME = Duration::from_millis(100);
    blocks.read(&mut stage, 1000);
    assert!(blocks.read.x_OK);
}

/// Manual p. 94, 98, 120: `x_EN` FALSE disturbs the exchange between the blocks, bits 0 and 1.
#[test]
fn a_dropped_job_needs_a_reset_of_both_blocks() {
    let mut stage = Stage::new(Memory::Heap, PARAMETER);
    for bit in [0, 1] {
        let mut blocks = Blocks::default();
        if bit == 0 {
            (blocks.read.u_PAR_NR, blocks.read.x_EN) = (1000, true);
        } else {
            (blocks.write.u_PAR_NR, blocks.write.ud_PAR_VALUE, blocks.write.x_EN) = (1000, 499, true);
        }
        blocks.call(&stage.base);
        (blocks.read.x_EN, blocks.write.x_EN) = (false, false);
        blocks.call(&stage.base);
        assert_eq!((blocks.control.b_ERR, blocks.control.x_ERR), (1 << bit, true));
        assert!(!blocks.read.x_BUSY && !blocks.write.x_BUSY);
        (blocks.read.x_EN, blocks.write.x_EN) = (bit == 0, bit == 1);
        blocks.call(&stage.base);
        assert!(!blocks.read.x_BUSY && !blocks.write.x_BUSY, "locked");
        (blocks.read.x_RESET, blocks.write.x_RESET, blocks.control.x_RESET) = (true, true, true);
        blocks.call(&stage.base);
        (blocks.read.x_RESET, blocks.write.x_RESET, blocks.control.x_RESET) = (false, false, false);
        assert_eq!(blocks.control.b_ERR, 0);
        blocks.read(&mut stage, 1000);
        assert_eq!((blocks.read.x_OK, blocks.read.ud_PAR_VALUE), (true, 100), "nothing was written");
    }
}

/// Manual p. 225-229, figure 7-6: a CANsync master reads a parameter of the drive that is connected to a slave.
#[test]
fn the_pins_of_par_sl_fit_those_of_the_baps_blocks() {
    let mut bench = crate::omega::cansync::bench::Bench::active(Memory::Heap);
    let ram = Ram::of(bench.rig.plant.devices()[1].segment()).unwrap();
    let baps = ram.at::<BAPS_CTRL_BMSTRUCT>(BAPS).unwrap();
    let mut jobs = CANsync_PAR_SL { x_EN: true, ..Default::default() };
    let mut blocks = Blocks::default();
    let mut set = CANsync_PAR_WRITE_MA {
        u_PAR_NR: 305,
        x_PAR_FORMAT: true,
        ud_PAR_VALUE: 4711,
        x_EN: true,
        ..Default::default()
    };
    let mut get = CANsync_PAR_READ_MA { u_PAR_NR: 305, ..Default::default() };
    let mut missing = CANsync_PAR_READ_MA { u_PAR_NR: 4000, ..Default::default() };
    bench.until(|bench| {
        jobs.call(&bench.sl);
        let (read, write) = (&mut blocks.read, &mut blocks.write);
        (read.u_PAR_NR, read.x_EN, read.x_RESET) = (jobs.u_PAR_NR, jobs.x_READ, jobs.x_RESET_JOB);
        (write.u_PAR_NR, write.x_EN, write.x_RESET) = (jobs.u_PAR_NR, jobs.x_WRITE, jobs.x_RESET_JOB);
        (write.x_PAR_FORMAT, write.ud_PAR_VALUE) = (jobs.x_PAR_FORMAT_WRITE, jobs.ud_PAR_VALUE_WRITE);
        blocks.control.x_RESET = jobs.x_RESET_JOB;
        blocks.call(&baps);
        let (read, write) = (&blocks.read, &blocks.write);
        (jobs.ud_PAR_VALUE_READ, jobs.x_PAR_FORMAT_READ) = (read.ud_PAR_VALUE, read.x_PAR_FORMAT);
        jobs.x_OK_IN = if jobs.x_READ { read.x_OK } else { write.x_OK };
        jobs.x_ERR_IN = if jobs.x_READ { read.x_ERR } else { write.x_ERR };
        jobs.i_ERR = if jobs.x_READ { read.i_ERR_DETAIL } else { write.i_ERR_DETAIL };
        set.call(&bench.ma);
        get.x_EN = set.x_OK;
        get.call(&bench.ma);
        missing.x_EN = get.x_OK;
        missing.call(&bench.ma);
        missing.x_ERR
    });
    assert_eq!((get.ud_PAR_VALUE, get.x_PAR_FORMAT_READ), (4711, true));
    assert_eq!((missing.b_ERR, missing.i_ERR), (1 << 0, -5));
}
