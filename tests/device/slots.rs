//! Frames in their slots: their length, the time of their reception, and the order in which stations wait (D-10, D-23,
//! D-280).

use crate::faults::add;
use crate::rig::{FASTEST, Memory, RATES, Rate, Rig};
use commram::can::wire;
use commram::devices::cansync::frames::{Channel, Frame, FrameKind};
use proptest::prelude::*;

/// Text after `[[bus]]`: two drives with the standard mapping.
const DRIVES: &str = "[[bus.drive]]\nname = 'd1'\nslave_number = 1\nlock_time_us = 30000\n\
                      [[bus.drive]]\nname = 'd2'\nslave_number = 2\nlock_time_us = 30000\n";
/// Configuration bytes of four words in use: values 0 and 1 as doublewords.
const ALL_WORDS: [u8; 4] = [0x01, 0x03, 0x05, 0x07];
/// Data that, after the length 1000, needs a stuff bit after each four bits.
const STUFFED: u32 = 0x3C3C_3C3C;

/// Returns a test rig with both nodes active, at a SYNC edge; `bus` is the text after `[[bus]]`.
fn running(rate: Rate, bus: &str) -> Rig {
    let mut rig = Rig::of(Memory::Heap, rate, bus);
    rig.activate();
    rig.step(60_000);
    rig.run_to_sync();
    rig
}

/// Makes the slave node send `sent` in both actual value frames, and the master `written` in both reference value
/// frames, from the next edge on. The function ends after this edge.
fn fill(rig: &mut Rig, config: [u8; 4], sent: [u32; 2], written: [u32; 2]) {
    let [a, b, c, d] = config;
    let (wrc, rdc) = (&rig.master._CFG_WRC_WORD, &rig.slave._CFG_RDC_WORD);
    let bytes = [
        [&wrc.b_CFG_WRC1_WORD0, &wrc.b_CFG_WRC2_WORD0, &rdc.b_CFG_RDC1_WORD0, &rdc.b_CFG_RDC2_WORD0],
        [&wrc.b_CFG_WRC1_WORD1, &wrc.b_CFG_WRC2_WORD1, &rdc.b_CFG_RDC1_WORD1, &rdc.b_CFG_RDC2_WORD1],
        [&wrc.b_CFG_WRC1_WORD2, &wrc.b_CFG_WRC2_WORD2, &rdc.b_CFG_RDC1_WORD2, &rdc.b_CFG_RDC2_WORD2],
        [&wrc.b_CFG_WRC1_WORD3, &wrc.b_CFG_WRC2_WORD3, &rdc.b_CFG_RDC1_WORD3, &rdc.b_CFG_RDC2_WORD3],
    ];
    for (cells, byte) in bytes.into_iter().zip([a, b, c, d]) {
        cells.into_iter().for_each(|cell| cell.store(byte));
    }
    for (value, number) in sent.into_iter().zip(0..) {
        rig.slave.a_RD_VALUE_SEND[number].store(value);
    }
    for (value, number) in written.into_iter().zip(0..) {
        rig.master.a_WR_VALUE[number].store(value);
    }
    rig.run_to_sync();
}

/// Releases all frames in this interval. The function ends two edges later, when the answer to the job of this interval
/// has arrived. Returns the frames with the time of their end.
fn full_interval(rig: &mut Rig, slaves: [u8; 2]) -> Vec<(u64, Frame)> {
    let before = rig.frames().len();
    rig.master.b_CTRLREG_RD_ORDER_RDC1.store(slaves[0]);
    rig.master.b_CTRLREG_RD_ORDER_RDC2.store(slaves[1]);
    rig.master.b_CTRLREG_WRC1.store(0x05);
    rig.master.b_CTRLREG_WRC2.store(0x05);
    rig.slave.b_CTRLREG_RD_RDC1.store(0x05);
    rig.slave.b_CTRLREG_RD_RDC2.store(0x05);
    rig.master.a_STEUREG_CONTROLWORD[1].store(0x05);
    rig.master.b_SL_NR_CONTROLWORD.store(1);
    rig.run_to_sync();
    rig.run_to_sync();
    rig.frames().split_off(before)
}

fn of_kind(frames: &[(u64, Frame)], wanted: impl Fn(FrameKind) -> bool) -> (u64, Frame) {
    *frames.iter().find(|(_, frame)| frame.kind().is_some_and(&wanted)).expect("the frame is on the bus")
}

/// 5.00005.03a p. 125: reference and actual value frames always have eight bytes, even if fewer are in use.
#[test]
fn process_data_frames_have_eight_bytes() {
    for rate in FASTEST {
        for (config, used) in [([0; 4], 0), ([0x01, 0, 0, 0], 2), ([0, 0, 0x05, 0], 6), (ALL_WORDS, 8)] {
            for (bus, length) in
                [("", 8), ("frame_length = 'fixed'\n", 8), ("frame_length = 'variable'\n", used)]
            {
                let mut rig = running(rate, &format!("{bus}{DRIVES}"));
                fill(&mut rig, config, [0x1122_3344; 2], [0x5566_7788; 2]);
                let frames = full_interval(&mut rig, [0, 0]);
                let lengths: Vec<_> =
                    frames.iter().map(|(_, frame)| (frame.id(), frame.data().len())).collect();
                let expected =
                    [(0x100, length), (0x300, length), (0x180, length), (0x380, length), (0x010, 8)];
                assert_eq!(lengths, expected, "{config:02X?} {bus}");
                let (_, wrc1) = frames[0];
                assert!(
                    wrc1.data().iter().skip(used).all(|byte| *byte == 0),
                    "words not in use are 0: {wrc1:?}"
                );
            }
        }
    }
}

#[test]
fn the_frames_of_drives_have_eight_bytes_too() {
    for rate in FASTEST {
        for (bus, length) in [("", 8), ("frame_length = 'variable'\n", 4)] {
            // Actual value 1 is a doubleword in word 0 of frame 1.
            let card = "zk_16 = 0x12D\nzk_20 = 0x41\n";
            let drive =
                "[[bus.drive]]\nname = 'd1'\nslave_number = 1\nlock_time_us = 30000\n[bus.drive.zk]\n";
            let mut rig = running(rate, &format!("{bus}{drive}{card}"));
            let frames = full_interval(&mut rig, [1, 1]);
            let (_, rdc1) = of_kind(&frames, |kind| matches!(kind, FrameKind::ActualValue(..)));
            assert_eq!(rdc1.data().len(), length, "{rdc1:?}");
        }
    }
}

/// Jobs and answers are as long as they need to be (p. 136): a read job has four bytes, the answer with a word six.
#[test]
fn jobs_and_answers_keep_their_own_length() {
    for rate in FASTEST {
        let mut rig = running(rate, DRIVES);
        rig.master.b_SL_NR_PARAMETER.store(1);
        rig.master.a_DATA_PARAMETER[1].w_PAR_NR.store(121);
        rig.master.a_CTRLREG_PAR_CMD_SL[1].b_STATREG_PAR_CMD.store(0x03);
        rig.master.a_CTRLREG_PAR_CMD_SL[1].b_STEUREG_PAR_CMD.store(0x03);
        rig.run_to_sync();
        rig.run_to_sync();
        let length = |id| rig.last_frame(id..=id).unwrap().data().len();
        assert_eq!((length(0x501), length(0x581)), (4, 6));
    }
}

/// Stations receive a frame at the end of its end-of-frame field, not at the end of the intermission after it.
#[test]
fn a_frame_is_there_before_the_intermission() {
    for rate in RATES {
        let mut rig = running(rate, DRIVES);
        fill(&mut rig, ALL_WORDS, [0x1234_5678; 2], [0x9ABC_DEF0; 2]);
        let (edge, timing) = (rig.plant.now(), rate.timing);
        let frames = full_interval(&mut rig, [0, 0]);
        let begins = [timing.t_WRC1, timing.t_RDC1, timing.t_WRC2, timing.t_RDC2, timing.t_CC];
        assert_eq!(frames.len(), begins.len());
        for ((end, frame), begin) in frames.iter().zip(begins) {
            let us = wire::bits_to_end_of_frame(&(*frame).into()) * 1000 / u32::from(rate.kbit_s);
            assert_eq!(*end, edge + u64::from(begin + us), "{frame:?}");
        }
    }
}

/// Returns two doublewords with enough stuff bits that the frame of this identifier takes more than 130 bit times, and
/// the frame itself.
fn longer_than_its_slot(id: u16) -> ([u32; 2], Frame) {
    let words = |low: u32| [STUFFED, STUFFED & !0xFFFF | low];
    let frame = |low: u32| {
        let [a, b] = words(low).map(u32::to_le_bytes);
        Frame::new(id, &[a, b].concat()).unwrap()
    };
    let low = (0..=0xFFFF).find(|low| wire::bits(&frame(*low).into()) > 130).expect("there is one");
    (words(low), frame(low))
}

/// Decision D-127: a frame that a fault delays takes no time from other stations, even if the delay is short.
#[test]
fn a_delayed_frame_delays_no_other_station() {
    for rate in RATES {
        let (words, expected) = longer_than_its_slot(0x300);
        let mut rig = running(rate, DRIVES);
        fill(&mut rig, ALL_WORDS, words, [0x1234_5678; 2]);
        add(&mut rig, "kind = 'delay_frame'\nslot = 'RDC1'\ndelay_us = 1\ncount = 1");
        let edge = rig.plant.now();
        let frames = full_interval(&mut rig, [0, 0]);
        assert!(frames.iter().any(|(_, frame)| *frame == expected));
        let (end, wrc2) = of_kind(&frames, |kind| matches!(kind, FrameKind::ReferenceValue(Channel::Two, _)));
        let us = wire::bits_to_end_of_frame(&wrc2.into()) * 1000 / u32::from(rate.kbit_s);
        assert_eq!(end, edge + u64::from(rate.timing.t_WRC2 + us), "{wrc2:?}");
    }
}

/// The gaps RDC1-WRC2 and RDC2-CC are 130 bit times; eight bytes with more than 19 stuff bits take longer. The
/// next frame begins directly after the intermission.
#[test]
fn a_frame_longer_than_its_slot_keeps_the_next_one_waiting() {
    for rate in RATES {
        let us = |bits: u32| u64::from(bits * 1000 / u32::from(rate.kbit_s));
        let mut rig = running(rate, DRIVES);
        for (words, expected) in [0x300, 0x380].map(longer_than_its_slot) {
            fill(&mut rig, ALL_WORDS, words, [0x1234_5678; 2]);
            let frames = full_interval(&mut rig, [0, 0]);
            let at =
                frames.iter().position(|(_, frame)| *frame == expected).expect("the frame is on the bus");
            let [(end, _), (next_end, next)] = frames[at..at + 2] else { panic!("{frames:?}") };
            assert_eq!(next_end, end + us(3 + wire::bits_to_end_of_frame(&next.into())), "{next:?}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// For any contents, a frame begins after the previous frame has left the wire, and at its slot time at the
    /// earliest.
    #[test]
    fn no_two_frames_are_on_the_wire_at_once(
        rate in prop::sample::select(&RATES[..]),
        values in prop::collection::vec((stuffed(), stuffed(), stuffed(), stuffed(), 0u8..3, 0u8..3), 6),
    ) {
        let us = |bits: u32| u64::from(bits * 1000 / u32::from(rate.kbit_s));
        let mut rig = running(rate, DRIVES);
        let first = rig.plant.now();
        for (a, b, c, d, one, two) in values {
            fill(&mut rig, ALL_WORDS, [a, b], [c, d]);
            full_interval(&mut rig, [one, two]);
        }
        let timing = rate.timing;
        let mut free = 0;
        for (end, frame) in rig.frames().into_iter().filter(|(end, _)| *end > first) {
            let begin = end - us(wire::bits_to_end_of_frame(&frame.into()));
            prop_assert!(begin >= free, "{:?} begins at {}, the bus is free from {} on", frame, begin, free);
            let slot = match frame.kind() {
                Some(FrameKind::ReferenceValue(channel, _)) => [timing.t_WRC1, timing.t_WRC2][channel.index()],
                Some(FrameKind::ActualValue(channel, _)) => [timing.t_RDC1, timing.t_RDC2][channel.index()],
                Some(FrameKind::Action | FrameKind::Job(_)) => timing.t_CC,
                _ => timing.t_RC,
            };
            let delay_us = (begin - first) % rate.interval_us - u64::from(slot);
            prop_assert!(delay_us <= us(5), "{:?} begins {} us behind its slot", frame, delay_us);
            prop_assert!(delay_us == 0 || begin == free, "{:?} waits for no other frame", frame);
            free = begin + us(wire::bits(&frame.into()));
        }
    }
}

/// Generates words that need many stuff bits, and any other words.
fn stuffed() -> impl Strategy<Value = u32> {
    prop_oneof![any::<u32>(), Just(STUFFED), Just(!STUFFED), Just(0), Just(u32::MAX), Just(0x8787_8787)]
}
