//! Blocks of a CANopen master (p. 52-68).

use super::order::{Jobs, Order, array, ms};
use crate::devices::cs0015::registers::values::job;
use crate::plc::function_block;
use core::time::Duration;

/// Defines blocks with ENABLE, NODE and RESULT. Some of these blocks also have STATE.
macro_rules! of_node {
    ($($(#[$doc:meta])* $name:ident $(: $state:ident)?)*) => {$(
        function_block! {
            $(#[$doc])*
            pub struct $name(jobs: Jobs) {
                in {
                    /// Each call with TRUE gives an order to the operating system.
                    ENABLE: bool;
                    /// Number of the node, 1 to 127; 0: all nodes.
                    NODE: u8;
                }
                out {
                    $(
                        /// State of the node at the previous order: 127 Pre-Operational, 5 Operational, 4
                        /// Prepared, 0 unknown.
                        $state: u8;
                    )?
                    /// Result of the previous order: 0 done, 1 not sent, 2 wrong parameters, 255 no master.
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
                let answer = self.internal.call(jobs, self.ENABLE, job::$name, &[self.NODE.into()], &[]);
                self.ANSWERED = answer.is_some();
                if let Some(answer) = answer {
                    let mut results = answer.results.into_iter();
                    for output in [$(&mut self.$state,)? &mut self.RESULT] {
                        *output = results.next().unwrap_or_default() as u8;
                    }
                }
            }
        }
    )*};
}

of_node! {
    /// Starts guarding a node (p. 57).
    NMM_START_GUARDING
    /// Stops guarding a node (p. 58).
    NMM_STOP_GUARDING
    /// Makes a node Pre-Operational (p. 60).
    NMM_SET_PREOPERATIONAL
    /// Makes a node Operational. The node may be the master itself (p. 61).
    NMM_SET_OPERATIONAL
    /// Stops a node (p. 62).
    NMM_SET_PREPARED
    /// Returns the state of a node (p. 63).
    NMM_GET_NODE_STATE: STATE
    /// Resets a node (p. 64).
    NMM_RESET_NODE
    /// Resets the communication of a node (p. 65).
    NMM_RESET_COMM: STATE
}

/// Defines blocks with ENABLE alone.
macro_rules! of_master {
    ($($(#[$doc:meta])* $name:ident)*) => {$(
        function_block! {
            $(#[$doc])*
            pub struct $name(jobs: Jobs) {
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

        impl $name {
            /// Runs one PLC cycle.
            pub fn call(&mut self, jobs: &Jobs) {
                self.ANSWERED = self.internal.call(jobs, self.ENABLE, job::$name, &[], &[]).is_some();
            }
        }
    )*};
}

of_master! {
    /// Makes the device the master of the network (p. 53).
    NMM_SET_NMT_MASTER
    /// Prepares SYNC objects, once (p. 66).
    PDO_INI_SEND_SYNC_OBJ
}

function_block! {
    /// Adds a node to the master (p. 55).
    pub struct NMM_ADD_NODE(jobs: Jobs) {
        in {
            /// Each call with TRUE gives an order to the operating system.
            ENABLE: bool;
            /// Number of the node, 1 to 127.
            NODE: u8;
            /// Time between two guarding objects, at most 65535 ms; 0: never.
            GUARDTIME: Duration;
            /// Number of consecutive answers that may be missing.
            LIFETIME: u8;
        }
        out {
            /// Result of the previous order: 0 done, 1 not done, 2 wrong parameters.
            RESULT: u8;
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl NMM_ADD_NODE {
    /// Runs one PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let arguments = [self.NODE.into(), ms(self.GUARDTIME), self.LIFETIME.into()];
        let answer = self.internal.call(jobs, self.ENABLE, job::NMM_ADD_NODE, &arguments, &[]);
        self.ANSWERED = answer.is_some();
        if let Some(answer) = answer {
            self.RESULT = answer.results[0] as u8;
        }
    }
}

function_block! {
    /// Guards the nodes for which guarding was started. The program must call the block in every cycle (p.
    /// 59).
    pub struct NMM_NODE_GUARDING(jobs: Jobs) {
        in {
            /// Each call with TRUE gives an order to the operating system.
            ENABLE: bool;
            /// Makes a returning node Operational.
            AUTO_RESTART: bool;
        }
        out {
            /// Result of the previous order: 0, or the number of a missing node (successive calls return all
            /// missing nodes in turn); 255 for a wrong call.
            RESULT: u8;
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl NMM_NODE_GUARDING {
    /// Runs one PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let arguments = [self.AUTO_RESTART.into()];
        let answer = self.internal.call(jobs, self.ENABLE, job::NMM_NODE_GUARDING, &arguments, &[]);
        self.ANSWERED = answer.is_some();
        if let Some(answer) = answer {
            self.RESULT = answer.results[0] as u8;
        }
    }
}

function_block! {
    /// Sends a SYNC object (p. 67).
    pub struct PDO_SEND_SYNC_OBJ(jobs: Jobs) {
        in {
            /// Each call with TRUE gives an order to the operating system.
            ENABLE: bool;
        }
        out {
            /// Result of the previous order: the object was sent.
            RESULT: bool;
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl PDO_SEND_SYNC_OBJ {
    /// Runs one PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let answer = self.internal.call(jobs, self.ENABLE, job::PDO_SEND_SYNC_OBJ, &[], &[]);
        self.ANSWERED = answer.is_some();
        self.RESULT = answer.is_some_and(|answer| answer.results[0] != 0);
    }
}

function_block! {
    /// Returns the emergencies of the nodes, the oldest first (p. 68).
    pub struct EMC_GET_EMERGENCY(jobs: Jobs) {
        in {
            /// Each call with TRUE gives an order to the operating system.
            ENABLE: bool;
        }
        out {
            /// A new emergency has arrived. The output is TRUE for one call.
            RECEIVED: bool;
            /// Number of the node.
            NODE: u8;
            /// Error code of the emergency.
            VALUE: u16;
            /// Error register, as 1001h.
            REGISTER: u8;
            /// Further data of the node.
            DATA: [u8; 5];
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl EMC_GET_EMERGENCY {
    /// Runs one PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let answer = self.internal.call(jobs, self.ENABLE, job::EMC_GET_EMERGENCY, &[], &[]);
        self.ANSWERED = answer.is_some();
        let answer = answer.filter(|answer| answer.results[0] != 0);
        self.RECEIVED = answer.is_some();
        let Some(answer) = answer else { return };
        let [_, node, value, register, ..] = answer.results;
        (self.NODE, self.VALUE, self.REGISTER) = (node as u8, value as u16, register as u8);
        self.DATA = array(&answer.data);
    }
}
