//! Running instances: their list, and connections to their channel.

use crate::errors;
use commram::channel::client::Patience;
use commram::channel::{Client, HeaderBells};
use commram::devices;
use commram::memory::names::channel_root;
use commram::memory::{AttachMode, Condition, MemoryError, list};
use core::time::Duration;
use pyo3::prelude::*;
use std::time::Instant;

/// Pause between two checks whether an instance has started.
const PAUSE: Duration = Duration::from_millis(10);
/// Timeout of a reply. A verb requests at most 100 ms of emulated time in one request. With a slow clock, this takes a
/// longer real time.
const REPLY: Duration = Duration::from_secs(60);

/// Connects to an instance; waits up to the given time for an instance that does not exist yet.
///
/// # Errors
/// The instance does not exist or refuses the connection, or a signal handler has raised an exception.
pub(crate) fn connect(instance: &str, patience: Duration) -> PyResult<Client> {
    let start = Instant::now();
    loop {
        match enter(instance) {
            Err(error) if start.elapsed() >= patience => return Err(error),
            Err(_) if errors::is_interrupted() => return Err(errors::interrupt()),
            Err(_) => std::thread::sleep(PAUSE),
            client => return client,
        }
    }
}

fn enter(instance: &str) -> PyResult<Client> {
    let plc = plcs(instance)?.into_iter().next().unwrap_or_default();
    let (attached, _) =
        devices::attach(instance, &plc, AttachMode::HeaderOnly).map_err(|e| errors::memory(&e))?;
    let bells = HeaderBells::of_client(attached).map_err(|error| errors::memory(&error))?;
    let root = channel_root(instance).map_err(|error| errors::memory(&error))?;
    let patience = Patience { reply: REPLY, ..Patience::default() };
    Client::connect(instance, &root, Box::new(bells), patience).map_err(|error| errors::client(&error))
}

/// Returns the PLCs of an instance, at least one. They are the PLCs that an emulator serves, or those that a dead
/// emulator has left.
///
/// # Errors
/// No instance of this name runs; the error lists the running ones.
pub(crate) fn plcs(instance: &str) -> PyResult<Vec<String>> {
    commram::memory::names::check_instance(instance).map_err(|error| errors::memory(&error))?;
    let images = list().map_err(|error: MemoryError| errors::memory(&error))?;
    let is_alive = |condition: &Condition| matches!(condition, Condition::Alive(_));
    let mut own: Vec<_> = images.iter().filter(|image| image.instance == instance).collect();
    if own.iter().any(|image| is_alive(&image.condition)) {
        own.retain(|image| is_alive(&image.condition));
    }
    if !own.is_empty() {
        return Ok(own.iter().map(|image| image.plc.clone()).collect());
    }
    let mut running: Vec<_> = images
        .iter()
        .filter(|image| is_alive(&image.condition))
        .map(|image| image.instance.as_str())
        .collect();
    running.dedup();
    let running =
        if running.is_empty() { String::new() } else { format!(" (running: {})", running.join(", ")) };
    let text =
        format!("no instance '{instance}' is running{running}; start it with `commram run -i {instance}`");
    Err(errors::of_class("NotAttached", text))
}
