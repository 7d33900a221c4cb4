//! Drives on a serial line: slaves of the protocol USS in front of simulated drives (decision D-859).

use super::drive_config::SerialDriveConfig;
use crate::devices::cansync::drive::{BuiltInDrive, ParamFormat};
use crate::devices::cansync::frames::codec::parameter::VALUE_ELEMENT;
use crate::devices::{BuildError, DriveDetails, DriveState, ParameterRefusal, ParameterState, Shaft};
use crate::journal::Origin;
use crate::serial::uss::{
    Parameter, ParameterAccess, ParameterType, Pkw, Refusal, Slave, SlaveEvent, Timing,
};
use crate::serial::{Character, CharacterFormat, Time};
use crate::snapshot_fields;
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use std::collections::VecDeque;

/// Interval of the control task in microseconds, as in the drive of a PLC.
const TASK_US: u64 = 500;

/// Sender numbers on the line from this number on are drives.
const FIRST: usize = 1 << 18;

/// The parameters of a drive, as the parameter channel reaches them.
struct DriveTable(BuiltInDrive);

impl SnapshotFields for DriveTable {
    fn save(&self, to: &mut Saving) {
        self.0.save(to);
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        self.0.restore(from)
    }
}

/// Returns a parameter of the drive as the parameter channel describes it.
fn described(state: &ParameterState) -> Parameter {
    let kind = match (state.bytes, state.min < 0) {
        (2, true) => ParameterType::Integer16,
        (2, false) => ParameterType::Unsigned16,
        (_, true) => ParameterType::Integer32,
        (_, false) => ParameterType::Unsigned32,
    };
    // All values have at most 32 bits.
    let parameter =
        Parameter::new(state.number, kind, state.value as f64).within(state.min as f64, state.max as f64);
    if state.read_only { parameter.read_only() } else { parameter }
}

impl ParameterAccess for DriveTable {
    fn execute(&mut self, request: &Pkw, has_room: bool) -> Pkw {
        let drive = &mut self.0;
        let Some(state) = drive.parameter_state(request.number) else {
            return request.refused(Refusal::Number);
        };
        if drive.regler().read_element(request.number, VALUE_ELEMENT).is_err() {
            // The drive recalculates the parameter.
            return request.refused(Refusal::State);
        }
        let mut parameter = described(&state);
        let answer = parameter.execute(request, has_room);
        if !request.is_change() || answer.refusal().is_some() {
            return answer;
        }
        match drive.set_parameter(request.number, parameter.value() as i64) {
            Ok(()) => answer,
            Err(ParameterRefusal::NotThere) => request.refused(Refusal::Number),
            Err(ParameterRefusal::ReadOnly) => request.refused(Refusal::ReadOnly),
            Err(ParameterRefusal::Range { .. }) => request.refused(Refusal::Limit),
            Err(ParameterRefusal::NotNow | ParameterRefusal::Off) => request.refused(Refusal::State),
        }
    }
}

/// A drive on the line.
pub(super) struct BusDrive {
    name: String,
    slave: Slave<DriveTable>,
    setpoints: Vec<u16>,
    actual_values: Vec<u16>,
    /// Time of the next run of the control task; `None` while the drive has no work.
    task: Option<Time>,
    /// Octets of the answer that have not begun.
    queue: VecDeque<u8>,
    /// Octets that were sent without a pause and are not in the journal yet.
    pub(super) burst: Vec<u8>,
    /// Tick at which the drive's last character has ended.
    pub(super) free_from: u64,
}

snapshot_fields!(BusDrive {
    values: task, queue, burst, free_from;
    parts: slave;
    built: name, setpoints, actual_values
});

impl BusDrive {
    /// Creates the drive of the plant file, in its state after power-on.
    ///
    /// # Errors
    /// The settings are wrong.
    pub(super) fn new(config: &SerialDriveConfig, format: CharacterFormat) -> Result<Self, BuildError> {
        config.check(format)?;
        let name = &config.name;
        let drive = BuiltInDrive::new(name, &config.drive())?;
        let unknown = |key: &str, number: u16, fault: &str| {
            BuildError::own(name, key, format!("drive {name}: {key} has parameter {number}, {fault}"))
        };
        for (key, numbers) in [("setpoints", &config.setpoints), ("actual_values", &config.actual_values)] {
            if let Some(number) = numbers.iter().find(|number| !drive.regler().is_readable(**number)) {
                return Err(unknown(key, *number, "which the drive does not have"));
            }
        }
        if let Some(number) = config.setpoints.iter().find(|number| !drive.regler().is_writable(**number)) {
            return Err(unknown("setpoints", *number, "which cannot be written"));
        }
        let timing = Timing::new(format.baud_rate().into());
        let slave = Slave::new(config.address, timing, config.layout()?, DriveTable(drive));
        let mut slave = slave.map_err(|error| BuildError::own(name, "address", error.to_string()))?;
        if let Some(delay) = config.response_delay_us {
            slave.set_response_delay(delay);
        }
        let mut drive = BusDrive {
            name: name.clone(),
            slave,
            setpoints: config.setpoints.clone(),
            actual_values: config.actual_values.clone(),
            task: None,
            queue: VecDeque::new(),
            burst: Vec::new(),
            free_from: 0,
        };
        drive.wake(0);
        Ok(drive)
    }

    /// Returns the name in the plant file.
    pub(super) fn name(&self) -> &str {
        &self.name
    }

    /// Returns the address on the line.
    pub(super) fn address(&self) -> u8 {
        self.slave.address()
    }

    /// Returns the drive as the sender of characters in the journal.
    pub(super) fn origin(&self) -> Origin {
        Origin::of_drive(self.address())
    }

    fn drive(&self) -> &BuiltInDrive {
        &self.slave.parameters().0
    }

    fn drive_mut(&mut self) -> &mut BuiltInDrive {
        &mut self.slave.parameters_mut().0
    }

    /// True if the drive has something to send.
    pub(super) fn has_to_send(&self) -> bool {
        !self.queue.is_empty()
    }

    /// Takes the octet that the drive sends next.
    pub(super) fn take_to_send(&mut self) -> Option<u8> {
        self.queue.pop_front()
    }

    /// Passes a character of the line to the drive.
    pub(super) fn received(&mut self, now: Time, character: Character) {
        self.slave.received(now, character);
        while let Some(event) = self.slave.next_event() {
            match event {
                SlaveEvent::Setpoints => {
                    self.take_setpoints();
                    self.drive_mut().exchanged(now);
                    self.wake(now);
                }
                SlaveEvent::Requested(..) => self.wake(now),
                SlaveEvent::Damaged(_) | SlaveEvent::WrongLength(_) => {}
            }
        }
    }

    /// Writes the process data into their parameters. A doubleword takes two words, the upper one first; if the process data
    /// end with its upper word, the lower one is 0. The drive refuses a value that the parameter does not accept, and the
    /// master does not notice it.
    fn take_setpoints(&mut self) {
        let words = self.slave.setpoints().to_vec();
        let mut words = words.into_iter();
        for number in self.setpoints.clone() {
            let (regler, Some(word)) = (self.drive_mut().regler_mut(), words.next()) else { return };
            let Some(format) = regler.format_of(number) else { return };
            let value = match format {
                ParamFormat::Word => u32::from(word),
                ParamFormat::Doubleword => u32::from(word) << 16 | u32::from(words.next().unwrap_or(0)),
            };
            let _ = regler.write_element(number, VALUE_ELEMENT, format, value);
        }
    }

    /// Gives the slave the present actual values. Words without a parameter are 0.
    fn show_actual_values(&mut self) {
        let regler = self.drive().regler();
        let mut words = Vec::new();
        for number in &self.actual_values {
            let value = regler.parameter(*number).unwrap_or_default();
            if regler.format_of(*number) == Some(ParamFormat::Doubleword) {
                words.push((value >> 16) as u16);
            }
            words.push((value & 0xFFFF) as u16);
        }
        words.resize(self.slave.setpoints().len(), 0);
        // The number of words is that of the layout, like the number of setpoints.
        let _ = self.slave.set_actual(&words);
    }

    /// Plans the control task if the drive has work.
    fn wake(&mut self, now: Time) {
        if self.task.is_none() && !self.drive().is_quiescent() {
            self.task = Some((now / TASK_US + 1) * TASK_US);
        }
    }

    /// Returns the time of the next action of [`poll`](Self::poll).
    pub(super) fn due(&self) -> Option<Time> {
        self.slave.due().into_iter().chain(self.task).min()
    }

    /// Runs the control task or begins an answer, if its time has come at `now`.
    pub(super) fn poll(&mut self, now: Time) {
        if self.task.is_some_and(|task| task <= now) {
            self.drive_mut().step(now, TASK_US as u32);
            self.task = None;
            self.wake(now);
        }
        if self.slave.due().is_some_and(|due| due <= now) {
            self.show_actual_values();
            let answer = self.slave.poll(now);
            self.queue.extend(answer);
        }
    }

    /// Returns the state of the drive.
    pub(super) fn state(&self) -> DriveState {
        self.details().state
    }

    /// Returns the state and all parameters.
    pub(super) fn details(&self) -> DriveDetails {
        let mut details = self.drive().details();
        details.state.number = Some(self.address());
        details
    }

    /// Sets a parameter, as a user does at the drive itself.
    ///
    /// # Errors
    /// [`ParameterRefusal`].
    pub(super) fn set_parameter(
        &mut self,
        now: Time,
        number: u16,
        value: i64,
    ) -> Result<(), ParameterRefusal> {
        self.drive_mut().set_parameter(number, value)?;
        self.wake(now);
        Ok(())
    }

    /// Returns demand and motion of the motor.
    pub(super) fn shaft(&self) -> Shaft {
        self.drive().shaft()
    }

    /// Sets the speed of the motor. With `None` the motor follows the drive.
    pub(super) fn turn_shaft(&mut self, now: Time, speed: Option<i32>) {
        self.drive_mut().turn_shaft(speed);
        self.wake(now);
    }
}

/// Returns the number of the drive at `place` as a sender on the line.
pub(super) fn sender_at(place: usize) -> usize {
    FIRST + place
}

/// Returns the place of the drive with this number as a sender on the line.
pub(super) fn place_of(sender: usize) -> Option<usize> {
    sender.checked_sub(FIRST)
}
