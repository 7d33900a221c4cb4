//! Errors of the CAN bus, and the flags that report them to the program (p. 18-19, 35-36).

use crate::can::ErrorState;
use crate::devices::can_bus::Controller;
use crate::devices::cs0015::registers::CS0015_FLAGS;
use crate::devices::cs0015::registers::values::bool;
use crate::memory::Cell8;
use serde::{Deserialize, Serialize};

/// Errors seen so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct CanErrors {
    /// Receive error counter of the controller at the last check.
    received: u16,
    /// Errors since power-on, for `CAN_ERRORHANDLER`.
    count: u16,
}

impl CanErrors {
    /// Sets the flag of an error, and the common flag. The program resets both.
    fn found(&mut self, flags: &CS0015_FLAGS, flag: &Cell8) {
        flag.store(bool::TRUE);
        flags.CAN_ERROR.store(bool::TRUE);
        self.count = self.count.saturating_add(1);
    }

    /// Called when the error state of the controller has changed. A controller leaves BUS-off only when the program
    /// requests it.
    pub(crate) fn state(&mut self, flags: &CS0015_FLAGS, state: ErrorState) {
        if state == ErrorState::BusOff {
            self.found(flags, &flags.CAN_BUS_OFF_ERROR);
        } else {
            flags.CAN_BUS_OFF_ERROR.store(bool::FALSE);
        }
    }

    /// Called when the controller cannot be initialised.
    pub(crate) fn not_initialised(&mut self, flags: &CS0015_FLAGS) {
        self.found(flags, &flags.CAN_INIT_ERROR);
    }

    /// Called when a received frame was lost.
    pub(crate) fn lost_received(&mut self, flags: &CS0015_FLAGS) {
        self.found(flags, &flags.CAN_RX_OVERRUN_ERROR);
    }

    /// Called when a frame was lost before it was sent.
    pub(crate) fn lost_to_send(&mut self, flags: &CS0015_FLAGS) {
        self.found(flags, &flags.CAN_TX_OVERRUN_ERROR);
    }

    /// Checks for received frames with errors.
    pub(crate) fn look(&mut self, flags: &CS0015_FLAGS, controller: &Controller) {
        let received = controller.errors().receive();
        if core::mem::replace(&mut self.received, received) < received {
            self.found(flags, &flags.CAN_DATA_ERROR);
        }
    }

    /// Runs `CAN_ERRORHANDLER` (p. 36): starts the return of a BUS-off controller, and returns ERRORCOUNT.
    pub(crate) fn handle(&mut self, controller: &mut Controller, is_reset: bool) -> u16 {
        if is_reset {
            self.count = 0;
        }
        controller.restart();
        self.count
    }
}
