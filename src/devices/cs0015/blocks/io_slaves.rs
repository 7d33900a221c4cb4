//! Blocks for the I/O modules CR2010 and CR2011 (p. 71-85).

use super::order::{Jobs, Order, array, ms};
use super::sdo::Sdo;
use crate::devices::cs0015::registers::values::job;
use crate::plc::function_block;
use core::time::Duration;

/// Values of CFG_RESULT (p. 77). `DONE`: read or written. `NOT_YET`: not yet read or written. The value is 0
/// if READ and WRITE are FALSE.
const DONE: u8 = 1;
const NOT_YET: u8 = 2;

function_block! {
    /// Makes the device the master of I/O modules 1 to NO_NODE (p. 73). ENABLE must stay TRUE until DONE is
    /// TRUE.
    pub struct COP_MSTR_BOOTUP(jobs: Jobs) {
        in {
            /// Starts the operation; FALSE ends it.
            ENABLE: bool;
            /// Number of nodes, without the master.
            NO_NODE: u8;
            /// Time between two guarding objects, at most 65535 ms; 0: never.
            GUARDTIME: Duration;
            /// Number of consecutive answers that may be missing.
            LIFETIME: u8;
        }
        out {
            /// The block has finished, more than 2 s after the start.
            DONE: bool;
        }
        internal: Sdo;
    }
}

impl COP_MSTR_BOOTUP {
    /// Runs one PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let arguments = [self.NO_NODE.into(), ms(self.GUARDTIME), self.LIFETIME.into()];
        let (result, _) = self.internal.call(jobs, self.ENABLE, job::COP_MSTR_BOOTUP, &arguments, &[]);
        self.DONE = result == DONE;
    }
}

function_block! {
    /// Sends SYNC objects and guards the nodes. The program must call the block in every cycle (p. 75).
    pub struct COP_MSTR_MAIN(jobs: Jobs) {
        in {
            /// Each call with TRUE gives an order to the operating system.
            ENABLE: bool;
            /// Number of nodes, without the master.
            NO_NODE: u8;
            /// Time between two SYNC objects, at most 65535 ms; 0: never.
            SYNC_TIME: Duration;
            /// Makes a returning node Operational.
            AUTO_OPERATIONAL: bool;
            /// Forgets the nodes in `RESULT`.
            RESET_GUARDING: bool;
        }
        out {
            /// Numbers of the missing nodes in ascending order, followed by 0.
            RESULT: [u8; 8];
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl COP_MSTR_MAIN {
    /// Runs one PLC cycle.
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

/// Defines blocks that configure a module. The macro gets the names of the inputs and outputs.
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
                    /// TRUE reads the configuration from the module.
                    READ: bool;
                    /// Writes the configuration, before it is read.
                    WRITE: bool;
                }
                out {
                    /// 1: read or written; 2: not yet read or written; 0: READ and WRITE are FALSE.
                    CFG_RESULT: u8;
                    $(
                        /// Value that was read.
                        $actual: u8;
                    )*
                    /// Reason of the last abort; 0: not aborted, or refused. commram has added this output.
                    ABORT: u32;
                }
                internal: Sdo;
            }
        }

        impl $name {
            /// Runs one PLC cycle.
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

/// Defines blocks for a CR2010. Each block also exists under an older name.
macro_rules! cr2010 {
    ($($(#[$doc:meta])* $name:ident)*) => {
        config! {$(
            $(#[$doc])*
            $name = SLAVE_CR2010_CONFIG:
                /// 0 off, 1 digital input.
                CHANNEL_1 CHANNEL_1_
                /// 0 off, 2 digital output, 3 analog input, 4 analog output.
                CHANNEL_2 CHANNEL_2_
                /// Values as for CHANNEL_1.
                CHANNEL_3 CHANNEL_3_
                /// Values as for CHANNEL_2.
                CHANNEL_4 CHANNEL_4_
                /// Values as for CHANNEL_1.
                CHANNEL_5 CHANNEL_5_
                /// Values as for CHANNEL_2.
                CHANNEL_6 CHANNEL_6_
                /// Values as for CHANNEL_1.
                CHANNEL_7 CHANNEL_7_
                /// Values as for CHANNEL_2.
                CHANNEL_8 CHANNEL_8_;
        )*}
    };
}

cr2010! {
    /// Writes and reads the configuration of a CR2010's connectors (p. 77).
    SLAVE_CR2010_CONFIG
    /// The older name of `SLAVE_CR2010_CONFIG` (p. 79).
    SLAVE_8_CONFIG
}

config! {
    /// Writes and reads the configuration of a CR2011's pairs of outputs (p. 81).
    SLAVE_CR2011_CONFIG = SLAVE_CR2011_CONFIG:
        /// 0 off, 2 digital outputs, 4 analog outputs (PWM), 5 analog outputs (current-controlled).
        CHANNEL_1_2 CHANNEL_1_2_
        /// Values as for CHANNEL_1_2.
        CHANNEL_3_4 CHANNEL_3_4_
        /// Values as for CHANNEL_1_2.
        CHANNEL_5_6 CHANNEL_5_6_
        /// Values as for CHANNEL_1_2.
        CHANNEL_7_8 CHANNEL_7_8_;
}

/// Defines blocks that exchange the words of a module.
macro_rules! work {
    ($($(#[$doc:meta])* $name:ident = $job:ident;)*) => {$(
        function_block! {
            $(#[$doc])*
            pub struct $name(jobs: Jobs) {
                in {
                    /// Each call with TRUE gives an order to the operating system.
                    ENABLE: bool;
                    /// Registers the module, in the first cycle.
                    INIT: bool;
                    /// Number of the module, 1 to 32.
                    NODE: u8;
                }
                out {
                    /// Result of the previous order: the words were exchanged.
                    RESULT: bool;
                    /// The previous order has been answered. commram has added this output.
                    ANSWERED: bool;
                }
                internal: Order;
            }
        }

        impl $name {
            /// Runs one PLC cycle.
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
