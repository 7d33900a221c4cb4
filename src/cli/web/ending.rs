//! Causes for the end of the server: a signal, or the end of its emulator.

use super::hub::Served;
use crate::cli::Instance;
use crate::cli::error::CliError;
use crate::cli::exit::Exit;
use crate::cli::output;
use crate::cli::session::Session;
use crate::cli::signals;
use crate::cli::start::{end_at_second_ctrl_c, in_thread};
use crate::memory::RunningInstance;
use signal_hook::iterator::Signals;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tokio::sync::watch;

/// Longest pause between two checks whether the emulator still runs.
const ALIVE_CHECK: Duration = Duration::from_millis(200);

/// Detects the end of the emulator, and signals.
pub(super) struct Ending {
    ends: watch::Receiver<bool>,
    by_signal: Arc<AtomicBool>,
}

impl Ending {
    /// Starts to watch for signals and, if a single instance is served, for the end of its emulator.
    ///
    /// # Errors
    /// The instance is not running, or signals cannot be caught.
    pub(super) fn watch(served: &Served, instance: &Instance) -> Result<Self, CliError> {
        let (sender, ends) = watch::channel(false);
        let (sender, by_signal) = (Arc::new(sender), Arc::new(AtomicBool::new(false)));
        watch_signals(Arc::clone(&sender), Arc::clone(&by_signal))?;
        if let Served::One(name) = served {
            // This line fails with the reason if the emulator cannot be reached.
            drop(Session::open(instance, 0)?);
            watch_emulator(name, sender)?;
        }
        Ok(Self { ends, by_signal })
    }

    /// Returns a receiver for a value that becomes true when the server has to end.
    pub(super) fn receiver(&self) -> watch::Receiver<bool> {
        self.ends.clone()
    }

    /// Returns the result of the command.
    ///
    /// # Errors
    /// The user has interrupted the server.
    pub(super) fn result(&self) -> Result<(), CliError> {
        match self.by_signal.load(Ordering::Relaxed) {
            true => Err(CliError::Ended(Exit::Interrupted.code())),
            false => Ok(()),
        }
    }
}

/// Handles signals. The first signal ends the server cleanly; a second Ctrl-C ends it at once. Other signals
/// may arrive repeatedly: a killed emulator sends one for each of its threads.
fn watch_signals(sender: Arc<watch::Sender<bool>>, by_signal: Arc<AtomicBool>) -> Result<(), CliError> {
    let refused = |reason: io::Error| CliError::Signals { reason };
    end_at_second_ctrl_c()?;
    output::give_up_after(Arc::clone(&by_signal));
    let mut signals = Signals::new(signals::termination()).map_err(refused)?;
    in_thread(move || {
        for _ in signals.forever() {
            by_signal.store(true, Ordering::Relaxed);
            sender.send_replace(true);
        }
    })?;
    Ok(())
}

fn watch_emulator(name: &str, sender: Arc<watch::Sender<bool>>) -> Result<(), CliError> {
    let running = RunningInstance::find(name)?;
    let name = name.to_owned();
    in_thread(move || {
        if let Some(running) = running {
            while !running.has_ended() {
                match running.process() {
                    Some(process) => drop(process.wait(ALIVE_CHECK)),
                    None => std::thread::sleep(ALIVE_CHECK),
                }
            }
        }
        output::note(&format!("instance '{name}' has ended"));
        sender.send_replace(true);
    })?;
    Ok(())
}
