//! PLCs write random values to random registers at any time, with random faults on the bus: nothing panics or hangs, the
//! same writes give the same journal, and restarted PLCs find working nodes.

use crate::rig::bring_up::{Mode, Stage};
use crate::rig::{BOTH, FASTEST, Memory, Rate, Rig};
use commram::devices::fault_kinds;
use commram::fault::FaultSpec;
use commram::memory::Width;
use proptest::prelude::*;

const DRIVE: usize = 1;
const DRIVES: &str = "[[bus.drive]]\nname = 'd1'\nslave_number = 1\nlock_time_us = 30000\n\
                      [[bus.drive.parameters]]\nnumber = 1000\nformat = 'word'\ninitial = 100\n\
                      [[bus.drive]]\nname = 'd2'\nslave_number = 2\nlock_time_us = 30000\n";

const FAULTS: [&str; 13] = [
    "kind = 'lose_frame'\ncount = 3",
    "kind = 'delay_frame'\ndelay_us = 1500\ncount = 2",
    "kind = 'duplicate_frame'\ndelay_us = 900\nduration_us = 5000",
    "kind = 'lose_sync'\ncount = 2",
    "kind = 'jitter_sync'\namplitude_us = 400\nduration_us = 9000",
    "kind = 'slave_off'\nslave = 0\nduration_us = 7000",
    "kind = 'slave_off'\nslave = 1\nduration_us = 7000",
    "kind = 'slave_late'\nslave = 0\ndelay_us = 2500",
    "kind = 'slave_busy'\nslave = 1\ncount = 4",
    "kind = 'wrong_offset'\nslave = 0",
    "kind = 'bus_off'\nplc = 'a'\nnode = 'MASTER'",
    "kind = 'bus_off'\nplc = 'b'\nnode = 'SLAVE'\ncount = 2",
    "kind = 'overrun'\nplc = 'a'\nnode = 'MASTER'\ncount = 3",
];

/// Actions of the two PLCs, and events that affect them.
#[derive(Clone, Debug)]
enum Act {
    /// `w_CPU_CONTROL` of the master or the slave.
    Command {
        slave: bool,
        value: u16,
    },
    InitData {
        slave: bool,
    },
    /// A byte register that follows the general registers.
    Byte {
        slave: bool,
        offset: usize,
        value: u8,
    },
    /// A valid job at the master.
    Job {
        slave: usize,
        control: u8,
    },
    Block {
        control: u8,
        length: u16,
    },
    /// The slave's application answers the job in its registers.
    Serve,
    Fault(usize),
    Pass(u64),
}

fn act() -> impl Strategy<Value = Act> {
    let command = prop_oneof![
        Just(0x0000u16),
        Just(0x0001),
        Just(0x0002),
        Just(0x0020),
        Just(0x0040),
        Just(0x0080),
        Just(0x00C0),
        any::<u16>()
    ];
    let byte = prop_oneof![any::<u8>(), Just(0x05), Just(0x80), Just(0x15), Just(0x03)];
    prop_oneof![
        3 => (any::<bool>(), command).prop_map(|(slave, value)| Act::Command { slave, value }),
        1 => any::<bool>().prop_map(|slave| Act::InitData { slave }),
        3 => (any::<bool>(), 12..3542usize, byte).prop_map(|(slave, offset, value)| Act::Byte { slave, offset, value }),
        2 => (0..3usize, prop::sample::select(vec![0x03, 0x13, 0x05, 0x15]))
            .prop_map(|(slave, control)| Act::Job { slave, control }),
        2 => (prop::sample::select(vec![0x05, 0x15, 0x80]), 1..40u16)
            .prop_map(|(control, length)| Act::Block { control, length }),
        3 => Just(Act::Serve),
        2 => (0..FAULTS.len()).prop_map(Act::Fault),
        6 => (1..6000u64).prop_map(Act::Pass),
    ]
}

fn take(rig: &mut Rig, act: &Act, slice_us: u64) {
    let node = |rig: &Rig, slave| if slave { rig.slave_node() } else { rig.master_node() };
    match *act {
        Act::Command { slave, value } => node(rig, slave).init.w_CPU_CONTROL.store(value),
        Act::InitData { slave } => node(rig, slave).write_init_data(),
        Act::Byte { slave, offset, value } => {
            let at = if slave { rig.slave_at } else { rig.master_at };
            let segment = rig.plant.devices()[at.plc].segment();
            // An offset without a byte register is not written.
            let _ = segment.store(at.base + offset as u32, Width::Byte, value.into());
        }
        Act::Job { slave, control } => enter_parameter(rig, slave, control),
        Act::Block { control, length } => enter_block(rig, control, length),
        Act::Serve => serve(rig),
        Act::Fault(index) => {
            let spec: FaultSpec = toml::from_str(&rig.rate.kind.named(FAULTS[index])).unwrap();
            let fault = spec.resolve(fault_kinds(), &rig.plant.names()).unwrap();
            let _ = rig.plant.add_fault(fault);
        }
        Act::Pass(us) => {
            let end = rig.plant.now() + us;
            while rig.plant.now() < end {
                rig.step(slice_us.min(end - rig.plant.now()));
            }
        }
    }
}

fn enter_parameter(rig: &Rig, slave: usize, control: u8) {
    rig.master.a_DATA_PARAMETER[slave].w_PAR_NR.store(1000);
    rig.master.a_DATA_PARAMETER[slave].d_PAR_VALUE.store(77);
    rig.master.a_CTRLREG_PAR_CMD_SL[slave].b_STATREG_PAR_CMD.store(control);
    rig.master.a_CTRLREG_PAR_CMD_SL[slave].b_STEUREG_PAR_CMD.store(control);
}

fn enter_block(rig: &Rig, control: u8, length: u16) {
    rig.master.b_SL_NR_UPDOWNBLK1.store(0);
    rig.master.d_BASE_ADR_UPDOWNBLK1.store(0x1000);
    rig.master.w_LENGTH_UPDOWNBLK1.store(length);
    rig.master.b_STATREG_UPDOWNBLK1.store(control);
    rig.master.b_STEUREG_UPDOWNBLK1.store(control);
}

/// Acts as the slave's application: allows, takes and confirms every pending job.
fn serve(rig: &Rig) {
    let regs = &rig.slave;
    for (control, status, changed) in [
        (&regs.b_STEUREG_PAR_CMD, &regs.b_STATREG_PAR_CMD, 0x08),
        (&regs.b_STEUREG_UPDOWNBLK1, &regs.b_STATREG_UPDOWNBLK1, 0x02),
        (&regs.b_STEUREG_UPDOWN_SINGLE, &regs.b_STATREG_UPDOWN_SINGLE, 0x02),
    ] {
        let now = control.load();
        let answer = if now & changed != 0 { now | 0x80 } else { now & !0x01 };
        if answer != now {
            status.store(answer);
            control.store(answer);
        }
    }
}

/// Restarts both PLCs and checks that everything works.
fn start_over(rig: &mut Rig) {
    rig.plant.clear_faults();
    // A store of an equal value leaves no trace in the RAM (D-29). So the test stores another value before the restart.
    for init in [&rig.master_init, &rig.slave_init] {
        init.w_CPU_CONTROL.store(0x0001);
    }
    rig.step(500);
    rig.activate();
    rig.step(60_000);
    rig.slave.b_EN_UPDOWNBLK1.store(1);
    rig.master.b_MAX_SL_NR.store(2);
    rig.master.b_SL_NR_PARAMETER.store(0x80);
    rig.run_to_sync();
    enter_parameter(rig, 0, 0x05);
    enter_parameter(rig, DRIVE, 0x03);
    enter_block(rig, 0x15, 20);
    for _ in 0..40 {
        serve(rig);
        rig.run_to_sync();
    }
    let job = |slave: usize| rig.master.a_CTRLREG_PAR_CMD_SL[slave].b_STEUREG_PAR_CMD.load();
    assert_eq!([job(0), job(DRIVE), rig.master.b_STEUREG_UPDOWNBLK1.load()], [0x04, 0x02, 0x1C]);
    assert_eq!((rig.slave.d_DATA_PAR_CMD.load(), rig.slave.w_COUNTER_UPDOWNBLK1.load()), (77, 20));
    for node in [&rig.master_init, &rig.slave_init] {
        assert_eq!(node.w_CANsync_STATUS.load() & 0xFFC3, 0, "no reserved bit, no error");
    }
}

fn run(memory: Memory, rate: Rate, acts: &[Act], active: bool, slice_us: u64) -> u64 {
    let mut rig = Rig::of(memory, rate, DRIVES);
    rig.tolerate_errors(&commram::devices::catalogue().rules);
    if active {
        rig.activate();
        rig.step(60_000);
        rig.slave.b_EN_UPDOWNBLK1.store(1);
    }
    for act in acts {
        take(&mut rig, act, slice_us);
    }
    let hash = rig.plant.journal().hash();
    start_over(&mut rig);
    hash
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]
    #[test]
    fn random_register_writes_never_stop_the_nodes(
        rate in prop::sample::select(&FASTEST[..]),
        acts in prop::collection::vec(act(), 1..80),
        active in prop::bool::weighted(0.8),
        slice_us in 1..3000u64,
    ) {
        let [heap, mapped] = BOTH.map(|memory| {
            run(memory, rate, &acts, active, if memory == Memory::Heap { u64::MAX } else { slice_us })
        });
        prop_assert_eq!(heap, mapped, "the same in any slices and on both memories");
    }
}

/// Tests values of `w_CPU_CONTROL` that a random generator would rarely draw, in every state of both nodes: all values
/// of the lower byte, each with one bit of the upper byte, whose bits have no meaning. With `COMMRAM_ALL_VALUES`, all
/// 65536 values.
#[test]
fn every_command_value_is_handled_in_every_state() {
    let mut rig = Rig::of(Memory::Heap, FASTEST[0], DRIVES);
    rig.tolerate_errors(&commram::devices::catalogue().rules);
    let commands = || -> Box<dyn Iterator<Item = u16>> {
        if std::env::var_os("COMMRAM_ALL_VALUES").is_some() {
            return Box::new(0..=u16::MAX);
        }
        let upper = || [0, 0xFF00].into_iter().chain((8..16).map(|bit| 1 << bit));
        Box::new((0..=0xFF).flat_map(move |lower| upper().map(move |upper| upper | lower)))
    };
    for stage in Stage::ALL {
        rig.bring_up(&[&rig.slave_node(), &rig.master_node()], stage..=stage);
        let snapshot = rig.plant.snapshot();
        for command in commands() {
            for node in [&rig.master_init, &rig.slave_init] {
                node.w_CPU_CONTROL.store(command);
            }
            rig.step(500);
            let states =
                [(&rig.master_init, Mode::Master), (&rig.slave_init, Mode::Slave)].map(|(node, mode)| {
                    let status = node.w_OPTION_STATUS.load();
                    Stage::ALL.into_iter().find(|stage| stage.status(mode) == status)
                });
            assert!(states.iter().all(Option::is_some), "16#{command:04X} in {stage:?}");
            if states != [Some(stage); 2] {
                rig.plant.go_back(&snapshot).unwrap();
            }
        }
        rig.plant.go_back(&snapshot).unwrap();
    }
    start_over(&mut rig);
}

/// A random generator rarely selects one register, and rarely keeps a value in it. In this test all bytes of the image
/// have the same value. They keep it so long that the master counts to more slaves than a bus can have.
#[test]
fn every_byte_value_is_handled_for_forty_intervals() {
    let mut rig = Rig::of(Memory::Heap, FASTEST[0], DRIVES);
    rig.tolerate_errors(&commram::devices::catalogue().rules);
    rig.activate();
    for value in [0xFF, 0x80, 0x7F, 0x20, 0x15, 0x05] {
        for (slave, offset) in (12..3542).flat_map(|offset| [(false, offset), (true, offset)]) {
            take(&mut rig, &Act::Byte { slave, offset, value }, u64::MAX);
        }
        (0..40).for_each(|_| rig.run_to_sync());
    }
    start_over(&mut rig);
}
