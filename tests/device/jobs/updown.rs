//! Up- and downloads of the master's PLC in block 1 (5.00005.03a p. 141-143, 166-168).

mod errors;

use super::bench::Bench;
use crate::rig::{BOTH, FASTEST, Memory};
use commram::devices::cansync::frames::Frame;
use commram::devices::cansync::frames::codec::{Direction, UpDownJob, UpDownResult, UpDownStep};
use commram::devices::cansync::registers::values::updown_error;
use core::array;

const ADDRESS: u32 = 0x0001_2300;
/// Control byte that the PLC enters.
const DOWNLOAD: u8 = 0x15;
const UPLOAD: u8 = 0x05;

/// Returns byte `n` of the test pattern.
fn byte(n: usize) -> u8 {
    (n as u8).wrapping_mul(37).wrapping_add(11)
}

fn pattern(n: usize) -> u32 {
    u32::from_le_bytes(array::from_fn(|i| byte(4 * n + i)))
}

fn fill(bench: &Bench, value: impl Fn(usize) -> u32) {
    for (n, cell) in bench.regs.a_DATA_UPDOWNBLK1.iter().enumerate() {
        cell.store(value(n));
    }
}

/// Returns the bytes of block 1.
fn bytes(bench: &Bench) -> Vec<u8> {
    bench.regs.a_DATA_UPDOWNBLK1.iter().flat_map(|cell| cell.load().to_le_bytes()).collect()
}

/// Returns the offsets of a transfer of `length` bytes; the flag is true for the last offset.
fn offsets(length: u16) -> impl Iterator<Item = (u16, bool)> {
    (0..length).step_by(6).map(move |offset| (offset, offset + 6 >= length))
}

/// Expects the init frame of an order and answers it.
fn init(bench: &mut Bench, direction: Direction, length: u16) {
    let (slave, job) = bench.updown_job().expect("the init frame");
    let step = UpDownStep::Init { direction, address: ADDRESS, sub_slave: 0 };
    assert_eq!((slave, job), (0, UpDownJob::new(length, step).unwrap()));
    bench.answer_block(slave, &job, UpDownResult::Done);
}

/// T17 and T25: downloads of every length. Every byte arrives once, and the unused bytes of the last frame are 0.
#[test]
fn a_download_travels_in_blocks_of_six_bytes() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut bench = Bench::new(memory, rate);
            fill(&bench, pattern);
            for length in 1..=300u16 {
                bench.enter_block(DOWNLOAD, 0, ADDRESS, length);
                init(&mut bench, Direction::Download, length);
                assert_eq!((bench.block(), bench.counter()), (0x17, 0), "sent, mode: initialization");
                let mut received = Vec::new();
                for (offset, last) in offsets(length) {
                    let (slave, job) = bench.updown_job().expect("a block");
                    assert_eq!(bench.block(), if last { 0x1F } else { 0x1B });
                    assert_eq!(bench.counter(), offset);
                    assert_eq!(job.offset(), offset);
                    let UpDownStep::Download { last: is_last, data } = job.step() else { panic!("{job:?}") };
                    assert_eq!(is_last, last);
                    received.extend(data);
                    bench.answer_block(slave, &job, UpDownResult::Done);
                }
                let (taken, padding) = received.split_at(usize::from(length));
                assert!(taken.iter().enumerate().all(|(n, b)| *b == byte(n)), "{length} bytes");
                assert!(padding.iter().all(|b| *b == 0));
                assert_eq!((bench.block(), bench.counter(), bench.error()), (0x1C, length, 0));
                assert_eq!(bench.interval(), None);
            }
        }
    }
}

#[test]
fn an_upload_stores_only_the_bytes_of_its_length() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut bench = Bench::new(memory, rate);
            for length in 1..=300u16 {
                fill(&bench, |_| 0xEEEE_EEEE);
                bench.enter_block(UPLOAD, 0, ADDRESS, length);
                init(&mut bench, Direction::Upload, length);
                assert_eq!(bench.block(), 0x07);
                for (offset, last) in offsets(length) {
                    let (slave, job) = bench.updown_job().expect("a block");
                    assert_eq!(job, UpDownJob::new(offset, UpDownStep::Upload { last }).unwrap());
                    assert_eq!((bench.block(), bench.counter()), (if last { 0x0F } else { 0x0B }, offset));
                    let data = array::from_fn(|n| byte(usize::from(offset) + n));
                    bench.answer_block(slave, &job, UpDownResult::Data(data));
                }
                let stored = bytes(&bench);
                let (taken, rest) = stored.split_at(usize::from(length));
                assert!(taken.iter().enumerate().all(|(n, b)| *b == byte(n)), "{length} bytes");
                assert!(rest.iter().all(|b| *b == 0xEE), "{length} bytes");
                assert_eq!((bench.block(), bench.counter(), bench.error()), (0x0C, length, 0));
                assert_eq!(bench.interval(), None);
            }
        }
    }
}

/// T25 to the letter: 300 bytes are 50 frames, offsets 0, 6 ... 294, the last with MODE 11.
#[test]
fn three_hundred_bytes_are_fifty_frames() {
    for rate in FASTEST {
        let mut bench = Bench::new(Memory::Heap, rate);
        bench.enter_block(DOWNLOAD, 0, ADDRESS, 300);
        init(&mut bench, Direction::Download, 300);
        let mut heads = Vec::new();
        while bench.block() & 1 != 0 {
            let frame = bench.interval().unwrap();
            let job = UpDownJob::decode(frame.payload()).unwrap();
            heads.push((frame.data()[0] & 0xF0, job.offset()));
            bench.answer_block(0, &job, UpDownResult::Done);
        }
        assert_eq!(heads.len(), 50);
        assert_eq!(heads.last(), Some(&(0xF0, 294)));
        assert!(heads[..49].iter().enumerate().all(|(n, head)| *head == (0xE0, 6 * n as u16)));
    }
}

#[test]
fn an_upload_without_a_length_takes_the_slaves() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut bench = Bench::new(memory, rate);
            // The master requests no length, or another length than the slave sets.
            for asked in [0, 100] {
                bench.enter_block(UPLOAD, 0, ADDRESS, asked);
                let (_, job) = bench.updown_job().unwrap();
                assert_eq!(job.offset(), asked);
                bench.respond(job.answer_with_length(8).unwrap().frame(0));
                assert_eq!(bench.regs.w_LENGTH_UPDOWNBLK1.load(), 8);
                for (offset, last) in [(0, false), (6, true)] {
                    let (_, job) = bench.updown_job().unwrap();
                    assert_eq!(job, UpDownJob::new(offset, UpDownStep::Upload { last }).unwrap());
                    bench.answer_block(0, &job, UpDownResult::Data([1; 6]));
                }
                assert_eq!((bench.block(), bench.counter()), (0x0C, 8));
            }
            // The length from the slave is larger than the block, or 0 (D-49).
            for (length, error) in [(301, updown_error::LENGTH), (4095, updown_error::LENGTH)] {
                bench.enter_block(UPLOAD, 0, ADDRESS, 0);
                let (_, job) = bench.updown_job().unwrap();
                bench.respond(job.answer_with_length(length).unwrap().frame(0));
                assert_eq!((bench.block(), bench.error()), (0x24, error));
            }
            bench.enter_block(UPLOAD, 0, ADDRESS, 0);
            let (_, job) = bench.updown_job().unwrap();
            bench.answer_block(0, &job, UpDownResult::Done);
            assert_eq!((bench.block(), bench.error()), (0x24, updown_error::NOT_POSSIBLE));
        }
    }
}

/// Manual p. 168: bit 7 cancels; an upload init frame with address and length 0 goes to the slave.
#[test]
fn bit_7_cancels_in_every_phase_and_without_a_job() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut bench = Bench::new(memory, rate);
            for frames in 0..4 {
                bench.enter_block(DOWNLOAD, 0, ADDRESS, 18);
                for _ in 0..frames {
                    let (slave, job) = bench.updown_job().unwrap();
                    bench.answer_block(slave, &job, UpDownResult::Done);
                }
                let last = (frames == 3).then(|| bench.updown_job().unwrap().1);
                let control = bench.block() | 0x80;
                bench.regs.b_STATREG_UPDOWNBLK1.store(control);
                bench.regs.b_STEUREG_UPDOWNBLK1.store(control);
                if let Some(job) = last {
                    bench.answer_block(0, &job, UpDownResult::Done);
                    assert_eq!(bench.block(), control, "an answer does not undo the cancellation");
                }
                let frame = bench.interval().unwrap();
                assert_eq!((frame.id(), frame.data()), (0x500, &[0x90, 0, 0, 0, 0, 0, 0, 0][..]));
                assert_eq!(bench.block(), 0x00);
                bench.answer_block(0, &UpDownJob::cancel(), UpDownResult::Done);
                assert_eq!(bench.block(), 0x00);
                assert_eq!(bench.interval(), None);
            }
            bench.enter_block(0x80, 5, 0, 0);
            assert_eq!(bench.interval(), None, "it is slave 0's turn");
            bench.regs.b_SL_NR_UPDOWN.store(5);
            assert_eq!(bench.updown_job(), Some((5, UpDownJob::cancel())));
            // The job is cancelled during the turn of another slave. A job that was not sent yet ends without a frame
            // (D-601). The cancellation of a sent job waits for the turn of its slave.
            bench.enter_block(DOWNLOAD | 0x80, 6, ADDRESS, 18);
            assert_eq!((bench.interval(), bench.block()), (None, 0x00));
            bench.enter_block(DOWNLOAD, 5, ADDRESS, 18);
            assert!(bench.updown_job().is_some());
            let control = bench.block() | 0x80;
            bench.regs.b_STATREG_UPDOWNBLK1.store(control);
            bench.regs.b_STEUREG_UPDOWNBLK1.store(control);
            bench.regs.b_SL_NR_UPDOWN.store(6);
            assert_eq!((bench.interval(), bench.block()), (None, control));
        }
    }
}

/// Decision D-48: after any change by the PLC, the transfer of the current entry restarts.
#[test]
fn a_changed_job_restarts_and_a_withdrawn_job_ends() {
    for rate in FASTEST {
        let started = |bench: &mut Bench| {
            bench.enter_block(DOWNLOAD, 0, ADDRESS, 60);
            init(bench, Direction::Download, 60);
            let (_, job) = bench.updown_job().unwrap();
            bench.answer_block(0, &job, UpDownResult::Done);
            assert_eq!(bench.counter(), 6);
            bench.updown_job().unwrap().1
        };
        for memory in BOTH {
            let mut bench = Bench::new(memory, rate);
            // The PLC withdraws the job.
            let job = started(&mut bench);
            bench.enter_block(0x00, 0, ADDRESS, 60);
            bench.answer_block(0, &job, UpDownResult::Done);
            assert_eq!((bench.block(), bench.counter()), (0, 6));
            assert_eq!(bench.interval(), None);
            // The PLC enters the job once more.
            let job = started(&mut bench);
            bench.enter_block(DOWNLOAD, 0, ADDRESS, 60);
            bench.answer_block(0, &job, UpDownResult::Done);
            init(&mut bench, Direction::Download, 60);
            assert_eq!(bench.counter(), 0);
            // The PLC enters a job with another direction, length or address.
            started(&mut bench);
            bench.enter_block(UPLOAD, 0, ADDRESS, 60);
            init(&mut bench, Direction::Upload, 60);
            started(&mut bench);
            bench.regs.w_LENGTH_UPDOWNBLK1.store(30);
            init(&mut bench, Direction::Download, 30);
            started(&mut bench);
            bench.regs.d_BASE_ADR_UPDOWNBLK1.store(0x77);
            assert_eq!(bench.interval(), None);
            assert_eq!(bench.error(), updown_error::BASE_ADDRESS);
        }
    }
}

/// When a job has ended or was withdrawn or cancelled, the next job begins with its init frame, independently of the
/// values in the registers.
#[test]
fn no_transfer_is_taken_up_again() {
    for rate in FASTEST {
        let mut bench = Bench::new(Memory::Heap, rate);
        for end in [0x00, 0x80] {
            bench.enter_block(DOWNLOAD | 0x20, 0, ADDRESS, 60);
            init(&mut bench, Direction::Download, 60);
            assert_eq!(bench.block(), 0x17, "the error bit of an earlier job is gone");
            let (_, job) = bench.updown_job().unwrap();
            bench.answer_block(0, &job, UpDownResult::Done);
            assert_eq!(bench.block(), 0x1B);
            bench.enter_block(end, 0, ADDRESS, 60);
            assert_eq!(bench.interval().is_some(), end == 0x80);
            bench.enter_block(0x1B, 0, ADDRESS, 60);
            init(&mut bench, Direction::Download, 60);
        }
    }
}

#[test]
fn the_job_waits_for_its_slaves_turn() {
    for rate in FASTEST {
        let mut bench = Bench::new(Memory::Heap, rate);
        bench.regs.b_SL_NR_UPDOWN.store(0x80);
        bench.regs.b_MAX_SL_NR.store(3);
        bench.regs.w_SUBSL_NR_UPDOWNBLK1.store(0x0102);
        bench.enter_block(DOWNLOAD, 3, ADDRESS, 7);
        let mut sent = Vec::new();
        for _ in 0..12 {
            let frame = bench.interval();
            if let Some(frame) = frame {
                assert_eq!(frame.id(), 0x503);
                bench.answer_block(3, &UpDownJob::decode(frame.payload()).unwrap(), UpDownResult::Done);
            }
            sent.push(frame.map(|frame| frame.data()[0]));
        }
        let every_fourth = |head| [None, None, None, Some(head)];
        assert_eq!(sent, [every_fourth(0xD0), every_fourth(0xE0), every_fourth(0xF0)].concat());
        assert_eq!((bench.block(), bench.counter()), (0x1C, 7));
    }
}

#[test]
fn the_sub_slave_goes_out_with_the_init_frame() {
    for rate in FASTEST {
        let mut bench = Bench::new(Memory::Heap, rate);
        bench.regs.w_SUBSL_NR_UPDOWNBLK1.store(0x0102);
        bench.enter_block(UPLOAD, 0, 0x8765_4321, 0x12C);
        let frame = bench.interval().unwrap();
        assert_eq!(frame.data(), [0x91, 0x2C, 0x21, 0x43, 0x65, 0x87, 0x02, 0x01]);
    }
}

/// Decision D-46.
#[test]
fn leaving_active_operation_restarts_the_job() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut bench = Bench::new(memory, rate);
            bench.enter_block(DOWNLOAD, 0, ADDRESS, 60);
            init(&mut bench, Direction::Download, 60);
            let (_, job) = bench.updown_job().unwrap();
            bench.command_node(0x0020);
            bench.answer_block(0, &job, UpDownResult::Done);
            assert_eq!((bench.block(), bench.counter()), (0x1B, 0));
            assert_eq!(bench.interval().map(|frame| frame.id()), Some(0x010), "set-up mode has the channel");
            bench.activate();
            init(&mut bench, Direction::Download, 60);

            bench.initialize();
            bench.activate();
            assert_eq!(bench.interval(), None);
            assert_eq!((bench.block(), bench.counter()), (0, 0));
        }
    }
}
