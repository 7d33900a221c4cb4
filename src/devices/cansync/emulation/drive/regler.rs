//! The drive itself (V-Regler): parameters, state machine, speed and position loop. It is the same for every
//! kind of connection.

mod run;

pub(super) use run::Run;

use super::angle::{self, SetPoint};
use super::config::{DriveError, ParameterNumbers};
use super::drivecom::{DrivecomState, Enable, StateMachine};
use super::monitoring::{Monitor, Reaction};
use super::motion::Motion;
use super::parameters::{ParamFormat, ParameterError, ParameterSlot, ParameterSpec, ParameterStore};
use super::table::{PARAMETERS, ParameterRow, number};
use crate::devices::Shaft;
use crate::devices::cansync::frames::codec::parameter::{MAX_NUMBER, VALUE_ELEMENT};
use crate::devices::cansync::registers::values::{drive_status, par_element, par_error};
use crate::snapshot_fields;
use std::num::NonZeroU32;

/// Element number of the minimum of a parameter (decision D-160).
pub(crate) const MINIMUM_ELEMENT: u8 = par_element::MINIMUM;
/// Element number of the maximum of a parameter (decision D-160).
pub(crate) const MAXIMUM_ELEMENT: u8 = par_element::MAXIMUM;
/// Value of the operating mode parameter: synchronous reference position.
const SYNCHRONOUS_POSITION: u32 = 1;

/// Settings of a drive from the plant file, without its connection.
pub(super) struct Setup<'a> {
    pub name: &'a str,
    pub enable: Enable,
    pub ramp_per_second: Option<NonZeroU32>,
    pub numbers: &'a ParameterNumbers,
    pub parameters: &'a [ParameterSpec],
    /// Version of the drive software; `None` for the value of the parameter table.
    pub software: Option<u32>,
    /// SYNC slot (P167) after power-on, in us; `None` for the value of the parameter table.
    pub sync_slot_us: Option<u16>,
}

/// Slots of the parameters that the control loops and the state machine use.
#[derive(Clone, Copy, Debug)]
struct Slots {
    speed_reference: ParameterSlot,
    speed_actual: ParameterSlot,
    additional_reference: ParameterSlot,
    angle_reference: ParameterSlot,
    angle_actual: ParameterSlot,
    mode: ParameterSlot,
    speed_limit: ParameterSlot,
    ramp: ParameterSlot,
    gain: ParameterSlot,
    sync_slot: ParameterSlot,
    sync_offset: ParameterSlot,
    pwm: ParameterSlot,
    fault: ParameterSlot,
    control_word: ParameterSlot,
}

/// A drive of the series V-Regler.
#[derive(Clone, Debug)]
pub(crate) struct VRegler {
    machine: StateMachine,
    motion: Motion,
    set_point: SetPoint,
    pub(super) store: ParameterStore,
    slots: Slots,
    /// Bit 15 of the status word. The connection sets it.
    synchronized: bool,
    /// Number of a communication error that is reported without a reaction; 0 if there is no such error.
    error: u16,
}

/// Format and value that a parameter job has read.
pub(crate) type ReadValue = (ParamFormat, u32);

snapshot_fields!(VRegler {
    values: machine, motion, set_point, synchronized, error;
    parts: store;
    built: slots
});

impl VRegler {
    /// Creates the drive in its state after power-on.
    pub(super) fn new(setup: &Setup) -> Result<Self, DriveError> {
        let numbers = setup.numbers;
        let mut specs: Vec<ParameterSpec> = PARAMETERS.iter().map(ParameterSpec::from).collect();
        for spec in &mut specs {
            spec.number = match spec.number {
                number::SPEED_REFERENCE => numbers.speed_reference,
                number::SPEED_ACTUAL => numbers.speed_actual,
                number::ADDITIONAL_REFERENCE => numbers.additional_reference,
                number => number,
            };
            match (spec.number, setup.ramp_per_second, setup.software) {
                (number::RAMP, Some(ramp), _) => spec.initial = ramp.get(),
                (number::SOFTWARE, _, Some(software)) => spec.initial = software,
                _ => {}
            }
            if let (number::SYNC_SLOT, Some(us)) = (spec.number, setup.sync_slot_us) {
                spec.initial = us.into();
            }
        }
        let fault = |(number, reason)| DriveError::Parameter { drive: setup.name.to_owned(), number, reason };
        // This check comes first. From here on there are at most 4096 different numbers, even if the file is
        // very large.
        if let Some(none) = setup.parameters.iter().find(|spec| spec.number > MAX_NUMBER) {
            return Err(fault((none.number, ParameterError::Number)));
        }
        for spec in setup.parameters {
            let same = |other: &ParameterSpec| other.number == spec.number;
            if setup.parameters.iter().filter(|other| same(other)).count() > 1 {
                return Err(fault((spec.number, ParameterError::Twice)));
            }
            match specs.iter_mut().find(|own| same(own)) {
                None => specs.push(*spec),
                // `enable` decides the control word after power-on.
                Some(own) if own.number != number::CONTROL_WORD && spec.is_value_of(own) => {
                    own.initial = spec.initial;
                }
                Some(_) => return Err(fault((spec.number, ParameterError::Own))),
            }
        }
        let mut store = ParameterStore::new(specs).map_err(fault)?;
        let slot = |number| store.slot(number).ok_or_else(|| fault((number, ParameterError::Number)));
        let slots = Slots {
            speed_reference: slot(numbers.speed_reference)?,
            speed_actual: slot(numbers.speed_actual)?,
            additional_reference: slot(numbers.additional_reference)?,
            angle_reference: slot(number::ANGLE_REFERENCE)?,
            angle_actual: slot(number::ANGLE_ACTUAL)?,
            mode: slot(number::OPERATING_MODE)?,
            speed_limit: slot(number::SPEED_LIMIT)?,
            ramp: slot(number::RAMP)?,
            gain: slot(number::POSITION_GAIN)?,
            sync_slot: slot(number::SYNC_SLOT)?,
            sync_offset: slot(number::SYNC_OFFSET)?,
            pwm: slot(number::PWM_FREQUENCY)?,
            fault: slot(number::FAULT_NUMBER)?,
            control_word: slot(number::CONTROL_WORD)?,
        };
        store.watch(slots.angle_reference);
        Ok(VRegler {
            machine: StateMachine::new(setup.enable),
            motion: Motion::default(),
            set_point: SetPoint::default(),
            store,
            slots,
            synchronized: false,
            error: 0,
        })
    }

    /// Runs the control task once. The previous run was `us` earlier.
    #[inline]
    pub(super) fn step(&mut self, us: u32) {
        let enabled = self.machine.state() == DrivecomState::OperationEnabled;
        let target = if self.is_following_angle() {
            self.follow_angle(enabled, us)
        } else if enabled {
            i64::from(self.store.get(self.slots.speed_reference) as i32)
        } else {
            0
        };
        let limit = i64::from(self.store.get(self.slots.speed_limit));
        let target = target.clamp(-limit, limit) as i32;
        let speed = self.motion.step(target, us, self.store.get(self.slots.ramp));
        self.store.set(self.slots.speed_actual, speed as u32);
        self.store.set(self.slots.angle_actual, self.motion.angle());
        if speed == 0 {
            self.machine.standstill();
        }
        self.store.pass(us);
    }

    #[inline]
    pub(super) fn is_following_angle(&self) -> bool {
        self.store.get(self.slots.mode) == SYNCHRONOUS_POSITION
    }

    /// Returns the target speed in mode "synchronous reference position". P258 shows the effective reference value.
    fn follow_angle(&mut self, enabled: bool, us: u32) -> i64 {
        let slots = &self.slots;
        let slot_us = self.store.get(slots.sync_slot) as u16;
        if self.store.take_written() {
            let mask = angle::mask(slot_us, self.store.get(slots.pwm) as u16);
            let reference = self.store.get(slots.angle_reference) & mask;
            self.store.set(slots.angle_reference, reference);
            self.store.take_written();
            self.set_point.reference(reference, slot_us);
        }
        if !enabled {
            self.set_point.hold(self.motion.angle());
            return 0;
        }
        self.set_point.pass(us);
        angle::follow(self.set_point.now(), self.motion.angle(), self.store.get(slots.gain), us)
    }

    /// Returns true if no value will change without a command: the motor does not move, and no parameter is
    /// in recalculation.
    pub(crate) fn is_quiescent(&self) -> bool {
        let driven = self.machine.state() == DrivecomState::OperationEnabled
            && (self.is_following_angle() || self.store.get(self.slots.speed_reference) != 0);
        let braking = matches!(
            self.machine.state(),
            DrivecomState::QuickStopActive | DrivecomState::FaultReactionActive
        );
        self.motion.speed() == 0
            && self.motion.demand() == 0
            && !driven
            && !braking
            && !self.store.is_settling()
    }

    /// Returns demand and motion of the motor.
    pub(super) fn shaft(&self) -> Shaft {
        use DrivecomState::{FaultReactionActive, OperationEnabled, QuickStopActive};
        Shaft {
            demand: self.motion.demand(),
            is_fed: matches!(self.state(), OperationEnabled | QuickStopActive | FaultReactionActive),
            speed: self.motion.speed(),
            angle: self.motion.angle(),
        }
    }

    /// Sets the speed of the motor, independent of the drive's demand. With `None`, the motor follows the demand.
    pub(super) fn turn_shaft(&mut self, speed: Option<i32>) {
        self.motion.turn(speed);
    }

    /// Reads an element of a parameter.
    ///
    /// The error number of the manual (5.00005.03a p. 95 and 166): 16#FFFB if the parameter or element does
    /// not exist, 16#FFFA if the parameter is in recalculation.
    pub(crate) fn read_element(&self, number: u16, element: u8) -> Result<ReadValue, u16> {
        let slot = self.store.slot(number).ok_or(par_error::NOT_PRESENT)?;
        let value = match element {
            MINIMUM_ELEMENT => self.store.limits(slot).0,
            MAXIMUM_ELEMENT => self.store.limits(slot).1,
            VALUE_ELEMENT if !self.store.is_available(slot) => return Err(par_error::NOT_AVAILABLE_NOW),
            VALUE_ELEMENT => self.value(number, slot),
            _ => return Err(par_error::NOT_PRESENT),
        };
        Ok((self.store.format(slot), value))
    }

    /// Writes an element of a parameter. Only the value can be written.
    ///
    /// # Errors
    /// The error number of the manual (5.00005.03a p. 95 and 166).
    pub(crate) fn write_element(
        &mut self,
        number: u16,
        element: u8,
        format: ParamFormat,
        value: u32,
    ) -> Result<(), u16> {
        let slot = self.store.slot(number).ok_or(par_error::NOT_PRESENT)?;
        if element != VALUE_ELEMENT {
            return Err(par_error::NOT_CHANGEABLE);
        }
        self.write(slot, format, value)
    }

    /// Writes a parameter with a value from outside. All external writes use this function: parameter jobs, process
    /// data of the card and of the BAPS, and local operation.
    ///
    /// # Errors
    /// The error number of the manual (5.00005.03a p. 95 and 166); the parameter keeps its value.
    #[inline]
    fn write(&mut self, slot: ParameterSlot, format: ParamFormat, value: u32) -> Result<(), u16> {
        self.store.write(slot, format, value)?;
        if slot == self.slots.control_word {
            self.take_control_word(value as u16);
        }
        Ok(())
    }

    /// Takes over a cyclic reference value of the card. The drive refuses a value that a parameter job could
    /// not write; the parameter then keeps its value (decision D-616).
    #[inline]
    pub(super) fn take_reference(&mut self, target: ParameterSlot, format: ParamFormat, value: u32) {
        // No answer to a frame exists in which the master could see the refusal.
        let _ = self.write(target, format, value);
    }

    /// Returns true if `number` can be a cyclic reference value.
    pub(crate) fn is_writable(&self, number: u16) -> bool {
        self.store.slot(number).is_some_and(|slot| !self.store.is_read_only(slot))
    }

    /// Returns true if `number` can be a cyclic actual value.
    pub(crate) fn is_readable(&self, number: u16) -> bool {
        self.store.slot(number).is_some()
    }

    /// Returns the width of parameter `number`.
    pub(crate) fn format_of(&self, number: u16) -> Option<ParamFormat> {
        self.store.slot(number).map(|slot| self.store.format(slot))
    }

    /// Returns a value. Control and status word come from the state machine, all other values from the store.
    fn value(&self, number: u16, slot: ParameterSlot) -> u32 {
        match number {
            number::CONTROL_WORD => u32::from(self.machine.control_word()),
            number::STATUS_WORD => u32::from(self.status_word()),
            _ => self.store.get(slot),
        }
    }

    /// Returns the value of parameter `number`, if the drive has it.
    pub(crate) fn parameter(&self, number: u16) -> Option<u32> {
        self.store.slot(number).map(|slot| self.value(number, slot))
    }

    /// Takes over the control word of process data.
    pub(crate) fn command(&mut self, word: u16) {
        // The control word has no limits, and the plant file cannot define limits for it, so the write cannot
        // fail.
        let _ = self.write(self.slots.control_word, ParamFormat::Word, word.into());
    }

    /// Takes over a control word. A fault reset clears the fault number.
    fn take_control_word(&mut self, word: u16) {
        let was_faulty = self.machine.state() == DrivecomState::Fault;
        self.machine.command(word);
        if was_faulty && self.machine.state() != DrivecomState::Fault {
            self.store.set(self.slots.fault, self.error.into());
        }
    }

    /// Returns the status word (parameter 121). Bit 15 is set if the drive is synchronized to the SYNC
    /// signal.
    #[inline]
    pub(crate) fn status_word(&self) -> u16 {
        let synchronized = if self.synchronized { drive_status::SYNCHRONIZED } else { 0 };
        self.machine.status_word() | synchronized
    }

    /// Sets bit 15 of the status word.
    #[inline]
    pub(crate) fn show_synchronized(&mut self, on: bool) {
        self.synchronized = on;
    }

    /// Returns the state of the state machine.
    #[inline]
    pub(crate) fn state(&self) -> DrivecomState {
        self.machine.state()
    }

    /// Trips the drive unless it already has a fault. The drive then brakes and waits for a fault reset.
    /// Returns true if the drive has tripped.
    pub(crate) fn trip(&mut self, number: u16) -> bool {
        let trips = !self.is_faulty();
        if trips {
            self.machine.trip();
            self.store.set(self.slots.fault, u32::from(number));
        }
        trips
    }

    fn is_faulty(&self) -> bool {
        matches!(self.machine.state(), DrivecomState::FaultReactionActive | DrivecomState::Fault)
    }

    /// Returns true if a communication error is reported without a reaction.
    #[inline]
    pub(super) fn reports_error(&self) -> bool {
        self.error != 0
    }

    /// Reports the communication errors present at `now`, and reacts (decision D-294).
    pub(super) fn monitor<'a>(&mut self, now: u64, monitors: impl Iterator<Item = &'a mut Monitor>) {
        let mut reported = 0;
        for (fault, reaction) in monitors.filter_map(|monitor| monitor.error(now)) {
            match reaction {
                Reaction::None if reported == 0 => reported = fault,
                Reaction::None => {}
                Reaction::QuickStop => {
                    self.trip(fault);
                }
                Reaction::Inhibit => {
                    self.trip(fault);
                    // If another fault has started a braking, `inhibit` ends this braking, too.
                    self.machine.inhibit();
                }
            }
        }
        if reported != self.error {
            self.error = reported;
            self.machine.set_warning(reported != 0);
            if !self.is_faulty() {
                self.store.set(self.slots.fault, reported.into());
            }
        }
    }

    /// Returns speed reference value, speed and fault number.
    pub(super) fn shown(&self) -> [u32; 3] {
        [self.slots.speed_reference, self.slots.speed_actual, self.slots.fault]
            .map(|slot| self.store.get(slot))
    }

    /// Bit 15 of the status word.
    pub(super) fn is_synchronized(&self) -> bool {
        self.synchronized
    }

    /// Returns the table row of a parameter; `None` if the plant file has added the parameter.
    pub(super) fn row_of(&self, number: u16) -> Option<&'static ParameterRow> {
        let renamed = [
            (self.slots.speed_reference, number::SPEED_REFERENCE),
            (self.slots.speed_actual, number::SPEED_ACTUAL),
            (self.slots.additional_reference, number::ADDITIONAL_REFERENCE),
        ];
        let slot = self.store.slot(number)?;
        let named = match renamed.iter().find(|(own, _)| *own == slot) {
            Some((_, named)) => *named,
            // The plant file has given the built-in parameter another number. So the old number can only
            // belong to a parameter that the plant file defines.
            None if renamed.iter().any(|(_, named)| *named == number) => return None,
            None => number,
        };
        PARAMETERS.iter().find(|row| row.number == named)
    }

    /// Sets or clears the warning bit of the status word.
    pub(crate) fn set_warning(&mut self, on: bool) {
        self.machine.set_warning(on);
    }

    /// Returns the SYNC slot (P167) and the SYNC offset (P168) in us.
    pub(crate) fn sync_times(&self) -> (u32, u32) {
        (self.store.get(self.slots.sync_slot), self.store.get(self.slots.sync_offset))
    }

    /// PWM frequency (P103) in kHz.
    pub(crate) fn pwm_khz(&self) -> u32 {
        self.store.get(self.slots.pwm)
    }

    /// Returns the version of the drive software (0309 as 309).
    pub(crate) fn software(&self) -> u32 {
        self.parameter(number::SOFTWARE).unwrap_or(0)
    }
}
