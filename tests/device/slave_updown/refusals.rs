//! Refusals by application and firmware, with the error numbers of p. 192.

use super::area::{BASE, BLOCK_1, SINGLE, areas, block, data, down, init, init_at, up};
use crate::rig::bench::{Bench, NUMBER};
use crate::rig::{FASTEST, Memory};
use commram::devices::cansync::frames::codec::{Direction, UpDownJob, UpDownResult};

/// Manual p. 192: error numbers of the slave's application. D-71: error numbers that a slave cannot use.
#[test]
fn the_application_refuses_at_each_acknowledgement() {
    for rate in FASTEST {
        for area in areas(rate) {
            for (written, sent) in [(0x0104, 0x0104), (0xFFFF, 0xFFFF), (0x00FF, 0x0103), (0, 0x0103)] {
                let mut bench = area.bench(Memory::Heap, rate);
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
                assert_eq!(
                    bench.updown(&init).result(),
                    UpDownResult::Busy,
                    "not the answer of the last time"
                );
                assert_eq!(area.job(&bench), 0x55);
            }
        }
    }
}

/// Decision D-71: an error that the application reports in bit 5 between two blocks ends the transfer, too.
#[test]
fn the_application_gives_up_between_two_blocks() {
    for rate in FASTEST {
        for area in areas(rate) {
            let mut bench = area.started(rate, Direction::Upload, 100);
            (area.error)(&bench.regs).store(0x0104);
            area.write(&bench, 0x24);
            assert_eq!(bench.updown(&up(0, false)).result(), UpDownResult::Error(0x0104));
            assert_eq!(bench.updown(&up(0, false)).result(), UpDownResult::Error(0x0108));

            let mut bench = area.started(rate, Direction::Upload, 100);
            area.write(&bench, 0x24);
            bench.updown(&init(Direction::Download, 50));
            assert_eq!(area.job(&bench), 0x55, "no change to confirm");
        }
    }
}

/// The numbers of p. 192 with which the firmware itself refuses a frame. A refusal does not change the transfer (D-68).
#[test]
fn frames_out_of_place_are_refused_and_change_nothing() {
    for rate in FASTEST {
        use Direction::{Download, Upload};
        for area in areas(rate) {
            for direction in [Upload, Download] {
                let other = if direction == Upload { Download } else { Upload };
                let mut bench = area.started(rate, direction, 20);
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
}

#[test]
fn block_frames_without_an_allowed_transfer_are_in_the_wrong_mode() {
    for rate in FASTEST {
        for area in areas(rate) {
            let mut bench = area.bench(Memory::Heap, rate);
            assert_eq!(bench.updown(&up(0, false)).result(), UpDownResult::Error(0x0108));
            assert_eq!(bench.updown(&down(6, true)).result(), UpDownResult::Error(0x0108));
            bench.updown(&init(Direction::Download, 20));
            assert_eq!(
                bench.updown(&down(0, false)).result(),
                UpDownResult::Error(0x0108),
                "not allowed yet"
            );
            assert_eq!(area.job(&bench), 0x55);
        }
    }
}

/// Manual p. 191 (base addresses) and D-68.
#[test]
fn init_frames_that_the_firmware_refuses() {
    for rate in FASTEST {
        use Direction::{Download, Upload};
        let mut bench = Bench::active(Memory::Heap, rate);
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

        // MODE 00 with offset 16#123 is valid in no phase.
        let reserved =
            commram::devices::cansync::frames::Frame::new(0x500 + u16::from(NUMBER), &[0x81, 0x23]).unwrap();
        let answer = bench.turn(&reserved).unwrap();
        assert_eq!(answer.data(), [0xA1, 0x23, 0x08, 0x01]);
    }
}

/// Decision D-63.
#[test]
fn set_up_mode_takes_no_transfer() {
    for rate in FASTEST {
        let mut bench = Bench::in_set_up(Memory::Heap, rate);
        bench.regs.b_EN_UPDOWNBLK1.store(1);
        assert_eq!(bench.updown(&init(Direction::Download, 6)).result(), UpDownResult::Error(0x0104));
        assert_eq!(bench.updown(&down(0, true)).result(), UpDownResult::Error(0x0103));
        assert_eq!(bench.updown(&UpDownJob::cancel()).result(), UpDownResult::Done);
        assert_eq!(BLOCK_1.job(&bench), 0x00);

        let mut bench = BLOCK_1.started(rate, Direction::Download, 20);
        bench.command(0x0020);
        assert_eq!(BLOCK_1.job(&bench), 0x00);
        assert_eq!(bench.updown(&down(0, false)).result(), UpDownResult::Error(0x0103));
        bench.command(0x0040);
        assert_eq!(bench.updown(&down(0, false)).result(), UpDownResult::Error(0x0108));
    }
}

/// Decision D-307: on a device without a single-frame area, the application has no register in which to answer such a
/// transfer.
#[test]
fn block_1_refuses_transfers_without_a_single_frame_area() {
    for rate in FASTEST.into_iter().filter(|rate| !rate.kind.is_omega()) {
        for direction in [Direction::Upload, Direction::Download] {
            for (length, enable, error) in [(300, 0, 0x0104), (301, 1, 0x0107), (4095, 0, 0x0107)] {
                let mut bench = Bench::active(Memory::Heap, rate);
                bench.regs.b_EN_UPDOWNBLK1.store(enable);
                let before = ram(&bench);
                let answer = bench.updown(&init(direction, length));
                assert_eq!(answer.result(), UpDownResult::Error(error), "{length} bytes, enable {enable}");
                assert_eq!(bench.updown(&block(direction, 0, false)).result(), UpDownResult::Error(0x0108));
                assert_eq!(ram(&bench), before, "nothing is shown, least of all where no register is");
            }
            // The transfer in progress stays, and disappears when the application has confirmed its end.
            let mut bench = BLOCK_1.bench(Memory::Heap, rate);
            bench.updown(&init(direction, 20));
            let shown = BLOCK_1.job(&bench);
            bench.regs.b_EN_UPDOWNBLK1.store(0);
            assert_eq!(bench.updown(&init(direction, 20)).result(), UpDownResult::Busy, "a repetition");
            assert_eq!(bench.updown(&init(direction, 30)).result(), UpDownResult::Error(0x0104));
            assert_eq!(BLOCK_1.job(&bench), shown);
            BLOCK_1.acknowledge(&bench);
            assert_eq!(bench.updown(&init(direction, 20)).result(), UpDownResult::Done);
        }
    }
}

/// Returns the slave's job registers, and the words after its last register.
fn ram(bench: &Bench) -> [u32; 6] {
    let regs = &bench.regs;
    [
        regs.b_STEUREG_UPDOWNBLK1.load().into(),
        regs.w_LENGTH_UPDOWNBLK1.load().into(),
        regs.b_STEUREG_UPDOWN_SINGLE.load().into(),
        regs.b_STATREG_UPDOWN_SINGLE.load().into(),
        regs.d_BASE_ADR_UPDOWN_SINGLE.load(),
        regs.w_LENGTH_UPDOWN_SINGLE.load().into(),
    ]
}
