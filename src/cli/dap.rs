//! `commram dap`: a debug adapter for scenarios.

mod history;
mod script;
mod session;
#[cfg(test)]
mod tests;
mod wire;

use super::editor_messages::framed;
use super::error::CliError;
use super::output;
use crate::memory::limits;
use crate::runtime;
use session::{Next, Session};
use std::sync::mpsc;

/// Debug a scenario from an editor: breakpoints, steps, variables and registers.
///
/// The editor starts this command and communicates with it over the standard input and output, by the Debug Adapter
/// Protocol. The scenario runs on a plant of its own, as in `commram test`. docs/guide/editors.md has the settings for
/// editors.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram dap")]
pub(crate) struct Args {}

/// Serves the editor until it ends the connection.
pub(crate) fn run(_: &Args) -> Result<(), CliError> {
    limits::space::allow_memory(runtime::MEMORY).map_err(|limit| CliError::LimitedMemory { limit })?;
    let (events, received) = mpsc::channel();
    let messages = events.clone();
    std::thread::Builder::new()
        .spawn(move || wire::read_all(&mut std::io::stdin().lock(), &messages))
        .map_err(|reason| CliError::Process { reason })?;
    let mut session = Session::new(events);
    for event in received {
        let mut answers = Vec::new();
        let next = session.take(event, &mut answers);
        for answer in answers {
            output::print(&framed(&answer))?;
        }
        match next {
            Next::Continue => {}
            // The thread of a scenario may still run. It ends with this process, and its plant is only memory of this
            // process.
            Next::End => return Ok(()),
            Next::Fail(reason) => return Err(CliError::Editor { reason }),
        }
    }
    Ok(())
}
