//! `CANsync_UPDOWNLOAD_MA`: up- and downloads of a master (p. 263-267, in 5.02066.01a p. 187-192). The bits of `b_ERR`
//! depend on the device.

use super::registers::Job;
use super::updownload::{Block, CANsync_UPDOWN_BMARRAY, UPDOWN_VALUES};
use crate::devices::cansync::registers::CANsync_MA_CTRL_BMSTRUCT;
use crate::devices::cansync::registers::values::updown_master::{ACTIVE, CANCEL, DOWNLOAD, ERROR, MODE_INIT};
use crate::plc::{Viewed, Watch};
use core::time::Duration;

/// Value of the control register for a new job, without the direction. The firmware adds the mode.
const ENTERED: u8 = ACTIVE | MODE_INIT;
/// Preset of `t_TIME`. The manual gives it only for the slave's block. The master's block uses the same
/// preset (decision D-212).
pub(crate) const PRESET_TIME: Duration = Duration::from_secs(30);

#[derive(Clone, Copy, Debug, Default)]
enum TransferPhase {
    #[default]
    Idle,
    /// Waits until the registers are free for this block.
    Waiting(Attempt),
    Running(Attempt),
    /// Finished; waits until `x_EN` falls.
    Done,
    /// Cancelled or failed; waits for `x_RESET`.
    Locked(Option<Failure>),
}

/// One attempt to transfer a block.
#[derive(Clone, Copy, Debug)]
struct Attempt {
    /// Slave and direction of the transfer. Later values of the inputs do not change them.
    slave: u8,
    download: bool,
    block: Block,
    number: u8,
    watch: Watch,
}

/// The inputs of the block.
pub(crate) struct Inputs {
    pub slave: i8,
    pub download: bool,
    pub length: u16,
    pub tries: u8,
    pub time: Duration,
    pub enable: bool,
    pub reset: bool,
}

/// Reason for the failure of a transfer.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Failure {
    /// `u_LENGTH` is 0 or more than 2048.
    Length,
    /// The time of the last attempt for a block has run out.
    Timeout,
    /// The slave or the node has returned this error number.
    Slave(u16),
}

/// A transfer, in progress or finished.
#[derive(Clone, Copy, Debug, Default)]
pub struct Transfer {
    phase: TransferPhase,
    /// True if the last transfer was done.
    done: bool,
}

impl Transfer {
    /// Runs one PLC cycle.
    pub(crate) fn call(
        &mut self,
        base: &Viewed<'_, CANsync_MA_CTRL_BMSTRUCT>,
        inputs: &Inputs,
        a_DOWNLOAD: &CANsync_UPDOWN_BMARRAY,
        a_UPLOAD: &mut CANsync_UPDOWN_BMARRAY,
    ) {
        if inputs.reset {
            self.cancel(base);
            *self = Self::default();
            return;
        }
        match (self.phase, inputs.enable) {
            (TransferPhase::Waiting(_) | TransferPhase::Running(_), false) => {
                self.cancel(base);
                self.phase = TransferPhase::Locked(None);
            }
            (TransferPhase::Done, false) => self.phase = TransferPhase::Idle,
            (TransferPhase::Idle, true) => self.begin(base, inputs),
            _ => {}
        }
        let job = job(base);
        if let TransferPhase::Running(this) = self.phase {
            let control = job.control();
            if control & ACTIVE != 0 {
                self.check_time(base, inputs, this);
            } else if control & ERROR != 0 {
                self.fail(Failure::Slave(base.w_ERR_NR_UPDOWNBLK1.load()));
            } else {
                self.block_done(base, inputs, this, a_UPLOAD);
            }
        }
        if let TransferPhase::Waiting(this) = self.phase {
            if job.control() & (ACTIVE | CANCEL) == 0 {
                self.enter(base, this, a_DOWNLOAD);
            } else {
                self.check_time(base, inputs, this);
            }
        }
    }

    /// Value of the output `x_BUSY`.
    pub(crate) fn is_busy(&self) -> bool {
        matches!(self.phase, TransferPhase::Waiting(_) | TransferPhase::Running(_))
    }

    /// `x_OK`: the last transfer was done.
    pub(crate) fn is_done(&self) -> bool {
        self.done
    }

    /// Returns the reason for the failure of the last transfer, if it has failed.
    pub(crate) fn failure(&self) -> Option<Failure> {
        if let TransferPhase::Locked(failure) = self.phase { failure } else { None }
    }

    fn fail(&mut self, failure: Failure) {
        self.phase = TransferPhase::Locked(Some(failure));
    }

    fn begin(&mut self, base: &Viewed<'_, CANsync_MA_CTRL_BMSTRUCT>, inputs: &Inputs) {
        self.done = false;
        let total = usize::from(inputs.length);
        if total == 0 || total > UPDOWN_VALUES {
            return self.fail(Failure::Length);
        }
        let first = Attempt {
            slave: inputs.slave as u8,
            download: inputs.download,
            block: Block::starting_at(0, total),
            number: 1,
            watch: base.ram().watch(inputs.time),
        };
        self.phase = TransferPhase::Waiting(first);
    }

    /// Enters the job of a block.
    fn enter(&mut self, base: &CANsync_MA_CTRL_BMSTRUCT, this: Attempt, a_DOWNLOAD: &CANsync_UPDOWN_BMARRAY) {
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
        self.phase = TransferPhase::Running(this);
    }

    fn block_done(
        &mut self,
        base: &Viewed<'_, CANsync_MA_CTRL_BMSTRUCT>,
        inputs: &Inputs,
        this: Attempt,
        a_UPLOAD: &mut CANsync_UPDOWN_BMARRAY,
    ) {
        if !this.download {
            let values = a_UPLOAD.iter_mut().skip(this.block.first).take(this.block.values);
            values.zip(&base.a_DATA_UPDOWNBLK1).for_each(|(value, cell)| *value = cell.load() as i32);
        }
        match this.block.next() {
            Some(block) => {
                let watch = base.ram().watch(inputs.time);
                self.phase = TransferPhase::Waiting(Attempt { block, number: 1, watch, ..this });
            }
            None => {
                (self.phase, self.done) = (TransferPhase::Done, true);
            }
        }
    }

    /// Tries the block again after its monitoring time, or gives up.
    fn check_time(&mut self, base: &Viewed<'_, CANsync_MA_CTRL_BMSTRUCT>, inputs: &Inputs, this: Attempt) {
        if !this.watch.is_over(base.ram()) {
            return;
        }
        // During the whole monitoring time, the command channel did not poll the slave of an earlier job. So
        // the master has not sent the cancellation of that job. The block ends the cancellation here.
        if matches!(self.phase, TransferPhase::Waiting(_)) && job(base).control() & CANCEL != 0 {
            job(base).enter(0);
        }
        if this.number < inputs.tries {
            // The new job replaces the old job. The registers are free as soon as the old job is withdrawn.
            if let TransferPhase::Running(_) = self.phase {
                job(base).enter(0);
            }
            let watch = base.ram().watch(inputs.time);
            self.phase = TransferPhase::Waiting(Attempt { number: this.number + 1, watch, ..this });
        } else {
            self.cancel(base);
            self.fail(Failure::Timeout);
        }
    }

    /// Makes the firmware notify the slave that the transfer is over.
    fn cancel(&self, base: &CANsync_MA_CTRL_BMSTRUCT) {
        if let TransferPhase::Running(_) = self.phase {
            job(base).change(|value| value | CANCEL);
        }
    }
}

fn job(base: &CANsync_MA_CTRL_BMSTRUCT) -> Job<'_> {
    Job { control: &base.b_STEUREG_UPDOWNBLK1, status: &base.b_STATREG_UPDOWNBLK1 }
}

/// Declares the block for a device: its pages, its text about `b_ERR`, and its bits for the failures.
macro_rules! updownload_ma {
    ($page:literal, $errors:literal, $bits:expr) => {
        $crate::plc::function_block! {
            /// Transfers up to 2048 values to or from a slave that runs
            /// [`CANsync_UPDOWNLOAD_SL`](super::CANsync_UPDOWNLOAD_SL). Needs
            /// [`CANsync_COMM_CONTROL_MA`](super::CANsync_COMM_CONTROL_MA) first.
            #[doc = concat!("Manual p. ", $page, ".")]
            pub struct CANsync_UPDOWNLOAD_MA(_BASE: $crate::plc::Base<$crate::devices::cansync::registers::CANsync_MA_CTRL_BMSTRUCT>) {
                in {
                    /// Number of the slave, 0 to 31.
                    si_SL_NR: i8;
                    /// FALSE: upload, TRUE: download.
                    x_UPDOWN: bool;
                    /// Number of values, 1 to 2048.
                    u_LENGTH: u16;
                    /// Number of attempts for each block; preset 1.
                    us_MAX_NR_OF_COMM: u8 = 1;
                    /// Monitoring time of each attempt for a block, in emulated time; preset 30 s.
                    t_TIME: core::time::Duration = $crate::devices::cansync::blocks::updownload_ma::PRESET_TIME;
                    /// Starts the job. The input must stay TRUE until `x_BUSY` becomes FALSE. If it becomes
                    /// FALSE earlier, the job is cancelled, and the block needs `x_RESET`.
                    x_EN: bool;
                    /// Resets the block; needed after an error or a cancelled job.
                    x_RESET: bool;
                }
                out {
                    /// The job is in progress.
                    x_BUSY: bool;
                    /// Error number of the slave or of the node (p. 267).
                    w_ERR_SL: u16;
                    /// `w_ERR_SL` is not 0.
                    x_ERR_SL: bool;
                    #[doc = $errors]
                    b_ERR: u8;
                    /// `b_ERR` is not 0.
                    x_ERR: bool;
                    /// The last job has been done.
                    x_OK: bool;
                }
                in_out {
                    a_DOWNLOAD: $crate::devices::cansync::blocks::CANsync_UPDOWN_BMARRAY;
                    a_UPLOAD: $crate::devices::cansync::blocks::CANsync_UPDOWN_BMARRAY;
                }
                internal: $crate::devices::cansync::blocks::updownload_ma::Transfer;
            }
        }

        impl CANsync_UPDOWNLOAD_MA {
            /// Runs one PLC cycle. Reads from `a_DOWNLOAD`, or writes to `a_UPLOAD`.
            pub fn call(
                &mut self,
                _BASE: &$crate::plc::Base<impl $crate::plc::Like<$crate::devices::cansync::registers::CANsync_MA_CTRL_BMSTRUCT>>,
                a_DOWNLOAD: &$crate::devices::cansync::blocks::CANsync_UPDOWN_BMARRAY,
                a_UPLOAD: &mut $crate::devices::cansync::blocks::CANsync_UPDOWN_BMARRAY,
            ) {
                use $crate::devices::cansync::blocks::updownload_ma::{Failure, Inputs};
                let inputs = Inputs {
                    slave: self.si_SL_NR,
                    download: self.x_UPDOWN,
                    length: self.u_LENGTH,
                    tries: self.us_MAX_NR_OF_COMM,
                    time: self.t_TIME,
                    enable: self.x_EN,
                    reset: self.x_RESET,
                };
                self.internal.call(&_BASE.viewed(), &inputs, a_DOWNLOAD, a_UPLOAD);
                (self.x_BUSY, self.x_OK) = (self.internal.is_busy(), self.internal.is_done());
                let bits: fn(Failure) -> u8 = $bits;
                let failure = self.internal.failure();
                self.b_ERR = failure.map_or(0, bits);
                self.x_ERR = self.b_ERR != 0;
                self.w_ERR_SL = if let Some(Failure::Slave(number)) = failure { number } else { 0 };
                self.x_ERR_SL = self.w_ERR_SL != 0;
            }
        }
    };
}

pub(crate) use updownload_ma;
