//! The instance of a command, and the time to wait for a starting emulator.

use super::error::CliError;
use crate::memory::{InstanceLock, MemoryError, State, names};
use crate::time;
use clap::Args;
use std::time::{Duration, Instant};

/// Pause between two attempts to reach a starting emulator.
const LOOK: Duration = Duration::from_millis(5);
/// Default time to wait for a starting emulator.
const STARTING: &str = "2s";

/// Environment variable with the default instance.
pub(crate) const VARIABLE: &str = "COMMRAM_INSTANCE";
/// Name of the default instance if the variable is not set.
const USUAL: &str = "default";

/// The name of an instance.
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
    /// Returns the default instance.
    pub(crate) fn usual() -> String {
        let configured = || super::config::get().instance.clone();
        std::env::var(VARIABLE).ok().or_else(configured).unwrap_or_else(|| USUAL.to_owned())
    }
}

/// Checks the name of an instance.
///
/// # Errors
/// The name is not valid.
pub(crate) fn instance_name(text: &str) -> Result<String, MemoryError> {
    names::check_instance(text).map(|()| text.to_owned())
}

/// The instance that a command connects to.
#[derive(Args, Clone, Debug)]
pub(crate) struct Instance {
    #[command(flatten)]
    named: InstanceName,
    /// How long to wait, in real time, for a starting instance; 0s: do not wait
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
    /// Returns an instance that should already run: the command does not wait for its start.
    pub(crate) fn running(name: &str) -> Self {
        Self { named: InstanceName { name: name.to_owned() }, connect_timeout: 0 }
    }

    /// Returns an instance that may be starting, with the default waiting time.
    pub(crate) fn starting(name: &str) -> Self {
        let connect_timeout = time::parse(STARTING).unwrap_or_default();
        Self { connect_timeout, ..Self::running(name) }
    }

    pub(crate) fn name(&self) -> &str {
        &self.named.name
    }

    /// Repeats `attempt` until it succeeds or the waiting time is over. An error that a starting emulator cannot cause
    /// ends the attempts.
    ///
    /// # Errors
    /// The error of the last attempt.
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

    /// True if a starting emulator can cause this error.
    fn may_be_starting(&self, error: &CliError) -> bool {
        use MemoryError::{NotReady, NotThere};
        match error {
            CliError::NotRunning { .. } | CliError::NoImages { .. } | CliError::Dead { .. } => true,
            CliError::Memory(NotReady { state, .. }) => *state == Some(State::Starting),
            CliError::Memory(NotThere { .. }) => true,
            // The emulator has not completed the channel yet.
            CliError::Client(
                crate::channel::ClientError::Unanswered { .. } | crate::channel::ClientError::Connect { .. },
            ) => true,
            _ => false,
        }
    }

    /// True if another emulator is taking over the files of a killed emulator.
    ///
    /// # Errors
    /// Returns the errors of [`InstanceLock::holder`].
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
    fn a_starting_instance_is_waited_for() {
        let left = Cell::new(3);
        let attempt = || match left.replace(left.get() - 1) {
            0 => Ok("there"),
            _ => Err(not_running()),
        };
        assert_eq!(Instance::starting("x").reach(attempt).unwrap(), "there");
    }

    #[test]
    fn other_errors_fail_at_once() {
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
