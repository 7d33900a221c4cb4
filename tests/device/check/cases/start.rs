//! Cases of starting up: commands, initialization data, rates and required settings of the drives.

use super::Case;
use crate::rig::bring_up::{Mode, Node, Stage};
use crate::rig::{Memory, Rate, Rig};
use commram::devices::cansync;
use commram::devices::cansync::registers::CANsync_INIT_BMSTRUCT;
use commram::journal::Rule;

pub(crate) const CASES: &[Case] = &[
    Case {
        rule: &cansync::rules::DRIVE_SYNC_SLOT,
        register: "MASTER.a_DATA_PARAMETER[1].d_PAR_VALUE",
        value: |rate| other_slot(rate).into(),
        wrong: |rig| {
            set_up_with_drive(rig, &[&cansync::rules::DRIVE_SYNC_SLOT], 167, other_slot(rig.rate));
        },
        right: |rig| set_up_with_drive(rig, &[], 167, rig.rate.interval_us as u16),
    },
    // In this case the master never polls the drive. The drive receives the command for SYNC mode like all other
    // drives.
    Case {
        rule: &cansync::rules::DRIVE_SYNC_SLOT,
        register: "MASTER.a_DATA_PARAMETER[5].d_PAR_VALUE",
        value: |rate| other_slot(rate).into(),
        wrong: |rig| {
            let slot = other_slot(rig.rate);
            set_up_with_slave(rig, 5, &[&cansync::rules::DRIVE_SYNC_SLOT], 167, slot);
        },
        right: |rig| set_up_with_slave(rig, 5, &[], 167, rig.rate.interval_us as u16),
    },
    Case {
        rule: &cansync::rules::DRIVE_BAUD_RATE,
        register: "slave1",
        value: |rate| rate.slower().kbit_s.into(),
        wrong: |rig| drive_at(rig, &[&cansync::rules::DRIVE_BAUD_RATE], rig.rate.slower().kbit_s),
        right: |rig| drive_at(rig, &[], rig.rate.kbit_s),
    },
    Case {
        rule: &cansync::rules::DRIVE_PWM,
        register: "MASTER.a_DATA_PARAMETER[1].d_PAR_VALUE",
        value: |_| 5,
        wrong: |rig| set_up_with_drive(rig, &[], 103, 5),
        right: |rig| set_up_with_drive(rig, &[], 103, 8),
    },
    Case {
        rule: &cansync::rules::DRIVE_SYNC_OFFSET,
        register: "MASTER.a_DATA_PARAMETER[1].d_PAR_VALUE",
        value: |_| 100,
        wrong: |rig| set_up_with_drive(rig, &[], 168, 100),
        right: |rig| set_up_with_drive(rig, &[], 168, 0),
    },
    Case {
        rule: &cansync::rules::CLUSTER_BAUD_RATE,
        register: "MASTER.b_BT_0",
        value: |rate| rate.slower().timing.b_BT_0.into(),
        wrong: |rig| cluster(rig, rig.rate.slower()),
        right: |rig| cluster(rig, rig.rate),
    },
    // The PLC has no slave node that could receive a signal to be passed on.
    Case {
        rule: &cansync::rules::NO_SYNC_IN,
        register: "MASTER.b_MA_SL_MODE",
        value: |_| 0x02,
        wrong: |rig| {
            let node = Node { mode: Mode::SyncIn, ..rig.master_node() };
            rig.bring_up(&[&node], ..=Stage::SetUp);
        },
        right: |rig| rig.bring_up(&[&rig.master_node()], ..=Stage::SetUp),
    },
    Case {
        rule: &cansync::rules::COMMAND,
        register: "MASTER.w_CPU_CONTROL",
        value: |_| 0x0020,
        wrong: |rig| rig.master.w_CPU_CONTROL.store(0x0020),
        right: |rig| rig.set_up(),
    },
    Case {
        rule: &cansync::rules::COMMAND,
        register: "SLAVE.w_CPU_CONTROL",
        value: |_| 0x0013,
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
        register: "SLAVE.w_CPU_CONTROL",
        value: |_| 0x0080,
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
        register: "MASTER.b_MA_SL_MODE",
        value: |_| 1,
        wrong: |rig| take_over_init_data(rig, |init, _| init.b_MA_SL_MODE.store(1)),
        right: |rig| take_over_init_data(rig, |init, _| init.b_MA_SL_MODE.store(2)),
    },
    Case {
        rule: &cansync::rules::INIT_BAUD_RATE,
        register: "MASTER.b_BT_0",
        value: |_| 2,
        wrong: |rig| take_over_init_data(rig, |init, _| init.b_BT_0.store(2)),
        right: |rig| take_over_init_data(rig, |_, _| ()),
    },
    Case {
        rule: &cansync::rules::INIT_INTERVAL,
        register: "MASTER.b_TIME_PATTERN",
        value: |rate| rate.timing.b_TIME_PATTERN.into(),
        wrong: |rig| {
            take_over_init_data(rig, |init, rate| init.b_BT_0.store(rate.slower().timing.b_BT_0));
        },
        right: |rig| {
            take_over_init_data(rig, |init, rate| {
                init.b_BT_0.store(rate.slower().timing.b_BT_0);
                init.b_TIME_PATTERN.store(rate.slower().timing.b_TIME_PATTERN);
            });
        },
    },
    Case {
        rule: &cansync::rules::INIT_CONTROLLER,
        register: "MASTER.b_CLOCK_DIVIDER",
        value: |_| 0,
        wrong: |rig| take_over_init_data(rig, |init, _| init.b_CLOCK_DIVIDER.store(0)),
        right: |rig| take_over_init_data(rig, |init, _| init.b_AM.store(0)),
    },
    Case {
        rule: &cansync::rules::BUS_BAUD_RATE,
        register: "SLAVE.b_BT_0",
        value: |rate| rate.timing.b_BT_0.into(),
        wrong: |rig| start_both(rig, [rig.rate.slower(), rig.rate]),
        right: |rig| start_both(rig, [rig.rate; 2]),
    },
];

fn take_over_init_data(rig: &mut Rig, change: fn(&CANsync_INIT_BMSTRUCT, Rate)) {
    let node = rig.master_node();
    rig.bring_up(&[&node], ..=Stage::WaitingForInit);
    node.write_init_data();
    change(&node.init, rig.rate);
    node.init.w_CPU_CONTROL.store(Stage::WaitingForStart.command());
    rig.step(500);
}

/// Starts master and slave at these rates.
fn start_both(rig: &mut Rig, [master, slave]: [Rate; 2]) {
    rig.rate = master;
    rig.initialize_master();
    rig.rate = slave;
    rig.initialize_slave();
    rig.master.w_CPU_CONTROL.store(0x0020);
    rig.step(500);
    rig.slave.w_CPU_CONTROL.store(0x0020);
    rig.step(500);
}

/// Starts a master in the same PLC as the slave; the master takes over the slave's SYNC signal, at `rate`.
fn cluster(rig: &mut Rig, rate: Rate) {
    let kind = rig.rate.kind;
    let above = kind.plc("a", 0, None, Some("line"));
    let between = kind.plc("b", 0, Some("line"), Some("below"));
    let text = format!("{above}{between}{}{}", rig.rate.bus("line", ""), rate.bus("below", ""));
    replace(rig, &[&cansync::rules::CLUSTER_BAUD_RATE][..usize::from(rate.kbit_s != rig.rate.kbit_s)], &text);
    rig.set_up();
    let node = Node::at(rig.plant.devices()[1].segment(), kind.master.base, rate.timing, Mode::SyncIn);
    rig.bring_up(&[&node], ..=Stage::SetUp);
    rig.step(10_000);
}

/// Replaces the plant by one with a drive card that is set to `kbit_s`, and brings its master into set-up mode.
fn drive_at(rig: &mut Rig, expected: &[&'static Rule], kbit_s: u16) {
    let drive = format!("[[bus.drive]]\nname = 'd'\nslave_number = 1\nkbit_s = {kbit_s}\n");
    replace(rig, expected, &rig.rate.plant(&drive));
    rig.set_up();
    rig.step(60_000);
}

/// Replaces the plant by one with a drive that has this value in a parameter, and brings its master into set-up mode.
fn set_up_with_drive(rig: &mut Rig, expected: &[&'static Rule], parameter: u16, value: u16) {
    set_up_with_slave(rig, 1, expected, parameter, value);
}

fn set_up_with_slave(rig: &mut Rig, slave: u8, expected: &[&'static Rule], parameter: u16, value: u16) {
    let drive = format!(
        "[[bus.drive]]\nname = 'd'\nslave_number = {slave}\n\
         parameters = [{{ number = {parameter}, format = 'word', initial = {value} }}]\n"
    );
    replace(rig, expected, &rig.rate.plant(&drive));
    rig.set_up();
    rig.step(60_000);
}

/// Replaces the plant of the test rig by another plant with the same rate.
fn replace(rig: &mut Rig, expected: &[&'static Rule], plant: &str) {
    rig.expect_errors(&[]);
    *rig = Rig::of_plant(Memory::Heap, rig.rate, plant);
    rig.expect_errors(expected);
}

/// Returns a SYNC slot in us that does not fit `rate`.
fn other_slot(rate: Rate) -> u16 {
    rate.slower().interval_us as u16
}
