//! Parameter jobs of the master's PLC (5.00005.03a p. 164-166).

use super::bench::Bench;
use crate::rig::{BOTH, FASTEST, Memory, RATES, Rate, Rig};
use commram::devices::cansync::frames::Frame;
use commram::devices::cansync::frames::codec::{Access, ParameterJob, ParameterResult};
use commram::devices::cansync::registers::values::par_error;

/// A kind of job: the PLC's entry, the frames, the result in the registers.
struct JobKind {
    id: &'static str,
    entered: u8,
    /// Data bytes of the job for parameter 300 with value 16#11223344.
    frame: &'static [u8],
    answer: ParameterResult,
    end: u8,
    value: u32,
}

const KINDS: [JobKind; 6] = [
    JobKind {
        id: "T12 write word",
        entered: 0x05,
        frame: &[0x71, 0x2C, 0x44, 0x33, 0, 0],
        answer: ParameterResult::Done,
        end: 0x04,
        value: 0x1122_3344,
    },
    JobKind {
        id: "T13 write doubleword",
        entered: 0x15,
        frame: &[0x71, 0x2C, 0x44, 0x33, 0x22, 0x11, 0, 0],
        answer: ParameterResult::Done,
        end: 0x14,
        value: 0x1122_3344,
    },
    JobKind {
        id: "T14 read word",
        entered: 0x03,
        frame: &[0x71, 0x2C, 0, 0],
        answer: ParameterResult::Word(0x8765),
        end: 0x02,
        value: 0x0000_8765,
    },
    JobKind {
        id: "T14 read doubleword",
        entered: 0x13,
        frame: &[0x71, 0x2C, 0, 0],
        answer: ParameterResult::Doubleword(0x8765_4321),
        end: 0x12,
        value: 0x8765_4321,
    },
    JobKind {
        id: "read as word, answered as doubleword",
        entered: 0x03,
        frame: &[0x71, 0x2C, 0, 0],
        answer: ParameterResult::Doubleword(5),
        end: 0x12,
        value: 5,
    },
    JobKind {
        id: "read as doubleword, answered as word",
        entered: 0x13,
        frame: &[0x71, 0x2C, 0, 0],
        answer: ParameterResult::Word(5),
        end: 0x02,
        value: 5,
    },
];

/// T12 to T14 and T28 for every slave: each step of both registers, with and without BUSY.
#[test]
fn every_kind_of_job_runs_through_its_bit_sequence_for_every_slave() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut bench = Bench::new(memory, rate);
            for slave in 0..32u8 {
                bench.regs.b_SL_NR_PARAMETER.store(slave);
                let n = usize::from(slave);
                for kind in &KINDS {
                    for busy in [0, 1, 3] {
                        bench.enter_parameter(n, kind.entered, 300, 0x1122_3344);
                        for round in 0..=busy {
                            let frame = bench.interval().expect(kind.id);
                            assert_eq!((frame.id(), frame.data()), (0x500 + u16::from(slave), kind.frame));
                            let shown = kind.entered | 0x08 | if round > 0 { 0x40 } else { 0 };
                            assert_eq!(bench.parameter(n), shown, "{} sent", kind.id);
                            let job = ParameterJob::decode(frame.payload()).unwrap();
                            if round < busy {
                                bench.answer(slave, &job, ParameterResult::Busy);
                                assert_eq!(bench.parameter(n), kind.entered | 0x48, "{} busy", kind.id);
                            } else {
                                bench.answer(slave, &job, kind.answer);
                            }
                        }
                        assert_eq!(
                            (bench.parameter(n), bench.value(n)),
                            (kind.end, kind.value),
                            "{}",
                            kind.id
                        );
                        assert_eq!(bench.interval(), None, "a finished job is not repeated");
                    }
                }
            }
        }
    }
}

/// T31 with all error numbers of p. 165-166 and one number of an application. Bits 0, 3 and 6 are clear, bit 5 is set.
#[test]
fn every_error_number_ends_the_job_and_is_in_the_value() {
    for rate in FASTEST {
        let numbers = [
            par_error::GENERAL,
            par_error::BELOW_MINIMUM,
            par_error::ABOVE_MAXIMUM,
            par_error::NOT_CHANGEABLE,
            par_error::NOT_PRESENT,
            par_error::NOT_AVAILABLE_NOW,
            par_error::DATA_FORMAT,
            0x4711,
        ];
        for memory in BOTH {
            let mut bench = Bench::new(memory, rate);
            for (entered, end) in [(0x05, 0x24), (0x15, 0x34), (0x03, 0x22), (0x13, 0x32)] {
                for number in numbers {
                    for busy in [false, true] {
                        bench.enter_parameter(0, entered, 300, 0xFFFF_FFFF);
                        let (slave, mut job) = bench.parameter_job().unwrap();
                        if busy {
                            bench.answer(slave, &job, ParameterResult::Busy);
                            job = bench.parameter_job().unwrap().1;
                        }
                        bench.answer(slave, &job, ParameterResult::Error(number));
                        assert_eq!((bench.parameter(0), bench.value(0)), (end, u32::from(number)));
                    }
                }
            }
            // The error bit of the last job has no effect on the next job.
            bench.enter_parameter(0, 0x25, 300, 7);
            let (slave, job) = bench.parameter_job().unwrap();
            assert_eq!(bench.parameter(0), 0x0D);
            bench.answer(slave, &job, ParameterResult::Done);
            assert_eq!(bench.parameter(0), 0x04);
        }
    }
}

/// Decision D-41: a job that no frame can express is refused without a frame.
#[test]
fn jobs_that_cannot_be_sent_are_refused_without_a_frame() {
    for rate in FASTEST {
        let mut bench = Bench::new(BOTH[0], rate);
        for (entered, number, end, error) in [
            (0x01, 300, 0x20, par_error::GENERAL),
            (0x07, 300, 0x26, par_error::GENERAL),
            (0x17, 300, 0x36, par_error::GENERAL),
            (0x05, 4096, 0x24, par_error::NOT_PRESENT),
            (0x03, 0xFFFF, 0x22, par_error::NOT_PRESENT),
        ] {
            bench.enter_parameter(0, entered, number, 1);
            assert_eq!(bench.interval(), None);
            assert_eq!((bench.parameter(0), bench.value(0)), (end, u32::from(error)));
        }
        bench.enter_parameter(0, 0x03, 4095, 1);
        assert_eq!(bench.parameter_job().unwrap().1.number(), 4095);
    }
}

/// Decision D-11: only the PLC ends a job that no slave answers.
#[test]
fn an_unanswered_job_is_repeated_on_each_turn_of_its_slave_until_the_plc_withdraws_it() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut bench = Bench::new(memory, rate);
            bench.regs.b_SL_NR_PARAMETER.store(0x80);
            bench.regs.b_MAX_SL_NR.store(3);
            bench.enter_parameter(2, 0x03, 300, 0);
            for interval in 0..20 {
                let sent = bench.interval();
                assert_eq!(sent.map(|frame| frame.id()), (interval % 4 == 2).then_some(0x502));
                if sent.is_some() {
                    bench.no_answer();
                    assert_eq!(bench.parameter(2), 0x0B);
                }
            }
            bench.put(2, 0, 0);
            assert!((0..8).all(|_| bench.interval().is_none()));
            assert_eq!(bench.parameter(2), 0);
        }
    }
}

/// An answer counts only for the job that the registers still hold.
#[test]
fn an_answer_to_a_job_that_was_changed_or_withdrawn_is_ignored() {
    for rate in FASTEST {
        let old = ParameterResult::Word(0xAAAA);
        for memory in BOTH {
            let mut bench = Bench::new(memory, rate);
            // The PLC withdraws the job.
            bench.enter_parameter(0, 0x03, 300, 1);
            let (_, job) = bench.parameter_job().unwrap();
            bench.put(0, 0, 0);
            bench.answer(0, &job, old);
            assert_eq!((bench.parameter(0), bench.value(0)), (0, 1));
            // The PLC replaces the job by a job with another number, as the manual says. The test does this twice.
            for number in [301, 301] {
                bench.enter_parameter(0, 0x03, 300, 1);
                let (_, job) = bench.parameter_job().unwrap();
                bench.enter_parameter(0, 0x03, number, 2);
                bench.answer(0, &job, old);
                assert_eq!((bench.parameter(0), bench.value(0)), (0x03, 2));
                let (_, job) = bench.parameter_job().unwrap();
                assert_eq!(job.number(), number);
                bench.answer(0, &job, ParameterResult::Word(3));
                assert_eq!((bench.parameter(0), bench.value(0)), (0x02, 3));
            }
            // If the PLC enters a job once more, this is a new job: only an answer after the new frame ends it.
            bench.enter_parameter(0, 0x03, 300, 1);
            let (_, job) = bench.parameter_job().unwrap();
            bench.put(0, 0x03, 0x03);
            bench.answer(0, &job, old);
            assert_eq!(bench.parameter(0), 0x03);
            // The PLC changes the value of the job, but not its control register. The answer to the old value does not
            // end the job.
            bench.enter_parameter(0, 0x05, 300, 1);
            let (_, job) = bench.parameter_job().unwrap();
            bench.regs.a_DATA_PARAMETER[0].d_PAR_VALUE.store(2);
            bench.answer(0, &job, ParameterResult::Done);
            assert_eq!(bench.parameter(0), 0x0D);
            assert_eq!(bench.parameter_job().unwrap().1.access(), Access::WriteWord(2));
            // A read job that becomes a write job.
            bench.enter_parameter(0, 0x03, 300, 1);
            let (_, job) = bench.parameter_job().unwrap();
            bench.put(0, 0x0D, 0x0D);
            bench.answer(0, &job, old);
            assert_eq!((bench.parameter(0), bench.value(0)), (0x0D, 1));
        }
    }
}

#[test]
fn mismatched_answers_count_as_missing() {
    for rate in FASTEST {
        let read = ParameterJob::new(300, Access::Read).unwrap();
        let other = ParameterJob::new(301, Access::Read).unwrap();
        let unfit: Vec<Frame> = vec![
            other.answer(ParameterResult::Word(1)).frame(0),
            other.answer(ParameterResult::Error(0xFFFB)).frame(0),
            other.answer(ParameterResult::Busy).frame(0),
            read.answer(ParameterResult::Done).frame(0),
            read.with_sub_slave(1).answer(ParameterResult::Word(1)).frame(0),
            // An answer of another slave.
            read.answer(ParameterResult::Word(1)).frame(1),
            // An answer to an up-/download, and a frame that matches no grammar.
            Frame::new(0x580, &[0x80, 0]).unwrap(),
            Frame::new(0x580, &[]).unwrap(),
            Frame::new(0x580, &[0x01]).unwrap(),
            Frame::new(0x580, &[0x01, 0x2C, 0]).unwrap(),
        ];
        let mut bench = Bench::new(BOTH[0], rate);
        for frame in unfit {
            bench.enter_parameter(0, 0x03, 300, 9);
            assert_eq!(bench.parameter_job(), Some((0, read)));
            bench.respond(frame);
            assert_eq!((bench.parameter(0), bench.value(0)), (0x0B, 9), "{frame:?}");
            assert_eq!(bench.parameter_job(), Some((0, read)), "repeated after {frame:?}");
            bench.answer(0, &read, ParameterResult::Word(4));
            assert_eq!((bench.parameter(0), bench.value(0)), (0x02, 4));
        }
        // This answer arrives after the begin of the next interval, which is too late.
        bench.enter_parameter(0, 0x03, 300, 9);
        assert_eq!(bench.parameter_job(), Some((0, read)));
        bench.regs.b_SL_NR_PARAMETER.store(1);
        assert_eq!(bench.interval(), None);
        bench.answer(0, &read, ParameterResult::Word(1));
        assert_eq!((bench.parameter(0), bench.value(0)), (0x0B, 9));
        bench.regs.b_SL_NR_PARAMETER.store(0);
        assert_eq!(bench.parameter_job(), Some((0, read)));
        bench.answer(0, &read, ParameterResult::Word(4));
        // No slave was polled.
        bench.answer(0, &read, ParameterResult::Word(1));
        assert_eq!((bench.parameter(0), bench.value(0)), (0x02, 4));
    }
}

#[test]
fn two_jobs_for_different_slaves_run_side_by_side() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut bench = Bench::new(memory, rate);
            bench.regs.b_SL_NR_PARAMETER.store(0x80);
            bench.regs.b_MAX_SL_NR.store(1);
            bench.enter_parameter(0, 0x03, 300, 0);
            bench.enter_parameter(1, 0x15, 301, 77);
            for _ in 0..3 {
                for slave in 0..2 {
                    let (asked, job) = bench.parameter_job().unwrap();
                    assert_eq!(asked, slave);
                    bench.answer(slave, &job, ParameterResult::Busy);
                }
            }
            assert_eq!((bench.parameter(0), bench.parameter(1)), (0x4B, 0x5D));
            let (_, job) = bench.parameter_job().unwrap();
            bench.answer(0, &job, ParameterResult::Word(5));
            let (_, job) = bench.parameter_job().unwrap();
            bench.answer(1, &job, ParameterResult::Done);
            assert_eq!((bench.parameter(0), bench.value(0)), (0x02, 5));
            assert_eq!((bench.parameter(1), bench.value(1)), (0x14, 77));
        }
    }
}

/// When the master returns to set-up mode, the job stays in its registers and the exchange in progress is dropped. The
/// master sends the job again in the next active operation (D-46). A restart clears the job.
#[test]
fn leaving_active_operation_ends_the_exchange_in_progress() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut bench = Bench::new(memory, rate);
            bench.enter_parameter(0, 0x03, 300, 1);
            let (_, job) = bench.parameter_job().unwrap();
            bench.command_node(0x0020);
            bench.answer(0, &job, ParameterResult::Word(9));
            assert_eq!((bench.parameter(0), bench.value(0)), (0x0B, 1));
            for _ in 0..4 {
                assert_ne!(bench.interval().map(|frame| frame.id()), Some(0x500));
            }
            bench.activate();
            let (_, job) = bench.parameter_job().unwrap();
            bench.answer(0, &job, ParameterResult::Word(9));
            assert_eq!((bench.parameter(0), bench.value(0)), (0x02, 9));

            bench.enter_parameter(0, 0x03, 300, 1);
            let (_, job) = bench.parameter_job().unwrap();
            bench.initialize();
            bench.activate();
            bench.answer(0, &job, ParameterResult::Word(9));
            assert_eq!((bench.parameter(0), bench.value(0)), (0, 0));
            assert_eq!(bench.interval(), None);
        }
    }
}

/// Jobs and answers over the bus: PLC `b` is slave 0, and its application answers; drive 1 answers at once.
fn over_the_bus(memory: Memory, rate: Rate) {
    let drive = "[[bus.drive]]\nname = 'd1'\nslave_number = 1\n\
                 [[bus.drive.parameters]]\nnumber = 18\nformat = 'doubleword'\ninitial = 5\nmax = 100\n";
    let mut rig = Rig::of(memory, rate, drive);
    rig.activate();
    rig.run_to_sync();
    rig.master.b_SL_NR_PARAMETER.store(0x80);
    rig.master.b_MAX_SL_NR.store(1);
    let enter = |rig: &Rig, slave: usize, control: u8, number: u16, value: u32| {
        rig.master.a_DATA_PARAMETER[slave].d_PAR_VALUE.store(value);
        rig.master.a_DATA_PARAMETER[slave].w_PAR_NR.store(number);
        rig.master.a_CTRLREG_PAR_CMD_SL[slave].b_STATREG_PAR_CMD.store(control);
        rig.master.a_CTRLREG_PAR_CMD_SL[slave].b_STEUREG_PAR_CMD.store(control);
    };
    let control = |rig: &Rig, slave: usize| rig.master.a_CTRLREG_PAR_CMD_SL[slave].b_STEUREG_PAR_CMD.load();
    let value = |rig: &Rig, slave: usize| rig.master.a_DATA_PARAMETER[slave].d_PAR_VALUE.load();
    let intervals = |rig: &mut Rig, count: u64| rig.step(count * rate.interval_us);

    enter(&rig, 0, 0x13, 300, 0);
    enter(&rig, 1, 0x15, 18, 42);
    intervals(&mut rig, 6);
    assert_eq!((control(&rig, 1), value(&rig, 1)), (0x14, 42));
    assert_eq!(control(&rig, 0), 0x5B, "the application of slave 0 has not answered yet");
    assert_eq!((rig.slave.b_STEUREG_PAR_CMD.load(), rig.slave.w_PAR_NR.load()), (0x43, 300));
    rig.slave.d_DATA_PAR_CMD.store(0xCAFE_0815);
    rig.slave.b_STATREG_PAR_CMD.store(0x52);
    rig.slave.b_STEUREG_PAR_CMD.store(0x52);
    enter(&rig, 1, 0x13, 18, 0);
    intervals(&mut rig, 6);
    assert_eq!((control(&rig, 0), value(&rig, 0)), (0x12, 0xCAFE_0815));
    assert_eq!((control(&rig, 1), value(&rig, 1)), (0x12, 42));

    enter(&rig, 1, 0x15, 18, 101);
    intervals(&mut rig, 4);
    assert_eq!((control(&rig, 1), value(&rig, 1)), (0x34, 0xFFFD));
    enter(&rig, 1, 0x05, 18, 1);
    intervals(&mut rig, 4);
    assert_eq!((control(&rig, 1), value(&rig, 1)), (0x24, 0xFFF9));
    enter(&rig, 1, 0x03, 19, 1);
    intervals(&mut rig, 4);
    assert_eq!((control(&rig, 1), value(&rig, 1)), (0x22, 0xFFFB));
    // The application of slave 0 refuses.
    enter(&rig, 0, 0x05, 301, 1);
    intervals(&mut rig, 4);
    rig.slave.w_ERR_NR_PAR_CMD.store(0xFFFE);
    rig.slave.b_STATREG_PAR_CMD.store(0x64);
    rig.slave.b_STEUREG_PAR_CMD.store(0x64);
    intervals(&mut rig, 4);
    assert_eq!((control(&rig, 0), value(&rig, 0)), (0x24, 0xFFFE));
    // The bus has no slave 2, so no answer comes and the job stays in its registers.
    rig.master.b_MAX_SL_NR.store(2);
    enter(&rig, 2, 0x03, 1, 1);
    intervals(&mut rig, 9);
    assert_eq!((control(&rig, 2), value(&rig, 2)), (0x0B, 1));
}

#[test]
fn jobs_travel_over_the_bus_and_back() {
    for memory in BOTH {
        for rate in RATES {
            over_the_bus(memory, rate);
        }
    }
}
