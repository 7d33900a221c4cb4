//! Which emulator a command is about, and how long it waits for one that is just starting.

use super::error::CliError;
use crate::memory::{InstanceLock, MemoryError, State, names};
use crate::time;
use clap::Args;
use std::time::{Duration, Instant};

/// Pause between two looks for an emulator that is just starting.
const LOOK: Duration = Duration::from_millis(5);
/// How long commands wait for an emulator that is just starting, unless told otherwise.
const STARTING: &str = "2s";

/// Names the instance that is meant if none is given.
const VARIABLE: &str = "COMMRAM_INSTANCE";
/// The one that is meant if nothing names any.
const USUAL: &str = "default";

/// The name of an emulator.
#[derive(Args, Clone, Debug)]
pub(crate) struct InstanceName {
    /// Name of the instance
    #[arg(
        add = super::complete::instances(),
        short = 'i',
        long = "instance",
        value_name = "NAME",
        env = VARIABLE,
        hide_env_values = true,
        default_value = USUAL,
        value_parser = instance_name
    )]
    pub name: String,
}

impl InstanceName {
    /// The one that is meant if none is given.
    pub(crate) fn usual() -> String {
        std::env::var(VARIABLE).unwrap_or_else(|_| USUAL.to_owned())
    }
}

/// Parses the name of an instance.
///
/// # Errors
/// It is none.
pub(crate) fn instance_name(text: &str) -> Result<String, MemoryError> {
    names::check_instance(text).map(|()| text.to_owned())
}

/// The emulator that a command talks to.
#[derive(Args, Clone, Debug)]
pub(crate) struct Instance {
    #[command(flatten)]
    named: InstanceName,
    /// How long to wait, in real time, for an instance that is just starting; 0s: not at all
    #[arg(
        long,
        value_name = "TIME",
        env = "COMMRAM_CONNECT_TIMEOUT",
        hide_env_values = true,
        default_value = STARTING,
        value_parser = time::parse
    )]
    connect_timeout: u64,
}

impl Instance {
    /// One that is there, or else is not waited for.
    pub(crate) fn running(name: &str) -> Self {
        Self { named: InstanceName { name: name.to_owned() }, connect_timeout: 0 }
    }

    /// One that may be just starting.
    pub(crate) fn starting(name: &str) -> Self {
        let connect_timeout = time::parse(STARTING).unwrap_or_default();
        Self { connect_timeout, ..Self::running(name) }
    }

    /// Its name.
    pub(crate) fn name(&self) -> &str {
        &self.named.name
    }

    /// Tries to get there until it works, or fails for another reason than that the emulator is just starting, or the
    /// patience is over.
    ///
    /// # Errors
    /// Those of the last try.
    pub(crate) fn reach<T>(&self, attempt: impl Fn() -> Result<T, CliError>) -> Result<T, CliError> {
        let patience = Duration::from_micros(self.connect_timeout);
        let start = Instant::now();
        loop {
            match attempt() {
                Err(error) if start.elapsed() < patience && self.may_be_starting(&error) => {
                    std::thread::sleep(LOOK.min(patience));
                }
                other => return other,
            }
        }
    }

    /// Whether an emulator that is just starting can be the reason.
    fn may_be_starting(&self, error: &CliError) -> bool {
        use MemoryError::{NotReady, NotThere};
        match error {
            CliError::NotRunning { .. } | CliError::NoImages { .. } | CliError::Dead { .. } => true,
            CliError::Memory(NotReady { state, .. }) => *state == Some(State::Starting),
            CliError::Memory(NotThere { .. }) => true,
            // The channel was found before it was complete.
            CliError::Client(
                crate::channel::ClientError::Unanswered { .. } | crate::channel::ClientError::Connect { .. },
            ) => true,
            _ => false,
        }
    }

    /// Whether somebody is about to take over what a killed emulator has left.
    ///
    /// # Errors
    /// As [`InstanceLock::holder`].
    pub(crate) fn is_being_taken_over(&self) -> Result<bool, CliError> {
        Ok(self.connect_timeout > 0 && InstanceLock::holder(self.name())?.is_some())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    fn not_running() -> CliError {
        CliError::NotRunning { instance: "x".into(), running: String::new() }
    }

    #[test]
    fn one_that_is_just_starting_is_waited_for() {
        let left = Cell::new(3);
        let attempt = || match left.replace(left.get() - 1) {
            0 => Ok("there"),
            _ => Err(not_running()),
        };
        assert_eq!(Instance::starting("x").reach(attempt).unwrap(), "there");
    }

    #[test]
    fn everything_else_fails_at_once() {
        let tries = Cell::new(0);
        let attempt = |error: fn() -> CliError| move || Err::<(), _>(error());
        let count = |error: fn() -> CliError, instance: Instance| {
            tries.set(0);
            let attempt = attempt(error);
            let counted = || {
                tries.set(tries.get() + 1);
                attempt()
            };
            assert!(instance.reach(counted).is_err());
            tries.get()
        };
        assert_eq!(count(not_running, Instance::running("x")), 1);
        assert_eq!(count(|| CliError::Reported, Instance::starting("x")), 1);
        let gone = || CliError::Memory(MemoryError::EmulatorDied { path: "x".into(), pid: 1 });
        assert_eq!(count(gone, Instance::starting("x")), 1);
        let short = Instance { connect_timeout: 12_000, ..Instance::running("x") };
        assert!(count(not_running, short) > 1);
    }
}
