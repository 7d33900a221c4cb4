//! The processes of the demonstration. They end when the demonstration ends, even after an error.

use crate::cli::error::CliError;
use crate::cli::start::in_thread;
use crate::cli::with::ended_early;
use crate::cli::{output, signals, stop};
use rustix::process::{Pid, Signal};
use std::io::{self, BufRead, BufReader, Write};
use std::os::unix::process::CommandExt;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};

/// Pause between two polls of the processes.
pub(crate) const POLL: Duration = Duration::from_millis(5);
/// Time limit for the start and for the end of the emulator.
const PATIENCE: Duration = Duration::from_secs(20);

/// Set when the user asks to end.
pub(crate) struct Interrupts(Arc<AtomicBool>);

impl Interrupts {
    /// Catches the termination signals. After the first signal, a write to an output that is not read ends. The second
    /// signal ends the process immediately.
    ///
    /// # Errors
    /// The operating system refuses the operation.
    pub(crate) fn catch() -> Result<Self, CliError> {
        let flag = Arc::new(AtomicBool::new(false));
        for signal in signals::termination() {
            // The handlers run in the order of their registration. The conditional handler, which ends the process if
            // the flag is set, comes first, so the first signal only sets the flag.
            signal_hook::flag::register_conditional_default(signal, Arc::clone(&flag))
                .and_then(|_| signal_hook::flag::register(signal, Arc::clone(&flag)))
                .map_err(|reason| CliError::Signals { reason })?;
        }
        output::give_up_after(Arc::clone(&flag));
        Ok(Self(flag))
    }

    /// True if a signal has arrived.
    pub(crate) fn any(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Builds a command that starts this program with a subcommand. The child ends when this process ends. The child does
/// not receive Ctrl-C from the terminal, because this process ends it cleanly.
///
/// # Errors
/// The path of this program is unknown.
pub(crate) fn command(subcommand: &str) -> Result<Command, CliError> {
    let program = std::env::current_exe().map_err(process_error)?;
    let mut command = Command::new(program);
    command.arg(subcommand).args(["--parent", &std::process::id().to_string()]);
    // The child must not use settings from the environment or the configuration files.
    command.env("COMMRAM_CONFIG", "").env_remove("COMMRAM_INSTANCE").stdin(Stdio::null()).process_group(0);
    Ok(command)
}

fn process_error(reason: io::Error) -> CliError {
    CliError::Process { reason }
}

/// Makes this process end when its parent ends. The parent must be the process `parent`.
///
/// # Errors
/// The operating system refuses the request, or the parent has already ended.
pub(crate) fn end_with(parent: u32) -> Result<(), CliError> {
    rustix::process::set_parent_process_death_signal(Some(Signal::TERM))
        .map_err(|errno| process_error(errno.into()))?;
    let found = rustix::process::getppid().map(|pid| pid.as_raw_nonzero().get().unsigned_abs());
    if found == Some(parent) { Ok(()) } else { Err(CliError::Interrupted) }
}

pub(crate) struct Emulator {
    child: Child,
    instance: String,
}

impl Emulator {
    /// Starts the emulator with this plant file, or with the built-in plant, and waits until it is ready.
    ///
    /// # Errors
    /// The emulator does not become ready, or the user interrupts the start.
    pub(crate) fn start(
        instance: &str,
        plant: Option<&'static str>,
        interrupts: &Interrupts,
    ) -> Result<Self, CliError> {
        let mut command = command("run")?;
        command.args(["-i", instance]).stdout(Stdio::piped());
        if plant.is_some() {
            command.arg("/dev/stdin").stdin(Stdio::piped());
        }
        let mut child = command.spawn().map_err(process_error)?;
        let (input, out) = (child.stdin.take(), child.stdout.take());
        let mut this = Self { child, instance: instance.to_owned() };
        if let (Some(plant), Some(mut input)) = (plant, input) {
            // The text fits into the buffer of the pipe, so this write does not block.
            input.write_all(plant.as_bytes()).map_err(process_error)?;
        }
        let (send, ready) = mpsc::channel();
        in_thread(move || {
            let mut line = String::new();
            let read = out.map(|out| BufReader::new(out).read_line(&mut line));
            if matches!(read, Some(Ok(1..))) {
                let _ = send.send(());
            }
        })?;
        let start = Instant::now();
        loop {
            match ready.recv_timeout(POLL) {
                Ok(()) => return Ok(this),
                _ if interrupts.any() => return Err(CliError::Interrupted),
                Err(RecvTimeoutError::Timeout) if start.elapsed() < PATIENCE => {}
                Err(RecvTimeoutError::Timeout) => {
                    return Err(CliError::Demo(format!("the emulator is not ready after {PATIENCE:?}")));
                }
                Err(RecvTimeoutError::Disconnected) => {
                    // The emulator has already printed the reason.
                    let status = this.child.wait().map_err(process_error)?;
                    return Err(match ended_early("the emulator", status) {
                        killed @ CliError::Killed { .. } => killed,
                        _ => CliError::Reported,
                    });
                }
            }
        }
    }

    pub(crate) fn pid(&self) -> u32 {
        self.child.id()
    }

    /// True if the emulator has ended.
    ///
    /// # Errors
    /// The system call fails.
    pub(crate) fn has_ended(&mut self) -> Result<bool, CliError> {
        Ok(self.child.try_wait().map_err(process_error)?.is_some())
    }

    /// Ends the emulator cleanly.
    ///
    /// # Errors
    /// The emulator does not end, or ends with an error.
    pub(crate) fn stop(mut self) -> Result<(), CliError> {
        terminate(&mut self.child, PATIENCE)?;
        let status = self.child.wait().map_err(process_error)?;
        if status.success() {
            return Ok(());
        }
        Err(CliError::Demo(format!("the emulator ended with an error ({status})")))
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        // An error is ignored: the child still runs here only if another error has occurred before, and the caller
        // reports that error.
        let _ = terminate(&mut self.child, PATIENCE);
        let _ = stop::remove_remains(&self.instance);
    }
}

pub(crate) struct SoftPlc {
    child: Child,
}

impl SoftPlc {
    /// Starts the soft-PLC on the image of a PLC.
    ///
    /// # Errors
    /// The operating system refuses the operation.
    pub(crate) fn start(instance: &str, plc: &str) -> Result<Self, CliError> {
        let child = command("demo-plc")?.args([instance, plc]).spawn().map_err(process_error)?;
        Ok(Self { child })
    }

    /// Returns the result of the soft-PLC; `None` while it runs.
    ///
    /// # Errors
    /// The system call fails.
    pub(crate) fn outcome(&mut self) -> Result<Option<Result<(), CliError>>, CliError> {
        let Some(status) = self.child.try_wait().map_err(process_error)? else { return Ok(None) };
        Ok(Some(match status.code() {
            Some(0) => Ok(()),
            Some(_) => Err(CliError::Reported),
            None => Err(CliError::Demo(format!("the soft-PLC has ended unexpectedly ({status})"))),
        }))
    }
}

impl Drop for SoftPlc {
    fn drop(&mut self) {
        let _ = terminate(&mut self.child, PATIENCE);
    }
}

/// Sends SIGTERM to a process, lets it continue if it was stopped, and waits for its end; kills it if it does not end
/// in time.
///
/// # Errors
/// The operating system refuses the operation.
pub(crate) fn terminate(child: &mut Child, patience: Duration) -> Result<(), CliError> {
    let start = Instant::now();
    let mut asked = false;
    while child.try_wait().map_err(process_error)?.is_none() {
        if !asked {
            asked = true;
            // The child has not been reaped, so the process id is still valid.
            let pid = i32::try_from(child.id()).ok().and_then(Pid::from_raw);
            if let Some(pid) = pid {
                for signal in [Signal::TERM, Signal::CONT] {
                    rustix::process::kill_process(pid, signal)
                        .map_err(|errno| process_error(errno.into()))?;
                }
            }
        }
        if start.elapsed() > patience {
            child.kill().and_then(|()| child.wait()).map_err(process_error)?;
        }
        std::thread::sleep(POLL);
    }
    Ok(())
}
