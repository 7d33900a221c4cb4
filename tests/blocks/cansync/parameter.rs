//! `CANsync_PAR_READ_MA`, `CANsync_PAR_WRITE_MA` against a drive and against `CANsync_PAR_SL`.

use super::bench::{Bench, Dead};
use super::device::*;
use crate::rig::{BOTH, Memory};
use commram::devices::cansync;
use std::collections::BTreeMap;
use std::time::Duration;

fn read(si_SL_NR: i8, u_PAR_NR: u16) -> CANsync_PAR_READ_MA {
    CANsync_PAR_READ_MA { si_SL_NR, u_PAR_NR, x_EN: true, ..Default::default() }
}

fn write(si_SL_NR: i8, u_PAR_NR: u16, ud_PAR_VALUE: u32) -> CANsync_PAR_WRITE_MA {
    CANsync_PAR_WRITE_MA { si_SL_NR, u_PAR_NR, ud_PAR_VALUE, x_EN: true, ..Default::default() }
}

/// Manual p. 222-224, 230-232: the drive's parameter 1000.
#[test]
fn a_drives_parameter_is_read_written_and_refused() {
    for memory in BOTH {
        let mut bench = Bench::active(memory);
        let mut get = read(1, 1000);
        bench.until(|b| {
            get.call(&b.ma);
            !get.x_BUSY
        });
        assert_eq!((get.ud_PAR_VALUE, get.x_PAR_FORMAT_READ, get.x_OK), (100, false, true), "{memory:?}");
        let mut set = write(1, 1000, 321);
        bench.until(|b| {
            set.call(&b.ma);
            !set.x_BUSY
        });
        assert_eq!((set.x_OK, set.x_ERR), (true, false));
        // While `x_EN` stays TRUE, the block does nothing more. A change to FALSE and back to TRUE begins the next job.
        get.call(&bench.ma);
        assert!(!get.x_BUSY && get.x_OK);
        get.x_EN = false;
        get.call(&bench.ma);
        assert!(get.x_OK, "still the last job's");
        get.x_EN = true;
        bench.until(|b| {
            get.call(&b.ma);
            !get.x_BUSY
        });
        assert_eq!(get.ud_PAR_VALUE, 321);
    }
}

/// Manual p. 224, 232: tests each bit of `b_ERR` of both blocks.
#[test]
fn every_error_bit_of_the_masters_blocks() {
    macro_rules! check {
        ($block:expr, $bits:expr, $number:expr) => {{
            let mut bench = Bench::active(Memory::Heap);
            // One of the slaves is not polled.
            bench.rig.tolerate_errors(&[&cansync::rules::NEVER_POLLED]);
            let mut block = $block;
            block.t_TIME = Duration::from_millis(500);
            let start = bench.rig.plant.now();
            bench.until(|b| {
                block.call(&b.ma);
                !block.x_BUSY
            });
            let took = bench.rig.plant.now() - start;
            assert_eq!((block.b_ERR, block.i_ERR), ($bits, $number as i16));
            assert_eq!((block.x_ERR, block.x_OK), (true, false));
            if $bits == 1 << 1 {
                assert!((500_000..502_000).contains(&took), "{took}");
                assert_eq!(bench.ma.a_CTRLREG_PAR_CMD_SL[5].b_STEUREG_PAR_CMD.load(), 0, "withdrawn");
            }
            // A change of `x_EN` to FALSE and back to TRUE does not clear the error. Only a reset clears it.
            for x_EN in [false, true] {
                block.x_EN = x_EN;
                block.call(&bench.ma);
                assert!(block.x_ERR && !block.x_BUSY);
            }
            block.x_RESET = true;
            block.call(&bench.ma);
            assert_eq!((block.b_ERR, block.i_ERR, block.x_ERR, block.x_BUSY), (0, 0, false, false));
            block.x_RESET = false;
            (block.si_SL_NR, block.u_PAR_NR, block.ud_PAR_VALUE) = (1, 1000, 7);
            bench.until(|b| {
                block.call(&b.ma);
                !block.x_BUSY
            });
            assert!(block.x_OK);
        }};
    }
    check!(read(1, 4000), 1 << 0, 0xFFFB_u16);
    check!(write(1, 1000, 501), 1 << 0, 0xFFFD_u16);
    for slave in [-1, 32] {
        check!(read(slave, 1000), 1 << 4, 0_u16);
        check!(write(slave, 1000, 7), 1 << 4, 0_u16);
    }
    check!(read(5, 1000), 1 << 1, 0_u16);
    check!(write(5, 1000, 7), 1 << 1, 0_u16);
}

/// Manual p. 223-224: if `x_EN` becomes FALSE too early, the job is cancelled.
#[test]
fn a_cancelled_job_needs_a_reset() {
    let mut bench = Bench::active(Memory::Heap);
    let mut block = write(1, 1000, 400);
    block.call(&bench.ma);
    assert!(block.x_BUSY);
    block.x_EN = false;
    block.call(&bench.ma);
    assert_eq!((block.x_BUSY, block.x_OK, block.x_ERR), (false, false, false));
    assert_eq!(bench.ma.a_CTRLREG_PAR_CMD_SL[1].b_STEUREG_PAR_CMD.load(), 0);
    block.x_EN = true;
    block.call(&bench.ma);
    assert!(!block.x_BUSY, "locked");
    block.x_RESET = true;
    block.call(&bench.ma);
    block.x_RESET = false;
    bench.until(|b| {
        block.call(&b.ma);
        block.x_OK
    });
}

/// Manual p. 222: a program may have several instances of the block, one per slave; two instances for the same slave
/// wait for each other.
#[test]
fn two_blocks_for_one_slave_take_turns() {
    let mut bench = Bench::active(Memory::Heap);
    let (mut set, mut get) = (write(1, 1000, 77), read(1, 1000));
    bench.until(|b| {
        set.call(&b.ma);
        get.call(&b.ma);
        set.x_OK && get.x_OK
    });
    assert_eq!(get.ud_PAR_VALUE, 77);
}

/// The monitoring time of a block also runs while the job of another block is in progress. That job is not disturbed.
#[test]
fn waiting_for_another_job_ends_with_a_timeout_too() {
    let dead = Dead::new();
    let base = dead.master();
    base.a_CTRLREG_PAR_CMD_SL[3].b_STEUREG_PAR_CMD.store(0x05);
    let mut block = read(3, 1);
    block.call(&base);
    dead.pass(2_999_999);
    block.call(&base);
    assert!(block.x_BUSY, "3 s are preset");
    dead.pass(1);
    block.call(&base);
    assert_eq!(block.b_ERR, 1 << 1);
    assert_eq!(base.a_CTRLREG_PAR_CMD_SL[3].b_STEUREG_PAR_CMD.load(), 0x05);
}

/// The application of a slave: parameters in a map, in the words of `CANsync_PAR_SL`.
#[derive(Default)]
struct Application {
    block: CANsync_PAR_SL,
    parameters: BTreeMap<u16, (u32, bool)>,
    /// Number of calls that a job takes.
    delay: u32,
    waited: u32,
}

impl Application {
    fn new() -> Self {
        let mut application = Application::default();
        application.block.x_EN = true;
        application
    }

    fn cycle(&mut self, bench: &Bench) {
        let block = &mut self.block;
        block.call(&bench.sl);
        if !block.x_ACTIV {
            self.waited = 0;
            return;
        }
        (block.x_OK_IN, block.x_ERR_IN) = (false, false);
        self.waited += 1;
        if self.waited <= self.delay {
            return;
        }
        if block.x_WRITE {
            self.parameters.insert(block.u_PAR_NR, (block.ud_PAR_VALUE_WRITE, block.x_PAR_FORMAT_WRITE));
            block.x_OK_IN = true;
        } else if let Some(&(value, format)) = self.parameters.get(&block.u_PAR_NR) {
            (block.ud_PAR_VALUE_READ, block.x_PAR_FORMAT_READ) = (value, format);
            block.x_OK_IN = true;
        } else {
            (block.i_ERR, block.x_ERR_IN) = (-5, true);
        }
    }
}

/// Manual p. 225-229: the slave's application does the jobs.
#[test]
fn jobs_to_a_slaves_application() {
    for memory in BOTH {
        let mut bench = Bench::active(memory);
        let mut application = Application::new();
        application.delay = 12;
        for (number, value, x_PAR_FORMAT) in [(7, 0xBEEF, false), (8, 0xDEAD_BEEF, true)] {
            let mut set = CANsync_PAR_WRITE_MA { x_PAR_FORMAT, ..write(0, number, value) };
            let mut busy = 0;
            bench.until(|b| {
                application.cycle(b);
                set.call(&b.ma);
                busy += u32::from(application.block.x_BUSY);
                !set.x_BUSY
            });
            assert!(set.x_OK, "{set:?}");
            assert!(busy > 12);
            let mut get = CANsync_PAR_READ_MA { x_PAR_FORMAT, ..read(0, number) };
            bench.until(|b| {
                application.cycle(b);
                get.call(&b.ma);
                !get.x_BUSY
            });
            assert_eq!((get.ud_PAR_VALUE, get.x_PAR_FORMAT_READ, get.x_OK), (value, x_PAR_FORMAT, true));
        }
        let mut missing = read(0, 9);
        bench.until(|b| {
            application.cycle(b);
            missing.call(&b.ma);
            !missing.x_BUSY
        });
        assert_eq!((missing.b_ERR, missing.i_ERR), (1 << 0, -5));
        bench.until(|b| {
            application.cycle(b);
            application.block.x_OK
        });
        assert!(!application.block.x_BUSY, "x_OK does not distinguish errors from good ends (p. 229)");
    }
}

/// Manual p. 227: the master withdraws a job and gives another job.
#[test]
fn a_job_the_master_changes_is_reset() {
    let mut bench = Bench::active(Memory::Heap);
    let mut application = Application::new();
    application.delay = u32::MAX;
    let mut get = read(0, 20);
    bench.until(|b| {
        get.call(&b.ma);
        application.cycle(b);
        application.block.x_READ
    });
    get.x_EN = false;
    get.call(&bench.ma);
    let mut set = write(0, 21, 5);
    let mut reset_seen = false;
    bench.until(|b| {
        set.call(&b.ma);
        application.cycle(b);
        if application.block.x_RESET_JOB {
            assert!(!application.block.x_READ && !application.block.x_BUSY);
            reset_seen = true;
            application.delay = 0;
        }
        !set.x_BUSY
    });
    assert!(reset_seen && set.x_OK);
    assert!(!application.block.x_RESET_JOB, "FALSE again with the next job");
    assert_eq!(application.parameters[&21], (5, false));
}

/// Manual p. 189-190, 227; 5.02066.01a p. 94-95, 142: an answer that the master does not fetch does not stop the slave's block, in
/// either way of restarting.
#[test]
fn a_slaves_block_restarts_after_an_unfetched_answer() {
    let resets: [fn(&mut Application, &Bench); 3] = [
        |application, bench| {
            application.block.x_RESET = true;
            application.cycle(bench);
            application.block.x_RESET = false;
        },
        |application, bench| {
            (application.block.x_EN, application.block.x_RESET) = (false, true);
            application.cycle(bench);
            (application.block.x_EN, application.block.x_RESET) = (true, false);
        },
        |application, _| *application = Application::new(),
    ];
    for (way, reset) in resets.into_iter().enumerate() {
        for (parameter, answer) in [(20, 0x42), (9, 0x62)] {
            let mut bench = Bench::active(Memory::Heap);
            let mut application = Application::new();
            application.parameters.insert(20, (7, false));
            application.delay = u32::MAX;
            let mut get = read(0, parameter);
            bench.until(|b| {
                get.call(&b.ma);
                application.cycle(b);
                application.block.x_READ
            });
            get.x_EN = false;
            get.call(&bench.ma);
            application.delay = 0;
            bench.cycles(5, |b| application.cycle(b));
            assert!(application.block.x_BUSY);
            assert_eq!(bench.sl.b_STEUREG_PAR_CMD.load(), answer, "the master does not fetch it");
            reset(&mut application, &bench);
            let mut set = write(0, 21, 5);
            bench.until(|b| {
                set.call(&b.ma);
                application.cycle(b);
                !set.x_BUSY
            });
            assert!(set.x_OK, "way {way}, answer 16#{answer:02X}: {set:?}");
            assert_eq!(application.parameters[&21], (5, false));
        }
    }
}

/// Manual p. 227; 5.02066.01a p. 144: when the firmware has dropped a job, the job that the block shows is no longer
/// valid (D-63).
#[test]
fn a_job_that_the_firmware_drops_is_reset() {
    for is_answered in [false, true] {
        let dead = Dead::new();
        let base = dead.slave();
        let mut block = CANsync_PAR_SL { x_EN: true, ..Default::default() };
        base.b_STEUREG_PAR_CMD.store(0x43);
        block.call(&base);
        assert!(block.x_READ && block.x_ACTIV);
        block.x_OK_IN = is_answered;
        block.call(&base);
        block.x_OK_IN = false;
        base.b_STEUREG_PAR_CMD.store(0x00);
        block.call(&base);
        assert_eq!((block.x_RESET_JOB, block.x_BUSY, block.x_READ, block.x_OK), (true, false, false, false));
        assert_eq!(base.b_STEUREG_PAR_CMD.load(), 0x00);
        base.b_STEUREG_PAR_CMD.store(0x45);
        block.call(&base);
        assert_eq!((block.x_RESET_JOB, block.x_WRITE), (false, true));
    }
}

/// Manual p. 228: without `x_EN` the block shows no job; if `x_EN` becomes FALSE too early, the block needs a reset.
#[test]
fn the_slaves_block_can_be_switched_off() {
    let mut bench = Bench::active(Memory::Heap);
    let mut application = Application::new();
    application.block.x_EN = false;
    let mut get = read(0, 20);
    get.t_TIME = Duration::from_millis(100);
    bench.until(|b| {
        get.call(&b.ma);
        application.cycle(b);
        assert!(!application.block.x_ACTIV);
        !get.x_BUSY
    });
    assert_eq!(get.b_ERR, 1 << 1, "no slave has answered");

    (application.block.x_EN, application.delay) = (true, u32::MAX);
    let mut set = write(0, 20, 9);
    bench.until(|b| {
        set.call(&b.ma);
        application.cycle(b);
        application.block.x_WRITE
    });
    for x_EN in [false, true] {
        application.block.x_EN = x_EN;
        bench.cycles(5, |b| application.cycle(b));
        assert!(!application.block.x_BUSY);
    }
    application.block.x_RESET = true;
    application.cycle(&bench);
    application.block.x_RESET = false;
    application.delay = 0;
    bench.until(|b| {
        set.call(&b.ma);
        application.cycle(b);
        !set.x_BUSY
    });
    assert!(set.x_OK);
}
