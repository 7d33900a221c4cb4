//! Progress of a command that waits for a long time, on a terminal.

use super::output;
use crate::memory::{AttachMode, Image};
use crate::time;
use std::io::{self, IsTerminal, Write};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};

/// Time before the first progress text, and between two texts.
const INTERVAL: Duration = Duration::from_secs(1);
/// Returns to the start of the line and clears it.
const CLEAR: &str = "\r\x1b[K";

/// Executes `work`. If it takes long and the standard error output is a terminal, shows real and emulated time on the
/// terminal. `emulated` returns the emulated time. `advance_us` is the time by which `work` advances the clock, if known.
pub(crate) fn shown<R>(
    advance_us: Option<u64>,
    emulated: &(dyn Fn() -> Option<u64> + Sync),
    work: impl FnOnce() -> R,
) -> R {
    if !io::stderr().is_terminal() || output::is_quiet() {
        return work();
    }
    let begin_us = emulated();
    let (running, over) = mpsc::channel::<()>();
    std::thread::scope(|scope| {
        scope.spawn(move || {
            let (start, mut any) = (Instant::now(), false);
            while over.recv_timeout(INTERVAL) == Err(RecvTimeoutError::Timeout) {
                any = true;
                let passed =
                    emulated().zip(begin_us).map(|(now, begin)| Passed { begin, now, advance: advance_us });
                print_status(&(CLEAR.to_owned() + &line(start.elapsed(), passed)));
            }
            if any {
                print_status(CLEAR);
            }
        });
        let outcome = work();
        drop(running);
        outcome
    })
}

/// Returns the emulated time of an instance with the PLC `plc`, in microseconds; `None` if it cannot be read.
pub(crate) fn emulated_us(instance: &str, plc: &str) -> Option<u64> {
    let attached = Image::attach(instance, plc, AttachMode::ReadOnly, None).ok()?;
    Some(attached.header_snapshot().virtual_time_us.load())
}

/// Emulated times of the work, in microseconds.
struct Passed {
    begin: u64,
    now: u64,
    /// Time by which the work advances the clock, if known.
    advance: Option<u64>,
}

/// Formats the elapsed real time. If the emulated time is known, adds the emulated time, its target and its rate.
fn line(real: Duration, passed: Option<Passed>) -> String {
    let emulated = |Passed { begin, now, advance }: Passed| {
        let target =
            advance.map_or_else(String::new, |us| format!(" of {}", time::seconds(begin.saturating_add(us))));
        let rate =
            Duration::from_micros(now.saturating_sub(begin)).as_secs_f64() / real.as_secs_f64().max(0.001);
        format!(", emulated time {}{target}, {rate:.1} times real time", time::seconds(now))
    };
    format!("{} s{}; Ctrl-C ends", real.as_secs(), passed.map_or_else(String::new, emulated))
}

/// Write errors are ignored.
fn print_status(text: &str) {
    let mut out = io::stderr().lock();
    let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn real_and_emulated_time_are_shown() {
        let passed = |advance| Some(Passed { begin: 1_000_000, now: 79_000_000, advance });
        assert_eq!(
            line(Duration::from_millis(3_900), passed(Some(86_400_000_000))),
            "3 s, emulated time 79.000000 s of 86401.000000 s, 20.0 times real time; Ctrl-C ends"
        );
        let printed = line(Duration::from_millis(3_900), passed(None));
        assert_eq!(printed, "3 s, emulated time 79.000000 s, 20.0 times real time; Ctrl-C ends");
        assert_eq!(line(Duration::from_secs(1), None), "1 s; Ctrl-C ends");
    }
}
