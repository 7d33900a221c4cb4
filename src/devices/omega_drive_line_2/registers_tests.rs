//! Tests of the layout's tables and structures of the Omega Drive-Line II.

use crate::devices::omega_drive_line_2::registers::*;
use crate::identity::PortNumber;
use crate::layout::{Owner, Provenance, Role};
use core::mem::offset_of;
use zerocopy::FromZeros;

#[test]
fn init_overlays_the_beginning_of_both_cyclic_structures() {
    assert_eq!(size_of::<CANsync_INIT_BMSTRUCT>(), 52);
    assert_eq!(offset_of!(CANsync_INIT_BMSTRUCT, w_CPU_CONTROL), 0);
    assert_eq!(offset_of!(CANsync_MA_CTRL_BMSTRUCT, w_OPTION_STATUS), 2);
    assert_eq!(offset_of!(CANsync_MA_CTRL_BMSTRUCT, a_WR_VALUE), 52);
}

/// Manual 5.00005.03a p. 176-186 prints the slave's registers in the order of their addresses. Each register
/// directly follows the previous one and is naturally aligned.
#[test]
fn the_slave_structure_is_in_the_order_of_the_manuals_tables_without_padding() {
    let ends = [
        (offset_of!(CANsync_SL_CTRL_BMSTRUCT, b_CTRLREG_WRC1), 12),
        (offset_of!(CANsync_SL_CTRL_BMSTRUCT, _CFG_WRC_WORD), 16),
        (offset_of!(CANsync_SL_CTRL_BMSTRUCT, a_WR_VALUE_RECEIVE), 32),
        (offset_of!(CANsync_SL_CTRL_BMSTRUCT, b_CTRLREG_RD_RDC1), 96),
        (offset_of!(CANsync_SL_CTRL_BMSTRUCT, _CFG_RDC_WORD), 100),
        (offset_of!(CANsync_SL_CTRL_BMSTRUCT, a_RD_VALUE_SEND), 116),
        (offset_of!(CANsync_SL_CTRL_BMSTRUCT, b_STATREG_RDC1), 180),
        (offset_of!(CANsync_SL_CTRL_BMSTRUCT, a_STATREG_RDC), 184),
        (offset_of!(CANsync_SL_CTRL_BMSTRUCT, a_CFG_RDC_WORD), 312),
        (offset_of!(CANsync_SL_CTRL_BMSTRUCT, a_RD_BMARRAY), 824),
        (offset_of!(CANsync_SL_CTRL_BMSTRUCT, b_STATREG_AKT_CMD), 2872),
    ];
    assert!(ends.iter().all(|(offset, expected)| offset == expected), "{ends:?}");
}

#[test]
fn snapshot_copies_every_register_and_reset_restores_it() {
    let node = CANsync_MA_CTRL_BMSTRUCT::new_zeroed();
    node.reset_from(0);
    assert_eq!(node.w_OPTION_STATUS.load(), 1);
    node.w_CPU_CONTROL.store(0x0002);
    node.a_RD_BMARRAY[31][7].store(0x1234_5678);
    node.a_DATA_PARAMETER[3].w_PAR_NR.store(121);
    node._CFG_WRC_WORD.b_CFG_WRC1_WORD0.store(0x0D);
    let copy = node.snapshot();
    assert_eq!(copy.a_RD_BMARRAY[31][7].get(), 0x1234_5678);
    assert_eq!(copy.a_DATA_PARAMETER[3].w_PAR_NR.get(), 121);
    assert_eq!(copy._CFG_WRC_WORD.b_CFG_WRC1_WORD0, 0x0D);

    node.reset_from(offset_of!(CANsync_MA_CTRL_BMSTRUCT, b_CTRLREG_WRC1));
    assert_eq!(node.w_CPU_CONTROL.load(), 0x0002);
    assert_eq!(node.a_RD_BMARRAY[31][7].load(), 0);
    assert_eq!(node._CFG_WRC_WORD.b_CFG_WRC1_WORD0.load(), 0);
}

/// Manual 5.00005.03a p. 192: the slave's application enters the error number. The firmware only sends this
/// number.
#[test]
fn error_numbers_of_up_and_downloads_are_the_masters_to_read_and_the_slaves_to_write() {
    for (name, owner) in [
        ("node2.w_ERR_NR_UPDOWNBLK1", Owner::Firmware),
        ("node1.w_ERR_NR_UPDOWNBLK1", Owner::Plc),
        ("node1.w_ERR_NR_UPDOWN_SINGLE", Owner::Plc),
    ] {
        assert_eq!(DEVICE.register(name).unwrap().owner(), owner, "{name}");
    }
}

/// 5.00005.03a p. 61: node 1 is the slave, node 2 is the master. Only the layout contains this fact.
#[test]
fn ports_are_found_by_name_and_by_number() {
    let found = DEVICE.port("node2").unwrap();
    assert_eq!((found.number, found.role(), found.area.first), (PortNumber(2), Some(Role::Master), NODE2));
    let found = DEVICE.port_numbered(PortNumber(1)).unwrap();
    assert_eq!((found.name, found.role(), found.medium), ("node1", Some(Role::Slave), "cansync"));
    assert!(DEVICE.port("baps").is_none() && DEVICE.port_numbered(PortNumber(0)).is_none());
}

/// 5.00005.03a p. 153, 181, 182 has the deadlines for 500 kbit/s; D-09 and D-26 define them for the other
/// rates.
#[test]
fn deadlines_say_where_they_are_from() {
    for rate in &BAUD_RATES {
        let documented = rate.kbit_per_s == 500;
        for deadline in [rate.deadline_WRC, rate.deadline_RDC1, rate.deadline_RDC2] {
            assert_eq!(deadline.source == Provenance::Manual, documented, "{rate:?}");
        }
        assert_eq!(rate.deadline_WRC.latest, rate.t_WRC1 - 240, "{rate:?}");
        assert_eq!(rate.deadline_RDC1.latest, rate.deadline_WRC.latest, "{rate:?}");
        let factor = 500 / u32::from(rate.kbit_per_s);
        let window = (rate.t_WRC1 + 70 * factor, rate.t_WRC1 + 270 * factor);
        assert_eq!((rate.deadline_RDC2.earliest, rate.deadline_RDC2.latest), window, "{rate:?}");
    }
}

#[test]
fn only_three_pairs_of_baud_rate_and_interval_exist() {
    let pairs = BAUD_RATES.map(|rate| (rate.kbit_per_s, rate.b_TIME_PATTERN, rate.b_BT_0, rate.t_WRC1));
    assert_eq!(pairs, [(500, 2, 0x00, 730), (250, 4, 0x01, 1430), (125, 8, 0x03, 3020)]);
}

/// The registers of the nodes are not in this list, because they have a separate watch.
#[cfg(feature = "emulator")]
#[test]
fn the_checker_watches_the_registers_of_the_board() {
    let names: Vec<_> = crate::check::with_rules(&DEVICE).map(|register| register.name()).collect();
    // `baps.w_COMMAND_REG` has reserved bits.
    for name in ["baps.w_STATUSWORD", "baps.a_RD_VALUE[7]", "ethernet.w_DIP_NR", "baps.w_COMMAND_REG"] {
        assert!(names.iter().any(|it| it == name), "{name} in {names:?}");
    }
    assert!(!names.iter().any(|name| name == "baps.w_CONTROLWORD" || name.starts_with("node")), "{names:?}");
    let offsets: Vec<_> = crate::check::with_rules(&DEVICE).map(|register| register.offset()).collect();
    assert!(offsets.is_sorted(), "each word is there once: {offsets:?}");
}
