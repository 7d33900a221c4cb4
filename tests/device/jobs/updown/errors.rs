//! Error cases: invalid orders, errors of the slave, answers that are missing or do not match.

use super::*;
use crate::rig::{FASTEST, RATES, Rig};

/// Decision D-43.
#[test]
fn orders_that_cannot_be_right_are_refused_without_a_frame() {
    for rate in FASTEST {
        let mut bench = Bench::new(Memory::Heap, rate);
        for (control, address, length, error) in [
            (DOWNLOAD, ADDRESS, 301, updown_error::LENGTH),
            (UPLOAD, ADDRESS, 0xFFFF, updown_error::LENGTH),
            (DOWNLOAD, 0x0000_0000, 12, updown_error::BASE_ADDRESS),
            (DOWNLOAD, 0x0000_00FF, 12, updown_error::BASE_ADDRESS),
            (UPLOAD, 0x0000_00FF, 0, updown_error::BASE_ADDRESS),
            (DOWNLOAD, 0x0000_00FF, 301, updown_error::LENGTH),
            (DOWNLOAD, ADDRESS, 0, updown_error::NOT_POSSIBLE),
        ] {
            bench.enter_block(control, 0, address, length);
            assert_eq!(bench.interval(), None);
            assert_eq!((bench.block(), bench.error()), (control & !1 | 0x20, error));
        }
        bench.enter_block(DOWNLOAD, 0, 0x0000_0100, 300);
        assert!(bench.updown_job().is_some(), "the first free address and the greatest length");
        assert_eq!(bench.error(), 0, "the error number of the last job is gone");
    }
}

/// Tests, in each phase, all numbers of p. 168 that a slave can send, and one number of an application.
#[test]
fn errors_of_the_slave_end_the_job() {
    for rate in FASTEST {
        let numbers = [
            updown_error::EXPECTS_END,
            updown_error::END_TOO_EARLY,
            updown_error::SLAVE_CANCELS,
            updown_error::NOT_POSSIBLE,
            updown_error::BASE_ADDRESS,
            updown_error::TOO_LONG,
            updown_error::MODE,
            0x4711,
        ];
        for memory in BOTH {
            let mut bench = Bench::new(memory, rate);
            for (control, direction) in [(DOWNLOAD, Direction::Download), (UPLOAD, Direction::Upload)] {
                let good = match direction {
                    Direction::Download => UpDownResult::Done,
                    Direction::Upload => UpDownResult::Data([0; 6]),
                };
                for number in numbers {
                    for (blocks, end) in [(None, 0x24), (Some(0), 0x28), (Some(1), 0x28), (Some(2), 0x2C)] {
                        bench.enter_block(control, 0, ADDRESS, 18);
                        if let Some(blocks) = blocks {
                            init(&mut bench, direction, 18);
                            for _ in 0..blocks {
                                let (_, job) = bench.updown_job().unwrap();
                                bench.answer_block(0, &job, good);
                            }
                        }
                        let (_, job) = bench.updown_job().unwrap();
                        bench.answer_block(0, &job, UpDownResult::Busy);
                        let (_, again) = bench.updown_job().unwrap();
                        assert_eq!(again, job);
                        bench.answer_block(0, &job, UpDownResult::Error(number));
                        assert_eq!((bench.block(), bench.error()), (end | control & 0x10, number));
                        assert_eq!(bench.counter(), 6 * blocks.unwrap_or(0));
                        assert_eq!(bench.interval(), None);
                    }
                }
            }
        }
    }
}

#[test]
fn a_gap_that_the_slave_finds_is_in_the_counter() {
    for rate in FASTEST {
        let mut bench = Bench::new(Memory::Heap, rate);
        bench.enter_block(DOWNLOAD, 0, ADDRESS, 60);
        init(&mut bench, Direction::Download, 60);
        for _ in 0..4 {
            let (_, job) = bench.updown_job().unwrap();
            bench.answer_block(0, &job, UpDownResult::Done);
        }
        let (_, job) = bench.updown_job().unwrap();
        bench.respond(job.expects_instead(12).unwrap().frame(0));
        assert_eq!((bench.block(), bench.error()), (0x38, updown_error::EXPECTS_OTHER_BLOCK));
        assert_eq!(bench.counter(), 12, "the block that the slave expects");
    }
}

#[test]
fn a_wrong_block_number_ends_the_job_with_0001() {
    for rate in FASTEST {
        for (control, direction) in [(DOWNLOAD, Direction::Download), (UPLOAD, Direction::Upload)] {
            let mut bench = Bench::new(Memory::Heap, rate);
            bench.enter_block(control, 0, ADDRESS, 60);
            init(&mut bench, direction, 60);
            let (_, job) = bench.updown_job().unwrap();
            let (wrong, good) = match job.step() {
                UpDownStep::Download { .. } => (UpDownJob::new(6, job.step()).unwrap(), UpDownResult::Done),
                _ => (UpDownJob::new(6, job.step()).unwrap(), UpDownResult::Data([7; 6])),
            };
            bench.answer_block(0, &wrong, good);
            assert_eq!((bench.block(), bench.error()), (0x28 | control & 0x10, updown_error::WRONG_BLOCK));
            assert_eq!(bytes(&bench)[..6], [0; 6], "data of a wrong block is not stored");
        }
    }
}

/// Manual p. 142-143: the master repeats a frame if it gets no answer, or the answer BUSY.
#[test]
fn frames_without_an_answer_and_with_busy_are_repeated() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut bench = Bench::new(memory, rate);
            fill(&bench, pattern);
            bench.enter_block(DOWNLOAD, 0, ADDRESS, 10);
            for (shown, offset) in [(0x17, 10), (0x1B, 0), (0x1F, 6)] {
                for _ in 0..3 {
                    let (_, job) = bench.updown_job().unwrap();
                    assert_eq!((bench.block(), job.offset()), (shown, offset));
                    bench.no_answer();
                    assert_eq!(bench.block(), shown);
                }
                for round in 0..3 {
                    let (_, job) = bench.updown_job().unwrap();
                    assert_eq!(bench.block(), if round == 0 { shown } else { shown | 0x40 });
                    bench.answer_block(0, &job, UpDownResult::Busy);
                    assert_eq!(bench.block(), shown | 0x40);
                }
                let (_, job) = bench.updown_job().unwrap();
                bench.answer_block(0, &job, UpDownResult::Done);
            }
            assert_eq!((bench.block(), bench.counter()), (0x1C, 10));
        }
    }
}

#[test]
fn unrelated_answers_count_as_missing() {
    for rate in FASTEST {
        let mut bench = Bench::new(Memory::Heap, rate);
        bench.enter_block(DOWNLOAD, 0, ADDRESS, 12);
        init(&mut bench, Direction::Download, 12);
        let (_, job) = bench.updown_job().unwrap();
        let unfit = [
            job.answer(UpDownResult::Data([0; 6])).frame(0), // data that the master has not requested
            job.answer(UpDownResult::Done).frame(1),         // of another slave
            Frame::new(0x580, &[0x00, 0, 0, 0]).unwrap(),    // answers a parameter job
            Frame::new(0x580, &[]).unwrap(),
            Frame::new(0x580, &[0x80]).unwrap(),
            Frame::new(0x580, &[0xA0, 0]).unwrap(),
        ];
        for frame in unfit {
            bench.respond(frame);
            assert_eq!((bench.block(), bench.counter()), (0x1B, 0), "{frame:?}");
            assert_eq!(bench.updown_job(), Some((0, job)), "repeated after {frame:?}");
        }
        bench.answer_block(0, &job, UpDownResult::Done);
        assert_eq!(bench.counter(), 6);
        bench.answer_block(0, &job, UpDownResult::Done);
        assert_eq!(bench.counter(), 6, "the same answer counts once");
    }
}

/// Decision D-47: a drive has no area for up- and downloads.
#[test]
fn a_drive_refuses_up_and_downloads() {
    for memory in BOTH {
        for rate in RATES {
            for control in [DOWNLOAD, UPLOAD] {
                let mut rig = Rig::of(memory, rate, "[[bus.drive]]\nname = 'd1'\nslave_number = 1\n");
                rig.activate();
                rig.run_to_sync();
                rig.master.b_SL_NR_UPDOWN.store(1);
                rig.master.b_SL_NR_UPDOWNBLK1.store(1);
                rig.master.d_BASE_ADR_UPDOWNBLK1.store(ADDRESS);
                rig.master.w_LENGTH_UPDOWNBLK1.store(12);
                rig.master.b_STATREG_UPDOWNBLK1.store(control);
                rig.master.b_STEUREG_UPDOWNBLK1.store(control);
                rig.step(2 * rate.interval_us);
                assert_eq!(rig.master.b_STEUREG_UPDOWNBLK1.load(), control & !1 | 0x20);
                assert_eq!(rig.master.w_ERR_NR_UPDOWNBLK1.load(), 0x0104);
            }
        }
    }
}
