//! `commram with`: an emulator that runs as long as a command.

use super::error::CliError;
use super::instance::instance_name;
use super::output;
use super::start::{InitialState, OnSignal, Settings, TerminationSignals, in_thread};
use crate::memory::limits;
use crate::runtime::StopHandle;
use rustix::process::{Pid, PidfdFlags, Signal};
use rustix::rand::{GetRandomFlags, getrandom};
use signal_hook::consts::SIGINT;
use std::ffi::OsString;
use std::io::{self, IsTerminal};
use std::os::fd::OwnedFd;
use std::os::unix::process::ExitStatusExt;
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;

/// Exit code if the command exists but cannot be started, as in shells.
const CANNOT_RUN: u8 = 126;
/// Exit code if the command does not exist, as in shells.
const NO_SUCH_COMMAND: u8 = 127;
/// If a signal ended the process, the exit code is this number plus the number of the signal, as in shells.
const BY_SIGNAL: i32 = 128;

/// Run a command with a separate emulator.
///
/// Starts an emulator, runs the command when the emulator is ready, ends the emulator after the command, and
/// returns the exit code of the command. The variable COMMRAM_INSTANCE contains the name of the emulator for the
/// command and its child processes. Without -i the name is unique, so that several can run at once. Signals are
/// passed on to the command. `commram stop` ends only the emulator.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram with -- commram peek node2.w_OPTION_STATUS
  commram with plant.toml --clock stepped -- ./run-tests.sh
  commram with -- sh -c './soft_plc /dev/shm/commram.$COMMRAM_INSTANCE.line'

Exit codes: the exit code of COMMAND, 128 + n if it was ended by signal n; 126 if it cannot be started, 127 if it does not \
exist. If the emulator does not start, the usual exit codes apply; 1 also if the emulator ended with an error.")]
pub(crate) struct Args {
    /// The plant file: PLCs, buses, drives [default: the built-in plant]
    #[arg(add = super::complete::files(&["toml"]), value_name = "PLANT.toml")]
    plant: Option<PathBuf>,
    /// Name of the instance [default: a unique name]
    #[arg(short, long, value_name = "NAME", value_parser = instance_name)]
    instance: Option<String>,
    #[command(flatten)]
    settings: Settings,
    /// The command and its arguments
    #[arg(value_name = "COMMAND", last = true, required = true)]
    command: Vec<OsString>,
}

pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    let name = args.instance.clone().unwrap_or_else(unique_name);
    let [program, arguments @ ..] = args.command.as_slice() else { return Ok(()) };
    let mut command = Command::new(program);
    command.args(arguments).env(super::instance::VARIABLE, &name);
    let signals = TerminationSignals::take()?;
    let (mut emulator, started) = args.settings.start(
        args.plant.as_deref().map_or(InitialState::BuiltIn, InitialState::Plant),
        &name,
        signals,
        false,
    )?;
    let stop = emulator.stop_handle();
    let is_done = Arc::new(AtomicBool::new(false));
    let (done, (give, child)) = (Arc::clone(&is_done), mpsc::channel::<io::Result<Child>>());
    // The emulator runs until the child ends. If the child cannot be started, the emulator ends at once.
    let ended = in_thread(move || {
        let ended = child.recv().unwrap_or_else(|_| Err(io::ErrorKind::Other.into()));
        let ended = ended.and_then(|mut child| child.wait());
        done.store(true, Ordering::Release);
        stop.stop_because("the command of `commram with` has ended");
        ended
    })?;
    let child = command.spawn();
    let passed = child.as_ref().map(|child| pass_on(child, emulator.stop_handle()));
    if let Ok(Ok(pass_on)) = passed {
        let _ = started.send(pass_on);
    }
    // Sending cannot fail, because the thread waits for this value.
    let _ = give.send(child);
    let outcome = emulator.run();
    drop(emulator);
    if !is_done.load(Ordering::Acquire) {
        output::note(&format!("instance '{name}' has ended before the command"));
    }
    let ended = ended.join().unwrap_or_else(|_| Err(io::ErrorKind::Other.into()));
    let ended = match ended {
        Ok(status) if status.success() => return Ok(outcome?),
        Ok(status) => ended_like(status),
        Err(reason) => {
            let limit = limits::named(&reason);
            let program = output::in_one_line(&program.to_string_lossy());
            output::complain(&format!("cannot run {program}: {reason}{limit}"));
            let missing = reason.kind() == io::ErrorKind::NotFound;
            CliError::Ended(if missing { NO_SUCH_COMMAND } else { CANNOT_RUN })
        }
    };
    if let Err(error) = outcome {
        output::complain(&error.to_string());
    }
    Err(ended)
}

/// Returns a name for an instance. Processes in several containers with one `/dev/shm` can have the same process id, so
/// the name also has a random part.
fn unique_name() -> String {
    let mut random = [0; 4];
    // Without random numbers of the kernel, the process id still distinguishes the name from most others.
    let _ = getrandom(&mut random, GetRandomFlags::empty());
    format!("with-{}-{:08x}", std::process::id(), u32::from_le_bytes(random))
}

/// Returns the error by which this process ends in the same way as a process with this exit status.
pub(crate) fn ended_like(status: ExitStatus) -> CliError {
    let code = status.code().or_else(|| Some(BY_SIGNAL + status.signal()?));
    CliError::Ended(code.and_then(|code| u8::try_from(code).ok()).unwrap_or(u8::MAX))
}

/// Passes signals on to a process by its pidfd. The terminal sends Ctrl-C to the command directly. The signal of
/// `commram stop` ends only the emulator.
fn pass_on(child: &Child, emulator: StopHandle) -> io::Result<OnSignal> {
    let number = i32::try_from(child.id()).ok().and_then(Pid::from_raw);
    let number = number.ok_or(io::ErrorKind::InvalidInput)?;
    let process = rustix::process::pidfd_open(number, PidfdFlags::empty())?;
    Ok(Box::new(move |signal| {
        if signal.is_from_stop {
            emulator.stop_because(signal.reason(None));
        } else if let Some(named) = Signal::from_named_raw(signal.number)
            && !(signal.number == SIGINT && is_ours_in_the_terminal())
        {
            send(&process, named);
            // A suspended process handles the signal only when it runs.
            send(&process, Signal::CONT);
        }
    }))
}

fn send(process: &OwnedFd, signal: Signal) {
    // An error is ignored: it means that the process has just ended, and the signal was to end it.
    let _ = rustix::process::pidfd_send_signal(process, signal);
}

/// True if Ctrl-C in the terminal reaches both this process and its command, so that the signal need not be passed on.
fn is_ours_in_the_terminal() -> bool {
    let input = io::stdin();
    let foreground = || rustix::termios::tcgetpgrp(&input).ok();
    input.is_terminal() && foreground() == Some(rustix::process::getpgrp())
}

/// Returns the error for a process of this program, `what`, that has ended before it was ready. A process that ends with
/// an exit code has printed the reason.
pub(crate) fn ended_early(what: &str, status: ExitStatus) -> CliError {
    match status.signal() {
        Some(signal) => CliError::Killed { what: what.to_owned(), status: status.to_string(), signal },
        None => ended_like(status),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exit_code_is_the_exit_code_of_the_command() {
        assert_eq!(ended_like(ExitStatus::from_raw(42 << 8)).exit_code(), 42);
        assert_eq!(ended_like(ExitStatus::from_raw(SIGINT)).exit_code(), 130);
    }

    #[test]
    fn a_process_that_a_signal_ends_early_is_an_error_with_the_signal() {
        let ended = |status| {
            let error = ended_early("the page", ExitStatus::from_raw(status));
            (error.exit_code(), error.to_string())
        };
        let killed = "the page was killed before it was ready (signal: 9 (SIGKILL)); the kernel kills processes when \
                      memory runs out, then `dmesg` names the process";
        assert_eq!(ended(9), (1, killed.to_owned()));
        assert_eq!(
            ended(15),
            (1, "the page was killed before it was ready (signal: 15 (SIGTERM))".to_owned())
        );
        assert_eq!(ended(3 << 8).0, 3);
    }
}
