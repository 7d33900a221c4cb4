//! Delay until a PLC process detects a SYNC edge in real time, compared with the delay of a bare `clock_nanosleep` loop.
//!
//! Both run at 2 ms, in turns of half a second, so that other load of the machine affects both equally. The delay is the
//! real time of waking up minus the real time of the edge (or of the deadline); the emulator reports the real time of its
//! emulated time 0. Target: the 99 % quantile at most 1.5 times that of the bare loop.

#[path = "support/mod.rs"]
#[allow(dead_code, reason = "each benchmark uses a part of it")]
mod support;

use commram::memory::{Attached, Header, View};
use commram::runtime::Clock;
use rustix::thread::{ClockId, clock_nanosleep_absolute};
use rustix::time::{Timespec, clock_gettime};
use std::time::Duration;
use support::emulator::{DRIVES, EmulatorOptions, Remote};
use support::{PATIENCE, active, child, cpu, emulator};

const SYNC: usize = 12;
const INTERVAL_NS: u64 = 2_000_000;
/// Number of samples in one turn.
const TURN: usize = 250;
/// Number of turns of each side; an argument of `cargo bench` can change it.
const TURNS: usize = 20;

fn main() {
    if let Some(role) = child::role() {
        match role.split_first() {
            Some((role, args)) if role == emulator::ROLE => emulator::play(args),
            _ => panic!("unknown role {role:?}"),
        }
        return;
    }
    let turns = std::env::args().find_map(|arg| arg.parse().ok()).unwrap_or(TURNS);
    let [here, there] = cpu::pair();
    let _pinned = cpu::Pinned::to(here);
    let remote =
        Remote::start(EmulatorOptions { clock: Clock::RealTime { speed: 1.0 }, busy: false, cpu: there });
    let image = remote.attached();
    let header = image.header().expect("attached for writing").clone();
    start_sync(image, &header);

    let (mut edges, mut bare) = (Vec::new(), Vec::new());
    for _ in 0..turns {
        bare_loop(&mut bare);
        wait_for_edges(image, &header, &mut edges);
    }
    let edges = print_line("SYNC edge at a waiting PLC process", &mut edges);
    let bare = print_line("bare clock_nanosleep loop", &mut bare);
    let ratio = edges / bare;
    let verdict = if ratio <= 1.5 { "met" } else { "MISSED" };
    println!("{ratio:.2} times at 99 %; target: at most 1.5 times: {verdict}");
}

/// Brings the master to active operation and enables event 12.
fn start_sync(image: &Attached, header: &View<Header>) {
    active::activate(image.segment(), DRIVES, |us| {
        let until = header.virtual_time_us.load() + us;
        while header.virtual_time_us.load() < until {
            std::thread::sleep(Duration::from_micros(100));
        }
    });
    let request = header.interrupts[SYNC].ask(0, true);
    header.submit_request();
    image
        .wait_until("INTR_SET", PATIENCE, |_| header.interrupts[SYNC].outcome(request))
        .expect("the emulator answers");
}

fn now_ns() -> u64 {
    nanoseconds(clock_gettime(rustix::time::ClockId::Monotonic))
}

fn nanoseconds(time: Timespec) -> u64 {
    time.tv_sec as u64 * 1_000_000_000 + time.tv_nsec as u64
}

fn bare_loop(lateness: &mut Vec<u64>) {
    let mut deadline = now_ns() + INTERVAL_NS;
    for _ in 0..TURN {
        let until = Timespec {
            tv_sec: (deadline / 1_000_000_000) as i64,
            tv_nsec: (deadline % 1_000_000_000) as i64,
        };
        clock_nanosleep_absolute(ClockId::Monotonic, &until).expect("the clock can be slept on");
        lateness.push(now_ns().saturating_sub(deadline));
        deadline += INTERVAL_NS;
    }
}

fn wait_for_edges(image: &Attached, header: &View<Header>, lateness: &mut Vec<u64>) {
    let slot = &header.events[SYNC];
    let mut seen = slot.bell.rings();
    for _ in 0..TURN {
        seen = image.wait_event(SYNC, seen, PATIENCE).expect("SYNC runs");
        let now = now_ns();
        let edge = header.real_epoch_ns.load() + slot.time_us.load() * 1_000;
        lateness.push(now.saturating_sub(edge));
    }
}

/// Prints the quantiles. Returns the 99 % quantile in us.
fn print_line(name: &str, lateness: &mut [u64]) -> f64 {
    lateness.sort_unstable();
    let quantile = |part: f64| {
        let place = (lateness.len() as f64 * part) as usize;
        lateness.get(place.min(lateness.len().saturating_sub(1))).copied().unwrap_or(0) as f64 / 1000.0
    };
    let [median, late, latest] = [0.5, 0.99, 0.999].map(quantile);
    println!("{name:<46} {median:>10.1} us median {late:>10.1} us 99 % {latest:>10.1} us 99.9 %");
    late
}
