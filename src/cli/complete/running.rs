//! Completions from a running emulator. The lists are empty if it does not run or does not answer.

use super::line::instance;
use crate::cli::{Instance, error::CliError, session::Session};

fn session() -> Result<Session, CliError> {
    Session::open(&Instance::running(&instance()), 0)
}

pub(super) fn known_buses() -> Vec<String> {
    let info = session().and_then(Session::into_client).ok().and_then(|client| client.info().ok());
    info.map(|info| info.names.buses).unwrap_or_default()
}

pub(super) fn known_faults() -> Vec<(String, String)> {
    use crate::request::Op;
    let Ok(session) = session() else { return Vec::new() };
    let (Ok(info), Ok(faults)) = (session.ask(Op::Info), session.ask(Op::FaultList)) else {
        return Vec::new();
    };
    let names = info.info().map(|info| info.names).unwrap_or_default();
    let faults = faults.faults().unwrap_or_default().into_iter();
    faults.map(|it| (it.id.to_string(), it.fault.text(&names))).collect()
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
