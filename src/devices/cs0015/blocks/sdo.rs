//! Blocks that read and write the object dictionary of a node (p. 69-70).

use super::order::{Jobs, Order, Progress, array};
use crate::devices::cs0015::registers::values::job;
use crate::plc::function_block;

/// RESULT: not active, finished, active.
const INACTIVE: u8 = 0;
const FINISHED: u8 = 1;
const ACTIVE: u8 = 2;

/// An order that takes several cycles: an SDO, or a function that uses SDOs. While ENABLE is TRUE, the block
/// repeats the order until it has finished once.
#[derive(Clone, Debug, Default)]
pub struct Sdo {
    order: Order,
    /// True if the order has finished, and ENABLE has been TRUE since then.
    is_finished: bool,
}

impl Sdo {
    /// Runs one call and returns RESULT. If the order has just finished, also returns the second result,
    /// which is the abort code, and the data.
    pub(super) fn call(
        &mut self,
        jobs: &Jobs,
        enable: bool,
        function: u16,
        arguments: &[u32],
        data: &[u8],
    ) -> (u8, Option<(u32, Vec<u8>)>) {
        if !enable {
            self.order.withdraw(jobs);
            self.is_finished = false;
            return (INACTIVE, None);
        }
        if self.is_finished {
            return (FINISHED, None);
        }
        match self.order.look(jobs) {
            Progress::UnderWay => (ACTIVE, None),
            Progress::Nothing => {
                self.order.give(jobs, function, arguments, data);
                (ACTIVE, None)
            }
            Progress::Answered(answer) => {
                let [result, code, ..] = answer.results;
                self.is_finished = result == u32::from(FINISHED);
                (if self.is_finished { FINISHED } else { INACTIVE }, Some((code, answer.data)))
            }
        }
    }
}

function_block! {
    /// Reads an entry of the object dictionary of a node (p. 69). While ENABLE is TRUE, the block reads the
    /// entry once. It repeats a transfer that was aborted (D-445).
    pub struct SDO_READ(jobs: Jobs) {
        in {
            /// Reads the entry.
            ENABLE: bool;
            /// Number of the node.
            NODE: u8;
            /// Index of the entry.
            IDX: u16;
            /// Sub-index of the entry.
            SUBIDX: u16;
            /// Length of the entry in bytes.
            LENGTH: u16;
        }
        out {
            /// 0: not active, or aborted; 1: finished; 2: active.
            RESULT: u8;
            /// Data of the entry in the object dictionary.
            DATA: [u8; 256] = [0; 256];
            /// Reason of the last abort; 0: not aborted, or refused. commram has added this output.
            ABORT: u32;
        }
        internal: Sdo;
    }
}

impl SDO_READ {
    /// Runs one PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let arguments = [self.NODE.into(), self.IDX.into(), self.SUBIDX.into(), self.LENGTH.into()];
        let (result, finished) = self.internal.call(jobs, self.ENABLE, job::SDO_READ, &arguments, &[]);
        self.RESULT = result;
        if let Some((code, data)) = finished {
            self.ABORT = code;
            if result == FINISHED {
                self.DATA = array(&data);
            }
        }
    }
}

function_block! {
    /// Writes an entry of the object dictionary of a node (p. 70), in the same way as `SDO_READ` reads an
    /// entry.
    pub struct SDO_WRITE(jobs: Jobs) {
        in {
            /// Writes the entry.
            ENABLE: bool;
            /// Number of the node.
            NODE: u8;
            /// Index of the entry.
            IDX: u16;
            /// Sub-index of the entry.
            SUBIDX: u16;
            /// Length of the data in bytes.
            LENGTH: u16;
            /// Data of the entry in the object dictionary.
            DATA: [u8; 256] = [0; 256];
        }
        out {
            /// 0: not active, or aborted; 1: finished; 2: active.
            RESULT: u8;
            /// Reason of the last abort; 0: not aborted, or refused. commram has added this output.
            ABORT: u32;
        }
        internal: Sdo;
    }
}

impl SDO_WRITE {
    /// Runs one PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let arguments = [self.NODE.into(), self.IDX.into(), self.SUBIDX.into(), self.LENGTH.into()];
        let (result, finished) =
            self.internal.call(jobs, self.ENABLE, job::SDO_WRITE, &arguments, &self.DATA);
        self.RESULT = result;
        if let Some((code, _)) = finished {
            self.ABORT = code;
        }
    }
}
