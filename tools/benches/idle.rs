//! Processor time of an emulator in real time without requests, compared with a bare `clock_nanosleep` loop of 500 us:
//! after power-on and with a master in active operation, while a process has the image mapped and while no process has.
//!
//! Target: at most 1.3 times the loop.

#[path = "support/mod.rs"]
#[allow(dead_code, reason = "each benchmark uses a part of it")]
mod support;

use commram::runtime::Clock;
use rustix::thread::{ClockId, clock_nanosleep_absolute};
use rustix::time::{Timespec, clock_gettime};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use support::child::Child;
use support::emulator::{DRIVES, EmulatorOptions, Remote};
use support::{active, child, cpu, emulator};

/// Role of the child process that runs the loop.
const LOOP: &str = "loop";
const PERIOD_NS: u64 = 500_000;
/// Duration of each measurement in seconds; an argument of `cargo bench` can change it.
const SECONDS: u64 = 5;

fn main() {
    if let Some(role) = child::role() {
        match role.split_first() {
            Some((role, args)) if role == emulator::ROLE => emulator::play(args),
            Some((role, _)) if role == LOOP => bare_loop(),
            _ => panic!("unknown role {role:?}"),
        }
        return;
    }
    let seconds = std::env::args().find_map(|arg| arg.parse().ok()).unwrap_or(SECONDS);
    let [_, there] = cpu::pair();
    let share = |child: &Child| {
        // Waits for the end of earlier activity: the emulator checks five times a second whether a process has an image
        // open.
        std::thread::sleep(Duration::from_secs(1));
        let (start, before) = (Instant::now(), child.cpu_ns());
        std::thread::sleep(Duration::from_secs(seconds));
        (child.cpu_ns() - before) as f64 / start.elapsed().as_nanos() as f64
    };
    let bare = {
        let _pinned = cpu::Pinned::to(there);
        let bare = Child::play(&[LOOP]);
        share(&bare)
    };
    println!("{:<56} {:>6.2} % of a core", "bare clock_nanosleep loop of 500 us", bare * 100.0);
    for is_active in [false, true] {
        let remote =
            Remote::start(EmulatorOptions { clock: Clock::RealTime { speed: 1.0 }, busy: false, cpu: there });
        let image = remote.attached();
        if is_active {
            let header = image.header().expect("attached for writing").clone();
            active::activate(image.segment(), DRIVES, |us| {
                let until = header.virtual_time_us.load() + us;
                while header.virtual_time_us.load() < until {
                    std::thread::sleep(Duration::from_micros(100));
                }
            });
        }
        let mapped = share(remote.child());
        let alone = share(&remote.into_child());
        let state = if is_active { "master in active operation" } else { "after power-on" };
        for (case, share) in [("a process has the image mapped", mapped), ("no process has", alone)] {
            let (name, ratio) = (format!("{state}, {case}"), share / bare);
            let verdict = if ratio <= 1.3 { "met" } else { "MISSED" };
            println!("{name:<56} {:>6.2} % of a core, {ratio:.2} times the loop: {verdict}", share * 100.0);
        }
    }
}

fn bare_loop() {
    let stop = Arc::new(AtomicBool::new(false));
    let stopped = Arc::clone(&stop);
    child::when_parent_ends(move || stopped.store(true, Ordering::Relaxed));
    let now = clock_gettime(rustix::time::ClockId::Monotonic);
    let mut deadline = now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64;
    while !stop.load(Ordering::Relaxed) {
        deadline += PERIOD_NS;
        let until = Timespec {
            tv_sec: (deadline / 1_000_000_000) as i64,
            tv_nsec: (deadline % 1_000_000_000) as i64,
        };
        let _ = clock_nanosleep_absolute(ClockId::Monotonic, &until);
    }
}
