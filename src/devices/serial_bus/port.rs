//! The serial port of a device.

use crate::devices::Context;
use crate::journal::Origin;
use crate::layout::DeviceLayout;
use crate::memory::Segment;
use crate::serial::{CharacterFormat, Received, Signal, Wires};
use crate::snapshot_fields::SnapshotFields;
use serde::{Deserialize, Serialize};

/// Settings of a port that is switched on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct PortSetup {
    /// Format of the characters that the port sends and expects.
    pub format: CharacterFormat,
    /// On four wires the port's transmitter is always active. On two wires it is active while the port sends.
    pub wires: Wires,
    /// True if the pull-up and pull-down resistors of the port are connected to the line.
    pub has_pull: bool,
    /// True if the terminating resistor of the port is connected to the line.
    pub is_terminated: bool,
}

/// Properties of a line that a port must fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LineState {
    /// Format of the other participants.
    pub format: CharacterFormat,
    /// Number of wires.
    pub wires: Wires,
    /// Number of terminating resistors on the line, including those of ports.
    pub terminators: u32,
    /// Number of participants with pull-up and pull-down resistors.
    pub pulls: u32,
}

/// Firmware of a device's serial port. The bus calls it at whole microseconds of emulated time.
pub(crate) trait SerialPort: Send + SnapshotFields {
    /// Called when the device stops.
    fn power_off(&mut self);

    /// Runs a processor cycle: reads the registers.
    fn look(&mut self, ctx: &mut Context);

    /// True if the program has written a register that the firmware must answer and has not polled yet.
    fn has_changed(&self) -> bool;

    /// Returns the settings of the port; `None` while the port is off.
    fn setup(&self) -> Option<PortSetup>;

    /// True if the port is on and has something to send.
    fn has_to_send(&self) -> bool;

    /// Takes the signal that the port sends next.
    fn take_to_send(&mut self) -> Option<Signal>;

    /// Called when the port begins to send its first character after it was switched on.
    fn judge_line(&mut self, ctx: &mut Context, line: &LineState);

    /// Called when a character of this port has ended. `has_collided` is true if another participant was sending, too.
    fn sent(&mut self, ctx: &mut Context, has_collided: bool);

    /// Called when the port has received a character.
    fn received(&mut self, ctx: &mut Context, received: Received);
}

/// A serial port as a device provides it.
pub(crate) struct SerialSocket {
    /// Device and number of the port.
    pub origin: Origin,
    /// Image of the device.
    pub segment: Segment,
    /// Registers of the device.
    pub layout: &'static DeviceLayout,
    /// Firmware of the port.
    pub port: Box<dyn SerialPort>,
}
