//! Cases of registers and the header page, whoever writes them.

use super::{Case, baps};
use crate::rig::Rig;
use commram::check::rules;
use commram::devices::cansync;
use commram::devices::omega_drive_line_2 as omega;
use commram::devices::omega_drive_line_2::registers::*;

pub(crate) const CASES: &[Case] = &[
    Case {
        rule: &omega::rules::IP_ADDRESS,
        register: "ethernet_config.a_IP_ADDRESS[3]",
        value: 255,
        wrong: |rig| store_ip_config(rig, 255),
        right: |rig| store_ip_config(rig, 7),
    },
    Case {
        rule: &rules::OWNER,
        register: "node2.w_OPTION_STATUS",
        value: 0x0080,
        wrong: |rig| rig.master.w_OPTION_STATUS.store(0x0080),
        right: |rig| rig.master.w_CPU_CONTROL.store(0x0001),
    },
    Case {
        rule: &rules::OWNER,
        register: "node2.a_RD_BMARRAY[31][7]",
        value: 1,
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
        register: "node1.w_CONTROLWORD",
        value: 7,
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
        rule: &rules::OWNER,
        register: "baps.w_STATUSWORD",
        value: 0x1234,
        wrong: |rig| baps(rig).w_STATUSWORD.store(0x1234),
        right: |rig| baps(rig).w_CONTROLWORD.store(0x1234),
    },
    Case {
        rule: &rules::RESERVED_REGISTER,
        register: "node2.a_WR_VALUE[8]",
        value: 5,
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
        register: "node2.a_CFG_RDC_WORD[3].b_CFG_RDC1_WORD0",
        value: 0x41,
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
        register: "node2.b_CMD_BC0",
        value: 0x10,
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
        register: "node2.a_WR_VALUE[0]",
        value: 3,
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
        register: "node2.b_CTRLREG_WRC5",
        value: 0x1C,
        wrong: |rig| {
            rig.initialize_master();
            rig.master_init.b_BT_1.store(0x1C);
        },
        right: |rig| {
            rig.initialize_master();
            rig.master_init.w_CPU_CONTROL.store(0x0000);
            rig.step(500);
            rig.master_init.b_BT_1.store(0x00);
        },
    },
    Case {
        rule: &rules::HEADER,
        register: "header.sync_counter",
        value: 77,
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

/// Stores a fixed IP address of PLC `a` that ends in `last` (manual p. 79).
fn store_ip_config(rig: &mut Rig, last: u8) {
    let segment = rig.plant.devices()[0].segment();
    let config = segment.view::<ETHERNET_CONFIG_BMSTRUCT>(ETHERNET_CONFIG).unwrap();
    config.a_IP_ADDRESS.iter().zip([192, 168, 75, last]).for_each(|(cell, byte)| cell.store(byte));
    config.a_IP_MASK.iter().zip([255, 255, 255, 0]).for_each(|(cell, byte)| cell.store(byte));
    config.d_IP_CONFIG.store(0x1234_5678);
}
