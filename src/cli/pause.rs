//! Waiting between two polls of an emulator.

use super::error::CliError;
use super::exit::Exit;
use super::{output, signals};
use crate::channel::ClientError;
use crate::request::Code;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;
use std::io;
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::thread;
use std::time::Duration;

/// Real time between two polls.
const INTERVAL: Timespec = Timespec { tv_sec: 0, tv_nsec: 50_000_000 };
/// Longest real time between a signal and the end of the process. The process may be blocked by an unread output, or
/// may wait for the emulator.
const LONGEST_END: Duration = Duration::from_secs(1);

/// Result of a poll.
pub(crate) enum PollResult<T> {
    /// The emulator has answered.
    Answered(T),
    /// The emulator does not answer now, because another client advances the stepped clock.
    Later,
    /// The emulator has ended, and this command has everything.
    Ended,
    /// The emulator has ended, and its last records or changes may be missing.
    CutOff,
}

impl<T> PollResult<T> {
    /// Converts the result of a read of records or changes, which `what` names. Prints a note if the emulator of `instance`
    /// has ended.
    ///
    /// # Errors
    /// Any other error.
    pub(crate) fn of(result: Result<T, CliError>, instance: &str, what: &str) -> Result<Self, CliError> {
        match result {
            Ok(seen) => Ok(PollResult::Answered(seen)),
            Err(CliError::Client(ClientError::Timeout { .. }) | CliError::Busy { .. }) => {
                Ok(PollResult::Later)
            }
            Err(CliError::Client(ClientError::EmulatorGone { .. })) => {
                output::note(&format!("instance '{instance}' has ended; its last {what} may be missing"));
                Ok(PollResult::CutOff)
            }
            Err(error) => match last_words(&error) {
                Some(reason) => {
                    output::note(reason);
                    Ok(PollResult::Ended)
                }
                None => Err(error),
            },
        }
    }
}

/// The answer of an emulator that ends to a client that has read all records and changes: the reason for the end. `None` if
/// the error has another cause.
pub(crate) fn last_words(error: &CliError) -> Option<&str> {
    match error {
        CliError::Client(ClientError::Refused(refused)) if refused.code == Code::SHUTTING_DOWN => {
            Some(&refused.text)
        }
        _ => None,
    }
}

/// The reason why a pause is over.
pub(crate) enum PauseEnd {
    /// The interval has elapsed.
    Time,
    /// A signal requests the process to end, or the terminal was closed.
    Signal,
    /// The reader has closed the standard output.
    OutputClosed,
}

/// Pauses that end early on a signal or when the output is closed.
pub(crate) struct Pause {
    /// Read end of a socket pair; the signal handler writes a byte to the other end.
    signals: UnixStream,
}

impl Pause {
    /// Catches signals. The first signal ends a pause and, after [`LONGEST_END`], the process. The second signal ends
    /// the process at once.
    pub(crate) fn new() -> Result<Self, CliError> {
        Self::on_signals().map_err(|reason| CliError::Signals { reason })
    }

    fn on_signals() -> io::Result<Self> {
        let (signals, sender) = UnixStream::pair()?;
        for signal in signals::termination() {
            let again = Arc::new(AtomicBool::new(false));
            signal_hook::flag::register_conditional_default(signal, Arc::clone(&again))?;
            signal_hook::flag::register(signal, again)?;
            signal_hook::low_level::pipe::register(signal, sender.try_clone()?)?;
        }
        let of_thread = signals.try_clone()?;
        thread::Builder::new().name("signals".to_owned()).spawn(move || end_after_signal(&of_thread))?;
        Ok(Self { signals })
    }

    pub(crate) fn wait(&mut self) -> Result<PauseEnd, CliError> {
        let out = io::stdout();
        // The output needs no requested event: `poll` reports in any case that the reader has closed it.
        let mut files = [PollFd::new(&self.signals, PollFlags::IN), PollFd::new(&out, PollFlags::empty())];
        match poll(&mut files, Some(&INTERVAL)) {
            // A signal interrupted the call. The signal handler has written its byte, which the next call reads.
            Err(Errno::INTR) | Ok(0) => Ok(PauseEnd::Time),
            Err(reason) => Err(CliError::Output { reason: reason.into() }),
            Ok(_) if !files[0].revents().is_empty() => Ok(PauseEnd::Signal),
            Ok(_) if output::is_closed_terminal() => Ok(PauseEnd::Signal),
            Ok(_) => Ok(PauseEnd::OutputClosed),
        }
    }
}

/// Waits for a signal. Then ends the process, unless the process ends by itself in time.
fn end_after_signal(signals: &UnixStream) {
    while poll(&mut [PollFd::new(signals, PollFlags::IN)], None) == Err(Errno::INTR) {}
    thread::sleep(LONGEST_END);
    signal_hook::low_level::exit(Exit::Interrupted.code().into());
}

/// Runs a command that follows an instance. If the terminal is closed, the command ends as after a signal, even if a
/// failed write is the first sign of it.
///
/// # Errors
/// Returns the errors of `follow`.
pub(crate) fn following(follow: impl FnOnce() -> Result<(), CliError>) -> Result<(), CliError> {
    follow().map_err(|error| match error {
        CliError::Output { .. } if output::is_closed_terminal() => CliError::Ended(Exit::Interrupted.code()),
        other => other,
    })
}
