//! Tests of the layout's tables and structures of the b maXX PLC.

use crate::devices::bm4_o_can_06::registers::*;
use crate::devices::cansync::registers as family;
use crate::devices::cansync::registers::phases;
use crate::devices::omega_drive_line_2::registers as omega;
use crate::layout::{Area, Provenance, RegisterPhase, Role, Structure};
use crate::memory::Segment;
use core::mem::offset_of;

/// Manual 5.02066.01a p. 43-45, 72-74.
#[test]
fn six_slots_lie_a_million_bytes_apart() {
    let slots = ["slotG", "slotH", "slotJ", "slotK", "slotL", "slotM"];
    assert_eq!(DEVICE.ports.len(), slots.len());
    for (n, name) in (0..).zip(slots) {
        let port = DEVICE.port(name).unwrap();
        assert_eq!(u32::from(port.number.0), n + 1);
        assert_eq!(port.area.first, 2_001_792 + n * 1_000_000);
        assert_eq!(port.area.bytes as usize, size_of::<CANsync_PLC_MA_BMSTRUCT>());
        assert_eq!((port.role(), port.roles), (None, &[Role::Master, Role::Slave][..]));
    }
}

fn placed(area: &'static Area, role: Role, live: RegisterPhase) -> &'static Structure {
    let mut found = area.structures.iter().filter(|placed| placed.role == Some(role) && placed.live == live);
    let structure = found.next().unwrap().structure;
    assert!(found.next().is_none());
    structure
}

#[test]
fn the_module_in_the_slot_decides_which_structure_lies_there() {
    for area in DEVICE.areas {
        assert_eq!(placed(area, Role::Master, phases::INIT).name, "CANsync_PLC_INIT_BMSTRUCT");
        assert_eq!(placed(area, Role::Slave, phases::INIT).name, "CANsync_PLC_INIT_BMSTRUCT");
        assert_eq!(placed(area, Role::Master, phases::CYCLIC).name, "CANsync_PLC_MA_BMSTRUCT");
        assert_eq!(placed(area, Role::Slave, phases::CYCLIC).name, "CANsync_PLC_SL_BMSTRUCT");
    }
}

/// Firmware and function blocks use only the structures of the CANsync family, for both devices.
#[test]
fn one_typed_view_serves_both_devices() {
    let segment = Segment::heap(200_000);
    let bm4 = segment.view::<CANsync_PLC_SL_BMSTRUCT>(100_000).unwrap();
    let view = bm4.project(|own| -> &family::CANsync_SL_CTRL_BMSTRUCT { own.as_ref() });
    view.w_OMEGA_NR.store(7);
    view.a_RD_BMARRAY[31][7].store(0x1234_5678);
    assert_eq!((bm4.w_SLAVE_NUMBER.load(), bm4.a_RD_BMARRAY[31][7].load()), (7, 0x1234_5678));
    let omega: &omega::CANsync_SL_CTRL_BMSTRUCT = &view;
    assert_eq!(omega.w_OMEGA_NR.load(), 7);
}

/// Manual 5.02066.01a p. 47, 76: only the slave shows a number. INIT is a type that both have in common.
#[test]
fn the_master_has_nothing_where_the_slave_shows_its_number() {
    let registers = |structure: &'static Structure, at: u32| {
        structure.registers.iter().find(|register| register.offset == at).map(|register| register.name)
    };
    let area = DEVICE.areas.first().unwrap();
    assert_eq!(registers(placed(area, Role::Master, phases::CYCLIC), 6), None);
    assert_eq!(registers(placed(area, Role::Slave, phases::CYCLIC), 6), Some("w_SLAVE_NUMBER"));
    assert_eq!(offset_of!(CANsync_PLC_MA_BMSTRUCT, i_SW1_NR), offset_of!(CANsync_PLC_SL_BMSTRUCT, i_SW1_NR));
    assert_eq!(offset_of!(CANsync_PLC_INIT_BMSTRUCT, b_MA_SL_MODE), 12);
    assert_eq!(offset_of!(CANsync_PLC_MA_BMSTRUCT, a_WR_VALUE) % 4, 0);
}

/// Manual 5.02066.01a p. 18, 32, 126-127.
#[test]
fn the_rates_are_those_of_the_manual() {
    let rows = BAUD_RATES.map(|rate| {
        let times = [rate.t_WRC1, rate.t_RDC1, rate.t_WRC2, rate.t_RDC2, rate.t_CC, rate.t_RC, rate.t_RSPTO];
        (rate.kbit_per_s, rate.us_BAUDRATE, rate.b_BT_0, rate.b_BT_1, rate.b_TIME_PATTERN, times)
    });
    assert_eq!(rows[0], (1000, 6, 0x40, 0x34, 1, [350, 520, 650, 820, 950, 210, 300]));
    assert_eq!(rows[1], (500, 5, 0x41, 0x34, 2, [730, 1060, 1320, 1630, 1890, 460, 600]));
    assert_eq!(rows[2], (250, 4, 0x43, 0x34, 4, [1430, 2100, 2620, 3290, 3810, 900, 1100]));
    assert_eq!(rows[3], (125, 3, 0x47, 0x34, 8, [3020, 4310, 5350, 6640, 7680, 1920, 2100]));
}

/// Manual 5.02066.01a p. 54, 86-87; D-298 for the other rates.
#[test]
fn deadlines_are_documented_at_1_mbit_only() {
    let [fastest, others @ ..] = &BAUD_RATES;
    let deadlines = [fastest.deadline_WRC, fastest.deadline_RDC1, fastest.deadline_RDC2];
    assert_eq!(deadlines.map(|it| (it.earliest, it.latest)), [(200, 200), (200, 200), (450, 450)]);
    assert!(deadlines.iter().all(|it| it.source == Provenance::Manual));
    for (ours, omegas) in others.iter().zip(&omega::BAUD_RATES) {
        assert_eq!(ours.kbit_per_s, omegas.kbit_per_s);
        for (own, theirs) in [
            (ours.deadline_WRC, omegas.deadline_WRC),
            (ours.deadline_RDC1, omegas.deadline_RDC1),
            (ours.deadline_RDC2, omegas.deadline_RDC2),
        ] {
            assert_eq!(own.source, Provenance::Inferred("D-298"));
            assert_eq!((own.earliest, own.latest), (theirs.earliest, theirs.latest));
        }
    }
}

/// Manual 5.02066.01a and manual 5.00005.03a describe some common facts. The meanings of this device name the
/// pages of 5.02066.01a.
#[test]
fn meanings_have_the_pages_of_this_manual() {
    let area = DEVICE.areas.first().unwrap();
    let meaning = |role, name: &str| {
        let structure = placed(area, role, phases::CYCLIC);
        structure.registers.iter().find(|register| register.name == name).unwrap().meaning.unwrap()
    };
    let control = meaning(Role::Master, "w_CPU_CONTROL");
    assert_eq!((control.name, control.page), ("cpu_control", "50, 79"));
    assert_eq!(meaning(Role::Slave, "b_STEUREG_PAR_CMD").page, "93-94");
    let theirs = family::descriptor::CANSYNC_MA_CTRL_BMSTRUCT.registers.first().unwrap().meaning.unwrap();
    assert_eq!(theirs.page, "149-150, 175");
    assert_eq!(format!("{:?}", theirs.bits), format!("{:?}", control.bits));
}
