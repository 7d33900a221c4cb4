//! For each rule something that breaks it, and next to it something much alike that is right.

use crate::rig::{Memory, OMEGA_RATES, Rate, Rig, write_init_data};
use commram::check::rules;
use commram::devices::cansync;
use commram::devices::omega_drive_line_2 as omega;
use commram::devices::omega_drive_line_2::registers::*;
use commram::journal::Rule;
use commram::memory::View;

/// How a rule is broken, and how its correct neighbour goes. Both start from a fresh plant.
pub(crate) struct Case {
    pub rule: &'static Rule,
    /// Name of the register that the finding is about.
    pub register: &'static str,
    /// Value in the finding.
    pub value: u32,
    pub wrong: fn(&mut Rig),
    pub right: fn(&mut Rig),
}

/// The same plant with a drive that has this value in a parameter, its master in set-up mode.
fn set_up_with_drive(rig: &mut Rig, expected: &[&'static Rule], parameter: u16, value: u16) {
    rig.expect_errors(&[]);
    let drive = format!(
        "[[bus.drive]]\nname = 'd'\nslave_number = 1\n\
         parameters = [{{ number = {parameter}, format = 'word', initial = {value} }}]\n"
    );
    *rig = Rig::of(Memory::Heap, OMEGA_RATES[0], &drive);
    rig.expect_errors(expected);
    rig.set_up();
    rig.step(60_000);
}

pub(crate) const CASES: &[Case] = &[
    Case {
        rule: &cansync::rules::DRIVE_SYNC_SLOT,
        register: "node2.a_DATA_PARAMETER[1].d_PAR_VALUE",
        value: 1000,
        wrong: |rig| set_up_with_drive(rig, &[&cansync::rules::DRIVE_SYNC_SLOT], 167, 1000),
        right: |rig| set_up_with_drive(rig, &[], 167, 2000),
    },
    Case {
        rule: &cansync::rules::DRIVE_PWM,
        register: "node2.a_DATA_PARAMETER[1].d_PAR_VALUE",
        value: 5,
        wrong: |rig| set_up_with_drive(rig, &[], 103, 5),
        right: |rig| set_up_with_drive(rig, &[], 103, 8),
    },
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
        rule: &cansync::rules::VALUE_NUMBER,
        register: "node2._CFG_WRC_WORD.b_CFG_WRC1_WORD2",
        value: 0x21,
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
        register: "node1.a_CFG_RDC_WORD[9].b_CFG_RDC2_WORD3",
        value: 0x3F,
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
        register: "node1._CFG_WRC_WORD.b_CFG_WRC1_WORD1",
        value: 0x0C,
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
        register: "node2._CFG_WRC_WORD.b_CFG_WRC1_WORD3",
        value: 0x09,
        wrong: |rig| {
            rig.activate();
            rig.configure_wrc1([0x01, 0x03, 0x05, 0x09]);
            rig.master._CFG_WRC_WORD.b_CFG_WRC2_WORD0.store(0x0B);
            rig.run_to_sync();
        },
        // Moved from frame to frame within one interval; values 0 and 1 are words of their own.
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
        register: "node1._CFG_RDC_WORD.b_CFG_RDC2_WORD0",
        value: 0x01,
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
        rule: &cansync::rules::CLUSTER_BAUD_RATE,
        register: "node2.b_BT_0",
        value: 0x01,
        wrong: |rig| cluster(rig, OMEGA_RATES[1]),
        right: |rig| cluster(rig, OMEGA_RATES[0]),
    },
    Case {
        rule: &cansync::rules::SLAVE_NUMBER,
        register: "node2.b_CTRLREG_RD_ORDER_RDC2",
        value: 0x81,
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
        register: "node2.b_MAX_SL_NR",
        value: 0x80,
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
        rule: &cansync::rules::NEVER_POLLED,
        register: "node2.a_CTRLREG_PAR_CMD_SL[3].b_STEUREG_PAR_CMD",
        value: 0x03,
        wrong: |rig| {
            rig.activate();
            rig.master.b_MAX_SL_NR.store(2);
            rig.master.b_SL_NR_PARAMETER.store(0x80);
            enter_parameter(rig, 3, 0x03);
        },
        right: |rig| {
            rig.activate();
            rig.master.b_MAX_SL_NR.store(3);
            rig.master.b_SL_NR_PARAMETER.store(0x80);
            enter_parameter(rig, 3, 0x03);
        },
    },
    Case {
        rule: &cansync::rules::NEVER_POLLED,
        register: "node2.a_STEUREG_CONTROLWORD[1]",
        value: 0x05,
        wrong: |rig| {
            rig.activate();
            rig.master.b_SL_NR_CONTROLWORD.store(0x80);
            rig.master.a_STEUREG_CONTROLWORD[1].store(0x05);
        },
        right: |rig| {
            rig.activate();
            rig.master.b_SL_NR_CONTROLWORD.store(1);
            rig.master.a_STEUREG_CONTROLWORD[1].store(0x05);
        },
    },
    Case {
        rule: &cansync::rules::NEVER_POLLED,
        register: "node2.b_STEUREG_UPDOWNBLK1",
        value: 0x15,
        wrong: |rig| enter_download(rig, 2, 1),
        right: |rig| enter_download(rig, 2, 2),
    },
    Case {
        rule: &cansync::rules::NOT_REQUESTED,
        register: "node2.b_MAX_SL_NR",
        value: 2,
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
        rule: &cansync::rules::COMMAND,
        register: "node2.w_CPU_CONTROL",
        value: 0x0020,
        wrong: |rig| rig.master.w_CPU_CONTROL.store(0x0020),
        right: |rig| rig.set_up(),
    },
    Case {
        rule: &cansync::rules::COMMAND,
        register: "node1.w_CPU_CONTROL",
        value: 0x0013,
        wrong: |rig| {
            rig.activate();
            rig.slave.w_CPU_CONTROL.store(0x0013);
        },
        right: |rig| {
            rig.activate();
            rig.slave.w_CPU_CONTROL.store(0x00C0);
        },
    },
    Case {
        rule: &cansync::rules::LEFT_BEHIND,
        register: "node1.w_CPU_CONTROL",
        value: 0x0080,
        wrong: |rig| {
            rig.activate();
            rig.slave.w_CPU_CONTROL.store(0x0080);
        },
        right: |rig| {
            rig.activate();
            rig.slave.w_CPU_CONTROL.store(0x00C0);
        },
    },
    Case {
        rule: &cansync::rules::ORDER,
        register: "node2.a_CTRLREG_PAR_CMD_SL[0].b_STEUREG_PAR_CMD",
        value: 0x05,
        wrong: |rig| {
            rig.activate();
            rig.master.a_CTRLREG_PAR_CMD_SL[0].b_STEUREG_PAR_CMD.store(0x05);
            rig.step(100);
            rig.master.a_CTRLREG_PAR_CMD_SL[0].b_STATREG_PAR_CMD.store(0x05);
        },
        right: |rig| {
            rig.activate();
            rig.master.a_CTRLREG_PAR_CMD_SL[0].b_STATREG_PAR_CMD.store(0x05);
            rig.step(100);
            rig.master.a_CTRLREG_PAR_CMD_SL[0].b_STEUREG_PAR_CMD.store(0x05);
        },
    },
    Case {
        rule: &cansync::rules::ORDER,
        register: "node1.b_STEUREG_PAR_CMD",
        value: 0x42,
        wrong: |rig| answer_parameter(rig, |slave| slave.b_STEUREG_PAR_CMD.store(0x42)),
        right: |rig| {
            answer_parameter(rig, |slave| {
                slave.b_STATREG_PAR_CMD.store(0x42);
                slave.b_STEUREG_PAR_CMD.store(0x42);
            });
        },
    },
    Case {
        rule: &cansync::rules::JOB_CHANGED,
        register: "node2.a_DATA_PARAMETER[0].w_PAR_NR",
        value: 9,
        wrong: |rig| {
            parameter_under_way(rig);
            rig.master.a_DATA_PARAMETER[0].w_PAR_NR.store(9);
        },
        // Given up as D-11 says; then the data are free.
        right: |rig| {
            parameter_under_way(rig);
            rig.master.a_CTRLREG_PAR_CMD_SL[0].b_STEUREG_PAR_CMD.store(0);
            rig.master.a_DATA_PARAMETER[0].w_PAR_NR.store(9);
            rig.step(100);
            rig.master.a_DATA_PARAMETER[0].w_PAR_NR.store(10);
        },
    },
    Case {
        rule: &cansync::rules::JOB_CHANGED,
        register: "node2.a_DATA_UPDOWNBLK1[74]",
        value: 1,
        wrong: |rig| {
            enter_download(rig, 0, 0);
            rig.run_to_sync();
            rig.master.a_DATA_UPDOWNBLK1[74].store(1);
        },
        right: |rig| {
            enter_download(rig, 0, 0);
            rig.run_to_sync();
            rig.master.b_STATREG_UPDOWNBLK1.update(|value| value | 0x80);
            rig.master.b_STEUREG_UPDOWNBLK1.update(|value| value | 0x80);
            rig.run_to_sync();
            rig.master.a_DATA_UPDOWNBLK1[74].store(1);
        },
    },
    Case {
        rule: &cansync::rules::JOB_REPLACED,
        register: "node2.a_CTRLREG_PAR_CMD_SL[0].b_STEUREG_PAR_CMD",
        value: 0x05,
        wrong: |rig| {
            parameter_under_way(rig);
            enter_parameter(rig, 0, 0x05);
        },
        right: |rig| {
            parameter_under_way(rig);
            rig.master.a_CTRLREG_PAR_CMD_SL[0].b_STEUREG_PAR_CMD.store(0);
            rig.step(100);
            enter_parameter(rig, 0, 0x05);
        },
    },
    Case {
        rule: &cansync::rules::LATE_REFERENCE,
        register: "node2.b_CTRLREG_WRC1",
        value: 0x05,
        wrong: |rig| release_reference(rig, 490 + 37),
        right: |rig| release_reference(rig, 489),
    },
    Case {
        rule: &cansync::rules::LATE_ACTUAL,
        register: "node1.b_CTRLREG_RD_RDC1",
        value: 0x05,
        wrong: |rig| release_actual(rig, 500),
        right: |rig| release_actual(rig, 400),
    },
    Case {
        rule: &cansync::rules::INIT_MODE,
        register: "node2.b_MA_SL_MODE",
        value: 1,
        wrong: |rig| take_over_init_data(rig, |init| init.b_MA_SL_MODE.store(1)),
        right: |rig| take_over_init_data(rig, |init| init.b_MA_SL_MODE.store(2)),
    },
    Case {
        rule: &cansync::rules::INIT_BAUD_RATE,
        register: "node2.b_BT_0",
        value: 2,
        wrong: |rig| take_over_init_data(rig, |init| init.b_BT_0.store(2)),
        right: |rig| take_over_init_data(rig, |_| ()),
    },
    Case {
        rule: &cansync::rules::INIT_INTERVAL,
        register: "node2.b_TIME_PATTERN",
        value: 2,
        wrong: |rig| take_over_init_data(rig, |init| init.b_BT_0.store(1)),
        right: |rig| {
            take_over_init_data(rig, |init| {
                init.b_BT_0.store(1);
                init.b_TIME_PATTERN.store(4);
            });
        },
    },
    Case {
        rule: &cansync::rules::INIT_CONTROLLER,
        register: "node2.b_CLOCK_DIVIDER",
        value: 0,
        wrong: |rig| take_over_init_data(rig, |init| init.b_CLOCK_DIVIDER.store(0)),
        right: |rig| take_over_init_data(rig, |init| init.b_AM.store(0)),
    },
    Case {
        rule: &cansync::rules::BUS_BAUD_RATE,
        register: "node1.b_BT_0",
        value: 0,
        wrong: |rig| start_both(rig, [1, 0]),
        right: |rig| start_both(rig, [0, 0]),
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

fn enter_parameter(rig: &mut Rig, slave: usize, command: u8) {
    let job = &rig.master.a_CTRLREG_PAR_CMD_SL[slave];
    job.b_STATREG_PAR_CMD.store(command);
    job.b_STEUREG_PAR_CMD.store(command);
}

/// A write job for slave 0 that its application has not answered yet.
fn parameter_under_way(rig: &mut Rig) {
    rig.activate();
    rig.master.a_DATA_PARAMETER[0].w_PAR_NR.store(8);
    enter_parameter(rig, 0, 0x05);
    rig.run_to_sync();
    rig.step(100);
    assert_eq!(rig.master.a_CTRLREG_PAR_CMD_SL[0].b_STEUREG_PAR_CMD.load(), 0x0D);
}

/// The slave's application meets a read job and clears bit 0 by `answer`.
fn answer_parameter(rig: &mut Rig, answer: fn(&CANsync_SL_CTRL_BMSTRUCT)) {
    rig.activate();
    enter_parameter(rig, 0, 0x03);
    rig.run_to_sync();
    rig.step(500);
    assert_eq!(rig.slave.b_STEUREG_PAR_CMD.load(), 0x43);
    answer(&rig.slave);
}

/// A download of 300 bytes to `slave`, while slaves 0 to `max` are polled.
fn enter_download(rig: &mut Rig, slave: u8, max: u8) {
    rig.activate();
    rig.master.b_MAX_SL_NR.store(max);
    rig.master.b_SL_NR_UPDOWN.store(0x80);
    rig.master.b_SL_NR_UPDOWNBLK1.store(slave);
    rig.master.d_BASE_ADR_UPDOWNBLK1.store(0x100);
    rig.master.w_LENGTH_UPDOWNBLK1.store(300);
    rig.master.b_STATREG_UPDOWNBLK1.store(0x15);
    rig.master.b_STEUREG_UPDOWNBLK1.store(0x15);
}

/// One interval in time, then one in which WRC1 is released at this time.
fn release_reference(rig: &mut Rig, at: u64) {
    rig.activate();
    rig.send_wrc1();
    rig.step(at);
    rig.master.b_CTRLREG_WRC1.store(0x05);
}

fn release_actual(rig: &mut Rig, at: u64) {
    rig.activate();
    rig.slave.b_CTRLREG_RD_RDC1.store(0x05);
    rig.run_to_sync();
    rig.step(at);
    rig.slave.b_CTRLREG_RD_RDC1.store(0x05);
}

fn take_over_init_data(rig: &mut Rig, change: fn(&CANsync_INIT_BMSTRUCT)) {
    let init = rig.master_init.clone();
    init.w_CPU_CONTROL.store(0x0001);
    rig.step(500);
    write_init_data(&init, rig.rate, 0);
    change(&init);
    init.w_CPU_CONTROL.store(0x0002);
    rig.step(500);
}

/// Starts master and slave at these rates.
fn start_both(rig: &mut Rig, [master, slave]: [usize; 2]) {
    rig.rate = OMEGA_RATES[master];
    rig.initialize_master();
    rig.rate = OMEGA_RATES[slave];
    rig.initialize_slave();
    rig.master.w_CPU_CONTROL.store(0x0020);
    rig.step(500);
    rig.slave.w_CPU_CONTROL.store(0x0020);
    rig.step(500);
}

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

/// BAPS registers of PLC `a`, at whose drive the clock has been running.
pub(crate) fn baps(rig: &mut Rig) -> View<BAPS_CTRL_BMSTRUCT> {
    rig.step(5000);
    rig.plant.devices()[0].segment().view(BAPS).unwrap()
}

/// Node 2 of the PLC that is a slave at 500 kbit/s takes its SYNC signal over, at `rate`.
fn cluster(rig: &mut Rig, rate: Rate) {
    rig.set_up();
    let init = rig.plant.devices()[1].segment().view::<CANsync_INIT_BMSTRUCT>(NODE2).unwrap();
    init.w_CPU_CONTROL.store(0x0001);
    rig.step(500);
    write_init_data(&init, rate, 0x02);
    init.w_CPU_CONTROL.store(0x0002);
    rig.step(500);
    init.w_CPU_CONTROL.store(0x0020);
    rig.step(10_000);
}
