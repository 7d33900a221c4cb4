//! Errors of the CAN bus, as the program is told of them by flags (p. 18-19, 35-36).

use super::registers::CS0015_FLAGS;
use super::registers::values::bool;
use crate::can::ErrorState;
use crate::devices::can_bus::Controller;
use crate::memory::Cell8;
use serde::{Deserialize, Serialize};

/// What has been seen of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct CanErrors {
    /// Receive errors, as last counted by the controller.
    received: u16,
    /// Errors since power-on, for `CAN_ERRORHANDLER`.
    count: u16,
}

impl CanErrors {
    /// An error: its flag, and the one for all of them, which the program resets.
    fn found(&mut self, flags: &CS0015_FLAGS, flag: &Cell8) {
        flag.store(bool::TRUE);
        flags.CAN_ERROR.store(bool::TRUE);
        self.count = self.count.saturating_add(1);
    }

    /// The controller is in another error state. BUS-off is left when the program asks for it.
    pub(super) fn state(&mut self, flags: &CS0015_FLAGS, state: ErrorState) {
        if state == ErrorState::BusOff {
            self.found(flags, &flags.CAN_BUS_OFF_ERROR);
        } else {
            flags.CAN_BUS_OFF_ERROR.store(bool::FALSE);
        }
    }

    /// The controller cannot be initialised.
    pub(super) fn not_initialised(&mut self, flags: &CS0015_FLAGS) {
        self.found(flags, &flags.CAN_INIT_ERROR);
    }

    /// A frame that was received was lost.
    pub(super) fn lost_received(&mut self, flags: &CS0015_FLAGS) {
        self.found(flags, &flags.CAN_RX_OVERRUN_ERROR);
    }

    /// A frame that was to be sent was lost.
    pub(super) fn lost_to_send(&mut self, flags: &CS0015_FLAGS) {
        self.found(flags, &flags.CAN_TX_OVERRUN_ERROR);
    }

    /// Looks for frames that came with errors.
    pub(super) fn look(&mut self, flags: &CS0015_FLAGS, controller: &Controller) {
        let received = controller.errors().receive();
        if core::mem::replace(&mut self.received, received) < received {
            self.found(flags, &flags.CAN_DATA_ERROR);
        }
    }

    /// ERRORCOUNT of `CAN_ERRORHANDLER` (p. 36), which lets a controller that is BUS-off return.
    pub(super) fn handle(&mut self, controller: &mut Controller, is_reset: bool) -> u16 {
        if is_reset {
            self.count = 0;
        }
        controller.restart();
        self.count
    }
}
