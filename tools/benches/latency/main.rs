//! Measures how long a client in another process waits for the emulator.
//!
//! Each latency that depends on the machine is compared with the same operation without an emulator, in the same run.
//! At the end the benchmark prints the medians with their targets; `docs/internals/performance.md` explains them.
//!
//! Processes are pinned: the client to the first processor, the other process to the second, unless a benchmark says
//! otherwise. The benchmark changes no register of a running instance and leaves no file or process.

mod bare;
mod channel;
mod handshake;
mod start;
#[path = "../support/mod.rs"]
#[allow(dead_code, reason = "each benchmark uses a part of it")]
mod support;

use criterion::Criterion;
use support::report::Outcome;
use support::{child, emulator};

fn main() {
    if let Some(role) = child::role() {
        play(&role);
        return;
    }
    // Plots need a font of the system.
    let mut criterion = Criterion::default().without_plots().configure_from_args();
    let outcomes = [
        handshake::doorbell(&mut criterion),
        handshake::busy(&mut criterion),
        channel::sleeping(&mut criterion),
        channel::busy(&mut criterion),
        channel::message(&mut criterion),
        start::first_peek(&mut criterion),
    ];
    criterion.final_summary();
    outcomes.iter().for_each(Outcome::print);
}

/// Runs the role of a child process.
fn play(role: &[String]) {
    match role.split_first() {
        Some((role, args)) if role == emulator::ROLE => emulator::play(args),
        Some((role, args)) if role == handshake::ROLE => handshake::play(args),
        Some((role, args)) if role == bare::ROLE => bare::play(args),
        _ => panic!("unknown role {role:?}"),
    }
}
