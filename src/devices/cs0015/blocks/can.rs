//! Blocks for plain CAN (p. 30-36).

use super::order::{Jobs, Order, array};
use crate::devices::cs0015::registers::values::job;
use crate::plc::function_block;

function_block! {
    /// Sets the bit rate. The rate takes effect at once and is stored (p. 31).
    pub struct CAN_BAUDRATE(jobs: Jobs) {
        in {
            /// Each call with TRUE gives an order to the operating system.
            ENABLE: bool;
            /// Bit rate in kbit/s: 10, 20, 50, 100, 125, 250, 500, 1000.
            BAUDRATE: u16;
        }
        out {
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl CAN_BAUDRATE {
    /// Runs one PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let arguments = [self.BAUDRATE.into()];
        self.ANSWERED = self.internal.call(jobs, self.ENABLE, job::CAN_BAUDRATE, &arguments, &[]).is_some();
    }
}

function_block! {
    /// Gives a message to the CAN controller (p. 32).
    pub struct CAN_TRANSMIT(jobs: Jobs) {
        in {
            /// Identifier, 0 to 2047.
            ID: u16;
            /// This block does not use RTR.
            RTR: u8;
            /// Number of bytes, 0 to 8.
            DLC: u8;
            /// Data bytes of the message.
            DATA: [u8; 8];
            /// Each call with TRUE gives an order to the operating system.
            ENABLE: bool;
        }
        out {
            /// The message of the previous order was accepted. If FALSE, the program must repeat the order.
            RESULT: bool;
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl CAN_TRANSMIT {
    /// Runs one PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let arguments = [self.ID.into(), self.RTR.into(), self.DLC.into()];
        let answer = self.internal.call(jobs, self.ENABLE, job::CAN_TRANSMIT, &arguments, &self.DATA);
        self.ANSWERED = answer.is_some();
        self.RESULT = answer.is_some_and(|answer| answer.results[0] != 0);
    }
}

function_block! {
    /// Registers an identifier and fetches its messages, the oldest first (p. 33-34). Each call gives an
    /// order.
    pub struct CAN_RECEIVE(jobs: Jobs) {
        in {
            /// Registers the identifier, once.
            CONFIG: bool;
            /// TRUE discards messages that wait to be read.
            CLEAR: bool;
            /// Identifier, 0 to 2047.
            ID: u16;
        }
        out {
            /// The bytes of the message.
            DATA: [u8; 8];
            /// Number of data bytes in the message.
            DLC: u8;
            /// This block does not use RTR.
            RTR: u8;
            /// Number of waiting messages, including the message that was fetched; 0: no message.
            AVAILABLE: u8;
            /// At least one message was lost.
            OVERFLOW: bool;
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl CAN_RECEIVE {
    /// Runs one PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let arguments = [self.CONFIG.into(), self.CLEAR.into(), self.ID.into()];
        let answer = self.internal.call(jobs, true, job::CAN_RECEIVE, &arguments, &[]);
        // AVAILABLE stays 0 until the program fetches the next message.
        self.AVAILABLE = 0;
        self.ANSWERED = answer.is_some();
        let Some(answer) = answer else { return };
        let [dlc, rtr, available, overflow, ..] = answer.results;
        (self.DATA, self.DLC, self.RTR) = (array(&answer.data), dlc as u8, rtr as u8);
        (self.AVAILABLE, self.OVERFLOW) = (available as u8, overflow != 0);
    }
}
