//! Operations for the words of the command line: register names, values, faults, settings.

use super::{Fields, Shown, named};
use crate::cli::error::CliError;
use crate::cli::web::link::Connection;
use crate::cli::web::problem::Problem;
use crate::cli::writes::RegisterWrite;
use crate::cli::{board, poke, wait};
use crate::devices;
use crate::fault::FaultSpec;
use crate::memory::header::BoardAssignment;
use crate::request::Op;

/// Returns the operations for all fields, in the order of the fields.
pub(super) fn show(connection: &mut Connection, fields: &Fields<'_>) -> Result<Shown, Problem> {
    let session = &connection.session;
    let is_write = |name: &str| matches!(name, "poke" | "force");
    let places = fields.pairs.iter().filter(|(name, _)| is_write(name));
    let places = places.map(|(_, text)| poke::parse(text, |name| session.place(name)));
    let mut writes = RegisterWrite::of(session, &places.collect::<Result<Vec<_>, CliError>>()?)?.into_iter();
    let mut ops = Vec::new();
    for (name, text) in fields.pairs {
        let write = is_write(name).then(|| writes.next()).flatten();
        ops.push(match write {
            Some(write) if name == "poke" => write.store(),
            Some(write) => write.force(),
            None => operation(connection, name, text)?,
        });
    }
    named("operations", ops)
}

/// Returns the operation for a field that is no write of a register.
fn operation(connection: &Connection, name: &str, text: &str) -> Result<Op, CliError> {
    let session = &connection.session;
    Ok(match name {
        "unforce" => {
            let place = session.place(text)?;
            let (offset, width) = place.whole();
            Op::Unforce { plc: session.plc_of(&place)?, offset, width }
        }
        "condition" => {
            let mut ops = wait::conditions_of(session, &[text.to_owned()])?;
            ops.pop().ok_or(crate::request::WrongReply)?
        }
        "board" => board::operation(session, &BoardAssignment::parse(text)?)?,
        "fault" => {
            let mut words = text.split_whitespace();
            let kind = words.next().unwrap_or_default();
            let kinds = devices::emulation::catalogue::fault_kinds_of(&connection.names);
            let spec = FaultSpec::from_words(&kinds, kind, &words.collect::<Vec<_>>())?;
            Op::FaultAdd { fault: spec.resolve(&kinds, &connection.names)? }
        }
        _ => {
            let (plc, node) = session.port(text)?;
            Op::AdvanceToSync { plc, node }
        }
    })
}
