//! Causes for the end of the server: a signal, or the end of its emulator.

use super::hub::Served;
use crate::cli::Instance;
use crate::cli::error::CliError;
use crate::cli::exit::Exit;
use crate::cli::output;
use crate::cli::session::Session;
use crate::cli::start::{end_at_second_ctrl_c, in_thread};
use crate::memory::RunningInstance;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tokio::sync::watch;

/// Longest pause between two checks whether the emulator still runs.
const ALIVE_CHECK: Duration = Duration::from_millis(200);

/// Notices the end.
pub(super) struct Ending {
    ends: watch::Receiver<bool>,
    by_signal: Arc<AtomicBool>,
}

impl Ending {
    /// Watches for signals, and for the end of the emulator of a single instance.
    ///
    /// # Errors
    /// The instance is not running, or signals cannot be caught.
    pub(super) fn watch(served: &Served, instance: &Instance) -> Result<Self, CliError> {
        let (sender, ends) = watch::channel(false);
        let (sender, by_signal) = (Arc::new(sender), Arc::new(AtomicBool::new(false)));
        watch_signals(Arc::clone(&sender), Arc::clone(&by_signal))?;
        if let Served::One(name) = served {
            // Fails with the reason if the emulator cannot be reached.
            drop(Session::open(instance, 0)?);
            watch_emulator(name, sender)?;
        }
        Ok(Self { ends, by_signal })
    }

    /// Becomes true at the end.
    pub(super) fn receiver(&self) -> watch::Receiver<bool> {
        self.ends.clone()
    }

    /// The result of the command.
    ///
    /// # Errors
    /// The user has interrupted it.
    pub(super) fn result(&self) -> Result<(), CliError> {
        match self.by_signal.load(Ordering::Relaxed) {
            true => Err(CliError::Ended(Exit::Interrupted.code())),
            false => Ok(()),
        }
    }
}

/// The first signal ends the server in an orderly way, the second Ctrl-C at once. Other signals may be repeated: a
/// killed emulator sends one for each of its threads.
fn watch_signals(sender: Arc<watch::Sender<bool>>, by_signal: Arc<AtomicBool>) -> Result<(), CliError> {
    let refused = |reason: io::Error| CliError::Signals { reason };
    end_at_second_ctrl_c()?;
    output::give_up_after(Arc::clone(&by_signal));
    let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP]).map_err(refused)?;
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
