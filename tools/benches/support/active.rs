//! A plant with everything switched on: the bus in active operation, all channels configured.

#[path = "../../../tests/rig/bring_up.rs"]
#[allow(dead_code, reason = "tests use more of it")]
mod bring_up;

use bring_up::{Mode, Node, Stage, bring_up};
use commram::devices::omega_drive_line_2::registers::{BAUD_RATES, CANsync_MA_CTRL_BMSTRUCT, NODE2};
use commram::memory::{Segment, View};
use std::ops::RangeInclusive;

/// Takes node 2 from restart to active operation at 500 kbit/s, with both reference value and both actual value
/// channels configured and the slaves `slaves` polled one after the other. `advance` advances the clock by a number of
/// microseconds.
pub(crate) fn activate(
    segment: &Segment,
    slaves: RangeInclusive<u8>,
    mut advance: impl FnMut(u64),
) -> View<CANsync_MA_CTRL_BMSTRUCT> {
    let last = *slaves.end();
    let expected = usize::from(*slaves.start())..usize::from(last) + 1;
    let node = Node::at(segment, NODE2, &BAUD_RATES[0], Mode::Master).expecting(expected);
    let master = segment.view::<CANsync_MA_CTRL_BMSTRUCT>(NODE2).expect("node 2 is there");
    // In real time, a write may come directly after a poll of the firmware. The firmware then reads the written value
    // only one cycle later, so this waits for two cycles' time.
    let mut pass = |us| advance(2 * us);
    bring_up(&[&node], ..=Stage::SetUp, &mut pass);
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
    master.b_MAX_SL_NR.store(last);
    // The master requests the actual values of the slaves in turn.
    master.b_CTRLREG_RD_ORDER_RDC1.store(0x80);
    master.b_CTRLREG_RD_ORDER_RDC2.store(0x80);
    // Waits until all drives are locked, then enables them.
    pass(1_000_000);
    bring_up(&[&node], Stage::Active.., &mut pass);
    master
}
