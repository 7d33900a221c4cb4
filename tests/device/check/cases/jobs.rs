//! Cases of jobs: parameters, control words and blocks.

use super::Case;
use crate::rig::Rig;
use commram::devices::cansync;
use commram::devices::omega_drive_line_2::registers::*;
use commram::identity::DeviceIndex;
use commram::memory::Width;
use core::mem::offset_of;

pub(crate) const CASES: &[Case] = &[
    Case {
        rule: &cansync::rules::NEVER_POLLED,
        register: "MASTER.a_CTRLREG_PAR_CMD_SL[3].b_STEUREG_PAR_CMD",
        value: |_| 0x03,
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
        register: "MASTER.a_STEUREG_CONTROLWORD[1]",
        value: |_| 0x05,
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
        register: "MASTER.b_STEUREG_UPDOWNBLK1",
        value: |_| 0x15,
        wrong: |rig| enter_download(rig, 2, 1),
        right: |rig| enter_download(rig, 2, 2),
    },
    Case {
        rule: &cansync::rules::NOT_POLLED,
        register: "MASTER.a_STEUREG_CONTROLWORD[1]",
        value: |_| 0x05,
        wrong: |rig| {
            rig.activate();
            rig.master.b_SL_NR_CONTROLWORD.store(2);
            rig.master.a_STEUREG_CONTROLWORD[1].store(0x05);
        },
        // If both stores are between two runs of the firmware, the checker does not know their order, and reports
        // nothing.
        right: |rig| {
            rig.activate();
            rig.master.a_STEUREG_CONTROLWORD[1].store(0x05);
            rig.master.b_SL_NR_CONTROLWORD.store(1);
        },
    },
    Case {
        rule: &cansync::rules::REQUEST_DATA_CHANGED,
        register: "MASTER.a_CONTROLWORD_SL[1]",
        value: |_| 0x000F,
        wrong: |rig| {
            rig.activate();
            rig.master.b_SL_NR_CONTROLWORD.store(1);
            rig.master.a_STEUREG_CONTROLWORD[1].store(0x05);
            rig.step(100);
            rig.master.a_CONTROLWORD_SL[1].store(0x000F);
        },
        right: |rig| {
            rig.activate();
            rig.master.b_SL_NR_CONTROLWORD.store(1);
            rig.master.a_CONTROLWORD_SL[1].store(0x000F);
            rig.step(100);
            rig.master.a_STEUREG_CONTROLWORD[1].store(0x05);
        },
    },
    Case {
        rule: &cansync::rules::REQUEST_DATA_CHANGED,
        register: "MASTER.w_DATA_WORD_BC1",
        value: |_| 7,
        wrong: |rig| {
            rig.activate();
            rig.master.b_CTRL_REG_BC1.store(0x05);
            rig.step(100);
            rig.master.w_DATA_WORD_BC1.store(7);
        },
        right: |rig| {
            rig.activate();
            rig.master.w_DATA_WORD_BC1.store(7);
            rig.step(100);
            rig.master.b_CTRL_REG_BC1.store(0x05);
        },
    },
    Case {
        rule: &cansync::rules::ORDER,
        register: "MASTER.a_CTRLREG_PAR_CMD_SL[0].b_STEUREG_PAR_CMD",
        value: |_| 0x05,
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
        register: "SLAVE.b_STEUREG_PAR_CMD",
        value: |_| 0x42,
        wrong: |rig| answer_parameter(rig, |slave| slave.b_STEUREG_PAR_CMD.store(0x42)),
        right: |rig| {
            answer_parameter(rig, |slave| {
                slave.b_STATREG_PAR_CMD.store(0x42);
                slave.b_STEUREG_PAR_CMD.store(0x42);
            });
        },
    },
    Case {
        rule: &cansync::rules::ORDER,
        register: "SLAVE.b_STEUREG_PAR_CMD",
        value: |_| 0x52,
        wrong: |rig| answer_parameter(rig, |slave| slave.b_STEUREG_PAR_CMD.store(0x52)),
        // An answer that changes only the format bit does not end the job.
        right: |rig| {
            answer_parameter(rig, |slave| {
                slave.b_STATREG_PAR_CMD.store(0x52);
                slave.b_STEUREG_PAR_CMD.store(0x53);
            });
            rig.step(100);
            rig.slave.b_STEUREG_PAR_CMD.store(0x52);
        },
    },
    Case {
        rule: &cansync::rules::JOB_CHANGED,
        register: "MASTER.a_DATA_PARAMETER[0].w_PAR_NR",
        value: |_| 9,
        wrong: |rig| {
            parameter_under_way(rig);
            rig.master.a_DATA_PARAMETER[0].w_PAR_NR.store(9);
        },
        // The program cancels the job as in D-11; after that it may change the data.
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
        register: "MASTER.a_DATA_UPDOWNBLK1[74]",
        value: |_| 1,
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
    // A different command changes the job; the program may change the other bits of the register.
    Case {
        rule: &cansync::rules::JOB_CHANGED,
        register: "MASTER.a_CTRLREG_PAR_CMD_SL[0].b_STEUREG_PAR_CMD",
        value: |_| 0x1D,
        wrong: |rig| {
            parameter_under_way(rig);
            rig.master.a_CTRLREG_PAR_CMD_SL[0].b_STEUREG_PAR_CMD.store(0x1D);
        },
        right: |rig| {
            parameter_under_way(rig);
            rig.master.a_CTRLREG_PAR_CMD_SL[0].b_STEUREG_PAR_CMD.store(0x0D);
        },
    },
    // Describes a case. For a write through the channel the checker also has the previous value.
    Case {
        rule: &cansync::rules::JOB_CHANGED,
        register: "MASTER.a_CTRLREG_PAR_CMD_SL[0].b_STEUREG_PAR_CMD",
        value: |_| 0x1D,
        wrong: |rig| {
            parameter_under_way(rig);
            store_by_channel(rig, 0x1D);
        },
        right: |rig| {
            parameter_under_way(rig);
            store_by_channel(rig, 0x0D);
        },
    },
    Case {
        rule: &cansync::rules::JOB_REPLACED,
        register: "MASTER.a_CTRLREG_PAR_CMD_SL[0].b_STEUREG_PAR_CMD",
        value: |_| 0x05,
        wrong: |rig| {
            parameter_under_way(rig);
            enter_parameter(rig, 0, 0x05);
        },
        right: |rig| {
            parameter_under_way(rig);
            rig.master.a_CTRLREG_PAR_CMD_SL[0].b_STEUREG_PAR_CMD.store(0);
            rig.step(100);
            enter_parameter(rig, 0, 0x05);
            // A program may still change a job that has not been sent.
            rig.step(100);
            enter_parameter(rig, 0, 0x03);
        },
    },
];

fn enter_parameter(rig: &mut Rig, slave: usize, command: u8) {
    let job = &rig.master.a_CTRLREG_PAR_CMD_SL[slave];
    job.b_STATREG_PAR_CMD.store(command);
    job.b_STEUREG_PAR_CMD.store(command);
}

/// Stores a command in the control register of the parameter job for slave 0, through the channel.
fn store_by_channel(rig: &mut Rig, command: u32) {
    let register = offset_of!(CANsync_MA_CTRL_BMSTRUCT, a_CTRLREG_PAR_CMD_SL)
        + offset_of!(CTRLREG_PAR_CMD_SL, b_STEUREG_PAR_CMD);
    let at = rig.master_at;
    rig.plant.store(DeviceIndex::at(at.plc), at.base + register as u32, Width::Byte, command).unwrap();
}

/// Enters a write job for slave 0, which the slave's application does not answer yet.
fn parameter_under_way(rig: &mut Rig) {
    rig.activate();
    rig.master.a_DATA_PARAMETER[0].w_PAR_NR.store(8);
    enter_parameter(rig, 0, 0x05);
    rig.run_to_sync();
    rig.step(100);
    assert_eq!(rig.master.a_CTRLREG_PAR_CMD_SL[0].b_STEUREG_PAR_CMD.load(), 0x0D);
}

/// Brings a read job to the application of the slave, which clears bit 0 by `answer`.
fn answer_parameter(rig: &mut Rig, answer: fn(&CANsync_SL_CTRL_BMSTRUCT)) {
    rig.activate();
    enter_parameter(rig, 0, 0x03);
    rig.run_to_sync();
    rig.step(500);
    assert_eq!(rig.slave.b_STEUREG_PAR_CMD.load(), 0x43);
    answer(&rig.slave);
}

/// Enters a download of 300 bytes to `slave`, while the master polls slaves 0 to `max`.
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
