//! Cases of registers and the header page, for every writer.

use super::Case;
use crate::rig::Rig;
use commram::check::rules;
use commram::devices::cansync;

pub(crate) const CASES: &[Case] = &[
    Case {
        rule: &rules::OWNER,
        register: "MASTER.w_OPTION_STATUS",
        value: |_| 0x0080,
        wrong: |rig| rig.master.w_OPTION_STATUS.store(0x0080),
        right: |rig| rig.master.w_CPU_CONTROL.store(0x0001),
    },
    Case {
        rule: &rules::OWNER,
        register: "MASTER.a_RD_BMARRAY[31][7]",
        value: |_| 1,
        wrong: |rig| {
            rig.activate();
            rig.master.a_RD_BMARRAY[31][7].store(1);
        },
        right: |rig| {
            rig.activate();
            rig.master.a_STATREG_RDC[31].b_STATREG_RDC1.store(0xFF);
        },
    },
    Case {
        rule: &rules::OWNER,
        register: "SLAVE.w_CONTROLWORD",
        value: |_| 7,
        wrong: |rig| {
            rig.activate();
            rig.slave.w_CONTROLWORD.store(7);
        },
        right: |rig| {
            rig.activate();
            rig.slave.b_STATREG_CONTROLWORD.store(0);
        },
    },
    Case {
        rule: &rules::RESERVED_REGISTER,
        register: "MASTER.a_WR_VALUE[8]",
        value: |_| 5,
        wrong: |rig| {
            rig.activate();
            rig.master.a_WR_VALUE[8].store(5);
        },
        right: |rig| {
            rig.activate();
            rig.master.a_WR_VALUE[7].store(5);
        },
    },
    Case {
        rule: &rules::RESERVED_BIT,
        register: "MASTER.a_CFG_RDC_WORD[3].b_CFG_RDC1_WORD0",
        value: |_| 0x41,
        wrong: |rig| {
            rig.activate();
            rig.master.a_CFG_RDC_WORD[3].b_CFG_RDC1_WORD0.store(0x41);
        },
        right: |rig| {
            rig.activate();
            rig.master.a_CFG_RDC_WORD[3].b_CFG_RDC1_WORD0.store(0x01);
        },
    },
    Case {
        rule: &rules::RESERVED_VALUE,
        register: "MASTER.b_CMD_BC0",
        value: |_| 0x10,
        wrong: |rig| {
            rig.activate();
            rig.master.b_CMD_BC0.store(0x10);
        },
        right: |rig| {
            rig.activate();
            rig.master.b_CMD_BC0.store(0x80);
        },
    },
    Case {
        rule: &cansync::rules::BEFORE_INIT,
        register: "MASTER.a_WR_VALUE[0]",
        value: |_| 3,
        wrong: |rig| {
            rig.master.a_WR_VALUE[0].store(3);
            rig.initialize_master();
        },
        right: |rig| {
            rig.initialize_master();
            rig.master.a_WR_VALUE[0].store(3);
        },
    },
    Case {
        rule: &cansync::rules::AFTER_INIT,
        register: "MASTER.b_CTRLREG_WRC5",
        value: |rate| rate.timing.b_BT_1.into(),
        wrong: |rig| {
            rig.initialize_master();
            rig.master_init.b_BT_1.store(rig.rate.timing.b_BT_1);
        },
        right: |rig| {
            rig.initialize_master();
            rig.master_init.w_CPU_CONTROL.store(0x0000);
            rig.step(500);
            rig.master_init.b_BT_1.store(0x00);
        },
    },
    Case {
        rule: &rules::RESERVED_REGISTER,
        // 5.02066.01a p. 51, 5.00005.03a p. 151: the registers of channels 3 to 8 share their addresses with
        // initialization data.
        register: "MASTER.b_CTRLREG_WRC3",
        value: |_| 0x05,
        wrong: |rig| {
            rig.activate();
            rig.master.b_CTRLREG_WRC3.store(0x05);
        },
        right: |rig| {
            rig.activate();
            rig.master.b_CTRLREG_WRC2.store(0x04);
        },
    },
    Case {
        rule: &rules::RESERVED_REGISTER,
        register: "MASTER._CFG_WRC_WORD.b_CFG_WRC3_WORD0",
        value: |_| 0x01,
        wrong: |rig| {
            rig.set_up();
            rig.master._CFG_WRC_WORD.b_CFG_WRC3_WORD0.store(0x01);
        },
        right: |rig| {
            rig.set_up();
            rig.master._CFG_WRC_WORD.b_CFG_WRC2_WORD0.store(0x01);
        },
    },
    Case {
        rule: &rules::HEADER,
        register: "header.sync_counter",
        value: |_| 77,
        wrong: |rig| header(rig, |header| header.sync_counter[0].store(77)),
        right: |rig| {
            header(rig, |header| {
                header.doorbell.ring();
                header.board.dip.store(3);
                header.board.switch.store(1);
            });
        },
    },
];

fn header(rig: &mut Rig, write: fn(&commram::memory::Header)) {
    rig.step(500);
    write(&rig.plant.devices()[0].segment().header().unwrap());
}
