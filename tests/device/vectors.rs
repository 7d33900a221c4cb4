//! Worked examples of the manuals as one table, run on heap memory and on the mapped image.
//!
//! "5.02066.01a" is the manual of BM4-O-CAN-06, a module of the same family: registers and jobs have the same names;
//! "5.00005.03a" is the Omega Drive-Line II itself. Times are those of the device under test.

use crate::rig::{BOTH, Memory, RATES, Rate, Rig};
use commram::check::rules;
use commram::devices::cansync::records::{Missed, OmittedFrame};

struct Vector {
    id: &'static str,
    source: &'static str,
    check: fn(Memory, Rate),
}

const VECTORS: &[Vector] = &[
    Vector { id: "T1", source: "5.00005.03a p. 153: 16#0D is the low word of value 3", check: t1 },
    Vector { id: "T2", source: "5.00005.03a p. 157: word 0 into the low word of actual value 3", check: t2 },
    Vector {
        id: "T3",
        source: "5.00005.03a p. 177: word 0 into the low word of reference value 3",
        check: t3,
    },
    Vector { id: "T4", source: "5.00005.03a p. 180: low word of own actual value 3 into word 0", check: t4 },
    Vector { id: "T5, T9", source: "5.00005.03a p. 127 (bytes inferred)", check: t5_and_t9 },
    Vector { id: "T6", source: "5.00005.03a p. 128 (bytes inferred)", check: t6 },
    Vector { id: "T7", source: "5.02066.01a p. 152 (bytes inferred)", check: t7 },
    Vector { id: "T8", source: "5.02066.01a p. 153 (byte inferred)", check: t8 },
    Vector { id: "T19", source: "5.00005.03a p. 155, 159; start and step: D-08", check: t19 },
    Vector { id: "T35", source: "5.00005.03a p. 153-154; other baud rates: D-09", check: t35 },
    Vector { id: "T40", source: "5.00005.03a p. 168", check: t40 },
];

#[test]
fn every_vector_holds_on_both_memories_at_every_baud_rate() {
    for vector in VECTORS {
        for memory in BOTH {
            for rate in RATES {
                println!("{} ({}) on {memory:?}, {rate:?}", vector.id, vector.source);
                (vector.check)(memory, rate);
            }
        }
    }
}

/// Reference values with halves that differ.
fn fill_reference_values(rig: &Rig) {
    for (number, cell) in rig.master.a_WR_VALUE.iter().enumerate().take(8) {
        cell.store(0xAA00_BB00 | (number as u32) << 16 | number as u32);
    }
}

/// Returns the data of the WRC1 frame for these values with configuration `bytes`.
fn wrc1_data(rig: &mut Rig, bytes: [u8; 4]) -> Vec<u8> {
    rig.configure_wrc1(bytes);
    rig.run_to_sync();
    rig.send_wrc1();
    rig.last_frame(0x100..=0x17F).expect("a WRC1 frame went out").data().to_vec()
}

fn t1(memory: Memory, rate: Rate) {
    let mut rig = Rig::new(memory, rate);
    rig.activate();
    fill_reference_values(&rig);
    assert_eq!(wrc1_data(&mut rig, [0x0D, 0, 0, 0]), [0x03, 0xBB, 0, 0, 0, 0, 0, 0]);
}

/// Lets slave 0 (PLC `b`) send `words` as its actual value frame 1.
fn send_rdc1(rig: &mut Rig, words: [u16; 4]) {
    let own = &rig.slave._CFG_RDC_WORD;
    for (word, cell) in
        [&own.b_CFG_RDC1_WORD0, &own.b_CFG_RDC1_WORD1, &own.b_CFG_RDC1_WORD2, &own.b_CFG_RDC1_WORD3]
            .into_iter()
            .enumerate()
    {
        cell.store(0x01 | (word as u8) << 2);
        rig.slave.a_RD_VALUE_SEND[word].store(u32::from(words[word]));
    }
    rig.slave.b_CTRLREG_RD_RDC1.store(0x05);
    rig.master.b_CTRLREG_RD_ORDER_RDC1.store(0);
    rig.send_wrc1();
    assert_eq!(rig.slave.b_CTRLREG_RD_RDC1.load(), 0x04);
}

fn t2(memory: Memory, rate: Rate) {
    let mut rig = Rig::new(memory, rate);
    rig.expect_errors(&[&rules::OWNER]); // to see that half of it stays
    rig.activate();
    rig.master.a_CFG_RDC_WORD[0].b_CFG_RDC1_WORD0.store(0x0D);
    rig.master.a_RD_BMARRAY[0][3].store(0x5555_6666);
    rig.master.b_STATREG_RDC1.store(0xFF);
    send_rdc1(&mut rig, [0x1234, 1, 2, 3]);
    assert_eq!(rig.master.a_RD_BMARRAY[0][3].load(), 0x5555_1234, "the high word stays");
    assert_eq!(rig.master.a_STATREG_RDC[0].b_STATREG_RDC1.load(), 0x02);
    assert_eq!(rig.master.b_STATREG_RDC1.load(), 0);
}

fn t3(memory: Memory, rate: Rate) {
    let mut rig = Rig::new(memory, rate);
    rig.activate();
    fill_reference_values(&rig);
    rig.configure_wrc1([0x01, 0, 0, 0]);
    rig.slave._CFG_WRC_WORD.b_CFG_WRC1_WORD0.store(0x0D);
    rig.run_to_sync();
    rig.send_wrc1();
    assert_eq!(rig.slave.a_WR_VALUE_RECEIVE[3].load(), 0x0000_BB00);
    assert_eq!(rig.slave.b_CTRLREG_WRC1.load(), 0x02);
}

fn t4(memory: Memory, rate: Rate) {
    let mut rig = Rig::new(memory, rate);
    rig.activate();
    rig.slave._CFG_RDC_WORD.b_CFG_RDC1_WORD0.store(0x0D);
    rig.slave.a_RD_VALUE_SEND[3].store(0x9876_5432);
    rig.slave.b_CTRLREG_RD_RDC1.store(0x05);
    rig.send_wrc1();
    let frame = rig.last_frame(0x300..=0x37F).expect("slave 0 answered");
    assert_eq!((frame.id(), frame.data()), (0x300, &[0x32, 0x54, 0, 0, 0, 0, 0, 0][..]));
}

fn t5_and_t9(memory: Memory, rate: Rate) {
    let mut rig = Rig::new(memory, rate);
    rig.activate();
    rig.master.a_WR_VALUE[0].store(0x1122_3344);
    rig.master.a_WR_VALUE[2].store(0x0000_5566);
    rig.master.a_WR_VALUE[3].store(0x0000_7788);
    let data = wrc1_data(&mut rig, [0x01, 0x03, 0x09, 0x0D]);
    assert_eq!(data, [0x44, 0x33, 0x22, 0x11, 0x66, 0x55, 0x88, 0x77]);
}

fn t6(memory: Memory, rate: Rate) {
    let mut rig = Rig::new(memory, rate);
    rig.activate();
    let cfg = &rig.master.a_CFG_RDC_WORD[0];
    cfg.b_CFG_RDC1_WORD0.store(0x01);
    cfg.b_CFG_RDC1_WORD1.store(0x03);
    cfg.b_CFG_RDC1_WORD2.store(0x09);
    cfg.b_CFG_RDC1_WORD3.store(0x0B);
    send_rdc1(&mut rig, [0x1111, 0x2222, 0x3333, 0x4444]);
    assert_eq!(rig.master.a_RD_BMARRAY[0][0].load(), 0x2222_1111);
    assert_eq!(rig.master.a_RD_BMARRAY[0][2].load(), 0x4444_3333);
}

fn t7(memory: Memory, rate: Rate) {
    let mut rig = Rig::new(memory, rate);
    rig.activate();
    fill_reference_values(&rig);
    let data = wrc1_data(&mut rig, [0x05, 0x07, 0x01, 0x09]);
    assert_eq!(data, [0x01, 0xBB, 0x01, 0xAA, 0x00, 0xBB, 0x02, 0xBB]);
}

fn t8(memory: Memory, rate: Rate) {
    let mut rig = Rig::new(memory, rate);
    rig.activate();
    fill_reference_values(&rig);
    let data = wrc1_data(&mut rig, [0x11, 0x00, 0x19, 0x00]);
    assert_eq!(data, [0x04, 0xBB, 0x00, 0x00, 0x06, 0xBB, 0x00, 0x00], "gap and tail are 0 (D-10)");
}

fn t19(memory: Memory, rate: Rate) {
    let mut rig = Rig::new(memory, rate);
    rig.set_up();
    rig.master.b_MAX_SL_NR.store(3);
    rig.master.b_CTRLREG_RD_ORDER_RDC1.store(0x80);
    rig.master.w_CPU_CONTROL.store(0x0040);
    rig.step(500);
    rig.run_to_sync();
    for _ in 0..6 {
        rig.send_wrc1();
    }
    let asked: Vec<u16> =
        rig.frames().iter().map(|(_, frame)| frame.id()).filter(|id| id & 0x780 == 0x100).collect();
    assert_eq!(asked, [0x100, 0x101, 0x102, 0x103, 0x100, 0x101]);
}

fn t35(memory: Memory, rate: Rate) {
    let deadline = u64::from(rate.timing.deadline_WRC.earliest);
    for (release_at, in_time) in [(0, true), (deadline - 1, true), (deadline, false), (deadline + 1, false)] {
        let mut rig = Rig::new(memory, rate);
        rig.activate();
        rig.step(release_at);
        rig.master.b_CTRLREG_WRC1.store(0x05);
        rig.run_to_sync();
        let sent = rig.last_frame(0x100..=0x17F).is_some();
        assert_eq!(sent, in_time, "released {release_at} us after SYNC");
        assert_eq!(rig.master.b_CTRLREG_WRC1.load(), if in_time { 0x04 } else { 0x05 });
        rig.run_to_sync();
        rig.run_to_sync();
        let missed = |frame: u8| {
            let what = OmittedFrame::ReferenceValue(frame);
            rig.records().any(|record| record.event.get().is_some_and(|it: Missed| it.what == what))
        };
        assert!(missed(1), "the journal has the frame without a release");
        assert!(!missed(2), "the program has never released this frame");
    }
}

fn t40(memory: Memory, rate: Rate) {
    let mut rig = Rig::new(memory, rate);
    rig.set_up();
    // Runs one round of polling: "SYNC mode: on", then slaves 0 to 3. Each answer comes one interval later.
    for _ in 0..3 {
        rig.run_to_sync();
    }
    assert_eq!(rig.master.a_STAT_SL[0].load(), 0x01, "slave 0 responds and is not locked yet");
    rig.step(20_000 + 6 * rate.interval_us);
    assert_eq!(rig.master.a_STAT_SL[0].load(), 0x03, "slave 0 is synchronized");
    assert_eq!(rig.master.a_STAT_SL[1].load(), 0x00, "slave 1 is expected and not there");
    assert_eq!(rig.slave.b_STATREG_SYNC_MODUS.load(), 0x02);
    assert_eq!(rig.slave.b_SYNC_MODUS.load(), 0x01);
}
