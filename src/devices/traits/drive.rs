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
    /// State of the drive's state machine: `operation_enabled`; `off` without supply.
    pub state: String,
    /// Status word of the drive.
    pub status_word: u16,
    /// True if the drive runs in step with its SYNC signal.
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
    /// Unit of the value; empty if it has none.
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
    /// The set speed of the motor: after the limits and the ramp of the drive.
    pub demand: i32,
    /// True if the drive feeds its motor. Otherwise it cannot influence the speed.
    pub is_fed: bool,
    /// Present speed of the motor.
    pub speed: i32,
    /// Angle of the motor, in parts of 2^32 of a revolution.
    pub angle: u32,
}

/// All visible details of a drive.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DriveDetails {
    /// State of the drive.
    pub state: DriveState,
    /// Parameters of the drive, in the order of their numbers.
    pub parameters: Vec<ParameterState>,
    /// The parameters of the drive's interface card, by their numbers: ZK 0, 1, 4 ...; empty if the drive has no card.
    pub card: Vec<(u8, u16)>,
}

/// Reason for which a parameter was not set.
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
/// [`Device::drives`](crate::devices::Device::drives)). The position of a drive in [`Drives::list`] is its number here.
pub trait Drives {
    /// Returns the drives in the order of the plant file: names and states.
    fn list(&self) -> Vec<(&str, DriveState)>;

    /// Returns all details of the drive at this place in [`Drives::list`].
    fn details(&self, drive: usize) -> Option<DriveDetails>;

    /// Sets a parameter of the drive at this place, as a user does at the drive itself.
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

    /// Reference and actual motion of the motor of the drive at this place.
    fn shaft(&self, drive: usize) -> Option<Shaft>;

    /// Sets the speed of the motor of the drive at this place, independently of the set speed. With `None` the motor
    /// follows the drive.
    fn turn_shaft(&mut self, drive: usize, speed: Option<i32>, now: u64);

    /// Does work that was postponed because its result was not visible. Readers get the same result without this call;
    /// the call only saves time.
    fn settle(&mut self) {}
}
