//! The server process that `commram run --web` starts beside the emulator.

use crate::cli::error::CliError;
use crate::cli::start::in_thread;
use crate::cli::with::ended_early;
use crate::cli::{demo, output};
use std::io::{BufRead, BufReader, Read};
use std::net::SocketAddr;
use std::process::{Child, ChildStderr, ChildStdout, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Time limit for the server to end before it is killed. The server has nothing to save.
const PATIENCE: Duration = Duration::from_secs(3);
/// Pause between two checks whether a server that has closed its outputs has ended.
const LOOK: Duration = Duration::from_millis(50);

/// The process of the server. Dropping this value ends the process.
pub(crate) struct WebProcess {
    child: Arc<Mutex<Child>>,
    has_failed: Arc<AtomicBool>,
    /// Set when the emulator begins to end.
    is_ending: Arc<AtomicBool>,
}

impl WebProcess {
    /// Starts the server for an instance that begins to serve soon. When the server is ready, `then` gets the line with
    /// its address; if the server fails, `then` gets `None`.
    ///
    /// # Errors
    /// The process cannot be started.
    pub(crate) fn start(
        instance: &str,
        listen: SocketAddr,
        then: impl FnOnce(Option<String>) + Send + 'static,
    ) -> Result<Self, CliError> {
        let mut command = demo::command("web")?;
        command.args(["-i", instance, "--listen", &listen.to_string()]);
        // The user's connect timeout is not inherited: the server waits for an emulator that is still starting.
        command.env_remove("COMMRAM_CONNECT_TIMEOUT").stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().map_err(|reason| CliError::Process { reason })?;
        let outputs = child.stdout.take().zip(child.stderr.take());
        let has_failed = Arc::new(AtomicBool::new(false));
        let (child, is_ending) = (Arc::new(Mutex::new(child)), Arc::<AtomicBool>::default());
        let (failed, ending, process) = (Arc::clone(&has_failed), Arc::clone(&is_ending), Arc::clone(&child));
        let this = Self { child, has_failed, is_ending };
        in_thread(move || {
            if let Some((out, err)) = outputs {
                pass_on(out, err, &failed, then);
            }
            report_end(&process, &ending);
        })?;
        Ok(this)
    }

    /// Ends the server.
    ///
    /// # Errors
    /// The server could not start; the error has its exit code.
    pub(crate) fn end(self) -> Result<(), CliError> {
        let failed = |reason| CliError::Process { reason };
        self.is_ending.store(true, Ordering::Relaxed);
        match self.has_failed.load(Ordering::Relaxed) {
            true => Err(ended_early("`commram web`", locked(&self.child).wait().map_err(failed)?)),
            false => Ok(()),
        }
    }
}

impl Drop for WebProcess {
    fn drop(&mut self) {
        self.is_ending.store(true, Ordering::Relaxed);
        // The result is ignored: if the signal cannot be sent, the server ends by itself when the emulator ends.
        let _ = demo::terminate(&mut locked(&self.child), PATIENCE);
    }
}

fn locked(child: &Mutex<Child>) -> MutexGuard<'_, Child> {
    child.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Reports that the server has ended while the emulator continues. A server that sees the end of its emulator exits
/// with code 0, which is not reported. This thread locks the child only for short times, because the function that ends
/// the server needs the child, too.
fn report_end(child: &Mutex<Child>, is_ending: &AtomicBool) {
    while !is_ending.load(Ordering::Relaxed) {
        match locked(child).try_wait() {
            Ok(None) => {}
            Ok(Some(status)) if !status.success() => {
                output::note(&format!(
                    "`commram web` has ended ({status}); the emulator continues without a page"
                ));
                return;
            }
            _ => return,
        }
        std::thread::sleep(LOOK);
    }
}

/// Forwards the address and the error messages of the server.
fn pass_on(out: ChildStdout, err: ChildStderr, has_failed: &AtomicBool, then: impl FnOnce(Option<String>)) {
    let mut line = String::new();
    let serves = BufReader::new(out).read_line(&mut line).is_ok_and(|length| length > 0);
    let mut err = BufReader::new(err);
    if !serves {
        let mut complaint = Vec::new();
        let _ = err.read_to_end(&mut complaint);
        output::relay(&complaint);
        has_failed.store(true, Ordering::Relaxed);
    }
    then(serves.then_some(line));
    let mut note = Vec::new();
    while matches!(err.read_until(b'\n', &mut note), Ok(1..)) {
        output::relay(&note);
        note.clear();
    }
}
