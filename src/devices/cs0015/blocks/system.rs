//! Blocks of the EEPROM, RS 232, timers and the interrupt program (p. 106-118).

use super::order::{Jobs, Order};
use crate::devices::cs0015::registers::values::job;
use crate::plc::function_block;
use core::time::Duration;

function_block! {
    /// Restarts the controller, as after switching the supply off and on (p. 106).
    pub struct SOFTRESET(jobs: Jobs) {
        in {
            /// Each call with TRUE gives an order to the operating system.
            ENABLE: bool;
        }
        out {
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl SOFTRESET {
    /// Runs one PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        self.ANSWERED = self.internal.call(jobs, self.ENABLE, job::SOFTRESET, &[], &[]).is_some();
    }
}

/// Defines blocks that work on the EEPROM while ENABLE is TRUE.
macro_rules! of_eeprom {
    ($($(#[$doc:meta])* $name:ident)*) => {$(
        function_block! {
            $(#[$doc])*
            pub struct $name(jobs: Jobs) {
                in {
                    /// Starts the operation; FALSE ends it.
                    ENABLE: bool;
                }
                out {
                    /// 0: inactive, 1: finished, 2: working.
                    RESULT: u8;
                    /// The previous order has been answered. commram has added this output.
                    ANSWERED: bool;
                }
                internal: Order;
            }
        }

        impl $name {
            /// Runs one PLC cycle.
            pub fn call(&mut self, jobs: &Jobs) {
                let is_wanted = self.ENABLE || self.RESULT != 0;
                let answer = self.internal.call(jobs, is_wanted, job::$name, &[self.ENABLE.into()], &[]);
                self.ANSWERED = answer.is_some();
                self.RESULT = answer.map_or(self.RESULT, |answer| answer.results[0] as u8);
            }
        }
    )*};
}

of_eeprom! {
    /// Saves %MW128 to %MW511 in the EEPROM (p. 109). ENABLE must stay TRUE until RESULT is 1.
    E2WRITE
    /// Loads %MW128 to %MW511 from the EEPROM (p. 110). ENABLE must stay TRUE until RESULT is 1.
    E2READ
}

function_block! {
    /// Sends a byte by RS 232 (p. 112). The program must first call SERIAL_MODE.
    pub struct SERIAL_TX(jobs: Jobs) {
        in {
            /// Each call with TRUE gives an order to the operating system.
            ENABLE: bool;
            /// The byte to send.
            DATA: u8;
        }
        out {
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl SERIAL_TX {
    /// Runs one PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let arguments = [self.DATA.into()];
        self.ANSWERED = self.internal.call(jobs, self.ENABLE, job::SERIAL_TX, &arguments, &[]).is_some();
    }
}

function_block! {
    /// Fetches a byte that was received by RS 232 (p. 113). The program must first call SERIAL_MODE. Each
    /// call gives an order.
    pub struct SERIAL_RX(jobs: Jobs) {
        in {
            /// TRUE discards received bytes that wait to be read.
            CLEAR: bool;
        }
        out {
            /// The byte that was received.
            RX: u8;
            /// Number of bytes that still wait.
            AVAILABLE: u16;
            /// TRUE if received bytes were lost.
            OVERFLOW: bool;
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl SERIAL_RX {
    /// Runs one PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let answer = self.internal.call(jobs, true, job::SERIAL_RX, &[self.CLEAR.into()], &[]);
        self.ANSWERED = answer.is_some();
        if let Some(answer) = answer {
            let [byte, available, has_overflowed, ..] = answer.results;
            (self.RX, self.AVAILABLE, self.OVERFLOW) = (byte as u8, available as u16, has_overflowed != 0);
        }
    }
}

function_block! {
    /// Returns the number of received bytes that wait to be read from RS 232 (p. 114). Each call gives an
    /// order.
    pub struct SERIAL_PENDING(jobs: Jobs) {
        out {
            /// Number of waiting bytes.
            NUMBER: u16;
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl SERIAL_PENDING {
    /// Runs one PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let answer = self.internal.call(jobs, true, job::SERIAL_PENDING, &[], &[]);
        self.ANSWERED = answer.is_some();
        self.NUMBER = answer.map_or(self.NUMBER, |answer| answer.results[0] as u16);
    }
}

function_block! {
    /// Returns the time since the supply was switched on (p. 115). Each call gives an order.
    pub struct TIMER_READ(jobs: Jobs) {
        out {
            /// Time in steps of 10 ms, up to 10 m 55 s 350 ms. Then it begins at 0 again.
            T: Duration;
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl TIMER_READ {
    /// Runs one PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let answer = self.internal.call(jobs, true, job::TIMER_READ, &[], &[]);
        self.ANSWERED = answer.is_some();
        self.T = answer.map_or(self.T, |answer| Duration::from_millis(answer.results[0].into()));
    }
}

function_block! {
    /// Returns the time since the supply was switched on (p. 116). Each call gives an order.
    pub struct TIMER_US_READ(jobs: Jobs) {
        out {
            /// Time in us, up to 4294967295. Then it begins at 0 again.
            TIME_US: u32;
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl TIMER_US_READ {
    /// Runs one PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let answer = self.internal.call(jobs, true, job::TIMER_US_READ, &[], &[]);
        self.ANSWERED = answer.is_some();
        self.TIME_US = answer.map_or(self.TIME_US, |answer| answer.results[0]);
    }
}

function_block! {
    /// Makes the program of event 2 run each millisecond (p. 118). A call that changes ENABLE gives an order.
    pub struct SET_INTERRUPT_1MS(jobs: Jobs) {
        in {
            /// Runs the program of event 2.
            ENABLE: bool;
        }
        out {
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: (Order, bool);
    }
}

impl SET_INTERRUPT_1MS {
    /// Runs one PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let (order, was_enabled) = &mut self.internal;
        let is_new = *was_enabled != self.ENABLE;
        let answer = order.call(jobs, is_new, job::SET_INTERRUPT_1MS, &[self.ENABLE.into()], &[]);
        *was_enabled = self.ENABLE;
        self.ANSWERED = answer.is_some();
    }
}
