//! Lost, delayed and duplicated frames.

use super::*;
use crate::rig::{BOTH, FASTEST, Memory, Rig};
use commram::devices::cansync::bus::drives;

/// Runs an interval; returns whether the master has received RDC1 in it.
fn exchanged(rig: &mut Rig) -> bool {
    rig.master.a_STATREG_RDC[DRIVE].b_STATREG_RDC1.store(0xFF);
    rig.send_wrc1();
    rig.master.a_STATREG_RDC[DRIVE].b_STATREG_RDC1.load() == 0x02
}

#[test]
fn a_lost_reference_frame_is_acknowledged_but_not_received() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut rig = running(memory, rate);
            let id = add(&mut rig, "kind = 'lose_frame'\nslot = 'WRC1'\ncount = 2");
            let frames = rig.frames().len();
            for _ in 0..2 {
                rig.slave.b_CTRLREG_WRC1.store(0);
                assert!(!exchanged(&mut rig), "the drive was not asked");
                assert_eq!(rig.master.b_CTRLREG_WRC1.load(), 0x04, "the master has sent it");
                assert_eq!(rig.slave.b_CTRLREG_WRC1.load(), 0, "the slave has not got it");
            }
            assert_eq!(rig.frames().len(), frames, "no frame had a receiver");
            assert!(exchanged(&mut rig), "the third one arrives");
            let now = news(&rig);
            let kinds: Vec<_> = now.iter().map(|(_, id, news)| (*id, *news)).collect();
            let frame = News::Hit(Hit::Frame(0x101));
            assert_eq!(kinds, [(id, News::Added), (id, frame), (id, frame), (id, News::Over)]);
            assert_eq!(rig.plant.faults().count(), 0);
        }
    }
}

/// ZK 26 watches the losses of a drive (manual 5.01010.01 p. 17); no loss is allowed by default.
#[test]
fn a_drive_counts_the_reference_frames_it_misses() {
    for rate in FASTEST {
        let mut rig = running(Memory::Heap, rate);
        exchanged(&mut rig);
        exchanged(&mut rig);
        let losses = |rig: &Rig| drives(rig.plant.buses()).next().unwrap().reference_losses();
        let before = losses(&rig);
        add(&mut rig, "kind = 'lose_frame'\nslot = 'WRC1'\ncount = 1");
        exchanged(&mut rig);
        exchanged(&mut rig);
        assert_eq!(losses(&rig), before + 1);
    }
}

#[test]
fn identifier_mask_and_slot_choose_the_frames() {
    for rate in FASTEST {
        for (choice, drive_1, drive_2) in [
            ("id = 0x301", false, true),
            ("id = 0x302", true, false),
            ("id = 0x300\nmask = 0x780", false, false),
            ("slot = 'RDC1'", false, false),
            ("slot = 'RDC2'", true, true),
            ("id = 0x301\nslot = 'RDC2'", true, true),
            ("", false, false),
        ] {
            let mut rig = running(Memory::Heap, rate);
            add(&mut rig, &format!("kind = 'lose_frame'\n{choice}"));
            let mut got = |slave: usize| {
                rig.master.b_CTRLREG_RD_ORDER_RDC1.store(slave as u8);
                rig.master.a_STATREG_RDC[slave].b_STATREG_RDC1.store(0xFF);
                rig.send_wrc1();
                rig.master.a_STATREG_RDC[slave].b_STATREG_RDC1.load() == 0x02
            };
            assert_eq!((got(1), got(2)), (drive_1, drive_2), "{choice}");
        }
    }
}

/// Every slot can lose its frame; the hit names the identifier.
#[test]
fn every_slot_can_be_hit() {
    for rate in FASTEST {
        for (slot, id) in
            [("WRC1", 0x101), ("RDC1", 0x301), ("WRC2", 0x181), ("RDC2", 0x381), ("CC", 0x501), ("RC", 0x581)]
        {
            let mut rig = running(Memory::Heap, rate);
            rig.master.b_CTRLREG_RD_ORDER_RDC2.store(DRIVE as u8);
            enter_parameter(&rig, DRIVE, 0x03, 1000, 0);
            add(&mut rig, &format!("kind = 'lose_frame'\nslot = '{slot}'\ncount = 1"));
            rig.master.b_CTRLREG_WRC2.store(0x05);
            rig.send_wrc1();
            rig.run_to_sync();
            assert_eq!(hits(&rig), [id], "{slot}");
        }
    }
}

/// T_RSPTO passes, and the job is repeated when the master polls the slave again (D-11).
#[test]
fn a_lost_job_or_answer_is_repeated() {
    for rate in FASTEST {
        for slot in ["CC", "RC"] {
            let mut rig = running(Memory::Heap, rate);
            add(&mut rig, &format!("kind = 'lose_frame'\nslot = '{slot}'\ncount = 3"));
            enter_parameter(&rig, DRIVE, 0x03, 1000, 0);
            intervals(&mut rig, 4);
            assert_eq!(parameter(&rig, DRIVE).0, 0x0B, "sent, not answered");
            intervals(&mut rig, 1);
            assert_eq!(parameter(&rig, DRIVE), (0x02, 100), "{slot}");
        }
    }
}

#[test]
fn a_slave_whose_status_answer_is_lost_does_not_respond() {
    for rate in FASTEST {
        let mut rig = Rig::of(Memory::Heap, rate, DRIVES);
        rig.set_up();
        rig.step(40_000);
        assert_eq!(rig.master.a_STAT_SL[DRIVE].load(), 0x03);
        let id = add(&mut rig, "kind = 'lose_frame'\nid = 0x581");
        rig.step(20_000);
        assert_eq!(rig.master.a_STAT_SL[DRIVE].load(), 0x00);
        rig.plant.clear_fault(id).unwrap();
        rig.step(20_000);
        assert_eq!(rig.master.a_STAT_SL[DRIVE].load(), 0x03);
    }
}

#[test]
fn a_delayed_reference_frame_and_its_answer_come_late() {
    for rate in FASTEST {
        let mut rig = running(Memory::Heap, rate);
        // The delayed frame begins after the slot of the answer; a frame has 50 to 130 bits.
        let (slot, delay) = (u64::from(rate.timing.t_WRC1), rate.interval_us * 3 / 10);
        let bits = |bits: u64| bits * 1000 / u64::from(rate.kbit_s);
        let edge = rig.plant.now();
        add(&mut rig, &format!("kind = 'delay_frame'\nslot = 'WRC1'\ndelay_us = {delay}\ncount = 1"));
        rig.send_wrc1();
        let ends: Vec<u64> =
            rig.frames().iter().filter(|(time, _)| *time > edge).map(|(time, _)| time - edge).collect();
        let [wrc1, rdc1] = ends[..] else { panic!("{ends:?}") };
        assert!((slot + delay + bits(50)..slot + delay + bits(130)).contains(&wrc1), "{wrc1}");
        assert!(rdc1 > wrc1 && rdc1 < wrc1 + bits(130), "answered at once, its slot is over: {rdc1}");
    }
}

/// A fault delays a frame beyond the SYNC edge. The frame then belongs to the next interval.
#[test]
fn a_frame_can_be_delayed_into_the_next_interval() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut rig = running(memory, rate);
            add(&mut rig, "kind = 'delay_frame'\nslot = 'WRC1'\ndelay_us = 2500\ncount = 1");
            rig.slave.b_CTRLREG_WRC1.store(0);
            rig.send_wrc1();
            assert_eq!(rig.slave.b_CTRLREG_WRC1.load(), 0);
            rig.send_wrc1();
            rig.run_to_sync();
            assert_eq!(rig.slave.b_CTRLREG_WRC1.load(), 0x02);
            assert_eq!(
                rig.frames().iter().filter(|(_, frame)| frame.id() == 0x101).count(),
                2,
                "both arrived"
            );
        }
    }
}

#[test]
fn an_answer_delayed_beyond_the_time_limit_counts_as_none() {
    for rate in FASTEST {
        let mut rig = running(Memory::Heap, rate);
        add(&mut rig, "kind = 'delay_frame'\nslot = 'RC'\ndelay_us = 500\ncount = 2");
        enter_parameter(&rig, DRIVE, 0x03, 1000, 0);
        intervals(&mut rig, 3);
        assert_eq!(parameter(&rig, DRIVE).0, 0x0B);
        assert_eq!(rig.frames().iter().filter(|(_, frame)| frame.id() == 0x581).count(), 2, "late, but sent");
        intervals(&mut rig, 1);
        assert_eq!(parameter(&rig, DRIVE), (0x02, 100));
    }
}

#[test]
fn a_duplicated_frame_arrives_twice() {
    for rate in FASTEST {
        let mut rig = running(Memory::Heap, rate);
        add(&mut rig, "kind = 'duplicate_frame'\nslot = 'WRC1'\ncount = 1");
        let before = rig.frames().len();
        assert!(exchanged(&mut rig));
        let frames = rig.frames().split_off(before);
        let ids: Vec<u16> = frames.iter().map(|(_, frame)| frame.id()).collect();
        assert_eq!(ids, [0x101, 0x101, 0x301], "the copy asks for no second answer");
        assert_eq!(frames[0].1, frames[1].1);
    }
}

/// A job arrives twice: the slave node treats the second frame as a repetition.
#[test]
fn a_duplicated_job_is_a_repetition() {
    for rate in FASTEST {
        let mut rig = running(Memory::Heap, rate);
        add(&mut rig, "kind = 'duplicate_frame'\nslot = 'CC'\nid = 0x500\ndelay_us = 10");
        enter_parameter(&rig, 0, 0x05, 300, 7);
        intervals(&mut rig, 2);
        assert_eq!(rig.slave.b_STEUREG_PAR_CMD.load(), 0x45, "no change is shown");
        rig.slave.b_STATREG_PAR_CMD.store(0x44);
        rig.slave.b_STEUREG_PAR_CMD.store(0x44);
        intervals(&mut rig, 2);
        assert_eq!(parameter(&rig, 0).0, 0x04);
    }
}
