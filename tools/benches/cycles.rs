//! Cost of a poke, a step and a peek of a scenario: the reference for `tools/python/cycles.py`.
//!
//! Does not use criterion: the loop and its counts are those of `cycles.py`.

use commram::script::{Bench, ScenarioError};
use std::time::Instant;

const CYCLES: u32 = 100_000;
const ROUNDS: usize = 9;
const CONTROL: &str = "node2.w_CPU_CONTROL";
const STATUS: &str = "node2.w_OPTION_STATUS";
const STEP_US: u64 = 50;

fn by_name(bench: &mut Bench) -> Result<(), ScenarioError> {
    for _ in 0..CYCLES {
        bench.poke(CONTROL, 0)?;
        bench.step(STEP_US)?;
        bench.peek(STATUS)?;
    }
    Ok(())
}

fn by_handle(bench: &mut Bench) -> Result<(), ScenarioError> {
    let (control, status) = (bench.find(CONTROL)?, bench.find(STATUS)?);
    for _ in 0..CYCLES {
        bench.poke_at(&control, 0)?;
        bench.step(STEP_US)?;
        bench.peek_at(&status)?;
    }
    Ok(())
}

type Cycles = fn(&mut Bench) -> Result<(), ScenarioError>;

fn main() -> Result<(), ScenarioError> {
    let all: [(&str, Cycles); 2] = [("by name", by_name), ("by handle", by_handle)];
    for (name, cycles) in all {
        let mut times = Vec::with_capacity(ROUNDS);
        for _ in 0..ROUNDS {
            let mut bench = Bench::built_in()?;
            bench.set_limit(u64::MAX);
            let begin = Instant::now();
            cycles(&mut bench)?;
            times.push(begin.elapsed().as_secs_f64() / f64::from(CYCLES) * 1e6);
        }
        times.sort_by(f64::total_cmp);
        let [first, median, last] =
            [0, ROUNDS / 2, ROUNDS - 1].map(|at| times.get(at).copied().unwrap_or(0.0));
        println!("{name:<12} {median:.3} us ({first:.3} to {last:.3})");
    }
    Ok(())
}
