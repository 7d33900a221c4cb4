//! After the end of a fault, the plant works as without the fault. During the fault, only the faulty station loses
//! frames.

use super::*;
use crate::rig::{FASTEST, Memory};
use commram::devices::cansync::frames::{Frame, FrameKind};
use commram::devices::cansync::registers::CANsync_MA_CTRL_BMSTRUCT;
use commram::identity::DeviceIndex;
use core::mem::offset_of;
use proptest::prelude::*;

const BUS_OFF: u16 = 0x00C0;

/// When the controller goes off, all frames of the interval have ended. The first frames after its return must be new
/// ones.
#[test]
fn the_first_command_after_bus_off_is_on_the_bus() {
    for rate in FASTEST {
        let mut rig = running(Memory::Heap, rate);
        rig.master.b_SL_NR_CONTROLWORD.store(DRIVE as u8);
        rig.master.a_STEUREG_CONTROLWORD[DRIVE].store(0x05);
        rig.send_wrc1();
        rig.step(rate.scaled(500));
        add(&mut rig, "kind = 'bus_off'\nplc = 'a'\nnode = 'MASTER'");
        rig.master.w_CPU_CONTROL.store(0x00C0);
        rig.step(rate.scaled(6_000));
        assert_eq!(rig.master.w_CANsync_STATUS.load() & BUS_OFF, 0);
        rig.run_to_sync();
        let before = rig.frames().len();
        rig.master.a_CONTROLWORD_SL[DRIVE].store(0x000F);
        rig.master.a_STEUREG_CONTROLWORD[DRIVE].store(0x05);
        rig.send_wrc1();
        assert_eq!(rig.master.a_STEUREG_CONTROLWORD[DRIVE].load(), 0x04);
        rig.run_to_sync();
        let ids: Vec<u16> = rig.frames()[before..].iter().map(|(_, frame)| frame.id()).collect();
        assert_eq!(ids, [0x101, 0x301, 0x010]);
    }
}

#[test]
fn a_slave_that_goes_off_takes_no_frame_of_another_one_with_it() {
    for rate in FASTEST {
        for fault in ["kind = 'slave_off'\nslave = 1", "kind = 'bus_off'\nplc = 'b'\nnode = 'SLAVE'"] {
            let mut rig = running(Memory::Heap, rate);
            // The last answers come from the slaves that are switched off.
            let last = if fault.contains("slave_off") { 1 } else { 0 };
            rig.slave.b_CTRLREG_RD_RDC1.store(0x05);
            rig.master.b_CTRLREG_RD_ORDER_RDC1.store(last);
            enter_parameter(&rig, usize::from(last), 0x03, 1000, 0);
            rig.send_wrc1();
            rig.master.a_CTRLREG_PAR_CMD_SL[usize::from(last)].b_STEUREG_PAR_CMD.store(0);
            rig.run_to_sync();
            rig.run_to_sync();
            add(&mut rig, fault);
            rig.master.b_CTRLREG_RD_ORDER_RDC1.store(2);
            enter_parameter(&rig, 2, 0x03, 121, 0);
            let before = rig.frames().len();
            rig.send_wrc1();
            rig.run_to_sync();
            let ids: Vec<u16> = rig.frames()[before..].iter().map(|(_, frame)| frame.id()).collect();
            assert_eq!(ids, [0x102, 0x302, 0x502, 0x582], "{fault}");
        }
    }
}

/// A frame that a fault delays beyond its slot ends outside the slot.
#[test]
fn a_delayed_frame_that_is_destroyed_takes_no_other_one_with_it() {
    for rate in FASTEST {
        let mut rig = running(Memory::Heap, rate);
        let delay_us = rate.scaled(400);
        add(&mut rig, &format!("kind = 'delay_frame'\nslot = 'RDC1'\ndelay_us = {delay_us}\ncount = 1"));
        let at = rig.plant.now() + rate.scaled(1_500);
        add(&mut rig, &format!("kind = 'slave_off'\nslave = 1\nat_us = {at}"));
        rig.send_wrc1();
        assert!(rig.last_frame(0x301..=0x301).is_none(), "it was on the wire as its sender went off");
        rig.master.b_CTRLREG_RD_ORDER_RDC1.store(2);
        rig.send_wrc1();
        assert!(rig.last_frame(0x302..=0x302).is_some());
    }
}

/// The fault begins while the firmware builds a frame, which takes 15 us for each word.
#[test]
fn a_controller_that_is_off_gets_no_frame_any_more() {
    for rate in FASTEST {
        let mut rig = running(Memory::Heap, rate);
        let at = rig.plant.now() + u64::from(rate.timing.deadline_WRC.earliest) + 5;
        add(&mut rig, &format!("kind = 'bus_off'\nplc = 'a'\nnode = 'MASTER'\nat_us = {at}"));
        let before = rig.frames().len();
        rig.send_wrc1();
        assert_eq!(rig.frames().len(), before);
        assert_eq!(rig.master.b_CTRLREG_WRC1.load(), 0x05, "not acknowledged");
    }
}

/// A drive without power loses an answer that it has prepared, even if the power returns before the slot of the answer.
#[test]
fn an_answer_does_not_survive_the_power_of_its_slave() {
    for rate in FASTEST {
        let mut rig = running(Memory::Heap, rate);
        enter_parameter(&rig, DRIVE, 0x03, 1000, 0);
        let (at, duration_us) = (rig.plant.now() + rate.scaled(2_200), rate.scaled(100));
        add(&mut rig, &format!("kind = 'slave_off'\nslave = 1\nat_us = {at}\nduration_us = {duration_us}"));
        rig.run_to_sync();
        rig.run_to_sync();
        assert!(rig.last_frame(0x581..=0x581).is_none());
        intervals(&mut rig, 1);
        assert_eq!(parameter(&rig, DRIVE), (0x02, 100), "the repetition is answered");
    }
}

/// Two faults that switch the same slave off do not cancel each other.
#[test]
fn a_slave_that_is_off_twice_is_off() {
    for rate in FASTEST {
        let mut rig = running(Memory::Heap, rate);
        for _ in 0..2 {
            add(&mut rig, "kind = 'slave_off'\nslave = 1");
        }
        enter_parameter(&rig, DRIVE, 0x03, 1000, 0);
        intervals(&mut rig, 6);
        assert_ne!(parameter(&rig, DRIVE).0, 0x02, "no slave answers");
        rig.plant.clear_faults();
        intervals(&mut rig, 12);
        assert_eq!(parameter(&rig, DRIVE), (0x02, 100));
    }
}

/// Requests of the PLC in one interval.
#[derive(Clone, Copy, Debug)]
struct PlcRequests {
    wrc1: Option<u8>,
    wrc2: Option<u8>,
    control_word: Option<u8>,
    parameter: Option<u8>,
}

fn requests() -> impl Strategy<Value = PlcRequests> {
    let slave = || prop::option::weighted(0.8, 0u8..3);
    (slave(), slave(), prop::option::weighted(0.3, 0u8..3), slave())
        .prop_map(|(wrc1, wrc2, control_word, parameter)| PlcRequests { wrc1, wrc2, control_word, parameter })
}

/// Returns the faulty station: `None` is the master, otherwise the slave with this number.
fn any_fault() -> impl Strategy<Value = (Option<u8>, &'static str)> {
    prop_oneof![
        Just((None, "kind = 'bus_off'\nplc = 'a'\nnode = 'MASTER'")),
        Just((Some(0), "kind = 'bus_off'\nplc = 'b'\nnode = 'SLAVE'")),
        Just((Some(0), "kind = 'slave_off'\nslave = 0\nduration_us = 3000")),
        Just((Some(1), "kind = 'slave_off'\nslave = 1\nduration_us = 3000")),
        Just((Some(2), "kind = 'slave_off'\nslave = 2\nduration_us = 70")),
    ]
}

fn interval(rig: &mut Rig, requests: PlcRequests) {
    let regs = &rig.master;
    for (order, release, slave) in [
        (&regs.b_CTRLREG_RD_ORDER_RDC1, &regs.b_CTRLREG_WRC1, requests.wrc1),
        (&regs.b_CTRLREG_RD_ORDER_RDC2, &regs.b_CTRLREG_WRC2, requests.wrc2),
    ] {
        if let Some(slave) = slave {
            order.store(slave);
            release.store(0x05);
        }
    }
    if let Some(slave) = requests.control_word {
        regs.b_SL_NR_CONTROLWORD.store(slave);
        regs.a_STEUREG_CONTROLWORD[usize::from(slave)].store(0x05);
    }
    if let Some(slave) = requests.parameter {
        // Only a new job gets an acknowledgement that the test can check.
        if parameter(rig, slave.into()).0 & 0x01 == 0 {
            enter_parameter(rig, slave.into(), 0x03, 121, 0);
        }
    }
    rig.slave.b_CTRLREG_RD_RDC1.store(0x05);
    rig.slave.b_CTRLREG_RD_RDC2.store(0x05);
    let job = rig.slave.b_STEUREG_PAR_CMD.load();
    if job & 0x01 != 0 {
        rig.slave.b_STATREG_PAR_CMD.store(job & !0x41);
        rig.slave.b_STEUREG_PAR_CMD.store(job & !0x41);
    }
    rig.run_to_sync();
}

type IsFrame = fn(&Frame) -> bool;

/// Returns the requests that the master has acknowledged, with the kind of frame that must follow.
fn acknowledged(rig: &Rig) -> Vec<(u64, IsFrame)> {
    const PARAMETER: usize = offset_of!(CANsync_MA_CTRL_BMSTRUCT, a_CTRLREG_PAR_CMD_SL);
    const CONTROL_WORD: usize = offset_of!(CANsync_MA_CTRL_BMSTRUCT, a_STEUREG_CONTROLWORD);
    const WRC1: usize = offset_of!(CANsync_MA_CTRL_BMSTRUCT, b_CTRLREG_WRC1);
    const WRC2: usize = offset_of!(CANsync_MA_CTRL_BMSTRUCT, b_CTRLREG_WRC2);
    fn reference(channel: u8, frame: &Frame) -> bool {
        matches!(frame.kind(), Some(FrameKind::ReferenceValue(of, _)) if of.number() == channel)
    }
    let frame_for = |offset: usize, request: u16, answer: u16| -> Option<IsFrame> {
        match offset {
            WRC1 => Some(|frame| reference(1, frame)),
            WRC2 => Some(|frame| reference(2, frame)),
            CONTROL_WORD.. if offset < CONTROL_WORD + 32 => {
                Some(|frame| frame.kind() == Some(FrameKind::Action))
            }
            // Bit 3 (sent) becomes 1.
            PARAMETER.. if offset < PARAMETER + 64 && !request & answer & 0x08 != 0 => {
                Some(|frame| matches!(frame.kind(), Some(FrameKind::Job(_))))
            }
            _ => None,
        }
    };
    rig.records()
        .filter_map(|record| {
            let Handshake { origin, offset, request, answer, .. } = record.event.get()?;
            let offset =
                (origin.plc == DeviceIndex(0)).then_some(offset)?.checked_sub(rig.master_at.base)? as usize;
            Some((record.time_us, frame_for(offset, request, answer)?))
        })
        .collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn acknowledged_frames_are_on_the_bus_and_only_the_faulty_station_loses_frames(
        rate in prop::sample::select(&FASTEST[..]),
        (faulty, text) in any_fault(),
        at in 0u64..8_000,
        before in prop::collection::vec(requests(), 4),
        after in prop::collection::vec(requests(), 8),
    ) {
        let mut rig = running(Memory::Heap, rate);
        // The test sends requests faster than slaves answer, and reads no results. So it tolerates all errors of the
        // access checker.
        rig.tolerate_errors(&commram::devices::catalogue().rules);
        let begin = rig.plant.now();
        add(&mut rig, &format!("{text}\nat_us = {}", begin + rate.scaled(at)));
        for requests in before {
            interval(&mut rig, requests);
        }
        rig.master.w_CPU_CONTROL.store(0x00C0);
        rig.slave.w_CPU_CONTROL.store(0x00C0);
        rig.step(rate.scaled(8_000));
        prop_assert_eq!(rig.plant.faults().count(), 0);
        prop_assert_eq!((rig.master.w_CANsync_STATUS.load() | rig.slave.w_CANsync_STATUS.load()) & BUS_OFF, 0);
        rig.run_to_sync();
        let well = rig.plant.now();
        for requests in after {
            interval(&mut rig, requests);
        }
        let end = rig.plant.now();
        rig.run_to_sync();
        rig.run_to_sync();

        let frames = rig.frames();
        let follows = |from: u64, within: u64, is: &dyn Fn(&Frame) -> bool| {
            frames.iter().any(|(time, frame)| (from..=from + within).contains(time) && is(frame))
        };
        for (time, is) in acknowledged(&rig) {
            let loses = faulty.is_none() && time < well;
            prop_assert!(time < begin || time >= end || loses || follows(time, rate.scaled(1_900), &is), "acknowledged at {}", time);
        }
        for &(time, frame) in frames.iter().filter(|(time, _)| (begin..end).contains(time)) {
            let healthy = |slave: u8| slave != 0 && Some(slave) != faulty;
            match frame.kind() {
                Some(FrameKind::ReferenceValue(channel, slave)) if healthy(slave) => {
                    let answer = Some(FrameKind::ActualValue(channel, slave));
                    prop_assert!(follows(time, rate.scaled(900), &|frame| frame.kind() == answer), "{:?} at {}", answer, time);
                }
                Some(FrameKind::Job(slave)) if healthy(slave) || slave != 0 && time >= well => {
                    let answer = Some(FrameKind::Response(slave));
                    prop_assert!(follows(time, rate.scaled(1_500), &|frame| frame.kind() == answer), "{:?} at {}", answer, time);
                }
                _ => {}
            }
        }
    }
}
