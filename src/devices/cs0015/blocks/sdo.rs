//! Blocks that read and write the object dictionary of a node (p. 69-70).

use super::order::{Jobs, Order, Progress, array};
use crate::devices::cs0015::registers::values::job;
use crate::plc::function_block;

/// RESULT: not active, finished, active.
const INACTIVE: u8 = 0;
const FINISHED: u8 = 1;
const ACTIVE: u8 = 2;

/// An order that takes its time: an SDO, and what is made of such. While it is enabled it is given until it has finished once.
#[derive(Clone, Debug, Default)]
pub struct Sdo {
    order: Order,
    /// It is finished; ENABLE has not been taken away since.
    is_finished: bool,
}

impl Sdo {
    /// A call: RESULT, the second result (the code of an abort), and data, if it has just finished.
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
    /// Reads an entry of the object dictionary of a node (p. 69). While ENABLE stays TRUE it is read once; what was aborted is
    /// tried again (D-445).
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
            /// 0 not active, or aborted; 1 finished; 2 active.
            RESULT: u8;
            /// The data.
            DATA: [u8; 256] = [0; 256];
            /// Why it was aborted last; 0: it was not, or was refused; ours.
            ABORT: u32;
        }
        internal: Sdo;
    }
}

impl SDO_READ {
    /// One PLC cycle.
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
    /// Writes an entry of the object dictionary of a node (p. 70), as `SDO_READ` reads one.
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
            /// The data.
            DATA: [u8; 256] = [0; 256];
        }
        out {
            /// 0 not active, or aborted; 1 finished; 2 active.
            RESULT: u8;
            /// Why it was aborted last; 0: it was not, or was refused; ours.
            ABORT: u32;
        }
        internal: Sdo;
    }
}

impl SDO_WRITE {
    /// One PLC cycle.
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
