//! `commram speed`: speed of a real-time clock.

use super::Instance;
use super::error::CliError;
use crate::request::MAX_SPEED;

/// Change the speed of a real-time clock, or pause it.
///
/// The emulated time continues from its present value. Tasks of the program and guests at doors keep running while the
/// clock is paused; the firmware still answers registers at once, but no emulated time passes. `commram run --speed`
/// starts an emulator with a speed, and `commram status` shows it. A stepped clock has no speed.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram speed 0                pause
  commram speed 1                real time
  commram speed 10               ten times as fast
  commram speed 0.05")]
pub(crate) struct Args {
    /// Emulated time per real time, 0.001 to 1000; 0: pause
    #[arg(value_name = "FACTOR", value_parser = permille, allow_negative_numbers = true)]
    permille: u32,
    #[command(flatten)]
    instance: Instance,
}

/// Parses a speed; returns emulated time per real time x 1000.
fn permille(text: &str) -> Result<u32, &'static str> {
    let factor: f64 = text.parse().unwrap_or(f64::NAN);
    let permille = (factor * 1000.0).round();
    let is_exact = (permille - factor * 1000.0).abs() < 1e-6;
    if is_exact && (0.0..=f64::from(MAX_SPEED)).contains(&permille) {
        return Ok(permille as u32);
    }
    Err("write 0 for a pause, or a factor from 0.001 to 1000 with at most three decimals")
}

/// Changes the speed, and prints the time from which it applies.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    use super::{output, session::Session, time};
    use crate::request::Op;

    let session = Session::open(&args.instance, 0)?;
    let time_us = session.ask(Op::SetSpeed { permille: args.permille })?.time()?;
    output::print(&format!("{}\n", time::seconds(time_us)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_speed_is_a_factor_or_a_pause() {
        let known = ["0", "1", "10", "0.001", "2.5", "1000"].map(|text| permille(text).unwrap());
        assert_eq!(known, [0, 1_000, 10_000, 1, 2_500, MAX_SPEED]);
        for text in ["-1", "1001", "0.0005", "2.5004", "NaN", "fast", "", "inf"] {
            assert!(permille(text).is_err(), "{text}");
        }
    }
}
