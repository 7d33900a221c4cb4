//! `CANsync_UPDOWNLOAD_SL`: up- and downloads at a slave (p. 268-271).

use super::registers::Job;
use super::updownload::{Block, CANsync_UPDOWN_BMARRAY};
use super::updownload_ma::PRESET_TIME;
use crate::devices::cansync::registers::CANsync_SL_CTRL_BMSTRUCT;
use crate::devices::cansync::registers::values::{
    updown_error,
    updown_slave::{ACTIVE, BUSY, CHANGED, DOWNLOAD, ERROR, MODE, MODE_END, MODE_INIT, RESET},
};
use crate::plc::{Base, Like, Viewed, Watch, function_block};
use core::time::Duration;

/// Bit 0 of `w_ERR`.
const TIMEOUT: u16 = 1 << 0;

function_block! {
    /// Handles the up- and downloads of `CANsync_UPDOWNLOAD_MA` at the slave (manual p. 268-271).
    pub struct CANsync_UPDOWNLOAD_SL(_BASE: Base<CANsync_SL_CTRL_BMSTRUCT>) {
        in {
            /// Monitoring time of a whole job, in emulated time; preset 30 s.
            t_TIME: Duration = PRESET_TIME;
            /// Accepts jobs. If the input becomes FALSE while `x_BUSY` is TRUE, the job is cancelled, and the
            /// block needs `x_RESET`.
            x_EN: bool;
            /// Resets the block; needed after an error or a cancelled job.
            x_RESET: bool;
        }
        out {
            /// FALSE: the job is an upload, TRUE: a download.
            x_UPDOWN: bool;
            /// A job is in progress.
            x_ORDER_ACTIV: bool;
            /// Values of the block being transferred, 1 to 75.
            u_LENGTH: u16;
            /// Number of values in the present block, 1 to 75.
            x_BUSY: bool;
            /// Errors of the block; bit 0: timeout.
            w_ERR: u16;
            /// `w_ERR` is not 0.
            x_ERR: bool;
            /// The last job has been done.
            x_OK: bool;
        }
        in_out {
            a_DOWNLOAD: CANsync_UPDOWN_BMARRAY;
            a_UPLOAD: CANsync_UPDOWN_BMARRAY;
        }
        internal: TransferPhase;
    }
}

#[derive(Clone, Copy, Debug, Default)]
pub enum TransferPhase {
    #[default]
    Idle,
    /// A job of several blocks is in progress. The second field is its latest block.
    Transfer(Watch, Block),
    /// The last block is answered. The master has not fetched the answer yet.
    Ending(Watch),
    /// Failed or cancelled; waits for `x_RESET`.
    Locked,
}

impl CANsync_UPDOWNLOAD_SL {
    /// Runs one PLC cycle. Reads from `a_UPLOAD`, or writes to `a_DOWNLOAD`.
    pub fn call(
        &mut self,
        _BASE: &Base<impl Like<CANsync_SL_CTRL_BMSTRUCT>>,
        a_DOWNLOAD: &mut CANsync_UPDOWN_BMARRAY,
        a_UPLOAD: &CANsync_UPDOWN_BMARRAY,
    ) {
        let _BASE = &_BASE.viewed();
        if self.x_RESET || !self.x_EN {
            _BASE.b_EN_UPDOWNBLK1.store(0);
            if let TransferPhase::Transfer(..) | TransferPhase::Ending(_) = self.internal {
                refuse(_BASE, updown_error::SLAVE_CANCELS);
                self.show(TransferPhase::Locked);
            }
            if self.x_RESET {
                self.show(TransferPhase::Idle);
                (self.w_ERR, self.x_ERR, self.x_OK) = (0, false, false);
            }
            return;
        }
        _BASE.b_EN_UPDOWNBLK1.store(1);
        let control = job(_BASE).control();
        let is_locked = matches!(self.internal, TransferPhase::Locked);
        if control & CHANGED != 0 {
            job(_BASE).change(|value| value | RESET);
            return self.show(if is_locked { TransferPhase::Locked } else { TransferPhase::Idle });
        }
        if is_locked {
            // The block is waiting for a reset, so it refuses the job. Otherwise the master would wait for an
            // answer.
            if control & ACTIVE != 0 {
                refuse(_BASE, updown_error::SLAVE_CANCELS);
            }
            return;
        }
        // A new job means that the answer to the previous job was sent.
        if matches!(self.internal, TransferPhase::Ending(_)) && (control & BUSY == 0 || control & ACTIVE != 0)
        {
            self.show(TransferPhase::Idle);
            self.x_OK = true;
        }
        if control & ACTIVE != 0 {
            match (control & MODE, self.internal) {
                (MODE_INIT, _) => self.begin(_BASE, control, a_UPLOAD),
                (MODE_END, TransferPhase::Transfer(watch, block)) => {
                    self.block_done(_BASE, watch, block, a_DOWNLOAD)
                }
                // The transfer began before this block was enabled or reset, so its earlier blocks are
                // missing.
                _ => refuse(_BASE, updown_error::SLAVE_CANCELS),
            }
        }
        if let TransferPhase::Transfer(watch, _) | TransferPhase::Ending(watch) = self.internal
            && watch.is_over(_BASE.ram())
        {
            refuse(_BASE, updown_error::SLAVE_CANCELS);
            self.show(TransferPhase::Locked);
            (self.w_ERR, self.x_ERR) = (TIMEOUT, true);
        }
    }

    /// Changes to `phase` and updates the outputs.
    fn show(&mut self, phase: TransferPhase) {
        self.internal = phase;
        self.x_BUSY = matches!(phase, TransferPhase::Transfer(..) | TransferPhase::Ending(_));
        self.x_ORDER_ACTIV = self.x_BUSY;
    }

    /// Called when the master starts a block of a transfer. The first block starts the job.
    fn begin(
        &mut self,
        base: &Viewed<'_, CANsync_SL_CTRL_BMSTRUCT>,
        control: u8,
        a_UPLOAD: &CANsync_UPDOWN_BMARRAY,
    ) {
        let block = match Block::of_job(base.d_BASE_ADR_UPDOWNBLK1.load(), base.w_LENGTH_UPDOWNBLK1.load()) {
            Ok(block) => block,
            Err(number) => {
                refuse(base, number);
                return self.show(TransferPhase::Idle);
            }
        };
        let watch = match self.internal {
            TransferPhase::Transfer(watch, before) if before.next() == Some(block) => watch,
            _ => base.ram().watch(self.t_TIME),
        };
        self.x_UPDOWN = control & DOWNLOAD != 0;
        self.u_LENGTH = block.values as u16;
        self.x_OK = false;
        if !self.x_UPDOWN {
            let values = a_UPLOAD.iter().skip(block.first).take(block.values);
            base.a_DATA_UPDOWNBLK1.iter().zip(values).for_each(|(cell, value)| cell.store(*value as u32));
        }
        self.show(TransferPhase::Transfer(watch, block));
        job(base).change(|value| value & !ACTIVE);
    }

    /// Handles a complete block.
    fn block_done(
        &mut self,
        base: &CANsync_SL_CTRL_BMSTRUCT,
        watch: Watch,
        block: Block,
        a_DOWNLOAD: &mut CANsync_UPDOWN_BMARRAY,
    ) {
        if self.x_UPDOWN {
            let values = a_DOWNLOAD.iter_mut().skip(block.first).take(block.values);
            values.zip(&base.a_DATA_UPDOWNBLK1).for_each(|(value, cell)| *value = cell.load() as i32);
        }
        if block.next().is_none() {
            self.show(TransferPhase::Ending(watch));
        }
        job(base).change(|value| value & !ACTIVE);
    }
}

/// Ends the transfer with an error number.
fn refuse(base: &CANsync_SL_CTRL_BMSTRUCT, number: u16) {
    base.w_ERR_NR_UPDOWNBLK1.store(number);
    job(base).change(|value| value & !ACTIVE | ERROR);
}

fn job(base: &CANsync_SL_CTRL_BMSTRUCT) -> Job<'_> {
    Job { control: &base.b_STEUREG_UPDOWNBLK1, status: &base.b_STATREG_UPDOWNBLK1 }
}
