//! `commram lsp`: a language server for editors.

mod complete;
mod definition;
mod document;
mod hover;
mod judge;
mod links;
mod outline;
mod pages;
mod place;
mod rename;
mod scenario;
mod scenes;
mod schema;
mod server;
mod signature;
mod table;
mod tables;
#[cfg(test)]
mod tests;
mod text;
mod tokens;

use super::editor_messages::{self, Received};
use super::error::CliError;
use super::output;
use crate::devices::folder::edited::allow_many_folders;
use crate::script::with_stack;
use lsp_server::{ErrorCode, Message};
use serde_json::json;
use server::{Next, Server};
use std::io;
use std::sync::mpsc;

/// Serve an editor: check, complete and explain scenarios and the files of plants and devices while they are edited.
///
/// The editor starts this command and communicates with it over the standard input and output, by the Language Server
/// Protocol. No emulator needs to run. docs/guide/editors.md has the settings for editors.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram lsp
  commram lsp --stdio")]
pub(crate) struct Args {
    /// Use the standard input and output, as always; some editors give this option
    #[arg(long, hide = true)]
    stdio: bool,
}

/// Serves the editor until it ends the connection.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    let Args { stdio: _ } = args;
    with_stack(serve).map_err(|reason| CliError::Process { reason })?
}

fn serve() -> Result<(), CliError> {
    allow_many_folders();
    let (inputs, received) = mpsc::channel();
    std::thread::Builder::new()
        .spawn(move || editor_messages::read_all(&mut io::stdin().lock(), |input| inputs.send(input).is_ok()))
        .map_err(|reason| CliError::Process { reason })?;
    let mut server = Server::new();
    let mut waiting = None;
    while let Some(input) = waiting.take().or_else(|| received.recv().ok()) {
        let mut answers: Vec<Message> = Vec::new();
        let next = match input {
            Ok(Some(Received::Message(message))) => match serde_json::from_value(message) {
                Ok(message) => server.take(message, &mut answers),
                Err(reason) => refuse(
                    ErrorCode::InvalidRequest,
                    &format!("this is no message of the protocol: {reason}"),
                )?,
            },
            Ok(Some(Received::NotJson(reason))) => refuse(ErrorCode::ParseError, &reason)?,
            // If the input ends without the message `exit`, the editor has crashed.
            Ok(None) => return Ok(()),
            Err(reason) => return Err(CliError::Editor { reason }),
        };
        // Fast typing sends several changes in a row. The document is checked only after the last of them.
        waiting = received.try_recv().ok();
        if matches!(next, Next::Continue) && waiting.is_none() {
            server.settle(&mut answers);
        }
        for answer in answers {
            let mut text = Vec::new();
            answer.write(&mut text).map_err(|reason| CliError::Output { reason })?;
            output::print_bytes(&text)?;
        }
        match next {
            Next::Continue => {}
            Next::End => return Ok(()),
            Next::EndWithoutShutdown => return Err(CliError::EditorLeft),
        }
    }
    Ok(())
}

/// Answers a message that cannot be assigned to a request.
fn refuse(code: ErrorCode, reason: &str) -> Result<Next, CliError> {
    let error = json!({ "code": code as i32, "message": reason });
    let answer = json!({ "jsonrpc": "2.0", "id": null, "error": error });
    output::print(&editor_messages::framed(&answer))?;
    Ok(Next::Continue)
}
