//! Up- and downloads of the master's PLC in block 1 (manual 5.00005.03a p. 141-143, 166-168).
//!
//! An init frame announces address and length. Then blocks of six bytes travel at the offsets 0, 6, 12 ...;
//! the last block has a separate mode. The master repeats a frame each time it polls the slave, until the
//! slave answers without BUSY. If the PLC enters another job during a transfer, the transfer restarts.

use super::block::{self, MAX_LENGTH};
use super::job_registers::JobRegisters;
use crate::can::Payload;
use crate::devices::Context;
use crate::devices::cansync::frames::codec::CodecError;
use crate::devices::cansync::frames::codec::updown::{
    BLOCK, Direction, UpDownJob, UpDownResponse, UpDownResult, UpDownStep,
};
use crate::devices::cansync::registers::CANsync_MA_CTRL_BMSTRUCT;
use crate::devices::cansync::registers::values::{base_adr, updown_error, updown_master};
use crate::devices::emulation::recorded_register::RecordedRegister;
use core::mem::offset_of;
use serde::{Deserialize, Serialize};

/// The job that the PLC has entered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct EnteredJob {
    slave: u8,
    direction: Direction,
    address: u32,
    sub_slave: u16,
    length: u16,
}

impl EnteredJob {
    fn entered(regs: &CANsync_MA_CTRL_BMSTRUCT, control: u8) -> Self {
        EnteredJob {
            slave: regs.b_SL_NR_UPDOWNBLK1.load(),
            direction: if control & updown_master::DOWNLOAD != 0 {
                Direction::Download
            } else {
                Direction::Upload
            },
            address: regs.d_BASE_ADR_UPDOWNBLK1.load(),
            sub_slave: regs.w_SUBSL_NR_UPDOWNBLK1.load(),
            length: regs.w_LENGTH_UPDOWNBLK1.load(),
        }
    }

    /// Returns an error number if the job must be refused before any request to the slave (decision D-43).
    fn refusal(&self) -> Option<u16> {
        if self.length > MAX_LENGTH {
            Some(updown_error::LENGTH)
        } else if base_adr::SYSTEM.contains(&self.address) {
            Some(updown_error::BASE_ADDRESS)
        } else if self.length == 0 && self.direction == Direction::Download {
            Some(updown_error::NOT_POSSIBLE)
        } else {
            None
        }
    }
}

/// Progress of a transfer: the content of the next frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum TransferPhase {
    Init,
    /// The block at this offset.
    Block(u16),
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Transfer {
    order: EnteredJob,
    phase: TransferPhase,
    /// Value that this firmware has last stored in the control register.
    control: u8,
}

/// The up-/download job of block 1.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct BlockJob {
    transfer: Option<Transfer>,
}

impl BlockJob {
    /// Returns the job to send now, when the master polls slave number `turn`.
    #[inline]
    pub(super) fn next(
        &mut self,
        ctx: &mut Context,
        regs: &CANsync_MA_CTRL_BMSTRUCT,
        turn: u8,
    ) -> Option<UpDownJob> {
        let control = regs.b_STEUREG_UPDOWNBLK1.load();
        if control & (updown_master::ACTIVE | updown_master::CANCEL) == 0 {
            self.transfer = None;
            return None;
        }
        let order = EnteredJob::entered(regs, control);
        if order.slave != turn {
            if self.is_cancelled_unsent(control) {
                registers(regs).replace(ctx, control, 0);
            }
            return None;
        }
        if control & updown_master::CANCEL != 0 {
            self.transfer = None;
            // After a cancellation no bit of the control register stays set (decision D-45).
            return registers(regs).replace(ctx, control, 0).then_some(UpDownJob::cancel());
        }
        let transfer = match self.transfer.filter(|t| (t.order, t.control) == (order, control)) {
            Some(transfer) => transfer,
            None => begin(ctx, regs, control, order)?,
        };
        let (mode, job) = transfer.job(regs)?;
        let shown = control & !(updown_master::MODE | updown_master::ERROR) | mode | updown_master::SENT;
        self.transfer = Some(Transfer { control: shown, ..transfer });
        registers(regs).replace(ctx, control, shown).then_some(job)
    }

    /// Returns true if the PLC has cancelled a job before its first frame was sent. The slave has not
    /// received the job, so it need not be notified. The firmware also cannot wait for a slot to notify the
    /// slave, because this slot might never come (decision D-601).
    fn is_cancelled_unsent(&self, control: u8) -> bool {
        const STATE: u8 = updown_master::ACTIVE | updown_master::SENT | updown_master::CANCEL;
        let is_under_way =
            self.transfer.is_some_and(|transfer| transfer.control & updown_master::ACTIVE != 0);
        !is_under_way && control & STATE == updown_master::ACTIVE | updown_master::CANCEL
    }

    /// Handles the slave's answer to `job`. An answer that does not fit the job is ignored, as if no answer
    /// had come. There is one exception: an answer with the number of another block than the block that was
    /// sent ends the transfer.
    pub(super) fn answered(
        &mut self,
        ctx: &mut Context,
        regs: &CANsync_MA_CTRL_BMSTRUCT,
        job: &UpDownJob,
        payload: &Payload,
    ) {
        let control = regs.b_STEUREG_UPDOWNBLK1.load();
        let Some(transfer) = &mut self.transfer else { return };
        if (transfer.order, transfer.control) != (EnteredJob::entered(regs, control), control) {
            return;
        }
        let progress = match UpDownResponse::decode(job, payload) {
            Ok(response) => match response.result() {
                UpDownResult::Busy => Progress::Busy,
                UpDownResult::Error(number) => {
                    if number == updown_error::EXPECTS_OTHER_BLOCK {
                        regs.w_COUNTER_UPDOWNBLK1.store(response.offset());
                    }
                    Progress::Failed(number)
                }
                UpDownResult::Done => transfer.advance(regs, response.offset(), None),
                UpDownResult::Data(data) => transfer.advance(regs, response.offset(), Some(data)),
            },
            Err(CodecError::OtherOffset { .. }) => Progress::Failed(updown_error::WRONG_BLOCK),
            Err(_) => return,
        };
        let shown = match progress {
            Progress::Busy => control | updown_master::BUSY,
            Progress::Next => control & !updown_master::BUSY,
            Progress::Finished => ended(control),
            Progress::Failed(number) => {
                show_error(ctx, regs, number);
                ended(control) | updown_master::ERROR
            }
        };
        transfer.control = shown;
        registers(regs).replace(ctx, control, shown);
    }
}

/// Effect of an answer on the transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Progress {
    Busy,
    Next,
    Finished,
    Failed(u16),
}

impl Transfer {
    /// Returns the next frame, and the mode that the registers show during this frame.
    fn job(&self, regs: &CANsync_MA_CTRL_BMSTRUCT) -> Option<(u8, UpDownJob)> {
        let EnteredJob { direction, address, sub_slave, length, .. } = self.order;
        let (mode, offset, step) = match self.phase {
            TransferPhase::Init => {
                (updown_master::MODE_INIT, length, UpDownStep::Init { direction, address, sub_slave })
            }
            TransferPhase::Block(offset) => {
                let last = block_end(offset) >= length;
                let step = match direction {
                    Direction::Upload => UpDownStep::Upload { last },
                    Direction::Download => {
                        let data = block::read(&regs.a_DATA_UPDOWNBLK1, offset, length);
                        UpDownStep::Download { last, data }
                    }
                };
                (if last { updown_master::MODE_END } else { updown_master::MODE_TRANSFER }, offset, step)
            }
        };
        // Offsets never exceed 300, so every job fits its frame.
        UpDownJob::new(offset, step).ok().map(|job| (mode, job))
    }

    /// Continues after an answer without BUSY and without an error.
    fn advance(
        &mut self,
        regs: &CANsync_MA_CTRL_BMSTRUCT,
        answered: u16,
        data: Option<[u8; BLOCK]>,
    ) -> Progress {
        match self.phase {
            TransferPhase::Init => {
                // In the answer to the init frame of an upload, the slave may set the length. If it does not,
                // the length in the answer is 0 (p. 141 note a).
                if self.order.direction == Direction::Upload && answered != 0 {
                    if answered > MAX_LENGTH {
                        return Progress::Failed(updown_error::LENGTH);
                    }
                    self.order.length = answered;
                    regs.w_LENGTH_UPDOWNBLK1.store(answered);
                }
                if self.order.length == 0 {
                    return Progress::Failed(updown_error::NOT_POSSIBLE);
                }
                self.phase = TransferPhase::Block(0);
                Progress::Next
            }
            TransferPhase::Block(offset) => {
                let length = self.order.length;
                if let Some(data) = data {
                    block::write(&regs.a_DATA_UPDOWNBLK1, offset, length, data);
                }
                let end = block_end(offset);
                regs.w_COUNTER_UPDOWNBLK1.store(end.min(length));
                self.phase = TransferPhase::Block(end);
                if end >= length { Progress::Finished } else { Progress::Next }
            }
        }
    }
}

/// Returns the offset after the block at `offset`.
const fn block_end(offset: u16) -> u16 {
    offset.saturating_add(BLOCK as u16)
}

/// Takes over a job that the PLC has entered, or refuses it.
fn begin(
    ctx: &mut Context,
    regs: &CANsync_MA_CTRL_BMSTRUCT,
    control: u8,
    order: EnteredJob,
) -> Option<Transfer> {
    regs.w_COUNTER_UPDOWNBLK1.store(0);
    let refusal = order.refusal();
    show_error(ctx, regs, refusal.unwrap_or(0));
    if refusal.is_some() {
        registers(regs).replace(ctx, control, ended(control) | updown_master::ERROR);
        return None;
    }
    Some(Transfer { order, phase: TransferPhase::Init, control })
}

/// Returns the bits that remain in a control register at the end of its job: direction and mode.
const fn ended(control: u8) -> u8 {
    control & !(updown_master::ACTIVE | updown_master::SENT | updown_master::BUSY | updown_master::ERROR)
}

fn show_error(ctx: &mut Context, regs: &CANsync_MA_CTRL_BMSTRUCT, number: u16) {
    let offset = offset_of!(CANsync_MA_CTRL_BMSTRUCT, w_ERR_NR_UPDOWNBLK1);
    regs.w_ERR_NR_UPDOWNBLK1.show(ctx, offset, number);
}

fn registers(regs: &CANsync_MA_CTRL_BMSTRUCT) -> JobRegisters<'_> {
    JobRegisters {
        control: &regs.b_STEUREG_UPDOWNBLK1,
        status: &regs.b_STATREG_UPDOWNBLK1,
        offset: offset_of!(CANsync_MA_CTRL_BMSTRUCT, b_STEUREG_UPDOWNBLK1),
        is_masters: true,
    }
}
