//! Cases of starting up: commands, initialization data, rates and what the drives must be set to.

use super::Case;
use crate::rig::{Memory, OMEGA_RATES, Rate, Rig, write_init_data};
use commram::devices::cansync;
use commram::devices::omega_drive_line_2::registers::*;
use commram::journal::Rule;

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
        rule: &cansync::rules::CLUSTER_BAUD_RATE,
        register: "node2.b_BT_0",
        value: 0x01,
        wrong: |rig| cluster(rig, OMEGA_RATES[1]),
        right: |rig| cluster(rig, OMEGA_RATES[0]),
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
];

fn take_over_init_data(rig: &mut Rig, change: fn(&CANsync_INIT_BMSTRUCT)) {
    let init = rig.master_init.clone();
    init.w_CPU_CONTROL.store(0x0001);
    rig.step(500);
    write_init_data(&init, rig.rate.timing, 0);
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

/// Node 2 of the PLC that is a slave at 500 kbit/s takes its SYNC signal over, at `rate`.
fn cluster(rig: &mut Rig, rate: Rate) {
    rig.set_up();
    let init = rig.plant.devices()[1].segment().view::<CANsync_INIT_BMSTRUCT>(NODE2).unwrap();
    init.w_CPU_CONTROL.store(0x0001);
    rig.step(500);
    write_init_data(&init, rate.timing, 0x02);
    init.w_CPU_CONTROL.store(0x0002);
    rig.step(500);
    init.w_CPU_CONTROL.store(0x0020);
    rig.step(10_000);
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
