//! Tests all 65,536 pairs of values that the application can write into the two registers of a job. In each
//! state, equal pairs give equal answers and registers, and only the control register decides.

use super::*;
use crate::devices::cansync::frames::codec::{Direction, ParameterResponse, UpDownResponse};
use crate::devices::omega_drive_line_2::registers::NODE1;
use crate::devices::omega_drive_line_2::registers::SEGMENT_END;
use crate::identity::{DeviceIndex, PortNumber};
use crate::journal::{Journal, Origin};
use crate::memory::{Cell8, Segment, View};
use core::fmt::Debug;

const NUMBER: u8 = 5;
const VALUE: u32 = 0x9ABC_1234;

struct Bench {
    jobs: Jobs,
    regs: View<CANsync_SL_CTRL_BMSTRUCT>,
    journal: Journal,
}

impl Bench {
    fn new(enable: u8) -> Self {
        let regs = Segment::heap(SEGMENT_END).view::<CANsync_SL_CTRL_BMSTRUCT>(NODE1).unwrap();
        regs.b_EN_UPDOWNBLK1.store(enable);
        regs.w_ERR_NR_PAR_CMD.store(0xFFFE);
        regs.w_ERR_NR_UPDOWNBLK1.store(0x0123);
        regs.w_ERR_NR_UPDOWN_SINGLE.store(0x0123);
        Bench { jobs: Jobs::new(NUMBER, true), regs, journal: Journal::new(1) }
    }

    /// Delivers a job to the node, and returns the answer that the node sends.
    fn turn(&mut self, frame: &Frame) -> Frame {
        let origin = Origin { plc: DeviceIndex(0), node: PortNumber(1) };
        let ctx = &mut Context { now: 0, journal: &mut self.journal, origin, base: NODE1 };
        self.jobs.arrive(ctx, &self.regs, frame.payload(), 0);
        let answer = self.jobs.response(ctx, &self.regs).unwrap();
        self.jobs.response_sent(ctx, &self.regs);
        answer
    }

    fn parameter(&mut self, job: &ParameterJob) -> ParameterResult {
        self.regs.d_DATA_PAR_CMD.store(VALUE);
        let answer = self.turn(&job.frame(NUMBER));
        ParameterResponse::decode(job, answer.payload()).unwrap().result()
    }

    fn updown(&mut self, job: &UpDownJob) -> UpDownResult {
        let answer = self.turn(&job.frame(NUMBER));
        UpDownResponse::decode(job, answer.payload()).unwrap().result()
    }
}

/// Control and status register of a job.
type Pair = fn(&CANsync_SL_CTRL_BMSTRUCT) -> [&Cell8; 2];

const PARAMETER: Pair = |regs| [&regs.b_STEUREG_PAR_CMD, &regs.b_STATREG_PAR_CMD];
const BLOCK_1: Pair = |regs| [&regs.b_STEUREG_UPDOWNBLK1, &regs.b_STATREG_UPDOWNBLK1];
const SINGLE: Pair = |regs| [&regs.b_STEUREG_UPDOWN_SINGLE, &regs.b_STATREG_UPDOWN_SINGLE];

/// Runs `turn` from the state of `bench` for every pair. `expected` returns the answer and the pair after the turn.
fn every_pair<R: PartialEq + Debug>(
    mut bench: Bench,
    pair: Pair,
    turn: impl Fn(&mut Bench) -> R,
    expected: impl Fn([u8; 2]) -> (R, [u8; 2]),
) {
    let jobs = bench.jobs.clone();
    for bytes in (0..=u16::MAX).map(u16::to_le_bytes) {
        bench.jobs = jobs.clone();
        for (cell, byte) in pair(&bench.regs).into_iter().zip(bytes) {
            cell.store(byte);
        }
        let answer = turn(&mut bench);
        assert_eq!((answer, pair(&bench.regs).map(Cell8::load)), expected(bytes), "from {bytes:02X?}");
    }
}

/// Returns the pair with bit 6 cleared.
fn not_busy(pair: [u8; 2]) -> [u8; 2] {
    pair.map(|byte| byte & 0xBF)
}

#[test]
fn parameter_jobs_have_a_defined_result_for_every_pair() {
    use ParameterResult::{Busy, Done, Doubleword, Error, Word};
    let other = ParameterJob::new(301, Access::Read).unwrap();
    for (access, shown) in
        [(Access::Read, 0x43), (Access::WriteWord(1), 0x45), (Access::WriteDoubleword(2), 0x55)]
    {
        let job = ParameterJob::new(300, access).unwrap();
        let write = access != Access::Read;

        every_pair(Bench::new(0), PARAMETER, |bench| bench.parameter(&job), |_| (Busy, [shown; 2]));

        let mut bench = Bench::new(0);
        bench.parameter(&job);
        every_pair(
            bench,
            PARAMETER,
            |bench| bench.parameter(&job),
            |pair| match pair[0] {
                control if control & 0x01 != 0 => (Busy, pair),
                control if control & 0x20 != 0 => (Error(0xFFFE), not_busy(pair)),
                _ if write => (Done, not_busy(pair)),
                control if control & 0x10 != 0 => (Doubleword(VALUE), not_busy(pair)),
                _ => (Word(VALUE as u16), not_busy(pair)),
            },
        );

        let mut bench = Bench::new(0);
        bench.parameter(&other);
        every_pair(
            bench,
            PARAMETER,
            |bench| bench.parameter(&job),
            |pair| match pair[0] {
                control if control & 0x80 != 0 => (Busy, [shown; 2]),
                _ => (Busy, pair.map(|byte| byte | 0x08)),
            },
        );
    }
}

fn init(direction: Direction) -> UpDownJob {
    UpDownJob::new(6, UpDownStep::Init { direction, address: 0x1000, sub_slave: 0 }).unwrap()
}

/// Progress of a download of one block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum DownloadState {
    Idle,
    InitShown,
    InitAnswered,
    LastShown,
}

const LAST: UpDownStep = UpDownStep::Download { last: true, data: [7; 6] };

fn in_state(state: DownloadState, pair: Pair, enable: u8) -> Bench {
    let mut bench = Bench::new(enable);
    let init = init(Direction::Download);
    if state >= DownloadState::InitShown {
        bench.updown(&init);
    }
    if state >= DownloadState::InitAnswered {
        pair(&bench.regs)[0].store(0x54);
        bench.updown(&init);
    }
    if state >= DownloadState::LastShown {
        bench.updown(&UpDownJob::new(0, LAST).unwrap());
    }
    bench
}

#[test]
fn up_downloads_have_a_defined_result_for_every_pair() {
    use UpDownResult::{Busy, Done, Error};
    let last = UpDownJob::new(0, LAST).unwrap();
    let (download, upload) = (init(Direction::Download), init(Direction::Upload));
    let acknowledged = |pair: [u8; 2]| match pair[0] {
        control if control & 0x01 != 0 => (Busy, pair),
        control if control & 0x20 != 0 => (Error(0x0123), not_busy(pair)),
        _ => (Done, not_busy(pair)),
    };
    for (pair, enable) in [(BLOCK_1, 1), (SINGLE, 0)] {
        let bench = |state| in_state(state, pair, enable);
        every_pair(bench(DownloadState::Idle), pair, |bench| bench.updown(&download), |_| (Busy, [0x55; 2]));
        every_pair(bench(DownloadState::InitShown), pair, |bench| bench.updown(&download), acknowledged);
        every_pair(
            bench(DownloadState::InitAnswered),
            pair,
            |bench| bench.updown(&last),
            |pair| match pair[0] {
                control if control & 0x20 != 0 => (Error(0x0123), not_busy(pair)),
                _ => (Busy, [0x5D; 2]),
            },
        );
        every_pair(bench(DownloadState::LastShown), pair, |bench| bench.updown(&last), acknowledged);

        for state in [DownloadState::InitShown, DownloadState::InitAnswered, DownloadState::LastShown] {
            // If bit 5 is set between two frames, the application has given up (D-71).
            let over = |control| state == DownloadState::InitAnswered && control & 0x20 != 0;
            every_pair(
                bench(state),
                pair,
                |bench| bench.updown(&upload),
                |pair| match pair[0] {
                    control if over(control) || control & 0x80 != 0 => (Busy, [0x45; 2]),
                    _ => (Busy, pair.map(|byte| byte | 0x02)),
                },
            );
            let cancel = UpDownJob::cancel();
            every_pair(
                bench(state),
                pair,
                |bench| bench.updown(&cancel),
                |pair| match pair[0] {
                    control if over(control) => (Done, pair),
                    control if control & 0x80 != 0 => (Done, [0; 2]),
                    _ => (Done, pair.map(|byte| byte | 0x02)),
                },
            );
        }
    }
}
