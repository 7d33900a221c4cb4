//! `CANsync_UPDOWNLOAD_MA`: up- and downloads of a master (p. 263-267).

use super::registers::{ACTIVE, ERROR, Job, RESET};
use super::updownload::{Block, CANsync_UPDOWN_BMARRAY, DOWNLOAD, UPDOWN_VALUES};
use crate::devices::omega_drive_line_2::registers::CANsync_MA_CTRL_BMSTRUCT;
use crate::plc::{Base, Like, Viewed, Watch, function_block};
use core::time::Duration;

/// Bit 0 of `b_ERR` (decision D-20).
const TIMEOUT: u8 = 1 << 0;
/// Bit 1.
const LENGTH: u8 = 1 << 1;
/// Control register of a job just entered, without the direction; the firmware fills in the mode.
const ENTERED: u8 = 0x05;
/// `t_TIME` is preset at the slave's block only; the master's takes the same (decision D-212).
pub(super) const PRESET_TIME: Duration = Duration::from_secs(30);

function_block! {
    /// Transfers up to 2048 values to or from a slave that runs
    /// [`CANsync_UPDOWNLOAD_SL`](super::CANsync_UPDOWNLOAD_SL) (manual p. 263-267). Needs
    /// [`CANsync_COMM_CONTROL_MA`](super::CANsync_COMM_CONTROL_MA) first.
    pub struct CANsync_UPDOWNLOAD_MA(_BASE: Base<CANsync_MA_CTRL_BMSTRUCT>) {
        in {
            /// The slave, 0 to 31.
            si_SL_NR: i8;
            /// FALSE: upload, TRUE: download.
            x_UPDOWN: bool;
            /// Number of values, 1 to 2048.
            u_LENGTH: u16;
            /// How often each block is tried; preset 1.
            us_MAX_NR_OF_COMM: u8 = 1;
            /// Monitoring time of each try of a block, in emulated time; preset 30 s.
            t_TIME: Duration = PRESET_TIME;
            /// Starts the job; TRUE until `x_BUSY` falls. FALSE before: cancels, then `x_RESET` is needed.
            x_EN: bool;
            /// Resets the block; needed after an error or a cancelled job.
            x_RESET: bool;
        }
        out {
            /// The job is under way.
            x_BUSY: bool;
            /// Error number of the slave or of the node (p. 267).
            w_ERR_SL: u16;
            /// `w_ERR_SL` is not 0.
            x_ERR_SL: bool;
            /// Bit 0: timeout, 1: `u_LENGTH` is 0 or more than 2048.
            b_ERR: u8;
            /// `b_ERR` is not 0.
            x_ERR: bool;
            /// The last job has been done.
            x_OK: bool;
        }
        in_out {
            a_DOWNLOAD: CANsync_UPDOWN_BMARRAY;
            a_UPLOAD: CANsync_UPDOWN_BMARRAY;
        }
        internal: Phase;
    }
}

#[derive(Clone, Copy, Debug, Default)]
pub enum Phase {
    #[default]
    Idle,
    /// Waits until the registers are free for this block.
    Waiting(Try),
    Running(Try),
    /// Ends when `x_EN` falls.
    Done,
    /// Failed or cancelled: only `x_RESET` helps.
    Locked,
}

/// A try to transfer a block.
#[derive(Clone, Copy, Debug)]
pub struct Try {
    /// Slave and direction of the transfer, whatever the inputs show meanwhile.
    slave: u8,
    download: bool,
    block: Block,
    number: u8,
    watch: Watch,
}

impl CANsync_UPDOWNLOAD_MA {
    /// One PLC cycle. Reads from `a_DOWNLOAD`, or writes to `a_UPLOAD`.
    pub fn call(
        &mut self,
        _BASE: &Base<impl Like<CANsync_MA_CTRL_BMSTRUCT>>,
        a_DOWNLOAD: &CANsync_UPDOWN_BMARRAY,
        a_UPLOAD: &mut CANsync_UPDOWN_BMARRAY,
    ) {
        let _BASE = &_BASE.viewed();
        if self.x_RESET {
            self.cancel(_BASE);
            self.end(Phase::Idle, 0, 0);
            return;
        }
        match (self.internal, self.x_EN) {
            (Phase::Waiting(_) | Phase::Running(_), false) => {
                self.cancel(_BASE);
                self.end(Phase::Locked, 0, 0);
            }
            (Phase::Done, false) => self.internal = Phase::Idle,
            (Phase::Idle, true) => self.begin(_BASE),
            _ => {}
        }
        let job = job(_BASE);
        if let Phase::Running(this) = self.internal {
            let control = job.control();
            if control & ACTIVE != 0 {
                self.check_time(_BASE, this);
            } else if control & ERROR != 0 {
                self.end(Phase::Locked, 0, _BASE.w_ERR_NR_UPDOWNBLK1.load());
            } else {
                self.block_done(_BASE, this, a_UPLOAD);
            }
        }
        if let Phase::Waiting(this) = self.internal {
            if job.control() & (ACTIVE | RESET) == 0 {
                self.enter(_BASE, this, a_DOWNLOAD);
            } else {
                self.check_time(_BASE, this);
            }
        }
    }

    fn begin(&mut self, base: &Viewed<'_, CANsync_MA_CTRL_BMSTRUCT>) {
        let total = usize::from(self.u_LENGTH);
        if total == 0 || total > UPDOWN_VALUES {
            return self.end(Phase::Locked, LENGTH, 0);
        }
        let first = Try {
            slave: self.si_SL_NR as u8,
            download: self.x_UPDOWN,
            block: Block::starting_at(0, total),
            number: 1,
            watch: base.ram().watch(self.t_TIME),
        };
        self.end(Phase::Waiting(first), 0, 0);
        self.x_BUSY = true;
    }

    /// Goes on to `phase` with these errors; the job is neither busy nor done.
    fn end(&mut self, phase: Phase, b_ERR: u8, w_ERR_SL: u16) {
        self.internal = phase;
        (self.x_BUSY, self.x_OK) = (false, false);
        (self.b_ERR, self.x_ERR) = (b_ERR, b_ERR != 0);
        (self.w_ERR_SL, self.x_ERR_SL) = (w_ERR_SL, w_ERR_SL != 0);
    }

    /// Enters the job of a block.
    fn enter(&mut self, base: &CANsync_MA_CTRL_BMSTRUCT, this: Try, a_DOWNLOAD: &CANsync_UPDOWN_BMARRAY) {
        let block = this.block;
        base.b_SL_NR_UPDOWNBLK1.store(this.slave);
        base.w_SUBSL_NR_UPDOWNBLK1.store(0);
        base.d_BASE_ADR_UPDOWNBLK1.store(block.base_address());
        base.w_LENGTH_UPDOWNBLK1.store(block.length());
        if this.download {
            let values = a_DOWNLOAD.iter().skip(block.first).take(block.values);
            base.a_DATA_UPDOWNBLK1.iter().zip(values).for_each(|(cell, value)| cell.store(*value as u32));
        }
        job(base).enter(ENTERED | if this.download { DOWNLOAD } else { 0 });
        self.internal = Phase::Running(this);
    }

    fn block_done(
        &mut self,
        base: &Viewed<'_, CANsync_MA_CTRL_BMSTRUCT>,
        this: Try,
        a_UPLOAD: &mut CANsync_UPDOWN_BMARRAY,
    ) {
        if !this.download {
            let values = a_UPLOAD.iter_mut().skip(this.block.first).take(this.block.values);
            values.zip(&base.a_DATA_UPDOWNBLK1).for_each(|(value, cell)| *value = cell.load() as i32);
        }
        match this.block.next() {
            Some(block) => {
                let watch = base.ram().watch(self.t_TIME);
                self.internal = Phase::Waiting(Try { block, number: 1, watch, ..this });
            }
            None => {
                self.end(Phase::Done, 0, 0);
                self.x_OK = true;
            }
        }
    }

    /// Tries the block again when its time is over, or gives up.
    fn check_time(&mut self, base: &Viewed<'_, CANsync_MA_CTRL_BMSTRUCT>, this: Try) {
        if !this.watch.is_over(base.ram()) {
            return;
        }
        if this.number < self.us_MAX_NR_OF_COMM {
            // The new job replaces the old one: the registers are free as soon as it is withdrawn.
            if let Phase::Running(_) = self.internal {
                job(base).enter(0);
            }
            let watch = base.ram().watch(self.t_TIME);
            self.internal = Phase::Waiting(Try { number: this.number + 1, watch, ..this });
        } else {
            self.cancel(base);
            self.end(Phase::Locked, TIMEOUT, 0);
        }
    }

    /// Makes the firmware tell the slave that the transfer is over.
    fn cancel(&self, base: &CANsync_MA_CTRL_BMSTRUCT) {
        if let Phase::Running(_) = self.internal {
            job(base).change(|value| value | RESET);
        }
    }
}

fn job(base: &CANsync_MA_CTRL_BMSTRUCT) -> Job<'_> {
    Job { control: &base.b_STEUREG_UPDOWNBLK1, status: &base.b_STATREG_UPDOWNBLK1 }
}
