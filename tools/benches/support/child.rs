//! Child processes that cannot outlive the benchmark.
//!
//! A child is another process of this executable; its first argument selects a role instead of measuring. Its standard
//! input is a pipe without data: when the benchmark ends, for any reason, the pipe breaks and the child ends
//! cleanly.

use super::PATIENCE;
use signal_hook::consts::{SIGINT, SIGTERM};
use std::io::Read;
use std::process::{Child as Process, Command, Stdio};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// First argument of a child process.
const ROLE: &str = "role";

/// Returns the role and its arguments if this process is a child.
pub(crate) fn role() -> Option<Vec<String>> {
    let mut args = std::env::args().skip(1);
    (args.next()? == ROLE).then(|| args.collect())
}

/// Runs `stop` in a child process when the parent wants the child to end, or has ended itself.
pub(crate) fn when_parent_ends(stop: impl FnOnce() + Send + 'static) {
    // Ctrl-C and `timeout` send the signal to the parent and the children. The children ignore it, because they end
    // with the pipe.
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register(signal, Arc::default()).expect("the signal can be caught");
    }
    std::thread::spawn(move || {
        // The parent writes nothing, so this read returns when the pipe ends.
        let _ = std::io::stdin().read(&mut [0]);
        stop();
    });
}

/// A running child process. It ends when this value is dropped.
pub(crate) struct Child {
    process: Process,
    name: String,
}

impl Child {
    /// Starts this executable in the role `args`.
    pub(crate) fn play(args: &[&str]) -> Self {
        let executable = std::env::current_exe().expect("the benchmark knows its own path");
        let process = Command::new(executable)
            .arg(ROLE)
            .args(args)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .spawn()
            .expect("a child process can be started");
        Child { process, name: args.join(" ") }
    }

    /// Returns the processor time in nanoseconds that all threads of the child have used.
    pub(crate) fn cpu_ns(&self) -> u64 {
        let tasks = std::fs::read_dir(format!("/proc/{}/task", self.process.id())).expect("it runs");
        let spent = |task: std::io::Result<std::fs::DirEntry>| {
            let text = std::fs::read_to_string(task.ok()?.path().join("schedstat")).ok()?;
            text.split_ascii_whitespace().next()?.parse::<u64>().ok()
        };
        tasks.filter_map(spent).sum()
    }

    /// Fails if the child has ended by itself.
    pub(crate) fn check(&mut self) {
        if let Some(status) = self.process.try_wait().expect("a child can be asked for its status") {
            panic!("the child process `{}` has ended: {status}", self.name);
        }
    }
}

impl Drop for Child {
    fn drop(&mut self) {
        drop(self.process.stdin.take());
        let status = wait(&mut self.process);
        // A panic during another panic would abort the benchmark without a message about the first panic.
        if !std::thread::panicking() {
            assert!(status.is_some_and(|status| status.success()), "`{}`: {status:?}", self.name);
        }
    }
}

/// Waits for the end of a process. If that takes too long, kills it and returns `None`.
pub(crate) fn wait(process: &mut Process) -> Option<std::process::ExitStatus> {
    let start = Instant::now();
    while start.elapsed() < PATIENCE {
        match process.try_wait() {
            Ok(Some(status)) => return Some(status),
            Ok(None) => std::thread::sleep(Duration::from_millis(1)),
            Err(_) => break,
        }
    }
    let _ = process.kill();
    let _ = process.wait();
    None
}
