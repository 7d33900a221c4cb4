//! `CANsync_UPDOWNLOAD_MA` and `CANsync_UPDOWNLOAD_SL`.

use super::bench::{Bench, Dead};
use super::device::*;
use crate::rig::{BOTH, Memory};
use commram::devices::cansync;
use std::time::Duration;

struct BlockPair {
    bench: Bench,
    ma: CANsync_UPDOWNLOAD_MA,
    sl: CANsync_UPDOWNLOAD_SL,
    at_master: CANsync_UPDOWN_BMARRAY,
    at_slave: CANsync_UPDOWN_BMARRAY,
    /// The values of the output `u_LENGTH` at the slave, in their order.
    lengths: Vec<u16>,
}

impl BlockPair {
    fn new(memory: Memory) -> Self {
        BlockPair {
            bench: Bench::active(memory),
            ma: CANsync_UPDOWNLOAD_MA { x_EN: true, ..Default::default() },
            sl: CANsync_UPDOWNLOAD_SL { x_EN: true, ..Default::default() },
            at_master: [0; UPDOWN_VALUES],
            at_slave: [0; UPDOWN_VALUES],
            lengths: Vec::new(),
        }
    }

    /// Calls each block once. Master and slave have one array each, for sending and for receiving.
    fn call(&mut self) {
        self.call_slave();
        self.call_master();
    }

    fn call_master(&mut self) {
        let source = self.at_master;
        self.ma.call(&self.bench.ma, &source, &mut self.at_master);
    }

    fn reset_master(&mut self) {
        self.ma.x_RESET = true;
        self.call_master();
        self.ma.x_RESET = false;
    }

    /// Calls only the master's block, as if the slave's program did not run yet.
    fn master_alone(&mut self, cycles: u32) {
        for _ in 0..cycles {
            self.call_master();
            self.bench.rig.step(1000);
        }
    }

    fn call_slave(&mut self) {
        let source = self.at_slave;
        self.sl.call(&self.bench.sl, &mut self.at_slave, &source);
        if self.sl.x_BUSY && self.lengths.last() != Some(&self.sl.u_LENGTH) {
            self.lengths.push(self.sl.u_LENGTH);
        }
    }

    fn until(&mut self, mut done: impl FnMut(&mut Self) -> bool) {
        for _ in 0..60_000 {
            self.call();
            if done(self) {
                return;
            }
            self.bench.rig.step(1000);
        }
        panic!("it never ends: {:?} {:?}", self.ma, self.sl);
    }
}

fn values(seed: i32) -> CANsync_UPDOWN_BMARRAY {
    core::array::from_fn(|index| (index as i32 + seed).wrapping_mul(0x1F3D_5B79))
}

fn transfer(memory: Memory, length: u16, download: bool) -> BlockPair {
    let mut both = BlockPair::new(memory);
    (both.ma.u_LENGTH, both.ma.x_UPDOWN) = (length, download);
    both.ma.t_TIME = Duration::from_secs(600);
    both.sl.t_TIME = Duration::from_secs(600);
    let sent = values(i32::from(length));
    if download {
        both.at_master = sent;
    } else {
        both.at_slave = sent;
    }
    both.until(|both| !both.ma.x_BUSY);
    assert_eq!((both.ma.x_OK, both.ma.b_ERR, both.ma.w_ERR_SL), (true, 0, 0), "{length} {download}");
    let received = if download { &both.at_slave } else { &both.at_master };
    let length = usize::from(length);
    assert_eq!(received[..length], sent[..length]);
    assert!(received[length..].iter().all(|value| *value == 0), "nothing after the end");
    both.until(|both| both.sl.x_OK);
    assert_eq!((both.sl.x_BUSY, both.sl.x_UPDOWN), (false, download));
    both
}

/// Manual p. 263-271: blocks of 75 values, up to 2048 of them.
#[test]
fn transfers_of_every_kind_of_length() {
    for download in [false, true] {
        for (length, last) in [(1, 1), (75, 75), (76, 1), (300, 75)] {
            let both = transfer(Memory::Heap, length, download);
            assert_eq!(both.sl.u_LENGTH, last);
        }
    }
    assert_eq!(transfer(Memory::Mapped, 76, true).lengths, [75, 1]);
    let both = transfer(Memory::Heap, 2048, true);
    assert_eq!(both.lengths, [75, 23]);
}

/// Manual p. 191, 263; 5.02066.01a p. 96, 187: a transfer that begins before the slave's block runs is done when the
/// block runs (D-600). A device without registers for such a transfer refuses it (D-307).
#[test]
fn a_transfer_may_begin_before_the_slaves_block_runs() {
    for download in [false, true] {
        let mut both = BlockPair::new(Memory::Heap);
        (both.ma.u_LENGTH, both.ma.x_UPDOWN) = (80, download);
        (both.at_master, both.at_slave) = (values(1), values(2));
        both.master_alone(50);
        assert_eq!((both.ma.x_BUSY, both.ma.x_ERR_SL), (HAS_SINGLE_FRAME_AREA, !HAS_SINGLE_FRAME_AREA));
        if HAS_SINGLE_FRAME_AREA {
            let shown = if download { 0x55 } else { 0x45 };
            assert_eq!(both.bench.rig.slave.b_STEUREG_UPDOWN_SINGLE.load(), shown);
        } else {
            assert_eq!(both.ma.w_ERR_SL, 0x0104);
            both.reset_master();
        }
        both.until(|both| both.ma.x_OK && both.sl.x_OK);
        let sent = values(if download { 1 } else { 2 });
        assert_eq!((&both.at_master[..80], &both.at_slave[..80]), (&sent[..80], &sent[..80]));
    }
}

/// A transfer begins before the slave's block runs, and the master gives it up before the block runs. The given-up
/// transfer does not block the next one.
#[test]
fn a_transfer_cancelled_before_the_slaves_block_runs_leaves_no_trace() {
    for download in [false, true] {
        let mut both = BlockPair::new(Memory::Heap);
        (both.ma.u_LENGTH, both.ma.x_UPDOWN) = (80, download);
        both.ma.t_TIME = Duration::from_millis(50);
        both.master_alone(100);
        assert!(!both.ma.x_BUSY && (both.ma.x_ERR || both.ma.x_ERR_SL));
        if HAS_SINGLE_FRAME_AREA {
            let shown = if download { 0x57 } else { 0x47 };
            assert_eq!(
                both.bench.rig.slave.b_STEUREG_UPDOWN_SINGLE.load(),
                shown,
                "the change waits for a block"
            );
        }
        both.ma.t_TIME = Duration::from_secs(30);
        both.reset_master();
        both.master_alone(50);
        if !HAS_SINGLE_FRAME_AREA {
            both.reset_master();
        }
        both.until(|both| both.ma.x_OK && both.sl.x_OK);
    }
}

/// Manual p. 263, 266; 5.02066.01a p. 187, 189: a job for a slave that the command channel never polls does not delay
/// later transfers.
#[test]
fn a_job_for_a_slave_without_a_turn_delays_no_other_job() {
    // The master never sends this job: slave 5 is above b_MAX_SL_NR (D-601).
    let mut both = BlockPair::new(Memory::Heap);
    both.bench.rig.expect_errors(&[&cansync::rules::NEVER_POLLED]);
    (both.ma.si_SL_NR, both.ma.u_LENGTH) = (5, 1);
    both.ma.t_TIME = Duration::from_millis(100);
    both.until(|both| !both.ma.x_BUSY);
    assert!(both.ma.x_ERR);
    both.ma.si_SL_NR = 0;
    both.reset_master();
    both.until(|both| both.ma.x_OK);

    // The master has sent this job, but it no longer polls slave 0 when the job is cancelled.
    let mut both = BlockPair::new(Memory::Heap);
    both.bench.rig.tolerate_errors(&[&cansync::rules::NEVER_POLLED]);
    both.ma.u_LENGTH = 75;
    both.until(|both| both.sl.x_BUSY);
    both.bench.ma.b_SL_NR_UPDOWN.store(1);
    both.ma.x_EN = false;
    both.call();
    (both.ma.si_SL_NR, both.ma.x_EN, both.ma.t_TIME) = (1, true, Duration::from_millis(100));
    both.reset_master();
    both.until(|both| !both.ma.x_BUSY);
    assert!(both.ma.x_ERR && !both.ma.x_ERR_SL, "a monitoring time for the cancel");
    both.reset_master();
    both.until(|both| !both.ma.x_BUSY);
    assert_eq!(both.ma.w_ERR_SL, 0x0104, "the drive has answered");
}

#[test]
fn one_transfer_after_another() {
    for memory in BOTH {
        let mut both = transfer(memory, 3, true);
        (both.ma.x_EN, both.ma.x_UPDOWN) = (false, false);
        both.call();
        both.at_slave = values(99);
        both.ma.x_EN = true;
        both.call();
        assert!(both.ma.x_BUSY && !both.ma.x_OK);
        both.until(|both| !both.ma.x_BUSY);
        assert!(both.ma.x_OK);
        assert_eq!(both.at_master[..3], values(99)[..3]);
    }
}

/// The block reads its inputs at the start of a transfer. Later changes of the inputs have no effect on this transfer.
#[test]
fn inputs_that_change_meanwhile_change_nothing() {
    let mut both = BlockPair::new(Memory::Heap);
    (both.ma.u_LENGTH, both.ma.x_UPDOWN) = (76, true);
    both.at_master = values(5);
    both.until(|both| both.sl.x_BUSY);
    (both.ma.u_LENGTH, both.ma.x_UPDOWN, both.ma.si_SL_NR) = (1, false, 1);
    both.until(|both| !both.ma.x_BUSY);
    assert!(both.ma.x_OK);
    assert_eq!(both.at_slave[..76], values(5)[..76]);
}

/// Manual p. 267: tests each bit of `b_ERR`, and errors that the slave reports.
#[test]
fn every_error_of_the_masters_block() {
    // No slave answers, so the transfer ends with a timeout after all tries.
    let mut both = BlockPair::new(Memory::Heap);
    both.bench.rig.expect_errors(&[&cansync::rules::NEVER_POLLED]);
    (both.ma.si_SL_NR, both.ma.u_LENGTH, both.ma.us_MAX_NR_OF_COMM) = (5, 1, 3);
    both.ma.t_TIME = Duration::from_millis(100);
    let start = both.bench.rig.plant.now();
    both.until(|both| !both.ma.x_BUSY);
    let took = both.bench.rig.plant.now() - start;
    assert!((300_000..306_000).contains(&took), "{took}");
    let [of_slave, of_length, timeout] = TRANSFER_ERRORS;
    assert_eq!((both.ma.b_ERR, both.ma.x_ERR, both.ma.x_ERR_SL, both.ma.x_OK), (timeout, true, false, false));

    for length in [0, 2049, u16::MAX] {
        let mut both = BlockPair::new(Memory::Heap);
        both.ma.u_LENGTH = length;
        both.call();
        assert_eq!((both.ma.b_ERR, both.ma.x_ERR, both.ma.x_BUSY), (of_length, true, false));
        both.ma.u_LENGTH = 1;
        both.call();
        assert!(!both.ma.x_BUSY, "needs a reset");
        both.ma.x_RESET = true;
        both.call();
        both.ma.x_RESET = false;
        both.until(|both| both.ma.x_OK);
    }

    // A drive has no area for up-/downloads (decision D-47).
    let mut both = BlockPair::new(Memory::Heap);
    (both.ma.si_SL_NR, both.ma.u_LENGTH) = (1, 1);
    both.until(|both| !both.ma.x_BUSY);
    assert_eq!((both.ma.w_ERR_SL, both.ma.x_ERR_SL, both.ma.b_ERR), (0x0104, true, of_slave));
}

/// Manual p. 270-271: tests the monitoring time of the slave's block.
#[test]
fn a_master_that_stops_half_way_is_a_timeout_at_the_slave() {
    let mut both = BlockPair::new(Memory::Heap);
    (both.ma.u_LENGTH, both.ma.x_UPDOWN) = (150, true);
    both.sl.t_TIME = Duration::from_millis(800);
    both.until(|both| both.sl.x_BUSY && both.bench.ma.w_COUNTER_UPDOWNBLK1.load() > 60);
    let start = both.bench.rig.plant.now();
    while !both.sl.x_ERR {
        both.call_slave();
        both.bench.rig.step(1000);
        assert!(both.bench.rig.plant.now() - start < 1_000_000);
    }
    assert_eq!((both.sl.w_ERR, both.sl.x_BUSY, both.sl.x_OK), (1 << 0, false, false));
    // The master detects the timeout when it continues. After a reset, the blocks of master and slave can start a new
    // job.
    both.until(|both| !both.ma.x_BUSY);
    assert_eq!(both.ma.w_ERR_SL, 0x0103);
    (both.ma.x_RESET, both.sl.x_RESET) = (true, true);
    both.call();
    (both.ma.x_RESET, both.sl.x_RESET) = (false, false);
    both.sl.t_TIME = Duration::from_secs(30);
    both.until(|both| both.ma.x_OK && both.sl.x_OK);
}

/// Manual p. 266: `x_EN` FALSE cancels the transfer; the slave's block recovers without a reset.
#[test]
fn a_transfer_the_master_cancels_leaves_no_trace() {
    let mut both = BlockPair::new(Memory::Heap);
    both.ma.u_LENGTH = 75;
    both.until(|both| both.bench.ma.w_COUNTER_UPDOWNBLK1.load() > 60);
    assert!(both.sl.x_BUSY && both.sl.x_ORDER_ACTIV);
    both.ma.x_EN = false;
    both.until(|both| !both.sl.x_BUSY);
    assert!(!both.ma.x_BUSY && !both.sl.x_OK && !both.sl.x_ERR);
    both.ma.x_EN = true;
    both.call();
    assert!(!both.ma.x_BUSY, "needs a reset");
    both.ma.x_RESET = true;
    both.call();
    both.ma.x_RESET = false;
    both.until(|both| both.ma.x_OK);
}

/// Manual p. 270: `x_EN` FALSE at the slave cancels the transfer, too.
#[test]
fn a_transfer_the_slave_cancels_fails_at_the_master() {
    let mut both = BlockPair::new(Memory::Heap);
    both.ma.u_LENGTH = 75;
    both.until(|both| both.bench.ma.w_COUNTER_UPDOWNBLK1.load() > 60);
    both.sl.x_EN = false;
    both.until(|both| !both.ma.x_BUSY);
    assert_eq!((both.ma.w_ERR_SL, both.sl.x_BUSY), (0x0103, false));
    both.sl.x_EN = true;
    both.call();
    assert!(!both.sl.x_BUSY);
    (both.ma.x_RESET, both.sl.x_RESET) = (true, true);
    both.call();
    (both.ma.x_RESET, both.sl.x_RESET) = (false, false);
    both.until(|both| both.ma.x_OK);
}

/// A master without the vendor's block may send any area of the slave's 2048 values.
#[test]
fn areas_that_the_slave_does_not_have_are_refused() {
    let mut both = BlockPair::new(Memory::Heap);
    for (address, length, error) in [(0x100 + 2048, 4, 0x0107), (0x100, 6, 0x0104), (0x102, 8, 0)] {
        let base = &both.bench.ma;
        base.b_SL_NR_UPDOWNBLK1.store(0);
        base.d_BASE_ADR_UPDOWNBLK1.store(address);
        base.w_LENGTH_UPDOWNBLK1.store(length);
        base.a_DATA_UPDOWNBLK1[0].store(11);
        base.a_DATA_UPDOWNBLK1[1].store(22);
        base.b_STATREG_UPDOWNBLK1.store(0x15);
        base.b_STEUREG_UPDOWNBLK1.store(0x15);
        for _ in 0..100 {
            both.call_slave();
            both.bench.rig.step(1000);
        }
        let base = &both.bench.ma;
        assert_eq!(base.b_STEUREG_UPDOWNBLK1.load() & 0x01, 0);
        assert_eq!(base.w_ERR_NR_UPDOWNBLK1.load(), error, "{address:X} {length}");
    }
    assert_eq!(both.at_slave[..5], [0, 0, 11, 22, 0]);
    assert!(both.sl.x_OK);
}

#[test]
fn the_slaves_preset_time_is_30_seconds() {
    let dead = Dead::new();
    let base = dead.slave();
    let mut block = CANsync_UPDOWNLOAD_SL { x_EN: true, ..Default::default() };
    let mut values = [0; UPDOWN_VALUES];
    base.b_STEUREG_UPDOWNBLK1.store(0x55);
    base.d_BASE_ADR_UPDOWNBLK1.store(0x100);
    base.w_LENGTH_UPDOWNBLK1.store(4);
    block.call(&base, &mut values, &[0; UPDOWN_VALUES]);
    dead.pass(29_999_999);
    block.call(&base, &mut values, &[0; UPDOWN_VALUES]);
    assert!(block.x_BUSY && !block.x_ERR);
    dead.pass(1);
    block.call(&base, &mut values, &[0; UPDOWN_VALUES]);
    assert_eq!((block.w_ERR, block.x_BUSY), (1, false));
    assert_eq!(base.w_ERR_NR_UPDOWNBLK1.load(), 0x0103);
}
