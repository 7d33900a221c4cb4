//! The drive's state machine according to the DRIVECOM profile, as shown in control word (parameter 120) and status
//! word (parameter 121).
//!
//! No available manual prints the profile. States, patterns and transition numbers are those of IEC 61800-7-201 (CiA
//! 402). "Not ready to switch on" lasts for a self-test, which takes no time here. Transition 16 (back from quick stop)
//! is optional in the profile and does not exist here.

use crate::devices::cansync::registers::values::{drive_control, drive_status as status};
use serde::{Deserialize, Serialize};

/// State of a drive after power-on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[serde(expecting = "how the drive is enabled, as a word")]
pub enum Enable {
    /// State "operation enabled", as if the control word were 16#000F. So the first reference value moves the
    /// drive.
    #[default]
    AtPowerOn,
    /// State "switch-on disabled". The master must send the control words 16#0006, 16#0007 and 16#000F.
    ByControlWord,
}

/// States of the profile.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum DrivecomState {
    /// DRIVECOM state "switch on disabled": the power stage is locked.
    SwitchOnDisabled,
    /// Power may be switched on.
    ReadyToSwitchOn,
    /// Power stage ready, no torque.
    SwitchedOn,
    /// The drive follows its reference value.
    OperationEnabled,
    /// Braking to standstill, then "switch-on disabled".
    QuickStopActive,
    /// The drive brakes to standstill after a fault. The state "fault" follows.
    FaultReactionActive,
    /// DRIVECOM state "fault": the drive waits for the fault reset.
    Fault,
}

impl DrivecomState {
    /// Returns bits 0-3, 5 and 6 of the status word.
    pub const fn status_bits(self) -> u16 {
        const ENABLED: u16 = status::READY | status::SWITCHED_ON | status::OPERATION_ENABLED;
        match self {
            DrivecomState::SwitchOnDisabled => status::DISABLED,
            DrivecomState::ReadyToSwitchOn => status::READY | status::NO_QUICK_STOP,
            DrivecomState::SwitchedOn => status::READY | status::SWITCHED_ON | status::NO_QUICK_STOP,
            DrivecomState::OperationEnabled => ENABLED | status::NO_QUICK_STOP,
            DrivecomState::QuickStopActive => ENABLED,
            DrivecomState::FaultReactionActive => ENABLED | status::FAULT,
            DrivecomState::Fault => status::FAULT,
        }
    }
}

/// State, control word and warning of one drive.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct StateMachine {
    state: DrivecomState,
    control_word: u16,
    warning: bool,
}

impl StateMachine {
    /// Returns the state machine after power-on.
    pub(crate) const fn new(enable: Enable) -> Self {
        let (state, control_word) = match enable {
            Enable::AtPowerOn => (DrivecomState::OperationEnabled, 0x000F),
            Enable::ByControlWord => (DrivecomState::SwitchOnDisabled, 0x0000),
        };
        StateMachine { state, control_word, warning: false }
    }

    /// Returns the state of the DRIVECOM state machine.
    #[inline]
    pub(crate) const fn state(&self) -> DrivecomState {
        self.state
    }

    /// Returns the control word last received.
    pub(crate) const fn control_word(&self) -> u16 {
        self.control_word
    }

    /// Returns the drive's status word. Bit 15 is 0; the card adds it.
    #[inline]
    pub(crate) const fn status_word(&self) -> u16 {
        let warning = if self.warning { status::WARNING } else { 0 };
        self.state.status_bits() | status::VOLTAGE | warning
    }

    /// Takes over a control word and makes all transitions that it causes.
    pub(crate) fn command(&mut self, word: u16) {
        let reset = word & !self.control_word & drive_control::FAULT_RESET != 0;
        self.control_word = word;
        if self.state == DrivecomState::Fault {
            if reset {
                self.state = DrivecomState::SwitchOnDisabled;
            }
            return;
        }
        // One word can cause two transitions: 16#000F switches on and enables (transitions 3 and 4).
        while let Some(next) = self.transition() {
            self.state = next;
        }
    }

    /// Returns the next transition under the present control word.
    const fn transition(&self) -> Option<DrivecomState> {
        use DrivecomState::*;
        let switch_on = self.control_word & drive_control::SWITCH_ON != 0;
        let enable = self.control_word & drive_control::ENABLE_OPERATION != 0;
        let voltage = self.control_word & drive_control::ENABLE_VOLTAGE != 0;
        let run = self.control_word & drive_control::NO_QUICK_STOP != 0;
        match self.state {
            ReadyToSwitchOn | SwitchedOn if !voltage || !run => Some(SwitchOnDisabled), // 7, 10
            OperationEnabled | QuickStopActive if !voltage => Some(SwitchOnDisabled),   // 9, 12
            OperationEnabled if !run => Some(QuickStopActive),                          // 11
            SwitchOnDisabled if voltage && run && !switch_on => Some(ReadyToSwitchOn),  // 2
            ReadyToSwitchOn if switch_on => Some(SwitchedOn),                           // 3
            SwitchedOn | OperationEnabled if !switch_on => Some(ReadyToSwitchOn),       // 6, 8
            SwitchedOn if enable => Some(OperationEnabled),                             // 4
            OperationEnabled if !enable => Some(SwitchedOn),                            // 5
            _ => None,
        }
    }

    /// Called when the drive is at a standstill: ends quick stop (transition 12) or fault reaction
    /// (transition 14).
    #[inline]
    pub(crate) fn standstill(&mut self) {
        self.state = match self.state {
            DrivecomState::QuickStopActive => DrivecomState::SwitchOnDisabled,
            DrivecomState::FaultReactionActive => DrivecomState::Fault,
            other => other,
        };
    }

    /// Trips the drive (transition 13).
    pub(crate) fn trip(&mut self) {
        if self.state != DrivecomState::Fault {
            self.state = DrivecomState::FaultReactionActive;
        }
    }

    /// Switches the power stage off at once because of a fault. Transitions 13 and 14 happen together.
    pub(crate) fn inhibit(&mut self) {
        self.state = DrivecomState::Fault;
    }

    /// Sets or clears the warning.
    pub(crate) fn set_warning(&mut self, on: bool) {
        self.warning = on;
    }
}

#[cfg(test)]
mod tests {
    use super::DrivecomState::*;
    use super::*;

    const ALL: [DrivecomState; 7] = [
        SwitchOnDisabled,
        ReadyToSwitchOn,
        SwitchedOn,
        OperationEnabled,
        QuickStopActive,
        FaultReactionActive,
        Fault,
    ];

    fn after(state: DrivecomState, word: u16) -> DrivecomState {
        let mut machine = StateMachine { state, control_word: 0, warning: false };
        machine.command(word);
        machine.state()
    }

    #[test]
    fn the_usual_control_words_enable_and_disable_operation() {
        let mut machine = StateMachine::new(Enable::ByControlWord);
        for (word, state, status) in [
            (0x0000, SwitchOnDisabled, 0x0050),
            (0x0006, ReadyToSwitchOn, 0x0031),
            (0x0007, SwitchedOn, 0x0033),
            (0x000F, OperationEnabled, 0x0037),
            (0x0007, SwitchedOn, 0x0033),
            (0x0006, ReadyToSwitchOn, 0x0031),
            (0x0000, SwitchOnDisabled, 0x0050),
        ] {
            machine.command(word);
            assert_eq!((machine.state(), machine.status_word()), (state, status), "16#{word:04X}");
            assert_eq!(machine.control_word(), word);
        }
    }

    #[test]
    fn commands_in_each_state() {
        // The columns are: disable voltage, quick stop, shutdown, switch on, enable operation.
        let words = [0x0000, 0x0002, 0x0006, 0x0007, 0x000F];
        for (state, expected) in [
            (
                SwitchOnDisabled,
                [SwitchOnDisabled, SwitchOnDisabled, ReadyToSwitchOn, SwitchOnDisabled, SwitchOnDisabled],
            ),
            (
                ReadyToSwitchOn,
                [SwitchOnDisabled, SwitchOnDisabled, ReadyToSwitchOn, SwitchedOn, OperationEnabled],
            ),
            (SwitchedOn, [SwitchOnDisabled, SwitchOnDisabled, ReadyToSwitchOn, SwitchedOn, OperationEnabled]),
            (
                OperationEnabled,
                [SwitchOnDisabled, QuickStopActive, ReadyToSwitchOn, SwitchedOn, OperationEnabled],
            ),
            (
                QuickStopActive,
                [SwitchOnDisabled, QuickStopActive, QuickStopActive, QuickStopActive, QuickStopActive],
            ),
            (FaultReactionActive, [FaultReactionActive; 5]),
            (Fault, [Fault; 5]),
        ] {
            assert_eq!(words.map(|word| after(state, word)), expected, "{state:?}");
        }
    }

    #[test]
    fn every_control_word_ends_in_a_stable_state() {
        for state in ALL {
            for word in 0..=u16::MAX {
                after(state, word);
            }
        }
    }

    #[test]
    fn fault_needs_a_rising_edge_of_bit_7() {
        let mut machine = StateMachine::new(Enable::AtPowerOn);
        machine.command(0x008F);
        machine.trip();
        assert_eq!(machine.status_word(), 0x001F);
        machine.standstill();
        assert_eq!((machine.state(), machine.status_word()), (Fault, 0x0018));
        machine.trip();
        assert_eq!(machine.state(), Fault);
        for (word, state) in [(0x008F, Fault), (0x000F, Fault), (0x008F, SwitchOnDisabled)] {
            machine.command(word);
            assert_eq!(machine.state(), state, "16#{word:04X}");
        }
    }

    #[test]
    fn quick_stop_ends_at_standstill() {
        let mut machine = StateMachine::new(Enable::AtPowerOn);
        machine.command(0x000B);
        assert_eq!((machine.state(), machine.status_word()), (QuickStopActive, 0x0017));
        machine.standstill();
        assert_eq!(machine.state(), SwitchOnDisabled);
    }

    #[test]
    fn standstill_changes_nothing_else() {
        let mut machine = StateMachine::new(Enable::AtPowerOn);
        machine.standstill();
        assert_eq!(machine.state(), OperationEnabled);
    }

    #[test]
    fn warning_is_bit_7() {
        let mut machine = StateMachine::new(Enable::AtPowerOn);
        machine.set_warning(true);
        assert_eq!(machine.status_word(), 0x00B7);
        machine.set_warning(false);
        assert_eq!(machine.status_word(), 0x0037);
    }
}
