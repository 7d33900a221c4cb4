//! The start-up handshake: the client writes 16#0001 to `w_CPU_CONTROL` and waits for 16#0002 in
//! `w_OPTION_STATUS`.
//!
//! For comparison, two processes without other work exchange the same two values over a bare shared page. Before each
//! repetition the client writes 16#0000 and waits for 16#0001; this time is not measured.

use crate::support::child::{Child, when_parent_ends};
use crate::support::cpu::{self, Pinned};
use crate::support::emulator::{EmulatorOptions, Remote};
use crate::support::page::{Page, Registers, ring, sleep};
use crate::support::report::{Outcome, Samples, Target};
use crate::support::{PATIENCE, spin_until};
use commram::devices::omega_drive_line_2::registers::{CANsync_INIT_BMSTRUCT, NODE2};
use commram::memory::{Attached, Width};
use commram::runtime::Clock;
use criterion::Criterion;
use std::cell::OnceCell;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Role of the child process at the other side of the bare page.
pub(crate) const ROLE: &str = "page";

/// `w_CPU_CONTROL` of node 2, `%MW3.200000`.
const W_CPU_CONTROL: u32 = NODE2;
/// `w_OPTION_STATUS` of node 2, `%MW3.200002`.
const W_OPTION_STATUS: u32 = NODE2 + 2;
/// Commands for the restart and for the handshake. The answer to a command is the next number.
const RESTART: u16 = 0x0000;
const HANDSHAKE: u16 = 0x0001;

/// Measures the handshake when the client rings the doorbell and sleeps, and the emulator sleeps until the doorbell
/// rings.
pub(crate) fn doorbell(criterion: &mut Criterion) -> Outcome {
    let [client, server] = cpu::pair();
    let _pinned = Pinned::to(client);
    let mut group = criterion.benchmark_group("handshake through the doorbell");
    let (mut raw, mut samples) = (Samples::new(), Samples::new());

    let page = OnceCell::new();
    group.bench_function("bare page", |bencher| {
        let page = page.get_or_init(|| BarePage::start("sleeping", server));
        bencher.iter_custom(|times| measure(times, &mut raw, |command| page.ring_and_wait(command)));
    });
    drop(page);

    let emulator = OnceCell::new();
    group.bench_function("emulator", |bencher| {
        let emulator = emulator.get_or_init(|| start(false, server));
        bencher.iter_custom(|times| {
            measure(times, &mut samples, |command| ring_and_wait(emulator.attached(), command))
        });
    });
    group.finish();
    let target = Target::Times(2.0, "the same over a bare page", raw);
    Outcome { what: "start-up handshake through the doorbell", samples, target }
}

/// Measures the handshake when both sides poll and the client does not ring the doorbell.
pub(crate) fn busy(criterion: &mut Criterion) -> Outcome {
    let [client, server] = cpu::pair();
    let _pinned = Pinned::to(client);
    let mut group = criterion.benchmark_group("handshake by polling");
    let (mut raw, mut samples) = (Samples::new(), Samples::new());

    let page = OnceCell::new();
    group.bench_function("bare page", |bencher| {
        let page = page.get_or_init(|| BarePage::start("busy", server));
        bencher.iter_custom(|times| measure(times, &mut raw, |command| page.store_and_spin(command)));
    });
    drop(page);

    let emulator = OnceCell::new();
    group.bench_function("emulator", |bencher| {
        let emulator = emulator.get_or_init(|| start(true, server));
        let node = emulator.attached().segment().view::<CANsync_INIT_BMSTRUCT>(NODE2);
        let node = node.expect("node 2 is there");
        bencher.iter_custom(|times| {
            measure(times, &mut samples, |command| {
                node.w_CPU_CONTROL.store(command);
                spin_until(|| node.w_OPTION_STATUS.load() == command + 1);
            })
        });
    });
    group.finish();
    let target = Target::Times(2.0, "the same over a bare page", raw);
    Outcome { what: "start-up handshake by polling", samples, target }
}

fn start(busy: bool, cpu: usize) -> Remote {
    Remote::start(EmulatorOptions { clock: Clock::RealTime { speed: 1.0 }, busy, cpu })
}

/// Measures the handshake, then returns to the state before it. `exchange` writes a command and returns when the
/// command is answered.
fn measure(times: u64, samples: &mut Samples, exchange: impl Fn(u16)) -> Duration {
    exchange(RESTART);
    let mut total = Duration::ZERO;
    for _ in 0..times {
        total += samples.time(|| exchange(HANDSHAKE));
        exchange(RESTART);
    }
    total
}

fn ring_and_wait(attached: &Attached, command: u16) {
    let answer = u32::from(command) + 1;
    attached.post(W_CPU_CONTROL, Width::Word, command.into()).expect("the register can be written");
    attached
        .wait_register(W_OPTION_STATUS, Width::Word, PATIENCE, |status| status == answer)
        .expect("the emulator answers");
}

/// A bare page and the process at its other side.
struct BarePage {
    page: Page,
    _other: Child,
}

impl BarePage {
    fn start(waiting: &str, cpu: usize) -> Self {
        let page = Page::create();
        let other = Child::play(&[ROLE, waiting, &page.path(), &cpu.to_string()]);
        BarePage { page, _other: other }
    }

    fn store_and_spin(&self, command: u16) {
        let Registers { control, status, .. } = self.page.registers();
        control.store(command);
        spin_until(|| status.load() == command + 1);
    }

    fn ring_and_wait(&self, command: u16) {
        let Registers { control, status, doorbell, answer, .. } = self.page.registers();
        control.store(command);
        ring(doorbell);
        let start = Instant::now();
        loop {
            let seen = answer.load();
            if status.load() == command + 1 {
                return;
            }
            assert!(start.elapsed() < PATIENCE, "the other process does not answer");
            sleep(answer, seen);
        }
    }
}

/// Runs the other side of the bare page: answers each command with the next number.
pub(crate) fn play(args: &[String]) {
    let [waiting, path, processor] = args else { panic!("page: wrong arguments {args:?}") };
    cpu::pin(processor.parse().expect("the number of a processor"));
    let page = Page::open(path);
    let stop = Arc::new(AtomicBool::new(false));
    when_parent_ends({
        let stop = Arc::clone(&stop);
        move || stop.store(true, Ordering::Relaxed)
    });
    let Registers { control, status, doorbell, answer, .. } = page.registers();
    let sleeps = waiting == "sleeping";
    let mut last = u16::MAX;
    while !stop.load(Ordering::Relaxed) {
        let seen = doorbell.load();
        let command = control.load();
        if command != last {
            last = command;
            status.store(command + 1);
            if sleeps {
                ring(answer);
            }
        } else if sleeps {
            sleep(doorbell, seen);
        }
    }
}
