//! Blocks for errors of the CAN bus (p. 35-36).

use super::order::{Jobs, Order};
use crate::devices::cs0015::registers::values::job;
use crate::plc::function_block;

function_block! {
    /// Starts the return of a BUS-off controller to the bus (p. 35).
    pub struct CAN_RESTART(jobs: Jobs) {
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

impl CAN_RESTART {
    /// Runs one PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        self.ANSWERED = self.internal.call(jobs, self.ENABLE, job::CAN_RESTART, &[], &[]).is_some();
    }
}

function_block! {
    /// Counts errors of CAN, and starts the return of a BUS-off controller (p. 36). Each call gives an order.
    pub struct CAN_ERRORHANDLER(jobs: Jobs) {
        in {
            /// Sets the counter to 0.
            RESET: bool;
        }
        out {
            /// Number of errors since the last reset of the counter.
            ERRORCOUNT: u16;
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl CAN_ERRORHANDLER {
    /// Runs one PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let answer = self.internal.call(jobs, true, job::CAN_ERRORHANDLER, &[self.RESET.into()], &[]);
        self.ANSWERED = answer.is_some();
        self.ERRORCOUNT = answer.map_or(self.ERRORCOUNT, |answer| answer.results[0] as u16);
    }
}
