//! A PLC writes arbitrary values into the control and status register of a job, in every state of the job. The
//! result is defined, the control register decides, and both registers agree as soon as the firmware has
//! answered (5.00005.03a p. 165).

use super::bench::Bench;
use crate::rig::{BOTH, FASTEST};
use commram::devices::cansync::frames::codec::{
    Access, ParameterJob, ParameterResult, UpDownJob, UpDownResult, UpDownStep,
};

/// Progress of a read job on parameter 300 when the random bytes are written.
#[derive(Clone, Copy, Debug)]
enum JobState {
    Idle,
    /// The job is sent and waits for its answer.
    Sent,
    /// The slave has answered BUSY, and the job is sent again.
    Busy,
    Finished,
}

const STATES: [JobState; 4] = [JobState::Idle, JobState::Sent, JobState::Busy, JobState::Finished];

fn job() -> ParameterJob {
    ParameterJob::new(300, Access::Read).unwrap()
}

fn bring_to(bench: &mut Bench, state: JobState) {
    bench.enter_parameter(0, 0x03, 300, 1);
    if matches!(state, JobState::Idle) {
        bench.put(0, 0, 0);
        return;
    }
    assert_eq!(bench.parameter_job(), Some((0, job())));
    match state {
        JobState::Busy => {
            bench.answer(0, &job(), ParameterResult::Busy);
            assert_eq!(bench.parameter_job(), Some((0, job())));
        }
        JobState::Finished => bench.answer(0, &job(), ParameterResult::Word(7)),
        JobState::Idle | JobState::Sent => {}
    }
}

/// Returns the expected values by the bit table of p. 164 and decisions D-41, D-42, D-48: the control register after
/// the pending answer, and after a further interval with an answer. `None`: the firmware does not act, both registers
/// keep their values.
fn right(state: JobState, control: u8) -> (Option<u8>, Option<u8>) {
    let (active, sent) = (control & 0x01 != 0, control & 0x08 != 0);
    let (read, write) = (control & 0x02 != 0, control & 0x04 != 0);
    // Bits 1, 2 and 7 do not change. Bit 4 does not change in a write job; in a read job it is the format of the
    // answer, which is a word here.
    let good_end = control & 0x86 | if write { control & 0x10 } else { 0 };
    let due = matches!(state, JobState::Sent | JobState::Busy);
    if due && active && sent && read && !write {
        return (Some(good_end), Some(good_end));
    }
    let later = match (active, read != write) {
        (false, _) => None,
        (true, true) => Some(good_end),
        (true, false) => Some(control & 0x96 | 0x20),
    };
    (None, later)
}

#[test]
fn all_pairs_of_bytes_in_every_state_of_a_parameter_job() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut bench = Bench::new(memory, rate);
            let registers = bench.regs.project(|regs| &regs.a_CTRLREG_PAR_CMD_SL[0]);
            let pair = || (registers.b_STEUREG_PAR_CMD.load(), registers.b_STATREG_PAR_CMD.load());
            for state in STATES {
                for control in 0..=u8::MAX {
                    let (at_once, later) = right(state, control);
                    for status in 0..=u8::MAX {
                        let expect = |found, right: Option<u8>, when| {
                            let right = right.map_or((control, status), |byte| (byte, byte));
                            assert_eq!(found, right, "{when}: {control:02X} {status:02X} in state {state:?}");
                        };
                        bring_to(&mut bench, state);
                        bench.put(0, control, status);
                        bench.answer(0, &job(), ParameterResult::Word(7));
                        expect(pair(), at_once, "after the answer that was due");
                        if let Some((slave, job)) = bench
                            .interval()
                            .map(|frame| (frame.id() & 0x7F, ParameterJob::decode(frame.payload()).unwrap()))
                        {
                            assert_eq!(slave, 0);
                            let result = match job.access() {
                                Access::Read => ParameterResult::Word(8),
                                _ => ParameterResult::Done,
                            };
                            bench.answer(0, &job, result);
                        }
                        expect(pair(), later.or(at_once), "an interval later");
                        assert_eq!(bench.interval(), None, "nothing goes on");
                    }
                }
            }
        }
    }
}

/// All values of the control byte of an up-/download, in each phase of the job. After any value, either the job ends,
/// or the master sends a cancellation and no further frame of the job. The status byte has no influence.
#[test]
fn all_control_bytes_in_every_phase_of_a_download() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut bench = Bench::new(memory, rate);
            let answer = |bench: &mut Bench, job: &UpDownJob| match job.step() {
                UpDownStep::Upload { .. } => bench.answer_block(0, job, UpDownResult::Data([9; 6])),
                _ => bench.answer_block(0, job, UpDownResult::Done),
            };
            for frames in 0..4 {
                for control in 0..=u8::MAX {
                    for status in [0x00, 0x15, 0x9F, 0xFF] {
                        bench.enter_block(0x15, 0, 0x1000, 14);
                        for _ in 0..frames {
                            let (_, job) = bench.updown_job().unwrap();
                            answer(&mut bench, &job);
                        }
                        bench.regs.b_STATREG_UPDOWNBLK1.store(status);
                        bench.regs.b_STEUREG_UPDOWNBLK1.store(control);
                        let mut sent = Vec::new();
                        while let Some((_, job)) = bench.updown_job() {
                            sent.push(job);
                            answer(&mut bench, &job);
                            assert!(sent.len() <= 4, "{control:02X} in phase {frames} goes on for ever");
                        }
                        let what = format!("16#{control:02X} in phase {frames}");
                        let end = bench.regs.b_STEUREG_UPDOWNBLK1.load();
                        if control & 0x80 != 0 {
                            assert_eq!((&sent[..], bench.block()), (&[UpDownJob::cancel()][..], 0), "{what}");
                        } else if control & 0x01 != 0 {
                            assert!(!sent.is_empty(), "{what}");
                            assert_eq!(bench.block(), control & 0x10 | 0x0C, "{what}");
                            assert_eq!((bench.counter(), bench.error()), (14, 0), "{what}");
                        } else {
                            assert_eq!((sent.len(), end), (0, control), "{what}");
                        }
                    }
                }
            }
        }
    }
}
