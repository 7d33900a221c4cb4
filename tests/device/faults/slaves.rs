//! Faults of slaves: a slave is off, late or busy, refuses jobs, or answers with a wrong offset.

use super::*;
use crate::rig::{BOTH, FASTEST, Memory};
use commram::devices::cansync::bus::drives;

#[test]
fn a_drive_without_power_is_silent_and_comes_back_as_new() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut rig = running(memory, rate);
            enter_parameter(&rig, DRIVE, 0x05, 1000, 321);
            intervals(&mut rig, 2);
            assert_eq!(parameter(&rig, DRIVE).0, 0x04);
            let us = 5 * rate.interval_us;
            let off = add(&mut rig, &format!("kind = 'slave_off'\nslave = {DRIVE}\nduration_us = {us}"));
            rig.master.a_STATREG_RDC[DRIVE].b_STATREG_RDC1.store(0xFF);
            rig.send_wrc1();
            assert_eq!(rig.master.a_STATREG_RDC[DRIVE].b_STATREG_RDC1.load(), 0xFF, "no actual values");
            enter_parameter(&rig, DRIVE, 0x03, 1000, 0);
            intervals(&mut rig, 3);
            assert_eq!(parameter(&rig, DRIVE), (0x0B, 0), "no answer");
            intervals(&mut rig, 3);
            assert_eq!(parameter(&rig, DRIVE), (0x02, 100), "the value of power-on");
            assert!(
                !drives(rig.plant.buses()).next().unwrap().is_synchronized(),
                "SYNC mode: on is sent in set-up mode only"
            );
            assert_eq!(
                news(&rig).iter().map(|n| (n.1, n.2)).collect::<Vec<_>>(),
                [(off, News::Added), (off, News::Over)]
            );
            rig.master.w_CPU_CONTROL.store(0x0020);
            rig.step(60_000);
            assert_eq!(rig.master.a_STAT_SL[DRIVE].load(), 0x03);
        }
    }
}

#[test]
fn an_unplugged_node_keeps_its_state_and_locks_again() {
    for rate in FASTEST {
        let mut rig = Rig::of(Memory::Heap, rate, DRIVES);
        rig.set_up();
        rig.step(60_000);
        assert_eq!(rig.master.a_STAT_SL[0].load(), 0x03);
        let id = add(&mut rig, "kind = 'slave_off'\nslave = 0");
        rig.step(20_000);
        assert_eq!(rig.master.a_STAT_SL[0].load(), 0x00);
        assert_eq!(rig.slave.w_OPTION_STATUS.load(), 0x0013);
        rig.plant.clear_fault(id).unwrap();
        rig.step(12_000);
        assert_eq!(rig.master.a_STAT_SL[0].load(), 0x01);
        rig.step(40_000);
        assert_eq!(rig.master.a_STAT_SL[0].load(), 0x03);
    }
}

#[test]
fn two_faults_that_switch_one_slave_off_must_both_end() {
    for rate in FASTEST {
        let mut rig = Rig::of(Memory::Heap, rate, DRIVES);
        rig.set_up();
        let first = add(&mut rig, "kind = 'slave_off'\nslave = 2");
        let second = add(&mut rig, "kind = 'slave_off'\nslave = 2");
        rig.plant.clear_fault(first).unwrap();
        rig.step(20_000);
        assert_eq!(rig.master.a_STAT_SL[2].load(), 0x00);
        rig.plant.clear_fault(second).unwrap();
        rig.step(20_000);
        assert_eq!(rig.master.a_STAT_SL[2].load() & 0x01, 0x01);
    }
}

/// T_RSPTO is counted from the end of the command frame (D-32).
#[test]
fn only_an_answer_within_the_time_limit_counts() {
    for rate in FASTEST {
        for (delay_us, answered) in [(100, true), (400, false), (5_000, false)] {
            let mut rig = running(Memory::Heap, rate);
            add(&mut rig, &format!("kind = 'slave_late'\nslave = {DRIVE}\ndelay_us = {delay_us}"));
            enter_parameter(&rig, DRIVE, 0x03, 1000, 0);
            intervals(&mut rig, 2);
            let expected = if answered { (0x02, 100) } else { (0x0B, 0) };
            assert_eq!(parameter(&rig, DRIVE), expected, "{delay_us} us");
        }
    }
}

#[test]
fn a_late_slave_does_not_respond_in_set_up_mode() {
    for rate in FASTEST {
        let mut rig = Rig::of(Memory::Heap, rate, DRIVES);
        rig.set_up();
        rig.step(60_000);
        let id = add(&mut rig, "kind = 'slave_late'\nslave = 0\ndelay_us = 700");
        rig.step(12_000);
        assert_eq!([0, 1].map(|n| rig.master.a_STAT_SL[n].load()), [0x00, 0x03]);
        rig.plant.clear_fault(id).unwrap();
        rig.step(12_000);
        assert_eq!(rig.master.a_STAT_SL[0].load(), 0x03);
    }
}

/// Manual p. 165: bit 6 is set while the slave works on the job.
#[test]
fn busy_answers_are_repeated_as_often_as_asked() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut rig = running(memory, rate);
            add(&mut rig, &format!("kind = 'slave_busy'\nslave = {DRIVE}\ncount = 3"));
            enter_parameter(&rig, DRIVE, 0x13, 1000, 0);
            intervals(&mut rig, 1);
            assert_eq!(parameter(&rig, DRIVE).0, 0x1B);
            for _ in 0..3 {
                intervals(&mut rig, 1);
                assert_eq!(parameter(&rig, DRIVE).0, 0x5B);
            }
            intervals(&mut rig, 1);
            assert_eq!(parameter(&rig, DRIVE), (0x02, 100));
            assert_eq!(hits(&rig), [0x581; 3]);
        }
    }
}

#[test]
fn a_busy_slave_node_does_not_see_the_job() {
    for rate in FASTEST {
        let mut rig = running(Memory::Heap, rate);
        add(&mut rig, "kind = 'slave_busy'\nslave = 0\ncount = 2");
        enter_parameter(&rig, 0, 0x05, 300, 7);
        intervals(&mut rig, 3);
        assert_eq!(parameter(&rig, 0).0, 0x4D);
        assert_eq!(rig.slave.b_STEUREG_PAR_CMD.load(), 0);
        intervals(&mut rig, 1);
        assert_eq!(rig.slave.b_STEUREG_PAR_CMD.load(), 0x45, "now it does");
    }
}

#[test]
fn a_busy_slave_holds_up_a_download() {
    for rate in FASTEST {
        let mut rig = running(Memory::Heap, rate);
        add(&mut rig, "kind = 'slave_busy'\nslave = 0\ncount = 2");
        enter_block(&rig, 0x15, 0x1000, 12);
        intervals(&mut rig, 2);
        assert_eq!(block(&rig).0, 0x57, "init frame, busy");
        serve_block(&mut rig, 20);
        assert_eq!(block(&rig), (0x1C, 0, 12));
    }
}

/// Decision D-49: a block with a wrong offset ends the transfer with 16#0001.
#[test]
fn a_wrong_offset_in_an_answer_ends_the_transfer() {
    for rate in FASTEST {
        for (control, ended) in [(0x15, 0x38), (0x05, 0x28)] {
            let mut rig = running(Memory::Heap, rate);
            add(&mut rig, "kind = 'wrong_offset'\nslave = 0\ncount = 1");
            enter_block(&rig, control, 0x1000, 24);
            serve_block(&mut rig, 20);
            assert_eq!(block(&rig), (ended, 0x0001, 0), "{control:02X}");
            assert_eq!(hits(&rig), [0x580], "init answers carry no offset");
        }
    }
}

/// D-49, D-68: the slave expects another block, and the counter shows which.
#[test]
fn a_wrong_offset_in_a_job_is_refused_by_the_slave() {
    for rate in FASTEST {
        let mut rig = running(Memory::Heap, rate);
        add(&mut rig, "kind = 'wrong_offset'\nslave = 0\nslot = 'CC'\noffset = 4095\ncount = 1");
        enter_block(&rig, 0x15, 0x1000, 24);
        serve_block(&mut rig, 20);
        assert_eq!(block(&rig), (0x38, 0x0100, 0));
        let wrong = rig.frames().iter().any(|(_, frame)| frame.id() == 0x580 && frame.data()[0] & 0x20 != 0);
        assert!(wrong, "the refusal was on the bus");
    }
}

#[test]
fn a_drive_with_a_fault_brakes_until_it_is_reset() {
    for rate in FASTEST {
        for memory in BOTH {
            let mut rig = running(memory, rate);
            let state = |rig: &Rig| drives(rig.plant.buses()).next().unwrap().status_word() & 0x006F;
            assert_eq!(state(&rig), 0x0027);
            let fault = add(&mut rig, &format!("kind = 'drive_fault'\nslave = {DRIVE}\nerror = 17"));
            // The second fault waits until a program has reset the first one.
            let second = add(&mut rig, &format!("kind = 'drive_fault'\nslave = {DRIVE}\nerror = 18"));
            intervals(&mut rig, 2);
            assert_eq!(state(&rig), 0x0008);
            enter_parameter(&rig, DRIVE, 0x03, 308, 0);
            intervals(&mut rig, 3);
            assert_eq!(parameter(&rig, DRIVE), (0x02, 17));
            enter_parameter(&rig, DRIVE, 0x05, 120, 0x0080);
            intervals(&mut rig, 3);
            assert_eq!(parameter(&rig, DRIVE).0, 0x04, "the fault reset");
            enter_parameter(&rig, DRIVE, 0x03, 308, 0);
            intervals(&mut rig, 3);
            assert_eq!((state(&rig), parameter(&rig, DRIVE)), (0x0008, (0x02, 18)));
            assert_eq!(
                news(&rig).iter().map(|n| (n.1, n.2)).collect::<Vec<_>>(),
                [
                    (fault, News::Added),
                    (fault, News::Hit(Hit::Plain)),
                    (fault, News::Over),
                    (second, News::Added),
                    (second, News::Hit(Hit::Plain)),
                    (second, News::Over)
                ]
            );
        }
    }
}

#[test]
fn a_node_of_a_plc_is_no_drive() {
    for rate in FASTEST {
        let mut rig = running(Memory::Heap, rate);
        add(&mut rig, "kind = 'drive_fault'\nslave = 0\nerror = 1");
        intervals(&mut rig, 3);
        assert!(hits(&rig).is_empty());
    }
}
