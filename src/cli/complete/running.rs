//! Completions from a running emulator. The lists are empty if it does not run or does not answer at once: the shell of the
//! user waits for them.

use super::line::instance;
use crate::cli::{error::CliError, session::Session};
use std::time::Duration;

/// Longest wait for an emulator.
const PATIENCE: Duration = Duration::from_millis(300);

fn session() -> Result<Session, CliError> {
    Session::open_within(&instance(), PATIENCE)
}

pub(super) fn known_buses() -> Vec<String> {
    let info = session().and_then(|session| session.info());
    info.map(|info| info.names.buses).unwrap_or_default()
}

pub(super) fn known_faults() -> Vec<(String, String)> {
    use crate::request::Op;
    let Ok(replies) = session().and_then(|session| session.request(&[Op::Info, Op::FaultList])) else {
        return Vec::new();
    };
    let mut replies = replies.into_iter();
    let names = replies.next().and_then(|info| Some(info.info().ok()?.names)).unwrap_or_default();
    let faults = replies.next().and_then(|faults| faults.faults().ok()).unwrap_or_default();
    faults.into_iter().map(|it| (it.id.to_string(), it.fault.text(&names))).collect()
}

/// Returns the drives with their states.
pub(super) fn known_drives() -> Vec<(String, String)> {
    use crate::request::Op;
    let drives = session().and_then(|session| Ok(session.ask(Op::Drives)?.drives()?)).unwrap_or_default();
    drives.into_iter().map(|drive| (drive.name, drive.state.state)).collect()
}

/// Returns the parameters of a drive that can be set, with their descriptions.
pub(super) fn known_parameters(drive: u16) -> Vec<(String, String)> {
    use crate::request::Op;
    let details = session().and_then(|session| Ok(session.ask(Op::Drive { drive })?.drive()?));
    let parameters = details.map(|details| details.parameters).unwrap_or_default().into_iter();
    parameters.filter(|it| !it.read_only).map(|it| (format!("P{}", it.number), it.name)).collect()
}
