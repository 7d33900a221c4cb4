//! Drives, independent of their connection: state, parameters and shaft.

use crate::journal::Journal;
use serde::{Deserialize, Serialize};

/// State of a drive.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DriveState {
    /// Number of the drive on its bus, if it is on a bus.
    pub number: Option<u8>,
    /// Rate of the drive's interface in kbit/s, if the drive is on a bus.
    pub kbit_s: Option<u16>,
    /// State of the drive's state machine, for example `operation_enabled`. `off` if the drive has no supply.
    pub state: String,
    /// Status word of the drive.
    pub status_word: u16,
    /// True if the drive is synchronized to its SYNC signal.
    pub is_synchronized: bool,
    /// Reference value of the speed, in increments of the drive's speed format.
    pub speed_reference: i32,
    /// Actual value of the speed, in increments of the drive's speed format.
    pub speed_actual: i32,
    /// Number of the drive's fault; 0 if there is no fault.
    pub fault: u32,
    /// Number of reference value frames that the drive has missed.
    pub lost_references: u64,
    /// True if the drive ignores reference values because too many were lost.
    pub is_stopped: bool,
}

/// A parameter of a drive.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ParameterState {
    /// Number of the parameter.
    pub number: u16,
    /// Name of the parameter; empty for a parameter that the plant file has added.
    pub name: String,
    /// Unit of the value; empty if the value has no unit.
    pub unit: String,
    /// Width of the value in bytes, 2 or 4.
    pub bytes: u8,
    /// Present value of the parameter.
    pub value: i64,
    /// Smallest value that the parameter takes.
    pub min: i64,
    /// Largest value that the parameter takes.
    pub max: i64,
    /// Only the drive itself can write the parameter.
    pub read_only: bool,
}

/// Reference and actual motion of the motor of a drive. Speeds are in increments of the drive's speed format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shaft {
    /// Speed that the drive demands of the motor: the set speed after limits and ramp.
    pub demand: i32,
    /// True if the drive feeds its motor. If false, the drive cannot influence the speed.
    pub is_fed: bool,
    /// Present speed of the motor.
    pub speed: i32,
    /// Angle of the motor. 2^32 is one revolution.
    pub angle: u32,
}

/// All visible details of a drive.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DriveDetails {
    /// State of the drive.
    pub state: DriveState,
    /// Parameters of the drive, in the order of their numbers.
    pub parameters: Vec<ParameterState>,
    /// The parameters of the drive's interface card with their numbers: ZK 0, 1, 4 and so on. Empty if the
    /// drive has no card.
    pub card: Vec<(u8, u16)>,
}

/// Reason why a parameter was not set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ParameterRefusal {
    /// The drive has no parameter of that number.
    #[error("it has no such parameter")]
    NotThere,
    /// Only the drive itself can write the parameter.
    #[error("only the drive itself writes it")]
    ReadOnly,
    /// The parameter is being recalculated.
    #[error("the drive is recalculating it; try again when some emulated time has passed")]
    NotNow,
    /// The value lies outside of its limits.
    #[error("it takes {min} to {max}")]
    Range {
        /// Smallest value that the parameter takes.
        min: i64,
        /// Largest value that the parameter takes.
        max: i64,
    },
    /// The drive has no supply.
    #[error("the drive has no supply")]
    Off,
}

/// The drives of a bus or device ([`Bus::drives`](crate::devices::Bus::drives),
/// [`Device::drives`](crate::devices::Device::drives)). The functions of this trait identify a drive by its
/// position in [`Drives::list`].
pub trait Drives {
    /// Returns the names and states of the drives, in the order of the plant file.
    fn list(&self) -> Vec<(&str, DriveState)>;

    /// Returns all details of the drive at this position.
    fn details(&self, drive: usize) -> Option<DriveDetails>;

    /// Sets a parameter of the drive at this position, as a user does at the drive itself.
    ///
    /// # Errors
    /// [`ParameterRefusal`].
    fn set_parameter(
        &mut self,
        drive: usize,
        number: u16,
        value: i64,
        now: u64,
        journal: &mut Journal,
    ) -> Result<(), ParameterRefusal>;

    /// Returns the reference and actual motion of the motor of the drive at this position.
    fn shaft(&self, drive: usize) -> Option<Shaft>;

    /// Sets the speed of the motor of the drive at this position. From then on it does not depend on the set
    /// speed. With `None` the motor follows the drive again.
    fn turn_shaft(&mut self, drive: usize, speed: Option<i32>, now: u64);

    /// Completes work that was postponed because its result was not visible. Readers get equal results
    /// without this call; it only saves time.
    fn settle(&mut self) {}
}
