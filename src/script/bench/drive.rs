//! The states of drives.

use super::Bench;
use crate::devices::DriveDetails;
use crate::request::Op;
use crate::script::ScenarioError;

impl Bench {
    /// Returns the names of all drives.
    ///
    /// # Errors
    /// The emulator of the instance has ended.
    #[cfg(feature = "cli")]
    pub(crate) fn drive_names(&mut self) -> Result<Vec<String>, ScenarioError> {
        let drives = self.ask(Op::Drives)?.drives()?;
        Ok(drives.into_iter().map(|drive| drive.name).collect())
    }

    /// Returns the state and parameters of a drive. `name` is its name in the plant file, or `line:drive` for the drive
    /// that contains PLC `line`.
    ///
    /// # Errors
    /// There is no such drive.
    pub fn drive(&mut self, name: &str) -> Result<DriveDetails, ScenarioError> {
        let drives = self.ask(Op::Drives)?.drives()?;
        match (0..).zip(&drives).find(|(_, drive)| drive.name == name) {
            Some((drive, _)) => Ok(self.ask(Op::Drive { drive })?.drive()?),
            None => {
                let names: Vec<_> = drives.into_iter().map(|drive| drive.name).collect();
                Err(ScenarioError::Unknown { what: "drive", name: name.to_owned(), known: names.join(", ") })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drive_has_its_state_and_parameters() {
        let mut bench = Bench::built_in().unwrap();
        let drive = bench.drive("drive1").unwrap();
        assert_eq!((drive.state.number, drive.state.fault), (Some(1), 0));
        assert!(drive.parameters.iter().any(|parameter| parameter.number == 167));
        let unknown = bench.drive("drive9").unwrap_err().to_string();
        assert_eq!(unknown, "there is no drive 'drive9'; there are: drive1, drive2, drive3, line:drive");
    }
}
