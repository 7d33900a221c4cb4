//! Views of a drive's state for users, and local operation of the drive.

use super::parameters::ParameterSlot;
use super::regler::VRegler;
use super::{BuiltInDrive, Drive, DrivecomState, ZkParameters};
use crate::devices::cansync::frames::codec::parameter::VALUE_ELEMENT;
use crate::devices::cansync::registers::values::par_error;
use crate::devices::{DriveDetails, DriveState, ParameterRefusal, ParameterState, Shaft};

impl DrivecomState {
    /// Returns the name of the state, such as `operation_enabled`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            DrivecomState::SwitchOnDisabled => "switch_on_disabled",
            DrivecomState::ReadyToSwitchOn => "ready_to_switch_on",
            DrivecomState::SwitchedOn => "switched_on",
            DrivecomState::OperationEnabled => "operation_enabled",
            DrivecomState::QuickStopActive => "quick_stop_active",
            DrivecomState::FaultReactionActive => "fault_reaction_active",
            DrivecomState::Fault => "fault",
        }
    }
}

impl ZkParameters {
    /// Returns numbers and values of the parameters.
    fn listed(&self) -> Vec<(u8, u16)> {
        let ZkParameters { zk_0, zk_1, zk_4, zk_5, zk_16, zk_17, zk_20, zk_21, zk_24, zk_25, zk_26 } = *self;
        [
            (0, zk_0),
            (1, zk_1),
            (4, zk_4),
            (5, zk_5),
            (16, zk_16),
            (17, zk_17),
            (20, zk_20),
            (21, zk_21),
            (24, zk_24),
            (25, zk_25),
            (26, zk_26),
        ]
        .to_vec()
    }
}

impl Drive {
    /// Returns the state of the drive.
    pub fn look(&self) -> DriveState {
        DriveState {
            number: Some(self.slave_number),
            kbit_s: Some(self.kbit_s),
            lost_references: self.reference_losses(),
            is_stopped: self.is_exchange_stopped(),
            ..self.regler.look()
        }
    }

    /// Returns the state, all parameters and the card's parameters.
    pub fn details(&self) -> DriveDetails {
        DriveDetails { state: self.look(), parameters: self.regler.parameters(), card: self.zk.listed() }
    }

    /// Sets a parameter by local operation, as at the drive itself.
    ///
    /// # Errors
    /// [`ParameterRefusal`].
    pub fn set_parameter(&mut self, number: u16, value: i64) -> Result<(), ParameterRefusal> {
        self.regler.set_by_hand(number, value)
    }

    /// Returns demand and motion of the motor.
    pub fn shaft(&self) -> Shaft {
        self.regler.shaft()
    }

    /// Sets the speed of the motor, independent of the drive's demand. With `None`, the motor follows the demand.
    pub fn turn_shaft(&mut self, speed: Option<i32>) {
        self.regler.turn_shaft(speed);
    }
}

impl BuiltInDrive {
    /// Returns the state and all parameters.
    pub fn details(&self) -> DriveDetails {
        let regler = self.regler();
        DriveDetails { state: regler.look(), parameters: regler.parameters(), card: Vec::new() }
    }

    /// Returns a parameter; `None` if the drive does not have it.
    pub(crate) fn parameter_state(&self, number: u16) -> Option<ParameterState> {
        let regler = self.regler();
        regler.store.slot(number).map(|slot| regler.parameter_state(slot))
    }

    /// Sets a parameter by local operation, as at the drive itself.
    ///
    /// # Errors
    /// [`ParameterRefusal`].
    pub(crate) fn set_parameter(&mut self, number: u16, value: i64) -> Result<(), ParameterRefusal> {
        self.regler_mut().set_by_hand(number, value)
    }

    /// Returns demand and motion of the motor.
    pub fn shaft(&self) -> Shaft {
        self.regler().shaft()
    }

    /// Sets the speed of the motor, independent of the drive's demand. With `None`, the motor follows the demand.
    pub(crate) fn turn_shaft(&mut self, speed: Option<i32>) {
        self.regler_mut().turn_shaft(speed);
    }
}

impl VRegler {
    fn look(&self) -> DriveState {
        let [speed_reference, speed_actual, fault] = self.shown();
        DriveState {
            number: None,
            kbit_s: None,
            state: self.state().name().to_owned(),
            status_word: self.status_word(),
            is_synchronized: self.is_synchronized(),
            speed_reference: speed_reference as i32,
            speed_actual: speed_actual as i32,
            fault,
            lost_references: 0,
            is_stopped: false,
        }
    }

    fn parameters(&self) -> Vec<ParameterState> {
        self.store.slots().map(|slot| self.parameter_state(slot)).collect()
    }

    fn parameter_state(&self, slot: ParameterSlot) -> ParameterState {
        let spec = self.store.spec(slot);
        let row = self.row_of(spec.number);
        let (min, max) = spec.range();
        ParameterState {
            number: spec.number,
            name: row.map_or("", |row| row.name).to_owned(),
            unit: row.map_or("", |row| row.unit).to_owned(),
            bytes: spec.format.bytes() as u8,
            value: spec.number_of(self.parameter(spec.number).unwrap_or_default()),
            min,
            max,
            read_only: spec.read_only,
        }
    }

    /// Writes a value like a parameter job.
    fn set_by_hand(&mut self, number: u16, value: i64) -> Result<(), ParameterRefusal> {
        let slot = self.store.slot(number).ok_or(ParameterRefusal::NotThere)?;
        let spec = *self.store.spec(slot);
        let (min, max) = spec.range();
        if !spec.read_only && !(min..=max).contains(&value) {
            return Err(ParameterRefusal::Range { min, max });
        }
        let bits = value as u32 & spec.format.mask(); // within the range of its format
        self.write_element(number, VALUE_ELEMENT, spec.format, bits).map_err(|error| match error {
            par_error::NOT_CHANGEABLE => ParameterRefusal::ReadOnly,
            par_error::NOT_AVAILABLE_NOW => ParameterRefusal::NotNow,
            par_error::NOT_PRESENT => ParameterRefusal::NotThere,
            _ => ParameterRefusal::Range { min, max },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::{DriveConfig, Enable, ParamFormat, ParameterSpec, number};
    use super::*;

    fn drive() -> Drive {
        let own = ParameterSpec { min: Some(-5), max: Some(9), ..ParameterSpec::new(400, ParamFormat::Word) };
        let config =
            DriveConfig { parameters: vec![own], enable: Enable::ByControlWord, ..DriveConfig::demo("d", 3) };
        Drive::new(&config, 500).unwrap()
    }

    #[test]
    fn state_parameters_and_card_can_be_seen() {
        let details = drive().details();
        assert_eq!(
            details.state,
            DriveState {
                number: Some(3),
                kbit_s: Some(500),
                state: "switch_on_disabled".to_owned(),
                status_word: 0x0050,
                is_synchronized: false,
                speed_reference: 0,
                speed_actual: 0,
                fault: 0,
                lost_references: 0,
                is_stopped: false,
            }
        );
        assert_eq!(details.card[..3], [(0, 300), (1, 302), (4, 0x0041)]);
        let of = |number| details.parameters.iter().find(|it| it.number == number).unwrap();
        let slot = of(number::SYNC_SLOT);
        assert_eq!((slot.value, slot.bytes, slot.unit.as_str(), slot.read_only), (2000, 2, "us", false));
        assert!(of(number::STATUS_WORD).read_only && !of(number::SPEED_REFERENCE).name.is_empty());
        let own = of(400);
        assert_eq!((own.name.as_str(), own.min, own.max), ("", -5, 9));
    }

    #[test]
    fn parameters_are_set_by_hand_within_their_limits() {
        let mut drive = drive();
        drive.set_parameter(400, -5).unwrap();
        assert_eq!(drive.parameter(400), Some(0xFFFB));
        assert_eq!(drive.details().parameters.iter().find(|it| it.number == 400).unwrap().value, -5);
        for value in [-6, 10, i64::MAX] {
            assert_eq!(drive.set_parameter(400, value), Err(ParameterRefusal::Range { min: -5, max: 9 }));
        }
        assert_eq!(drive.set_parameter(number::STATUS_WORD, 0), Err(ParameterRefusal::ReadOnly));
        assert_eq!(drive.set_parameter(4095, 0), Err(ParameterRefusal::NotThere));
        for word in [0x0006, 0x0007, 0x000F] {
            drive.set_parameter(number::CONTROL_WORD, word).unwrap();
        }
        assert_eq!(drive.look().state, "operation_enabled");
        drive.set_parameter(number::SPEED_REFERENCE, -1000).unwrap();
        assert_eq!(drive.look().speed_reference, -1000);
    }
}
