//! Progress of a run, on a terminal.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// Erases the line of the terminal.
const ERASE: &str = "\r\x1b[2K";

/// Progress line on the standard error output, if it is a terminal.
pub(crate) struct Progress {
    state: Option<Mutex<State>>,
}

#[derive(Default)]
struct State {
    of: usize,
    done: usize,
    not_passed: usize,
    running: Vec<PathBuf>,
}

impl Progress {
    /// Starts the progress line for `count` scenarios.
    pub(crate) fn of(count: usize) -> Self {
        let state = || Mutex::new(State { of: count, ..State::default() });
        let is_shown = std::io::stderr().is_terminal() && !crate::cli::output::is_quiet();
        Self { state: is_shown.then(state) }
    }

    /// Adds a scenario that begins.
    pub(crate) fn begins(&self, file: &Path) {
        self.change(|state| state.begins(file));
    }

    /// Removes a scenario that has ended.
    pub(crate) fn ends(&self, file: &Path, passed: bool) {
        self.change(|state| state.ends(file, passed));
    }

    /// Erases the progress line, calls `act`, and shows the line again.
    pub(crate) fn aside<T>(&self, act: impl FnOnce() -> T) -> T {
        // The lock cannot be poisoned, because no thread panics while it holds the lock.
        let Some(state) = self.state.as_ref().and_then(|state| state.lock().ok()) else { return act() };
        show("");
        let done = act();
        show(&state.line());
        done
    }

    fn change(&self, change: impl FnOnce(&mut State)) {
        if let Some(mut state) = self.state.as_ref().and_then(|state| state.lock().ok()) {
            change(&mut state);
            show(&state.line());
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if self.state.is_some() {
            show("");
        }
    }
}

fn show(line: &str) {
    let width = rustix::termios::tcgetwinsize(std::io::stderr()).map_or(0, |size| usize::from(size.ws_col));
    // Some terminals report a width of 0.
    let width = if width == 0 { 80 } else { width };
    let line: String = crate::cli::output::harmless(line).chars().take(width.saturating_sub(1)).collect();
    crate::cli::output::relay(format!("{ERASE}{line}").as_bytes());
}

impl State {
    fn begins(&mut self, file: &Path) {
        self.running.push(file.to_owned());
    }

    fn ends(&mut self, file: &Path, passed: bool) {
        if let Some(index) = self.running.iter().position(|running| running == file) {
            self.running.remove(index);
        }
        self.done += 1;
        self.not_passed += usize::from(!passed);
    }

    /// Formats the line: `3 of 12 done, 1 not passed; running 04-deadlines, 05-control-word`.
    fn line(&self) -> String {
        if self.done == self.of {
            return String::new();
        }
        let not_passed = match self.not_passed {
            0 => String::new(),
            count => format!(", {count} not passed"),
        };
        let name = |file: &PathBuf| file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let running: Vec<_> = self.running.iter().map(name).collect();
        let running =
            if running.is_empty() { String::new() } else { format!("; running {}", running.join(", ")) };
        format!("{} of {} done{not_passed}{running}", self.done, self.of)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_shows_the_progress() {
        let mut progress = State { of: 3, ..State::default() };
        assert_eq!(progress.line(), "0 of 3 done");
        let files = ["x/a.rhai", "b.rhai", "c.rhai"].map(Path::new);
        progress.begins(files[0]);
        progress.begins(files[1]);
        assert_eq!(progress.line(), "0 of 3 done; running a, b");
        progress.ends(files[0], false);
        assert_eq!(progress.line(), "1 of 3 done, 1 not passed; running b");
        progress.ends(files[1], true);
        progress.ends(files[2], true);
        assert_eq!(progress.line(), "");
    }
}
