//! `commram lsp`: a language server for editors.

mod complete;
mod definition;
mod document;
mod hover;
mod judge;
mod outline;
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

use super::error::CliError;
use crate::devices::folder::edited::allow_many_folders;
use crate::script::with_stack;
use lsp_server::{Connection, Message};
use server::{Next, Server};

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
    let (connection, threads) = Connection::stdio();
    let mut server = Server::new();
    let mut next = Next::Continue;
    let mut waiting = None;
    'messages: while let Some(message) = waiting.take().or_else(|| connection.receiver.recv().ok()) {
        let mut answers: Vec<Message> = Vec::new();
        next = server.take(message, &mut answers);
        // Fast typing sends several changes in a row. The document is checked only after the last of them.
        waiting = connection.receiver.try_recv().ok();
        if matches!(next, Next::Continue) && waiting.is_none() {
            server.settle(&mut answers);
        }
        for answer in answers {
            if connection.sender.send(answer).is_err() {
                break 'messages;
            }
        }
        if !matches!(next, Next::Continue) {
            break;
        }
    }
    drop(connection);
    match next {
        Next::EndWithoutShutdown => Err(CliError::EditorLeft),
        // If the input ends without the message `exit`, the editor has crashed.
        _ => threads.join().map_err(|reason| CliError::Editor { reason }),
    }
}
