//! Up- and downloads at a slave node (manual 5.00005.03a p. 141-143, 190-193), on heap memory and on the
//! mapped image: what the application finds in its registers and what the master gets to read.

mod rig;

use commram::bus::codec::{Direction, UpDownJob, UpDownResult, UpDownStep};
use commram::layout::omega_drive_line_2::CANsync_SL_CTRL_BMSTRUCT;
use commram::memory::{Cell8, Cell16, Cell32};
use rig::bench::{Bench, NUMBER};
use rig::{BOTH, Memory};

const BASE: u32 = 0x0001_0000;

fn init_at(direction: Direction, address: u32, sub_slave: u16, length: u16) -> UpDownJob {
    UpDownJob::new(length, UpDownStep::Init { direction, address, sub_slave }).unwrap()
}

fn init(direction: Direction, length: u16) -> UpDownJob {
    init_at(direction, BASE, 0, length)
}

fn up(offset: u16, last: bool) -> UpDownJob {
    UpDownJob::new(offset, UpDownStep::Upload { last }).unwrap()
}

fn down(offset: u16, last: bool) -> UpDownJob {
    UpDownJob::new(offset, UpDownStep::Download { last, data: bytes(offset) }).unwrap()
}

fn block(direction: Direction, offset: u16, last: bool) -> UpDownJob {
    match direction {
        Direction::Upload => up(offset, last),
        Direction::Download => down(offset, last),
    }
}

/// The six bytes at `offset` of a block in which byte n is n + 1, cut to eight bits.
fn bytes(offset: u16) -> [u8; 6] {
    core::array::from_fn(|n| (offset + n as u16 + 1) as u8)
}

/// Frames behind the init frame of a block of `length` bytes.
fn blocks(length: u16) -> impl Iterator<Item = (u16, bool)> {
    (0..length).step_by(6).map(move |offset| (offset, offset + 6 >= length))
}

/// Registers that block 1 and the single-frame area have in common.
#[derive(Clone, Copy)]
struct Area {
    control: fn(&CANsync_SL_CTRL_BMSTRUCT) -> &Cell8,
    status: fn(&CANsync_SL_CTRL_BMSTRUCT) -> &Cell8,
    error: fn(&CANsync_SL_CTRL_BMSTRUCT) -> &Cell16,
    base: fn(&CANsync_SL_CTRL_BMSTRUCT) -> &Cell32,
    length: fn(&CANsync_SL_CTRL_BMSTRUCT) -> &Cell16,
    counter: fn(&CANsync_SL_CTRL_BMSTRUCT) -> &Cell16,
    enable: u8,
}

const BLOCK_1: Area = Area {
    control: |regs| &regs.b_STEUREG_UPDOWNBLK1,
    status: |regs| &regs.b_STATREG_UPDOWNBLK1,
    error: |regs| &regs.w_ERR_NR_UPDOWNBLK1,
    base: |regs| &regs.d_BASE_ADR_UPDOWNBLK1,
    length: |regs| &regs.w_LENGTH_UPDOWNBLK1,
    counter: |regs| &regs.w_COUNTER_UPDOWNBLK1,
    enable: 1,
};

const SINGLE: Area = Area {
    control: |regs| &regs.b_STEUREG_UPDOWN_SINGLE,
    status: |regs| &regs.b_STATREG_UPDOWN_SINGLE,
    error: |regs| &regs.w_ERR_NR_UPDOWN_SINGLE,
    base: |regs| &regs.d_BASE_ADR_UPDOWN_SINGLE,
    length: |regs| &regs.w_LENGTH_UPDOWN_SINGLE,
    counter: |regs| &regs.w_COUNTER_UPDOWN_SINGLE,
    enable: 0,
};

const AREAS: [Area; 2] = [BLOCK_1, SINGLE];

impl Area {
    fn bench(&self, memory: Memory) -> Bench {
        let bench = Bench::active(memory);
        bench.regs.b_EN_UPDOWNBLK1.store(self.enable);
        bench
    }

    /// Control register; the status register must agree.
    fn job(&self, bench: &Bench) -> u8 {
        let control = (self.control)(&bench.regs).load();
        assert_eq!((self.status)(&bench.regs).load(), control);
        control
    }

    /// The application's write: status register first.
    fn write(&self, bench: &Bench, value: u8) {
        (self.status)(&bench.regs).store(value);
        (self.control)(&bench.regs).store(value);
    }

    /// The application clears bit 0.
    fn acknowledge(&self, bench: &Bench) {
        self.write(bench, self.job(bench) & !0x01);
    }

    fn counter(&self, bench: &Bench) -> u16 {
        (self.counter)(&bench.regs).load()
    }

    /// A transfer that the application has allowed and whose init frame is answered.
    fn started(&self, direction: Direction, length: u16) -> Bench {
        let mut bench = self.bench(Memory::Heap);
        let init = init(direction, length);
        assert_eq!(bench.updown(&init).result(), UpDownResult::Busy);
        self.acknowledge(&bench);
        assert_eq!(bench.updown(&init).result(), UpDownResult::Done);
        bench
    }
}

/// Bytes of block 1.
fn data(bench: &Bench) -> Vec<u8> {
    bench.regs.a_DATA_UPDOWNBLK1.iter().flat_map(|cell| cell.load().to_le_bytes()).collect()
}

/// T18 and p. 191.
#[test]
fn a_download_fills_block_1() {
    for memory in BOTH {
        for length in [1, 6, 7, 12, 298, 300] {
            let mut bench = BLOCK_1.bench(memory);
            let init = init(Direction::Download, length);
            assert_eq!(bench.updown(&init).result(), UpDownResult::Busy);
            assert_eq!(BLOCK_1.job(&bench), 0x55);
            assert_eq!(bench.regs.d_BASE_ADR_UPDOWNBLK1.load(), BASE);
            assert_eq!(bench.regs.w_LENGTH_UPDOWNBLK1.load(), length);
            assert_eq!(bench.updown(&init).result(), UpDownResult::Busy, "a repetition changes nothing");
            assert_eq!(BLOCK_1.job(&bench), 0x55);
            BLOCK_1.acknowledge(&bench);
            assert_eq!(bench.updown(&init).result(), UpDownResult::Done);
            assert_eq!(BLOCK_1.job(&bench), 0x14, "D-65");

            for (offset, last) in blocks(length) {
                let frame = down(offset, last);
                let result = bench.updown(&frame).result();
                assert_eq!(BLOCK_1.counter(&bench), (offset + 6).min(length));
                if last {
                    assert_eq!((result, BLOCK_1.job(&bench)), (UpDownResult::Busy, 0x5D));
                    assert_eq!(bench.updown(&frame).result(), UpDownResult::Busy);
                    BLOCK_1.acknowledge(&bench);
                    assert_eq!(bench.updown(&frame).result(), UpDownResult::Done);
                } else {
                    assert_eq!((result, BLOCK_1.job(&bench)), (UpDownResult::Done, 0x18));
                }
            }
            assert_eq!(BLOCK_1.job(&bench), 0x1C);
            let expected: Vec<u8> = (0..300).map(|n| if n < length { (n + 1) as u8 } else { 0 }).collect();
            assert_eq!(data(&bench), expected, "bytes behind the length are not taken (p. 143)");
            assert_eq!(SINGLE.job(&bench), 0x00);
        }
    }
}

/// P. 192: the data are in the block before the init frame is acknowledged. Block end: D-65.
#[test]
fn an_upload_empties_block_1() {
    for memory in BOTH {
        for length in [1, 6, 7, 300] {
            let mut bench = BLOCK_1.bench(memory);
            let init = init(Direction::Upload, length);
            assert_eq!(bench.updown(&init).result(), UpDownResult::Busy);
            assert_eq!(BLOCK_1.job(&bench), 0x45, "D-14");
            for (n, cell) in bench.regs.a_DATA_UPDOWNBLK1.iter().enumerate() {
                cell.store(u32::from_le_bytes(core::array::from_fn(|k| (4 * n + k + 1) as u8)));
            }
            BLOCK_1.acknowledge(&bench);
            let answer = bench.updown(&init);
            assert_eq!((answer.result(), answer.offset()), (UpDownResult::Done, 0));
            assert_eq!(BLOCK_1.job(&bench), 0x04);

            for (offset, last) in blocks(length) {
                let frame = up(offset, last);
                if last {
                    assert_eq!(bench.updown(&frame).result(), UpDownResult::Busy);
                    assert_eq!(BLOCK_1.job(&bench), 0x4D);
                    BLOCK_1.acknowledge(&bench);
                }
                let mut sent = bytes(offset);
                sent.iter_mut().skip(usize::from(length - offset)).for_each(|byte| *byte = 0);
                assert_eq!(bench.updown(&frame).result(), UpDownResult::Data(sent), "filled with 0 (D-44)");
                assert_eq!(BLOCK_1.job(&bench), if last { 0x0C } else { 0x08 });
                assert_eq!(BLOCK_1.counter(&bench), (offset + 6).min(length));
            }
        }
    }
}

/// P. 193: each frame is acknowledged by itself and shown with its mode. Data and counter: D-66.
#[test]
fn the_single_frame_area_shows_every_frame() {
    for memory in BOTH {
        for (direction, bit) in [(Direction::Download, 0x10), (Direction::Upload, 0x00)] {
            let length = 16;
            let mut bench = SINGLE.bench(memory);
            let init = init(direction, length);
            bench.updown(&init);
            assert_eq!(SINGLE.job(&bench), 0x45 | bit);
            assert_eq!(bench.regs.d_BASE_ADR_UPDOWN_SINGLE.load(), BASE);
            assert_eq!(bench.regs.w_LENGTH_UPDOWN_SINGLE.load(), length);
            SINGLE.acknowledge(&bench);
            assert_eq!(bench.updown(&init).result(), UpDownResult::Done);
            assert_eq!(SINGLE.job(&bench), 0x04 | bit);

            for (offset, last) in blocks(length) {
                let frame = block(direction, offset, last);
                assert_eq!(bench.updown(&frame).result(), UpDownResult::Busy);
                let mode = if last { 0x0C } else { 0x08 };
                assert_eq!(SINGLE.job(&bench), 0x41 | bit | mode);
                assert_eq!(SINGLE.counter(&bench), offset);
                let (doubleword, word) =
                    (&bench.regs.d_DATA_DW_UPDOWN_SINGLE, &bench.regs.w_DATA_W_UPDOWN_SINGLE);
                let [a, b, c, d, e, f] = bytes(offset);
                if direction == Direction::Download {
                    assert_eq!(doubleword.load(), u32::from_le_bytes([a, b, c, d]));
                    let shown = if last { 0 } else { u16::from_le_bytes([e, f]) };
                    assert_eq!(word.load(), shown, "12 + 4 bytes are the block");
                } else {
                    doubleword.store(u32::from_le_bytes([a, b, c, d]));
                    word.store(u16::from_le_bytes([e, f]));
                }
                SINGLE.acknowledge(&bench);
                let done = match direction {
                    Direction::Download => UpDownResult::Done,
                    Direction::Upload => UpDownResult::Data(bytes(offset)),
                };
                assert_eq!(bench.updown(&frame).result(), done);
                assert_eq!(SINGLE.job(&bench), bit | mode);
                assert_eq!(SINGLE.counter(&bench), (offset + 6).min(length));
            }
            assert_eq!(BLOCK_1.job(&bench), 0x00);
        }
    }
}

/// P. 191: longer than 300 bytes, or block 1 not enabled.
#[test]
fn length_and_enable_choose_the_area() {
    for (length, enable, area) in [
        (300, 0x00, SINGLE),
        (300, 0x01, BLOCK_1),
        (300, 0x80, BLOCK_1),
        (301, 0x01, SINGLE),
        (4095, 0xFF, SINGLE),
    ] {
        let mut bench = Bench::active(Memory::Heap);
        bench.regs.b_EN_UPDOWNBLK1.store(enable);
        bench.updown(&init(Direction::Download, length));
        assert_eq!(area.job(&bench), 0x55, "{length} bytes, enable {enable}");
        let other = if area.enable == 1 { SINGLE } else { BLOCK_1 };
        assert_eq!(other.job(&bench), 0x00);
    }
}

/// P. 192; error numbers that are not the slave's: D-71.
#[test]
fn the_application_refuses_at_each_acknowledgement() {
    for area in AREAS {
        for (written, sent) in [(0x0104, 0x0104), (0xFFFF, 0xFFFF), (0x00FF, 0x0103), (0, 0x0103)] {
            let mut bench = area.bench(Memory::Heap);
            let init = init(Direction::Download, 6);
            bench.updown(&init);
            (area.error)(&bench.regs).store(written);
            area.write(&bench, 0x74);
            assert_eq!(bench.updown(&init).result(), UpDownResult::Error(sent));
            assert_eq!(area.job(&bench), 0x34);
            bench.updown(&init);
            assert_eq!(area.job(&bench), 0x55, "the same job is a new one now");

            area.acknowledge(&bench);
            bench.updown(&init);
            bench.updown(&down(0, true));
            (area.error)(&bench.regs).store(written);
            area.write(&bench, 0x7C);
            assert_eq!(bench.updown(&down(0, true)).result(), UpDownResult::Error(sent));
            assert_eq!(area.job(&bench), 0x3C);
            assert_eq!(bench.updown(&down(0, true)).result(), UpDownResult::Error(0x0108), "it is over");
            assert_eq!(bench.updown(&init).result(), UpDownResult::Busy, "not the answer of the last time");
            assert_eq!(area.job(&bench), 0x55);
        }
    }
}

/// D-71: bit 5 between two blocks ends the transfer as well.
#[test]
fn the_application_gives_up_between_two_blocks() {
    for area in AREAS {
        let mut bench = area.started(Direction::Upload, 100);
        (area.error)(&bench.regs).store(0x0104);
        area.write(&bench, 0x24);
        assert_eq!(bench.updown(&up(0, false)).result(), UpDownResult::Error(0x0104));
        assert_eq!(bench.updown(&up(0, false)).result(), UpDownResult::Error(0x0108));

        let mut bench = area.started(Direction::Upload, 100);
        area.write(&bench, 0x24);
        bench.updown(&init(Direction::Download, 50));
        assert_eq!(area.job(&bench), 0x55, "no change to confirm");
    }
}

/// The numbers of p. 192 that the firmware finds by itself. Each refusal leaves the transfer alone (D-68).
#[test]
fn frames_out_of_place_are_refused_and_change_nothing() {
    use Direction::{Download, Upload};
    for area in AREAS {
        for direction in [Upload, Download] {
            let other = if direction == Upload { Download } else { Upload };
            let mut bench = area.started(direction, 20);
            let step = |bench: &mut Bench, frame: &UpDownJob| {
                let mut result = bench.updown(frame).result();
                if result == UpDownResult::Busy {
                    area.acknowledge(bench);
                    result = bench.updown(frame).result();
                }
                assert!(matches!(result, UpDownResult::Done | UpDownResult::Data(_)), "{result:?}");
            };
            let refuse = |bench: &mut Bench, frame: &UpDownJob, number, offset| {
                let before = (area.job(bench), area.counter(bench), data(bench));
                let answer = bench.updown(frame);
                assert_eq!((answer.result(), answer.offset()), (UpDownResult::Error(number), offset));
                assert_eq!((area.job(bench), area.counter(bench), data(bench)), before);
            };
            refuse(&mut bench, &block(direction, 6, false), 0x0100, 0);
            refuse(&mut bench, &block(direction, 0, true), 0x0102, 0);
            refuse(&mut bench, &block(other, 0, false), 0x0108, 0);
            step(&mut bench, &block(direction, 0, false));
            refuse(&mut bench, &block(direction, 12, false), 0x0100, 6);
            step(&mut bench, &block(direction, 6, false));
            refuse(&mut bench, &block(direction, 0, false), 0x0100, 12);
            step(&mut bench, &block(direction, 12, false));
            refuse(&mut bench, &block(direction, 18, false), 0x0101, 18);
            bench.updown(&block(direction, 18, true));
            refuse(&mut bench, &block(direction, 18, false), 0x0101, 18);
            refuse(&mut bench, &block(direction, 12, true), 0x0100, 18);
            step(&mut bench, &block(direction, 18, true));
            assert_eq!(area.counter(&bench), 20);
        }
    }
}

#[test]
fn block_frames_without_an_allowed_transfer_are_in_the_wrong_mode() {
    for area in AREAS {
        let mut bench = area.bench(Memory::Heap);
        assert_eq!(bench.updown(&up(0, false)).result(), UpDownResult::Error(0x0108));
        assert_eq!(bench.updown(&down(6, true)).result(), UpDownResult::Error(0x0108));
        bench.updown(&init(Direction::Download, 20));
        assert_eq!(bench.updown(&down(0, false)).result(), UpDownResult::Error(0x0108), "not allowed yet");
        assert_eq!(area.job(&bench), 0x55);
    }
}

/// P. 191 (base addresses) and D-68.
#[test]
fn init_frames_that_the_firmware_refuses() {
    use Direction::{Download, Upload};
    let mut bench = Bench::active(Memory::Heap);
    for (job, number) in [
        (init_at(Download, 0x00, 0, 10), 0x0105),
        (init_at(Upload, 0xFF, 0, 0), 0x0105),
        (init_at(Upload, BASE, 1, 10), 0x0104),
        (init_at(Download, BASE, 0, 0), 0x0104),
    ] {
        assert_eq!(bench.updown(&job).result(), UpDownResult::Error(number), "{job:?}");
        assert_eq!((BLOCK_1.job(&bench), SINGLE.job(&bench)), (0x00, 0x00));
    }
    bench.updown(&init_at(Download, 0x100, 0, 10));
    assert_eq!((BLOCK_1.base)(&bench.regs).load(), 0x100);

    // MODE 00, offset 16#123: no mode of any phase.
    let reserved = commram::bus::Frame::new(0x500 + u16::from(NUMBER), &[0x81, 0x23]).unwrap();
    let answer = bench.turn(&reserved).unwrap();
    assert_eq!(answer.data(), [0xA1, 0x23, 0x08, 0x01]);
}

/// P. 141, footnote; D-67.
#[test]
fn the_slave_sets_the_length_of_an_upload() {
    let ask = init(Direction::Upload, 0);
    for (area, length, result) in [
        (BLOCK_1, 300, UpDownResult::Done),
        (BLOCK_1, 301, UpDownResult::Error(0x0107)),
        (BLOCK_1, 0, UpDownResult::Error(0x0104)),
        (SINGLE, 4095, UpDownResult::Done),
        (SINGLE, 4096, UpDownResult::Error(0x0107)),
        (SINGLE, 0, UpDownResult::Error(0x0104)),
    ] {
        let mut bench = area.bench(Memory::Heap);
        bench.updown(&ask);
        (area.length)(&bench.regs).store(length);
        area.acknowledge(&bench);
        let answer = bench.updown(&ask);
        assert_eq!(answer.result(), result, "{length} bytes");
        if result == UpDownResult::Done {
            assert_eq!(answer.offset(), length);
            assert_eq!(bench.updown(&up(0, true)).result(), UpDownResult::Error(0x0102));
        }
    }
}

/// P. 192; D-61, D-62, D-18: in each phase, and across the areas.
#[test]
fn a_changed_transfer_waits_until_the_application_confirms() {
    for area in AREAS {
        for phase in 0..4 {
            let old = init(Direction::Download, 20);
            let new = init(Direction::Upload, if phase == 3 { 301 } else { 30 });
            let mut bench = area.bench(Memory::Heap);
            bench.updown(&old);
            if phase > 0 {
                area.acknowledge(&bench);
                bench.updown(&old);
            }
            if phase > 1 {
                bench.updown(&down(0, false));
            }
            let before = area.job(&bench);
            assert_eq!(bench.updown(&new).result(), UpDownResult::Busy);
            assert_eq!(area.job(&bench), before | 0x02, "phase {phase}");
            assert_eq!(bench.updown(&down(0, true)).result(), UpDownResult::Error(0x0108));
            area.write(&bench, before | 0x82);
            bench.pass(500);
            let target = if phase == 3 { SINGLE } else { area };
            assert_eq!(target.job(&bench), 0x45, "bits 1 and 7 are cleared");
            if phase == 3 && area.enable == 1 {
                assert_eq!(area.job(&bench), 0x00);
            }
            target.acknowledge(&bench);
            assert_eq!(bench.updown(&new).result(), UpDownResult::Done);
        }
    }
}

/// P. 142-143, 168; D-70: upload init frame with address 0 and length 0.
#[test]
fn the_master_cancels() {
    for area in AREAS {
        let mut bench = area.bench(Memory::Heap);
        assert_eq!(bench.updown(&UpDownJob::cancel()).result(), UpDownResult::Done, "nothing to cancel");
        assert_eq!(area.job(&bench), 0x00);

        let mut bench = area.started(Direction::Download, 100);
        assert_eq!(bench.updown(&UpDownJob::cancel()).result(), UpDownResult::Done);
        assert_eq!(area.job(&bench), 0x16);
        assert_eq!(bench.updown(&UpDownJob::cancel()).result(), UpDownResult::Done);
        assert_eq!(bench.updown(&down(0, false)).result(), UpDownResult::Error(0x0108));
        let next = init(Direction::Download, 50);
        assert_eq!(bench.updown(&next).result(), UpDownResult::Busy);
        assert_eq!(area.job(&bench), 0x16, "not confirmed yet");
        bench.updown(&UpDownJob::cancel());
        area.write(&bench, 0x96);
        bench.pass(500);
        assert_eq!(area.job(&bench), 0x00);
        bench.updown(&next);
        assert_eq!(area.job(&bench), 0x55);
    }
}

/// D-69: the master repeats what it has no answer to.
#[test]
fn a_repeated_frame_gets_the_same_answer() {
    for area in AREAS {
        for direction in [Direction::Upload, Direction::Download] {
            let mut bench = area.started(direction, 12);
            assert_eq!(bench.updown(&init(direction, 12)).result(), UpDownResult::Done);
            for frame in [block(direction, 0, false), block(direction, 6, true)] {
                if bench.updown(&frame).result() == UpDownResult::Busy {
                    area.acknowledge(&bench);
                }
                let first = bench.updown(&frame);
                assert_ne!(first.result(), UpDownResult::Busy);
                let job = area.job(&bench);
                assert_eq!(bench.updown(&frame), first);
                assert_eq!(area.job(&bench), job, "shown once");
            }
            bench.updown(&init(direction, 12));
            assert_eq!(area.job(&bench) & 0x4D, 0x45, "a new transfer");
        }
    }
}

/// D-63.
#[test]
fn set_up_mode_takes_no_transfer() {
    let mut bench = Bench::in_set_up(Memory::Heap);
    bench.regs.b_EN_UPDOWNBLK1.store(1);
    assert_eq!(bench.updown(&init(Direction::Download, 6)).result(), UpDownResult::Error(0x0104));
    assert_eq!(bench.updown(&down(0, true)).result(), UpDownResult::Error(0x0103));
    assert_eq!(bench.updown(&UpDownJob::cancel()).result(), UpDownResult::Done);
    assert_eq!(BLOCK_1.job(&bench), 0x00);

    let mut bench = BLOCK_1.started(Direction::Download, 20);
    bench.command(0x0020);
    assert_eq!(BLOCK_1.job(&bench), 0x00);
    assert_eq!(bench.updown(&down(0, false)).result(), UpDownResult::Error(0x0103));
    bench.command(0x0040);
    assert_eq!(bench.updown(&down(0, false)).result(), UpDownResult::Error(0x0108));
}
