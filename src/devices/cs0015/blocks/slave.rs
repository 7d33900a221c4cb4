//! Blocks of a CANopen slave (p. 45-51).

use super::order::{Jobs, Order, ms};
use crate::devices::cs0015::registers::values::job;
use crate::plc::function_block;
use core::time::Duration;

function_block! {
    /// Sets the Node-ID. It takes effect at once and is stored (p. 45).
    pub struct NMS_SET_NODEID(jobs: Jobs) {
        in {
            /// Each call with TRUE gives an order to the operating system.
            ENABLE: bool;
            /// Node-ID, 1 to 30.
            NODEID: u8;
        }
        out {
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl NMS_SET_NODEID {
    /// Runs one PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let arguments = [self.NODEID.into()];
        self.ANSWERED = self.internal.call(jobs, self.ENABLE, job::NMS_SET_NODEID, &arguments, &[]).is_some();
    }
}

function_block! {
    /// Configures how the slave supervises its master (p. 46).
    pub struct NMS_GUARDING_CONFIG(jobs: Jobs) {
        in {
            /// Each call with TRUE gives an order to the operating system.
            ENABLE: bool;
            /// Time between two guarding objects, at most 65535 ms; 0: off.
            GUARDTIME: Duration;
            /// Number of consecutive guarding objects that may be missing.
            LIFETIME: u8;
            /// Time between two SYNC objects, at most 65535 ms; 0: off.
            CYCLEPERIOD: Duration;
        }
        out {
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl NMS_GUARDING_CONFIG {
    /// Runs one PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let arguments = [ms(self.GUARDTIME), self.LIFETIME.into(), ms(self.CYCLEPERIOD)];
        let answer = self.internal.call(jobs, self.ENABLE, job::NMS_GUARDING_CONFIG, &arguments, &[]);
        self.ANSWERED = answer.is_some();
    }
}

function_block! {
    /// Configures a transmit PDO, and resets the communication (p. 47-48).
    pub struct PDO_TX_CONFIG(jobs: Jobs) {
        in {
            /// Each call with TRUE gives an order to the operating system.
            ENABLE: bool;
            /// Number of the PDO, 1 to 8.
            PDO: u8;
            /// Identifier of the PDO, from 16#380 on; 0 keeps the present identifier.
            ID: u16;
            /// 0 to 240: the PDO is sent with SYNC; 255: the PDO is sent when the data have changed.
            TRANS_TYPE: u8;
            /// Minimum time until the next PDO, at most 65535 ms.
            INHIBIT_TIME: Duration;
        }
        out {
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl PDO_TX_CONFIG {
    /// Runs one PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let arguments = [self.PDO.into(), self.ID.into(), self.TRANS_TYPE.into(), ms(self.INHIBIT_TIME)];
        self.ANSWERED = self.internal.call(jobs, self.ENABLE, job::PDO_TX_CONFIG, &arguments, &[]).is_some();
    }
}

function_block! {
    /// Configures a receive PDO, and resets the communication (p. 49-50).
    pub struct PDO_RX_CONFIG(jobs: Jobs) {
        in {
            /// Each call with TRUE gives an order to the operating system.
            ENABLE: bool;
            /// Number of the PDO, 1 to 8.
            PDO: u8;
            /// Identifier of the PDO, from 16#380 on; 0 keeps the present identifier.
            ID: u16;
            /// 0 to 240: the data take effect with SYNC; 255: the data take effect immediately.
            TRANS_TYPE: u8;
        }
        out {
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl PDO_RX_CONFIG {
    /// Runs one PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let arguments = [self.PDO.into(), self.ID.into(), self.TRANS_TYPE.into()];
        self.ANSWERED = self.internal.call(jobs, self.ENABLE, job::PDO_RX_CONFIG, &arguments, &[]).is_some();
    }
}

function_block! {
    /// Sends a PDO once more (p. 51).
    pub struct PDO_TX_REFRESH(jobs: Jobs) {
        in {
            /// TRUE gives the order. Do not set it in every cycle.
            ENABLE: bool;
            /// Number of the PDO, 1 to 8.
            PDO: u8;
        }
        out {
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl PDO_TX_REFRESH {
    /// Runs one PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let arguments = [self.PDO.into()];
        self.ANSWERED = self.internal.call(jobs, self.ENABLE, job::PDO_TX_REFRESH, &arguments, &[]).is_some();
    }
}
