//! A plant with everything switched on: the bus in active operation, all channels configured.

use commram::devices::omega_drive_line_2::registers::{
    CANsync_INIT_BMSTRUCT, CANsync_MA_CTRL_BMSTRUCT, NODE2,
};
use commram::memory::{Segment, View};
use std::ops::RangeInclusive;

/// Takes node 2 from restart to active operation at 500 kbit/s, with both reference value and both actual
/// value channels configured and the slaves `slaves` asked in turn. `advance` lets emulated time pass, in
/// microseconds.
pub(crate) fn activate(
    segment: &Segment,
    slaves: RangeInclusive<u8>,
    mut advance: impl FnMut(u64),
) -> View<CANsync_MA_CTRL_BMSTRUCT> {
    let init = segment.view::<CANsync_INIT_BMSTRUCT>(NODE2).expect("node 2 is there");
    let master = segment.view::<CANsync_MA_CTRL_BMSTRUCT>(NODE2).expect("node 2 is there");

    init.w_CPU_CONTROL.store(0x0001);
    advance(1000);
    init.b_BT_1.store(0x1C);
    init.b_TIME_PATTERN.store(2);
    init.b_AC.store(0xFF);
    init.b_AM.store(0xFF);
    for number in slaves.clone() {
        init.a_SL_TYP[usize::from(number)].store(1);
    }
    for command in [0x0002, 0x0020] {
        init.w_CPU_CONTROL.store(command);
        advance(1000);
    }
    let cfg = &master._CFG_WRC_WORD;
    for (cell, byte) in [
        (&cfg.b_CFG_WRC1_WORD0, 0x01),
        (&cfg.b_CFG_WRC1_WORD1, 0x03),
        (&cfg.b_CFG_WRC1_WORD2, 0x05),
        (&cfg.b_CFG_WRC1_WORD3, 0x07),
        (&cfg.b_CFG_WRC2_WORD0, 0x11),
        (&cfg.b_CFG_WRC2_WORD1, 0x13),
        (&cfg.b_CFG_WRC2_WORD2, 0x15),
        (&cfg.b_CFG_WRC2_WORD3, 0x17),
    ] {
        cell.store(byte);
    }
    for slave in &master.a_CFG_RDC_WORD {
        slave.b_CFG_RDC1_WORD0.store(0x01);
        slave.b_CFG_RDC1_WORD1.store(0x03);
        slave.b_CFG_RDC2_WORD0.store(0x11);
        slave.b_CFG_RDC2_WORD1.store(0x13);
    }
    master.b_MAX_SL_NR.store(*slaves.end());
    // Ask the slaves in turn.
    master.b_CTRLREG_RD_ORDER_RDC1.store(0x80);
    master.b_CTRLREG_RD_ORDER_RDC2.store(0x80);
    // Let all drives lock, then enable.
    advance(2_000_000);
    init.w_CPU_CONTROL.store(0x0040);
    advance(1000);
    assert_eq!(init.w_OPTION_STATUS.load(), 0x0080, "the master is active");
    master
}
