//! Operations for the words of the command line: register names, values, faults, settings.

use super::{Fields, Shown, named};
use crate::cli::error::CliError;
use crate::cli::web::link::Connection;
use crate::cli::web::problem::Problem;
use crate::cli::{board, poke, wait};
use crate::devices;
use crate::fault::FaultSpec;
use crate::memory::header::BoardAssignment;
use crate::request::Op;

/// Returns the operations for all fields, in the order of the fields.
pub(super) fn show(connection: &mut Connection, fields: &Fields<'_>) -> Result<Shown, Problem> {
    let mut ops = Vec::new();
    for (name, text) in fields.pairs {
        ops.push(operation(connection, name, text)?);
    }
    named("operations", ops)
}

fn operation(connection: &Connection, name: &str, text: &str) -> Result<Op, CliError> {
    let session = &connection.session;
    Ok(match name {
        "poke" | "force" => {
            let (place, value) = poke::parse(text, |name| session.place(name))?;
            let (plc, offset, width) = (session.plc_of(&place)?, place.offset(), place.width());
            match name {
                "poke" => Op::Poke { plc, offset, width, value },
                _ => Op::Force { plc, offset, width, value },
            }
        }
        "unforce" => {
            let place = session.place(text)?;
            Op::Unforce { plc: session.plc_of(&place)?, offset: place.offset(), width: place.width() }
        }
        "condition" => {
            let mut ops = wait::conditions_of(session, &[text.to_owned()])?;
            ops.pop().ok_or(crate::request::WrongReply)?
        }
        "board" => board::operation(session, &BoardAssignment::parse(text)?)?,
        "fault" => {
            let mut words = text.split_whitespace();
            let kind = words.next().unwrap_or_default();
            let kinds = devices::fault_kinds_of(&connection.names);
            let spec = FaultSpec::from_words(&kinds, kind, &words.collect::<Vec<_>>())?;
            Op::FaultAdd { fault: spec.resolve(&kinds, &connection.names)? }
        }
        _ => {
            let (plc, node) = session.port(text)?;
            Op::AdvanceToSync { plc, node }
        }
    })
}
