//! Progress of a command that waits for a long time, on a terminal.

use crate::devices;
use crate::memory::AttachMode;
use crate::time;
use std::io::{self, IsTerminal, Write};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};

/// Time before the first progress text, and between two texts.
const INTERVAL: Duration = Duration::from_secs(1);
/// Returns to the start of the line and clears it.
const CLEAR: &str = "\r\x1b[K";

/// Does `work`. If it takes long, shows real and emulated time on the standard error output, if it is a terminal;
/// `plc` is a PLC of the instance.
pub(crate) fn shown<R>(instance: &str, plc: &str, work: impl FnOnce() -> R) -> R {
    if !io::stderr().is_terminal() {
        return work();
    }
    let emulated = || {
        let attached = devices::attach(instance, plc, AttachMode::ReadOnly).ok();
        attached.map(|(image, _)| image.header_snapshot().virtual_time_us.load())
    };
    let (goes_on, over) = mpsc::channel::<()>();
    std::thread::scope(|scope| {
        scope.spawn(move || {
            let (start, mut any) = (Instant::now(), false);
            while over.recv_timeout(INTERVAL) == Err(RecvTimeoutError::Timeout) {
                any = true;
                say(&(CLEAR.to_owned() + &line(start.elapsed(), emulated())));
            }
            if any {
                say(CLEAR);
            }
        });
        let outcome = work();
        drop(goes_on);
        outcome
    })
}

/// Formats the elapsed real time, and the emulated time if it is known.
fn line(real: Duration, emulated_us: Option<u64>) -> String {
    let emulated =
        emulated_us.map_or_else(String::new, |us| format!(", emulated time {}", time::seconds(us)));
    format!("{} s{emulated}; Ctrl-C ends", real.as_secs())
}

/// Write errors are ignored.
fn say(text: &str) {
    let mut out = io::stderr().lock();
    let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn real_and_emulated_time_are_shown() {
        let printed = line(Duration::from_millis(3_900), Some(72_000_000_000));
        assert_eq!(printed, "3 s, emulated time 72000.000000 s; Ctrl-C ends");
        assert_eq!(line(Duration::from_secs(1), None), "1 s; Ctrl-C ends");
    }
}
