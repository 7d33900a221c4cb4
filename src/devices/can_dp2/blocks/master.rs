//! The PLC's DP master: sends parameters and configuration, then exchanges the peripherals with the gateway.

use super::Peripherals;
use crate::devices::can_dp2::registers::values::{mst_control, mst_dsap, mst_result};
use crate::devices::can_dp2::registers::values::{
    station_status_1 as status_1, station_status_2 as status_2,
};
use crate::devices::can_dp2::registers::{CAN_DP2_MST, gsd};
use crate::plc::{Base, Shared, function_block};

/// Number of octets of each direction, and of the diagnosis.
const OCTETS: usize = gsd::MAX_OUTPUT_LEN as usize;
const DIAG: usize = gsd::MAX_DIAG_DATA_LEN as usize;

/// Largest number of calls after which a slave may still be not ready, although it has acknowledged its configuration
/// (D-369).
const NOT_READY_CALLS: u16 = 1000;

/// The request that the block sends next or has sent last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum MasterStep {
    /// Finds out whether the slave answers.
    #[default]
    Find,
    Parameters,
    Configuration,
    /// Finds out whether the slave is ready.
    Check,
    Exchange,
    /// Reads a waiting diagnosis.
    Diagnosis,
}

/// Progress of the master.
#[derive(Clone, Debug, Default)]
pub struct Master {
    step: MasterStep,
    is_asked: bool,
    /// Number of calls that have found the slave not ready since it acknowledged its configuration.
    not_ready_calls: u16,
}

function_block! {
    /// Exchanges outputs and inputs with the gateway, with at most one request per call. The block uses the
    /// registers of the DP master without a stack. A program calls it once in each cycle. In a real PLC the
    /// CPU exchanges the data, not the program. So no manual describes this block; commram defines it.
    pub struct DP_MASTER(mst: Base<CAN_DP2_MST>, peripherals: Shared<Peripherals>) {
        in {
            /// TRUE enables the exchange; FALSE restarts it.
            ENABLE: bool;
            /// Octets of the telegram Set_Prm.
            PRM: [u8; 16] = [0; 16];
            /// Octets of the telegram Chk_Cfg.
            CFG: [u8; 244] = [0; 244];
            /// Number of octets in `CFG`.
            CFG_LEN: u8;
            /// Number of octets of all output modules.
            OUTPUT_LEN: u8;
        }
        out {
            /// TRUE while data exchange with the slave runs.
            READY: bool;
            /// Number of data exchanges since ENABLE.
            COUNT: u32;
            /// Octets of the last diagnosis that the slave sent.
            DIAG: [u8; 16] = [0; 16];
        }
        internal: Master;
    }
}

impl DP_MASTER {
    /// Runs one PLC cycle.
    pub fn call(&mut self, mst: &Base<CAN_DP2_MST>, peripherals: &mut Peripherals) {
        let is_busy = mst.mst_control.load() == mst_control::SEND;
        if !self.ENABLE {
            (self.READY, self.COUNT, self.internal) = (false, 0, Master::default());
            return;
        }
        if is_busy {
            return;
        }
        if core::mem::take(&mut self.internal.is_asked) {
            self.internal.step = self.answered(mst, peripherals);
        }
        let (dsap, octets): (u8, &[u8]) = match self.internal.step {
            MasterStep::Find | MasterStep::Check | MasterStep::Diagnosis => (mst_dsap::SLAVE_DIAG, &[]),
            MasterStep::Parameters => (mst_dsap::SET_PRM, &self.PRM),
            MasterStep::Configuration => {
                (mst_dsap::CHK_CFG, &self.CFG[..usize::from(self.CFG_LEN).min(OCTETS)])
            }
            MasterStep::Exchange => {
                (mst_dsap::DATA_EXCHANGE, &peripherals.outputs[..usize::from(self.OUTPUT_LEN).min(OCTETS)])
            }
        };
        mst.mst_dsap.store(dsap);
        mst.mst_request_len.store(octets.len() as u8);
        mst.mst_request.iter().zip(octets).for_each(|(cell, octet)| cell.store(*octet));
        mst.mst_control.store(mst_control::SEND);
        self.internal.is_asked = true;
    }

    /// Evaluates the result of a request; returns the next step.
    fn answered(&mut self, mst: &Base<CAN_DP2_MST>, peripherals: &mut Peripherals) -> MasterStep {
        let result = mst.mst_result.load();
        let reply = mst.mst_reply.iter().take(mst.mst_reply_len.load().into()).map(|cell| cell.load());
        let step = self.internal.step;
        let not_ready_calls = core::mem::take(&mut self.internal.not_ready_calls) + 1;
        let is_diagnosis = matches!(step, MasterStep::Find | MasterStep::Check | MasterStep::Diagnosis);
        match (step, result) {
            (_, mst_result::DATA | mst_result::DATA_AND_DIAGNOSIS) if is_diagnosis => {
                self.DIAG = [0; DIAG];
                self.DIAG.iter_mut().zip(reply).for_each(|(to, from)| *to = from);
                match step {
                    MasterStep::Find => MasterStep::Parameters,
                    MasterStep::Check
                        if self.DIAG[0] & (status_1::CFG_FAULT | status_1::PRM_FAULT) != 0
                            || self.DIAG[1] & status_2::PRM_REQ != 0 =>
                    {
                        MasterStep::Find
                    }
                    MasterStep::Check if self.DIAG[0] & status_1::NOT_READY == 0 => MasterStep::Exchange,
                    // A slave that has not received the configuration, but has repeated an earlier receipt, is never
                    // ready.
                    MasterStep::Check if not_ready_calls >= NOT_READY_CALLS => MasterStep::Find,
                    MasterStep::Check => {
                        self.internal.not_ready_calls = not_ready_calls;
                        MasterStep::Check
                    }
                    _ => MasterStep::Exchange,
                }
            }
            (MasterStep::Parameters, mst_result::RECEIPT) => MasterStep::Configuration,
            (MasterStep::Configuration, mst_result::RECEIPT) => MasterStep::Check,
            (
                MasterStep::Exchange,
                mst_result::DATA | mst_result::DATA_AND_DIAGNOSIS | mst_result::RECEIPT,
            ) => {
                peripherals.inputs.iter_mut().zip(reply).for_each(|(to, from)| *to = from);
                (self.READY, self.COUNT) = (true, self.COUNT.wrapping_add(1));
                if result == mst_result::DATA_AND_DIAGNOSIS {
                    MasterStep::Diagnosis
                } else {
                    MasterStep::Exchange
                }
            }
            _ => {
                self.READY = false;
                MasterStep::Find
            }
        }
    }
}
