//! Command and response channel of a slave node, on heap memory and on the mapped image: the registers
//! of the application, and the answers that the master reads.
//!
//! "5.02066.01a" is the manual of BM4-O-CAN-06, a module of the same family: registers and jobs have the same names;
//! "5.00005.03a" is the Omega Drive-Line II itself.

use crate::rig::bench::{Bench, LOCK_US, NUMBER};
use crate::rig::{BOTH, FASTEST, Memory, Rate};
use commram::devices::cansync::frames::codec::{Access, ActionCommand, ParameterJob, ParameterResult};

struct Vector {
    id: &'static str,
    source: &'static str,
    check: fn(Memory, Rate),
}

const VECTORS: &[Vector] = &[
    Vector { id: "T15", source: "5.00005.03a p. 189: write jobs", check: t15 },
    Vector { id: "T16", source: "5.00005.03a p. 189: read job", check: t16 },
    Vector { id: "T32", source: "5.00005.03a p. 188: own bit not set", check: t32 },
    Vector { id: "T33", source: "5.00005.03a p. 188: control word", check: t33 },
    Vector { id: "T34", source: "5.00005.03a p. 188: other action commands", check: t34 },
    Vector { id: "T38", source: "5.00005.03a p. 189 (bytes inferred)", check: t38 },
    Vector { id: "T39", source: "5.00005.03a p. 189 (bytes inferred)", check: t39 },
];

#[test]
fn every_vector_holds_on_both_memories() {
    for vector in VECTORS {
        for (memory, rate) in BOTH.into_iter().flat_map(|memory| FASTEST.map(|rate| (memory, rate))) {
            println!("{} ({}) on {memory:?}, {rate:?}", vector.id, vector.source);
            (vector.check)(memory, rate);
        }
    }
}

const READ: Access = Access::Read;

fn job(number: u16, access: Access) -> ParameterJob {
    ParameterJob::new(number, access).unwrap()
}

/// Returns the control register of the parameter job, and checks that the status register has the same value.
fn par_cmd(bench: &Bench) -> u8 {
    let control = bench.regs.b_STEUREG_PAR_CMD.load();
    assert_eq!(bench.regs.b_STATREG_PAR_CMD.load(), control);
    control
}

/// Writes like the application: status register first.
fn write_par_cmd(bench: &Bench, value: u8) {
    bench.regs.b_STATREG_PAR_CMD.store(value);
    bench.regs.b_STEUREG_PAR_CMD.store(value);
}

fn t15(memory: Memory, rate: Rate) {
    for (access, value, shown, done, end) in [
        (Access::WriteWord(0x1234), 0x0000_1234, 0x45, 0x44, 0x04),
        (Access::WriteDoubleword(0x1234_5678), 0x1234_5678, 0x55, 0x54, 0x14),
    ] {
        let mut bench = Bench::active(memory, rate);
        let job = job(300, access);
        assert_eq!(bench.parameter(&job).result(), ParameterResult::Busy);
        assert_eq!(par_cmd(&bench), shown);
        assert_eq!((bench.regs.w_PAR_NR.load(), bench.regs.d_DATA_PAR_CMD.load()), (300, value));
        assert_eq!(bench.parameter(&job).result(), ParameterResult::Busy);
        assert_eq!(par_cmd(&bench), shown, "a repetition changes nothing");
        write_par_cmd(&bench, done);
        assert_eq!(bench.parameter(&job).result(), ParameterResult::Done);
        assert_eq!(par_cmd(&bench), end);
    }
}

fn t16(memory: Memory, rate: Rate) {
    let mut bench = Bench::active(memory, rate);
    bench.parameter(&job(4095, READ));
    assert_eq!((par_cmd(&bench), bench.regs.w_PAR_NR.load()), (0x43, 4095));
    bench.regs.d_DATA_PAR_CMD.store(0xFFFF_1234);
    write_par_cmd(&bench, 0x42);
    assert_eq!(bench.parameter(&job(4095, READ)).result(), ParameterResult::Word(0x1234));
    assert_eq!(par_cmd(&bench), 0x02);
}

fn t38(memory: Memory, rate: Rate) {
    let mut bench = Bench::active(memory, rate);
    bench.parameter(&job(300, READ));
    bench.regs.d_DATA_PAR_CMD.store(0x1122_3344);
    write_par_cmd(&bench, 0x52);
    bench.deliver(&job(300, READ).frame(NUMBER));
    assert_eq!(par_cmd(&bench), 0x52, "busy until the answer has gone out");
    let answer = bench.answer().unwrap();
    assert_eq!(answer.data(), [0x01, 0x2C, 0x44, 0x33, 0x22, 0x11, 0, 0]);
    assert_eq!(par_cmd(&bench), 0x12);
}

fn t39(memory: Memory, rate: Rate) {
    let mut bench = Bench::active(memory, rate);
    let job = job(300, Access::WriteWord(1));
    bench.parameter(&job);
    bench.regs.w_ERR_NR_PAR_CMD.store(0xFFFB);
    write_par_cmd(&bench, 0x64);
    assert_eq!(bench.parameter(&job).result(), ParameterResult::Error(0xFFFB));
    assert_eq!(par_cmd(&bench), 0x24);
}

/// Returns a command that appears in every register that can show a command.
fn command(command: u8) -> ActionCommand {
    ActionCommand { slave_group: 1 << NUMBER, command, data_byte: 0x5A, data_word: 0x1234 }
}

/// Returns the status registers of action command, control word and SYNC mode.
fn received(bench: &Bench) -> [u8; 3] {
    let regs = &bench.regs;
    [&regs.b_STATREG_AKT_CMD, &regs.b_STATREG_CONTROLWORD, &regs.b_STATREG_SYNC_MODUS].map(|cell| cell.load())
}

fn t32(memory: Memory, rate: Rate) {
    let mut bench = Bench::active(memory, rate);
    for byte in 0..=u8::MAX {
        bench.action(ActionCommand { slave_group: !(1 << NUMBER), ..command(byte) });
    }
    assert_eq!(received(&bench), [0, 0, 0]);
    let regs = &bench.regs;
    assert_eq!((regs.w_CONTROLWORD.load(), regs.w_DATAWORD_AKT_CMD.load()), (0, 0));
    assert_eq!((regs.b_AKT_CMD.load(), regs.b_DATA_BYTE_AKT_CMD.load()), (0, 0));
    assert_eq!(regs.b_SYNC_MODUS.load(), 0);
}

fn t33(memory: Memory, rate: Rate) {
    let mut bench = Bench::active(memory, rate);
    bench.action(command(0x01));
    assert_eq!(bench.regs.w_CONTROLWORD.load(), 0x1234);
    assert_eq!(received(&bench), [0, 0x02, 0], "shown as control word only");
    assert_eq!(bench.regs.w_DATAWORD_AKT_CMD.load(), 0);
}

fn t34(memory: Memory, rate: Rate) {
    let mut bench = Bench::active(memory, rate);
    for byte in (0..=u8::MAX).filter(|byte| !matches!(byte, 0x01 | 0x02)) {
        bench.regs.b_STATREG_AKT_CMD.store(0);
        bench.action(command(byte));
        let regs = &bench.regs;
        assert_eq!(regs.b_AKT_CMD.load(), byte);
        assert_eq!((regs.b_DATA_BYTE_AKT_CMD.load(), regs.w_DATAWORD_AKT_CMD.load()), (0x5A, 0x1234));
        assert_eq!(received(&bench), [0x02, 0, 0]);
    }
    bench.regs.b_STATREG_AKT_CMD.store(0);
    bench.action(command(0x02)); // the PLC finds this command in registers of its own (D-06)
    assert_eq!(received(&bench), [0, 0, 0x02]);
    assert_eq!(bench.regs.b_SYNC_MODUS.load(), 0x5A);
}

/// 5.00005.03a p. 190; D-18, D-61, D-62: the firmware does not answer the old job, and the new job waits for bit 7.
#[test]
fn a_changed_job_waits_until_the_application_confirms() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut bench = Bench::active(memory, rate);
            let (old, new) = (job(300, READ), job(301, Access::WriteWord(7)));
            bench.parameter(&old);
            assert_eq!(bench.parameter(&new).result(), ParameterResult::Busy);
            assert_eq!((par_cmd(&bench), bench.regs.w_PAR_NR.load()), (0x4B, 300), "bit 3 on the old job");
            write_par_cmd(&bench, 0x4A); // The application answers the old job: too late.
            assert_eq!(bench.parameter(&new).result(), ParameterResult::Busy);
            assert_eq!(bench.regs.w_PAR_NR.load(), 300);
            write_par_cmd(&bench, 0xCB);
            bench.pass(500);
            assert_eq!(
                (par_cmd(&bench), bench.regs.w_PAR_NR.load()),
                (0x45, 301),
                "bits 3 and 7 are cleared"
            );
            assert_eq!(bench.parameter(&new).result(), ParameterResult::Busy);
            write_par_cmd(&bench, 0x44);
            assert_eq!(bench.parameter(&new).result(), ParameterResult::Done);
        }
    }
}

/// Decision D-61: A change stays pending until the application confirms it. This is so even if the master returns to
/// the old job, or if the application has cleared bit 3 by a write of the whole byte.
#[test]
fn a_change_is_shown_until_it_is_confirmed() {
    for rate in FASTEST {
        let mut bench = Bench::active(Memory::Heap, rate);
        bench.parameter(&job(300, Access::WriteWord(1)));
        bench.parameter(&job(300, Access::WriteWord(2)));
        assert_eq!(par_cmd(&bench), 0x4D, "another value is another job");
        write_par_cmd(&bench, 0x44);
        bench.parameter(&job(300, Access::WriteWord(1)));
        assert_eq!(par_cmd(&bench), 0x4C);
        write_par_cmd(&bench, 0xCC);
        assert_eq!(bench.parameter(&job(300, Access::WriteWord(1))).result(), ParameterResult::Busy);
        assert_eq!((par_cmd(&bench), bench.regs.d_DATA_PAR_CMD.load()), (0x45, 1));
    }
}

/// If the master has not fetched an answer, the old job is not finished. So another job of the master counts as a
/// change (p. 190).
#[test]
fn an_answered_job_can_still_be_changed() {
    for rate in FASTEST {
        let mut bench = Bench::active(Memory::Heap, rate);
        bench.parameter(&job(300, READ));
        write_par_cmd(&bench, 0x42);
        bench.deliver(&job(301, READ).frame(NUMBER));
        assert_eq!(par_cmd(&bench), 0x4A);
    }
}

/// Decision D-60: the firmware refuses a job that no register can show (p. 140: only element 7 may be written).
#[test]
fn jobs_that_no_register_can_show_never_reach_the_application() {
    for rate in FASTEST {
        let mut bench = Bench::active(Memory::Heap, rate);
        let read = job(300, READ);
        let write = job(300, Access::WriteWord(1));
        for (job, error) in [
            (read.with_sub_slave(1), 0xFFFB),
            (write.with_sub_slave(1), 0xFFFB),
            (write.with_element(6).unwrap(), 0xFFFC),
        ] {
            assert_eq!(bench.parameter(&job).result(), ParameterResult::Error(error));
            assert_eq!(par_cmd(&bench), 0x00);
        }
        bench.parameter(&read.with_element(3).unwrap());
        assert_eq!(par_cmd(&bench), 0x43, "reading may ignore the element (p. 139)");
    }
}

/// D-06, D-36: in set-up mode the firmware answers; the status word shows whether the node is locked.
#[test]
fn in_set_up_mode_the_firmware_answers_the_status_word() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut bench = Bench::in_set_up(memory, rate);
            let status_word = job(121, READ);
            assert_eq!(bench.parameter(&status_word).result(), ParameterResult::Word(0));
            bench.action(ActionCommand::sync_mode(ActionCommand::ALL_SLAVES, true));
            for _ in 0..=LOCK_US / rate.interval_us {
                assert!(!bench.slave.is_synchronized());
                bench.edge();
            }
            assert_eq!(bench.parameter(&status_word).result(), ParameterResult::Word(0x8000));
            for other in [job(120, READ), job(121, Access::WriteWord(0)), status_word.with_sub_slave(1)] {
                assert_eq!(bench.parameter(&other).result(), ParameterResult::Error(0xFFFA));
            }
            assert_eq!(par_cmd(&bench), 0x00, "the application sees nothing of it");
        }
    }
}

/// Decision D-63: leaving active operation drops the job and empties its registers.
#[test]
fn leaving_active_operation_drops_the_job() {
    for rate in FASTEST {
        for control in [0x0020, 0x0000] {
            let mut bench = Bench::active(Memory::Heap, rate);
            bench.deliver(&job(300, READ).frame(NUMBER));
            bench.command(control);
            assert_eq!((par_cmd(&bench), bench.answer()), (0x00, None));
        }
    }
}

/// Decision D-64: a job survives a missing SYNC signal and a restarted master.
#[test]
fn a_job_outlives_the_sync_signal() {
    for rate in FASTEST {
        let mut bench = Bench::active(Memory::Heap, rate);
        bench.action(ActionCommand::sync_mode(ActionCommand::ALL_SLAVES, true));
        let intervals = LOCK_US / rate.interval_us;
        for _ in 0..=intervals + 1 {
            bench.edge();
        }
        assert!(bench.slave.is_synchronized());
        bench.parameter(&job(300, READ));
        bench.pass(rate.interval_us * 5 / 2 - 500);
        assert!(bench.slave.is_synchronized(), "one edge is missing (p. 135)");
        bench.pass(500);
        assert!(!bench.slave.is_synchronized(), "two and a half intervals without an edge (D-07)");
        assert_eq!(bench.regs.w_OPTION_STATUS.load(), 0x0020);
        assert_eq!(par_cmd(&bench), 0x43);
        write_par_cmd(&bench, 0x42);
        bench.pass(100_000);
        for edge in 0..intervals + 2 {
            bench.edge();
            assert_eq!(bench.slave.is_synchronized(), edge >= intervals, "edge {edge}: locking starts again");
        }
        assert_eq!(bench.parameter(&job(300, READ)).result(), ParameterResult::Word(0));
    }
}

/// A slave does not answer a frame that matches no grammar. The master detects the missing answer by t_RSPTO.
#[test]
fn a_frame_of_wrong_length_is_not_answered() {
    for rate in FASTEST {
        let mut bench = Bench::active(Memory::Heap, rate);
        for len in [0, 1, 2, 3, 5, 7] {
            let frame =
                commram::devices::cansync::frames::Frame::new(0x500 + u16::from(NUMBER), &[0; 8][..len])
                    .unwrap();
            assert_eq!(bench.turn(&frame), None, "{len} bytes");
        }
        assert_eq!(par_cmd(&bench), 0x00);
    }
}

/// Decision D-21: the acceptance filter holds for jobs and action commands too.
#[test]
fn the_acceptance_filter_keeps_frames_out() {
    for rate in FASTEST {
        let mut bench = Bench::active(Memory::Heap, rate);
        let identifiers = [0x500 + u16::from(NUMBER), 0x010];
        for (id, passes) in [(identifiers[0], [true, false]), (identifiers[1], [false, true])] {
            bench.start_over([(id >> 3) as u8, 0x00]);
            bench.action(ActionCommand::control_word(1 << NUMBER, 1));
            let answered = bench.turn(&job(300, READ).frame(NUMBER)).is_some();
            assert_eq!([answered, bench.regs.b_STATREG_CONTROLWORD.load() == 0x02], passes, "16#{id:03X}");
        }
    }
}
