//! `commram with`: an emulator for as long as a command runs.

use super::error::CliError;
use super::instance::instance_name;
use super::output;
use super::start::{Begin, OnSignal, Settings, SignalsTaken};
use rustix::process::{Pid, PidfdFlags, Signal};
use signal_hook::consts::SIGINT;
use std::ffi::OsString;
use std::io::{self, IsTerminal};
use std::os::fd::OwnedFd;
use std::os::unix::process::ExitStatusExt;
use std::path::PathBuf;
use std::process::{Child, Command, ExitStatus};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// As shells have it: the command is there and cannot be started.
const CANNOT_RUN: u8 = 126;
/// As shells have it: there is no such command.
const NO_SUCH_COMMAND: u8 = 127;
/// As shells have it: the exit code of a process that was ended by signal 0.
const BY_SIGNAL: i32 = 128;

/// Run a command with an emulator of its own.
///
/// Starts an emulator, runs the command when it is ready, ends the emulator when the command has ended, and ends with the
/// exit code of the command. The command and what it starts find the emulator by COMMRAM_INSTANCE, which is set to its
/// name: without -i one that nobody else has, so that several can run at once. Signals are passed on to the command.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram with -- commram peek node2.w_OPTION_STATUS
  commram with plant.toml --clock stepped -- ./run-tests.sh
  commram with -- sh -c './soft_plc /dev/shm/commram.$COMMRAM_INSTANCE.line'

Exit codes: that of COMMAND, 128 + n if signal n has ended it; 126 if it cannot be started, 127 if there is no such \
command. If the emulator does not start, as all commands; 1 also if it could not end in good order.")]
pub(crate) struct Args {
    /// The plant: PLCs, buses, drives [default: the built-in one]
    #[arg(add = super::complete::files(&["toml"]), value_name = "PLANT.toml")]
    plant: Option<PathBuf>,
    /// Name of the instance [default: one of its own]
    #[arg(short, long, value_name = "NAME", value_parser = instance_name)]
    instance: Option<String>,
    #[command(flatten)]
    settings: Settings,
    /// The command and its arguments
    #[arg(value_name = "COMMAND", last = true, required = true)]
    command: Vec<OsString>,
}

/// Runs emulator and command.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    let name = args.instance.clone().unwrap_or_else(|| format!("with-{}", std::process::id()));
    let [program, arguments @ ..] = args.command.as_slice() else { return Ok(()) };
    let mut command = Command::new(program);
    command.args(arguments).env("COMMRAM_INSTANCE", &name);
    let signals = SignalsTaken::take()?;
    let (mut emulator, started) = args.settings.start(
        args.plant.as_deref().map_or(Begin::BuiltIn, Begin::Plant),
        &name,
        signals,
        false,
    )?;
    let stop = emulator.stop_handle();
    // As long as it is there, a signal waits for its end; what cannot be started ends the emulator at once.
    let child = command.spawn();
    let passed = child.as_ref().map(pass_on);
    if let Ok(Ok(pass_on)) = passed {
        let _ = started.send(pass_on);
    }
    let is_done = Arc::new(AtomicBool::new(false));
    let done = Arc::clone(&is_done);
    let command = std::thread::spawn(move || {
        let ended = child.and_then(|mut child| child.wait());
        done.store(true, Ordering::Release);
        stop.stop();
        ended
    });
    let outcome = emulator.run();
    drop(emulator);
    if !is_done.load(Ordering::Acquire) {
        output::note(&format!("instance '{name}' has ended before the command"));
    }
    let ended = command.join().unwrap_or_else(|_| Err(io::ErrorKind::Other.into()));
    let ended = match ended {
        Ok(status) if status.success() => return Ok(outcome?),
        Ok(status) => ended_like(status),
        Err(reason) => {
            output::complain(&format!("cannot run {}: {reason}", program.display()));
            let missing = reason.kind() == io::ErrorKind::NotFound;
            CliError::Ended { code: if missing { NO_SUCH_COMMAND } else { CANNOT_RUN } }
        }
    };
    if let Err(error) = outcome {
        output::complain(&error.to_string());
    }
    Err(ended)
}

/// This process ends as another one has ended.
pub(crate) fn ended_like(status: ExitStatus) -> CliError {
    let code = status.code().or_else(|| Some(BY_SIGNAL + status.signal()?));
    CliError::Ended { code: code.and_then(|code| u8::try_from(code).ok()).unwrap_or(u8::MAX) }
}

/// Passes signals on to a process, whatever becomes of its number. Ctrl-C at the terminal reaches it by itself.
fn pass_on(child: &Child) -> io::Result<OnSignal> {
    let number = i32::try_from(child.id()).ok().and_then(Pid::from_raw);
    let number = number.ok_or(io::ErrorKind::InvalidInput)?;
    let process = rustix::process::pidfd_open(number, PidfdFlags::empty())?;
    Ok(Box::new(move |signal| {
        if let Some(named) = Signal::from_named_raw(signal)
            && !(signal == SIGINT && is_ours_in_the_terminal())
        {
            send(&process, named);
        }
    }))
}

fn send(process: &OwnedFd, signal: Signal) {
    // It has just ended, which is what was wanted.
    let _ = rustix::process::pidfd_send_signal(process, signal);
}

/// Whether the terminal sends Ctrl-C to this process and its command.
fn is_ours_in_the_terminal() -> bool {
    let input = io::stdin();
    let foreground = || rustix::termios::tcgetpgrp(&input).ok();
    input.is_terminal() && foreground() == Some(rustix::process::getpgrp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_ends_as_its_command_has_ended() {
        assert_eq!(ended_like(ExitStatus::from_raw(42 << 8)).exit_code(), 42);
        assert_eq!(ended_like(ExitStatus::from_raw(SIGINT)).exit_code(), 130);
    }
}
