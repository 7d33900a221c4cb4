//! Blocks for the I/O modules CR2010 and CR2011 (p. 71-85).

use super::order::{Jobs, Order, array, ms};
use super::sdo::Sdo;
use crate::devices::cs0015::registers::values::job;
use crate::plc::function_block;
use core::time::Duration;

/// CFG_RESULT: read or written; not yet (p. 77). Without READ and WRITE it is 0.
const DONE: u8 = 1;
const NOT_YET: u8 = 2;

function_block! {
    /// Makes the device the master of I/O modules 1 to NO_NODE (p. 73). ENABLE stays until DONE.
    pub struct COP_MSTR_BOOTUP(jobs: Jobs) {
        in {
            /// Begins, and ends when it is FALSE again.
            ENABLE: bool;
            /// Number of nodes, the master left out.
            NO_NODE: u8;
            /// Time between two guarding objects, to 65535 ms; 0: never.
            GUARDTIME: Duration;
            /// Answers in a row that may be missing.
            LIFETIME: u8;
        }
        out {
            /// It is done, more than 2 s after its begin.
            DONE: bool;
        }
        internal: Sdo;
    }
}

impl COP_MSTR_BOOTUP {
    /// One PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let arguments = [self.NO_NODE.into(), ms(self.GUARDTIME), self.LIFETIME.into()];
        let (result, _) = self.internal.call(jobs, self.ENABLE, job::COP_MSTR_BOOTUP, &arguments, &[]);
        self.DONE = result == DONE;
    }
}

function_block! {
    /// Sends SYNC objects and guards the nodes; to be called in every cycle (p. 75).
    pub struct COP_MSTR_MAIN(jobs: Jobs) {
        in {
            /// Gives the order.
            ENABLE: bool;
            /// Number of nodes, the master left out.
            NO_NODE: u8;
            /// Time between two SYNC objects, to 65535 ms; 0: never.
            SYNC_TIME: Duration;
            /// A node that is back is made Operational.
            AUTO_OPERATIONAL: bool;
            /// Forgets the nodes in RESULT.
            RESET_GUARDING: bool;
        }
        out {
            /// Nodes that have been missing, in their order, 0 behind them.
            RESULT: [u8; 8];
            /// The order before has been answered; ours.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl COP_MSTR_MAIN {
    /// One PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let arguments = [
            self.NO_NODE.into(),
            ms(self.SYNC_TIME),
            self.AUTO_OPERATIONAL.into(),
            self.RESET_GUARDING.into(),
        ];
        let answer = self.internal.call(jobs, self.ENABLE, job::COP_MSTR_MAIN, &arguments, &[]);
        self.ANSWERED = answer.is_some();
        if let Some(answer) = answer {
            self.RESULT = array(&answer.data);
        }
    }
}

/// Blocks that configure a module: what its inputs and outputs are called.
macro_rules! config {
    ($($(#[$doc:meta])* $name:ident = $job:ident: $($(#[$pin_doc:meta])* $pin:ident $actual:ident)*;)*) => {$(
        function_block! {
            $(#[$doc])*
            pub struct $name(jobs: Jobs) {
                in {
                    /// Number of the module, 1 to 32.
                    NODE_ID: u8;
                    $($(#[$pin_doc])* $pin: u8;)*
                    /// PWM frequency in Hz, 20 to 200.
                    PWM_FRQ: u8;
                    /// Reads the configuration.
                    READ: bool;
                    /// Writes the configuration, before it is read.
                    WRITE: bool;
                }
                out {
                    /// 1: read or written; 2: not yet; 0: neither READ nor WRITE.
                    CFG_RESULT: u8;
                    $(
                        /// As it was read.
                        $actual: u8;
                    )*
                    /// Why it was aborted last; 0: it was not, or was refused; ours.
                    ABORT: u32;
                }
                internal: Sdo;
            }
        }

        impl $name {
            /// One PLC cycle.
            pub fn call(&mut self, jobs: &Jobs) {
                let (arguments, data) = (
                    [self.NODE_ID.into(), self.PWM_FRQ.into(), self.READ.into(), self.WRITE.into()],
                    [$(self.$pin),*],
                );
                let is_wanted = self.READ || self.WRITE;
                let (result, finished) = self.internal.call(jobs, is_wanted, job::$job, &arguments, &data);
                self.CFG_RESULT = match result {
                    _ if !is_wanted => 0,
                    DONE => DONE,
                    _ => NOT_YET,
                };
                if let Some((code, read)) = finished {
                    self.ABORT = code;
                    let outputs = [$(&mut self.$actual),*];
                    outputs.into_iter().zip(read).for_each(|(output, kind)| *output = kind);
                }
            }
        }
    )*};
}

/// Blocks for a CR2010, under its old name, too.
macro_rules! cr2010 {
    ($($(#[$doc:meta])* $name:ident)*) => {
        config! {$(
            $(#[$doc])*
            $name = SLAVE_CR2010_CONFIG:
                /// 0 off, 1 digital input.
                CHANNEL_1 CHANNEL_1_
                /// 0 off, 2 digital output, 3 analog input, 4 analog output.
                CHANNEL_2 CHANNEL_2_
                /// As CHANNEL_1.
                CHANNEL_3 CHANNEL_3_
                /// As CHANNEL_2.
                CHANNEL_4 CHANNEL_4_
                /// As CHANNEL_1.
                CHANNEL_5 CHANNEL_5_
                /// As CHANNEL_2.
                CHANNEL_6 CHANNEL_6_
                /// As CHANNEL_1.
                CHANNEL_7 CHANNEL_7_
                /// As CHANNEL_2.
                CHANNEL_8 CHANNEL_8_;
        )*}
    };
}

cr2010! {
    /// Writes and reads what the connectors of a CR2010 are (p. 77).
    SLAVE_CR2010_CONFIG
    /// The older name of `SLAVE_CR2010_CONFIG` (p. 79).
    SLAVE_8_CONFIG
}

config! {
    /// Writes and reads what the pairs of outputs of a CR2011 are (p. 81).
    SLAVE_CR2011_CONFIG = SLAVE_CR2011_CONFIG:
        /// 0 off, 2 digital outputs, 4 analog outputs (PWM), 5 analog outputs (current-controlled).
        CHANNEL_1_2 CHANNEL_1_2_
        /// As CHANNEL_1_2.
        CHANNEL_3_4 CHANNEL_3_4_
        /// As CHANNEL_1_2.
        CHANNEL_5_6 CHANNEL_5_6_
        /// As CHANNEL_1_2.
        CHANNEL_7_8 CHANNEL_7_8_;
}

/// Blocks that exchange the words of a module.
macro_rules! work {
    ($($(#[$doc:meta])* $name:ident = $job:ident;)*) => {$(
        function_block! {
            $(#[$doc])*
            pub struct $name(jobs: Jobs) {
                in {
                    /// Gives the order.
                    ENABLE: bool;
                    /// Makes the module known, in the first cycle.
                    INIT: bool;
                    /// Number of the module, 1 to 32.
                    NODE: u8;
                }
                out {
                    /// Of the order before: the words were exchanged.
                    RESULT: bool;
                    /// The order before has been answered; ours.
                    ANSWERED: bool;
                }
                internal: Order;
            }
        }

        impl $name {
            /// One PLC cycle.
            pub fn call(&mut self, jobs: &Jobs) {
                let arguments = [self.INIT.into(), self.NODE.into()];
                let answer = self.internal.call(jobs, self.ENABLE, job::$job, &arguments, &[]);
                self.ANSWERED = answer.is_some();
                if let Some(answer) = answer {
                    self.RESULT = answer.results[0] != 0;
                }
            }
        }
    )*};
}

work! {
    /// Exchanges inputs and outputs of a CR2010 with its words, in every cycle (p. 80).
    SLAVE_CR2010_WORK = SLAVE_CR2010_WORK;
    /// The older name of `SLAVE_CR2010_WORK` (p. 80).
    SLAVE_8_WORK = SLAVE_CR2010_WORK;
    /// Exchanges outputs and currents of a CR2011 with its words, in every cycle (p. 84).
    SLAVE_CR2011_WORK = SLAVE_CR2011_WORK;
}
