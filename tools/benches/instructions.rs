//! Runs the intervals of the benchmark `intervals` in the requested number, for an instruction counter. The difference
//! between two runs is the cost of the additional intervals, without the start. `just instructions` counts them.

#[path = "support/active.rs"]
mod active;
#[path = "support/line.rs"]
mod line;

use line::{INTERVAL_US, active_plant, release};

/// Without arguments, for example in `cargo bench`, a short run only shows that the program works.
fn main() {
    let numbers: Vec<u32> = std::env::args().skip(1).filter_map(|argument| argument.parse().ok()).collect();
    let (drives, intervals) = match numbers[..] {
        [drives, intervals] => (drives.clamp(1, 32) as u8, intervals),
        _ => (3, 10),
    };
    let (mut plant, master) = active_plant(drives);
    for value in 0..intervals {
        release(&master, value.wrapping_mul(0x0001_0001));
        plant.advance_to(plant.now() + INTERVAL_US);
    }
    println!("{drives} drives, {intervals} intervals, {} events", plant.journal().written());
}
