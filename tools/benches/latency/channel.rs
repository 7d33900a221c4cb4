//! The channel: a peek beside a bare iceoryx2 request-response, and a whole message in stepped mode.

use crate::bare::Pair;
use crate::support::active::activate;
use crate::support::cpu::{self, Pinned};
use crate::support::emulator::{EmulatorOptions, Remote};
use crate::support::report::{Outcome, Samples, Target};
use crate::support::{PATIENCE, emulator};
use commram::channel::Client;
use commram::devices::omega_drive_line_2::registers::{CANsync_MA_CTRL_BMSTRUCT, NODE2};
use commram::identity::{DeviceIndex, PortNumber};
use commram::memory::Width;
use commram::request::{Op, Reply};
use commram::runtime::Clock;
use core::mem::offset_of;
use criterion::Criterion;
use std::cell::OnceCell;
use std::time::Duration;

/// `w_OPTION_STATUS` of node 2, and its value after power-on.
const W_OPTION_STATUS: u32 = NODE2 + 2;
const START_UP: u32 = 0x0001;
/// `b_CTRLREG_WRC1` of node 2.
const B_CTRLREG_WRC1: u32 = NODE2 + offset_of!(CANsync_MA_CTRL_BMSTRUCT, b_CTRLREG_WRC1) as u32;
/// Values of the register: a reference value frame is released, and the firmware has taken it.
const RELEASED: u32 = 0x05;
const TAKEN: u32 = 0x04;
/// Length of an interval at 500 kbit/s.
const INTERVAL_US: u64 = 2000;

/// Measures a peek while client and emulator sleep until their bell rings.
pub(crate) fn sleeping(criterion: &mut Criterion) -> Outcome {
    peek(criterion, "sleeping", Duration::ZERO)
}

/// Measures a peek while client and emulator poll.
pub(crate) fn busy(criterion: &mut Criterion) -> Outcome {
    peek(criterion, "busy", PATIENCE)
}

fn peek(criterion: &mut Criterion, waiting: &'static str, spin: Duration) -> Outcome {
    let [client, server] = cpu::pair();
    let _pinned = Pinned::to(client);
    let mut group = criterion.benchmark_group(format!("peek, both {waiting}"));
    let (mut raw, mut samples) = (Samples::new(), Samples::new());

    let pair = OnceCell::new();
    group.bench_function("bare iceoryx2", |bencher| {
        let pair = pair.get_or_init(|| Pair::start(waiting, Some(server)));
        bencher.iter_custom(|times| (0..times).map(|number| raw.time(|| pair.exchange(number))).sum());
    });
    drop(pair);

    let connection = OnceCell::new();
    group.bench_function("channel", |bencher| {
        let (client, _) = connection.get_or_init(|| {
            let clock = Clock::RealTime { speed: 1.0 };
            let remote = Remote::start(EmulatorOptions { clock, busy: waiting == "busy", cpu: server });
            let client = remote.connect(spin);
            (client, remote)
        });
        bencher.iter_custom(|times| (0..times).map(|_| samples.time(|| one_peek(client))).sum());
    });
    group.finish();
    let what = if waiting == "busy" { "peek, both polling" } else { "peek, both sleeping" };
    Outcome { what, samples, target: Target::Times(1.5, "bare iceoryx2 request-response", raw) }
}

fn one_peek(client: &Client) {
    let value = client.peek(DeviceIndex(0), W_OPTION_STATUS, Width::Word).expect("the emulator answers");
    assert_eq!(value, START_UP);
}

/// Measures a poke, a step of 2 ms and a peek in one message, with client and emulator on one processor. The bus is in
/// active operation: each message releases a reference value frame and checks that the firmware has taken it.
pub(crate) fn message(criterion: &mut Criterion) -> Outcome {
    let [cpu, _] = cpu::pair();
    let _pinned = Pinned::to(cpu);
    let mut group = criterion.benchmark_group("message, 1 CPU");
    let (mut raw, mut samples) = (Samples::new(), Samples::new());

    let pair = OnceCell::new();
    group.bench_function("bare iceoryx2", |bencher| {
        let pair = pair.get_or_init(|| Pair::start("sleeping", Some(cpu)));
        bencher.iter_custom(|times| (0..times).map(|number| raw.time(|| pair.exchange(number))).sum());
    });
    drop(pair);

    let connection = OnceCell::new();
    group.bench_function("poke, 2 ms step and peek", |bencher| {
        let (client, _) = connection.get_or_init(|| {
            let remote = Remote::start(EmulatorOptions { clock: Clock::Stepped, busy: false, cpu });
            let client = remote.connect(Duration::ZERO);
            activate(remote.attached().segment(), emulator::DRIVES, |us| {
                client.advance(us).expect("the emulator answers");
            });
            to_sync_edge(&client);
            (client, remote)
        });
        let mut replies = Vec::new();
        bencher.iter_custom(|times| {
            (0..times).map(|_| samples.time(|| one_message(client, &mut replies))).sum()
        });
    });
    group.finish();
    let what = "message of poke, 2 ms step and peek, 1 CPU";
    Outcome { what, samples, target: Target::Microseconds(5.0, "bare iceoryx2 request-response, 1 CPU", raw) }
}

fn one_message(client: &Client, replies: &mut Vec<Reply>) {
    let (plc, offset, width) = (0, B_CTRLREG_WRC1, Width::Byte);
    let ops = [
        Op::Poke { plc: DeviceIndex(plc), offset, width, value: RELEASED },
        Op::Advance { us: INTERVAL_US },
        Op::Peek { plc: DeviceIndex(plc), offset, width },
    ];
    client.request_into(&ops, replies).expect("the emulator answers");
    assert!(matches!(replies[..], [Reply::Written, Reply::Time(_), Reply::Value(TAKEN)]), "{replies:?}");
}

fn to_sync_edge(client: &Client) {
    let replies = client
        .request(&[Op::AdvanceToSync { plc: DeviceIndex(0), node: PortNumber(2) }])
        .expect("the emulator answers");
    assert!(matches!(replies[..], [Reply::Time(_)]), "{replies:?}");
}
