//! Drives: their states and parameters.

use super::{Code, DriveEntry, Host, Refused, Reply};
use crate::devices::ParameterRefusal;
use crate::plant::PlantDrive;

/// Returns the drives and their states.
pub(super) fn drives(host: &dyn Host) -> Reply {
    let entry = |PlantDrive { name, bus, state }| DriveEntry { name, bus, state };
    Reply::Drives(host.plant().drives().into_iter().map(entry).collect())
}

/// Returns all details of a drive.
pub(super) fn drive(host: &dyn Host, drive: u16) -> Result<Reply, Refused> {
    let details = host.plant().drive(drive.into());
    details.map(|details| Reply::Drive(Box::new(details))).ok_or_else(|| unknown(host, drive))
}

/// Sets a parameter.
pub(super) fn set(host: &mut dyn Host, drive: u16, number: u16, value: i64) -> Result<Reply, Refused> {
    match host.plant_mut().set_parameter(drive.into(), number, value) {
        Some(Ok(())) => Ok(Reply::Written),
        Some(Err(refusal)) => {
            let code = match refusal {
                ParameterRefusal::Off | ParameterRefusal::NotNow => Code::NOT_NOW,
                _ => Code::PARAMETER,
            };
            let drives = host.plant().drives();
            let name = drives.get(usize::from(drive)).map_or("", |drive| drive.name.as_str());
            Err(Refused::new(code, format_args!("drive '{name}': P{number} = {value}: {refusal}")))
        }
        None => Err(unknown(host, drive)),
    }
}

fn unknown(host: &dyn Host, drive: u16) -> Refused {
    let count = host.plant().drives().len();
    let text = format_args!("there is no drive number {drive}; the instance has {count}, counted from 0");
    Refused::new(Code::UNKNOWN_DRIVE, text)
}
