//! Transfers without an error: whole, changed, cancelled, repeated.

use super::area::{Area, BASE, BLOCK_1, SINGLE, areas, block, blocks, bytes, data, down, init, up};
use crate::rig::bench::Bench;
use crate::rig::{BOTH, FASTEST, Memory, OMEGA_RATES};
use commram::devices::cansync::frames::codec::{Direction, UpDownJob, UpDownResult};

/// T18 and p. 191.
#[test]
fn a_download_fills_block_1() {
    for rate in FASTEST {
        for memory in BOTH {
            for length in [1, 6, 7, 12, 298, 300] {
                let mut bench = BLOCK_1.bench(memory, rate);
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
                let expected: Vec<u8> =
                    (0..300).map(|n| if n < length { (n + 1) as u8 } else { 0 }).collect();
                assert_eq!(data(&bench), expected, "bytes behind the length are not taken (p. 143)");
                assert_eq!(SINGLE.job(&bench), 0x00);
            }
        }
    }
}

/// Manual p. 192: the data are in the block before the init frame is acknowledged. Block end: D-65.
#[test]
fn an_upload_empties_block_1() {
    for rate in FASTEST {
        for memory in BOTH {
            for length in [1, 6, 7, 300] {
                let mut bench = BLOCK_1.bench(memory, rate);
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
                    assert_eq!(
                        bench.updown(&frame).result(),
                        UpDownResult::Data(sent),
                        "filled with 0 (D-44)"
                    );
                    assert_eq!(BLOCK_1.job(&bench), if last { 0x0C } else { 0x08 });
                    assert_eq!(BLOCK_1.counter(&bench), (offset + 6).min(length));
                }
            }
        }
    }
}

/// Manual p. 193: each frame is acknowledged by itself and shown with its mode. Data and counter: D-66.
#[test]
fn the_single_frame_area_shows_every_frame() {
    for rate in OMEGA_RATES {
        for memory in BOTH {
            for (direction, bit) in [(Direction::Download, 0x10), (Direction::Upload, 0x00)] {
                let length = 16;
                let mut bench = SINGLE.bench(memory, rate);
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
}

/// Manual p. 191: a transfer that is longer than 300 bytes, or that begins while block 1 is not enabled.
#[test]
fn length_and_enable_choose_the_area() {
    for rate in OMEGA_RATES {
        for (length, enable, area) in [
            (300, 0x00, SINGLE),
            (300, 0x01, BLOCK_1),
            (300, 0x80, BLOCK_1),
            (301, 0x01, SINGLE),
            (4095, 0xFF, SINGLE),
        ] {
            let mut bench = Bench::active(Memory::Heap, rate);
            bench.regs.b_EN_UPDOWNBLK1.store(enable);
            bench.updown(&init(Direction::Download, length));
            assert_eq!(area.job(&bench), 0x55, "{length} bytes, enable {enable}");
            let other = if area.enable == 1 { SINGLE } else { BLOCK_1 };
            assert_eq!(other.job(&bench), 0x00);
        }
    }
}

/// Manual p. 141, footnote; D-67.
#[test]
fn the_slave_sets_the_length_of_an_upload() {
    for rate in FASTEST {
        let ask = init(Direction::Upload, 0);
        let most = |area: &Area| if area.enable == 1 { 300 } else { 4095 };
        let cases = |area: &'static Area| {
            [
                (area, most(area), UpDownResult::Done),
                (area, most(area) + 1, UpDownResult::Error(0x0107)),
                (area, 0, UpDownResult::Error(0x0104)),
            ]
        };
        for (area, length, result) in areas(rate).iter().flat_map(cases) {
            let mut bench = area.bench(Memory::Heap, rate);
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
}

/// Manual p. 192; D-61, D-62, D-18: the master begins another transfer in each phase of a transfer, in the same area or
/// in the other one.
#[test]
fn a_changed_transfer_waits_until_the_application_confirms() {
    for rate in FASTEST {
        for area in areas(rate) {
            // In the last phase, the new transfer is in the other area, which only the Omega Drive-Line II has.
            for phase in 0..if rate.kind.is_omega() { 4 } else { 3 } {
                let old = init(Direction::Download, 20);
                let new = init(Direction::Upload, if phase == 3 { 301 } else { 30 });
                let mut bench = area.bench(Memory::Heap, rate);
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
                let target = if phase == 3 { &SINGLE } else { area };
                assert_eq!(target.job(&bench), 0x45, "bits 1 and 7 are cleared");
                if phase == 3 && area.enable == 1 {
                    assert_eq!(area.job(&bench), 0x00);
                }
                target.acknowledge(&bench);
                assert_eq!(bench.updown(&new).result(), UpDownResult::Done);
            }
        }
    }
}

/// Manual p. 142-143, 168; D-70: upload init frame with address 0 and length 0.
#[test]
fn the_master_cancels() {
    for rate in FASTEST {
        for area in areas(rate) {
            let mut bench = area.bench(Memory::Heap, rate);
            assert_eq!(bench.updown(&UpDownJob::cancel()).result(), UpDownResult::Done, "nothing to cancel");
            assert_eq!(area.job(&bench), 0x00);

            let mut bench = area.started(rate, Direction::Download, 100);
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
}

/// Decision D-69: the master repeats a frame without an answer.
#[test]
fn a_repeated_frame_gets_the_same_answer() {
    for rate in FASTEST {
        for area in areas(rate) {
            for direction in [Direction::Upload, Direction::Download] {
                let mut bench = area.started(rate, direction, 12);
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
}
