//! Operations on drives: states and parameters.

use super::Work;
use crate::devices::ParameterRefusal;
use crate::plant::PlantDrive;
use crate::request::{Code, DriveEntry, Host, Refused, Reply};

impl Work<'_> {
    pub(super) fn drives(&mut self) -> Result<Reply, Refused> {
        let entry = |PlantDrive { name, bus, state }| DriveEntry { name, bus, state };
        Ok(Reply::Drives(self.host.plant().drives().into_iter().map(entry).collect()))
    }

    pub(super) fn drive(&mut self, drive: u16) -> Result<Reply, Refused> {
        let details = self.host.plant().drive(drive.into());
        details.map(|details| Reply::Drive(Box::new(details))).ok_or_else(|| unknown(self.host, drive))
    }

    pub(super) fn set_parameter(&mut self, drive: u16, number: u16, value: i64) -> Result<Reply, Refused> {
        match self.host.plant_mut().set_parameter(drive.into(), number, value) {
            Some(Ok(())) => Ok(Reply::Written),
            Some(Err(refusal)) => {
                let code = match refusal {
                    ParameterRefusal::Off | ParameterRefusal::NotNow => Code::NOT_NOW,
                    _ => Code::PARAMETER,
                };
                let drives = self.host.plant().drives();
                let name = drives.get(usize::from(drive)).map_or("", |drive| drive.name.as_str());
                Err(Refused::new(code, format_args!("drive '{name}': P{number} = {value}: {refusal}")))
            }
            None => Err(unknown(self.host, drive)),
        }
    }
}

fn unknown(host: &dyn Host, drive: u16) -> Refused {
    let count = host.plant().drives().len();
    let text = format_args!("there is no drive number {drive}; the instance has {count}, counted from 0");
    Refused::new(Code::UNKNOWN_DRIVE, text)
}
