//! Cases of process data: contents of the frames, the polled slave, and the time of their release.

use super::Case;
use crate::rig::Rig;
use commram::devices::cansync;

pub(crate) const CASES: &[Case] = &[
    Case {
        rule: &cansync::rules::VALUE_NUMBER,
        register: "MASTER._CFG_WRC_WORD.b_CFG_WRC1_WORD2",
        value: |_| 0x21,
        wrong: |rig| {
            rig.activate();
            rig.configure_wrc1([0, 0, 0x21, 0]); // value 8
        },
        right: |rig| {
            rig.activate();
            rig.configure_wrc1([0, 0, 0x1D, 0]); // value 7
        },
    },
    Case {
        rule: &cansync::rules::VALUE_NUMBER,
        register: "SLAVE.a_CFG_RDC_WORD[9].b_CFG_RDC2_WORD3",
        value: |_| 0x3F,
        wrong: |rig| {
            rig.activate();
            rig.slave.a_CFG_RDC_WORD[9].b_CFG_RDC2_WORD3.store(0x3F);
        },
        right: |rig| {
            rig.activate();
            rig.slave.a_CFG_RDC_WORD[9].b_CFG_RDC2_WORD3.store(0x1F);
        },
    },
    Case {
        rule: &cansync::rules::WORD_UNASSIGNED,
        register: "SLAVE._CFG_WRC_WORD.b_CFG_WRC1_WORD1",
        value: |_| 0x0C,
        wrong: |rig| {
            rig.activate();
            rig.slave._CFG_WRC_WORD.b_CFG_WRC1_WORD1.store(0x0C);
        },
        right: |rig| {
            rig.activate();
            rig.slave._CFG_WRC_WORD.b_CFG_WRC1_WORD1.store(0x0D);
        },
    },
    Case {
        rule: &cansync::rules::SPLIT_DOUBLEWORD,
        register: "MASTER._CFG_WRC_WORD.b_CFG_WRC1_WORD3",
        value: |_| 0x09,
        wrong: |rig| {
            rig.activate();
            rig.configure_wrc1([0x01, 0x03, 0x05, 0x09]);
            rig.master._CFG_WRC_WORD.b_CFG_WRC2_WORD0.store(0x0B);
            rig.run_to_sync();
        },
        // The program may move a value to another frame within an interval. Values 0 and 1 have separate words.
        right: |rig| {
            rig.activate();
            rig.configure_wrc1([0x01, 0x03, 0x05, 0x09]);
            rig.master._CFG_WRC_WORD.b_CFG_WRC2_WORD0.store(0x0B);
            rig.step(100);
            rig.configure_wrc1([0x01, 0x03, 0x05, 0x00]);
            rig.master._CFG_WRC_WORD.b_CFG_WRC2_WORD1.store(0x09);
            rig.run_to_sync();
        },
    },
    Case {
        rule: &cansync::rules::SPLIT_DOUBLEWORD,
        register: "SLAVE.a_CFG_RDC_WORD[9].b_CFG_RDC1_WORD1",
        value: |_| 0x09,
        wrong: |rig| {
            rig.activate();
            rig.slave.a_CFG_RDC_WORD[9].b_CFG_RDC1_WORD1.store(0x09);
            rig.slave.a_CFG_RDC_WORD[9].b_CFG_RDC2_WORD0.store(0x0B);
            rig.run_to_sync();
        },
        // One half of value 2 and one half of value 1 are two separate words.
        right: |rig| {
            rig.activate();
            rig.slave.a_CFG_RDC_WORD[9].b_CFG_RDC1_WORD1.store(0x09);
            rig.slave.a_CFG_RDC_WORD[9].b_CFG_RDC2_WORD0.store(0x07);
            rig.run_to_sync();
        },
    },
    Case {
        rule: &cansync::rules::SPLIT_DOUBLEWORD,
        register: "SLAVE._CFG_RDC_WORD.b_CFG_RDC2_WORD0",
        value: |_| 0x01,
        wrong: |rig| {
            rig.activate();
            rig.slave._CFG_RDC_WORD.b_CFG_RDC1_WORD0.store(0x03);
            rig.slave._CFG_RDC_WORD.b_CFG_RDC2_WORD0.store(0x01);
            rig.run_to_sync();
        },
        right: |rig| {
            rig.activate();
            rig.slave._CFG_RDC_WORD.b_CFG_RDC1_WORD0.store(0x03);
            rig.slave._CFG_RDC_WORD.b_CFG_RDC1_WORD3.store(0x01);
            rig.slave._CFG_RDC_WORD.b_CFG_RDC2_WORD0.store(0x01);
            rig.run_to_sync();
        },
    },
    Case {
        rule: &cansync::rules::SLAVE_NUMBER,
        register: "MASTER.b_CTRLREG_RD_ORDER_RDC2",
        value: |_| 0x81,
        wrong: |rig| {
            rig.activate();
            rig.master.b_CTRLREG_RD_ORDER_RDC2.store(0x81);
        },
        right: |rig| {
            rig.activate();
            rig.master.b_CTRLREG_RD_ORDER_RDC2.store(31);
        },
    },
    Case {
        rule: &cansync::rules::SLAVE_NUMBER,
        register: "MASTER.b_MAX_SL_NR",
        value: |_| 0x80,
        wrong: |rig| {
            rig.activate();
            rig.master.b_MAX_SL_NR.store(0x80);
        },
        right: |rig| {
            rig.activate();
            rig.master.b_MAX_SL_NR.store(31);
            rig.master.b_SL_NR_PARAMETER.store(0x80);
        },
    },
    Case {
        rule: &cansync::rules::NOT_REQUESTED,
        register: "MASTER.b_MAX_SL_NR",
        value: |_| 2,
        wrong: |rig| {
            rig.activate(); // slaves 0 to 3 are expected
            rig.master.b_MAX_SL_NR.store(2);
            rig.master.b_CTRLREG_RD_ORDER_RDC1.store(0x80);
            rig.run_to_sync();
        },
        right: |rig| {
            rig.activate();
            rig.master.b_CTRLREG_RD_ORDER_RDC1.store(0x80);
            rig.step(100);
            rig.master.b_MAX_SL_NR.store(3);
            rig.run_to_sync();
        },
    },
    Case {
        rule: &cansync::rules::LATE_REFERENCE,
        register: "MASTER.b_CTRLREG_WRC1",
        value: |_| 0x05,
        wrong: |rig| release_reference(rig, rig.rate.timing.deadline_WRC.latest + 37),
        right: |rig| release_reference(rig, rig.rate.timing.deadline_WRC.earliest - 1),
    },
    Case {
        rule: &cansync::rules::LATE_ACTUAL,
        register: "SLAVE.b_CTRLREG_RD_RDC1",
        value: |_| 0x05,
        wrong: |rig| release_actual(rig, rig.rate.timing.deadline_RDC1.latest + 10),
        right: |rig| release_actual(rig, rig.rate.timing.deadline_RDC1.earliest - 90),
    },
];

/// Releases WRC1 in time in one interval, and at this time in the next interval.
fn release_reference(rig: &mut Rig, at: u32) {
    rig.activate();
    rig.send_wrc1();
    rig.step(at.into());
    rig.master.b_CTRLREG_WRC1.store(0x05);
}

fn release_actual(rig: &mut Rig, at: u32) {
    rig.activate();
    rig.slave.b_CTRLREG_RD_RDC1.store(0x05);
    rig.run_to_sync();
    rig.step(at.into());
    rig.slave.b_CTRLREG_RD_RDC1.store(0x05);
}
