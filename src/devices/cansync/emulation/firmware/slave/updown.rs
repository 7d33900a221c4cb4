//! The slave's side of up-/downloads. The firmware answers some frames itself, and passes the others to the
//! application (manual 5.00005.03a p. 141-143, 190-193).

use super::area::AreaKind;
use super::transfer::{Successor, Transfer};
use crate::devices::Context;
use crate::devices::cansync::frames::codec::{
    Direction, UpDownJob, UpDownResponse, UpDownResult, UpDownStep,
};
use crate::devices::cansync::registers::CANsync_SL_CTRL_BMSTRUCT;
use crate::devices::cansync::registers::values::{base_adr, updown_error};
use crate::snapshot_fields;
use serde::{Deserialize, Serialize};

/// Effect of an answer on the transfer, when the answer has been sent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum AnswerEffect {
    None,
    /// The frame is complete.
    Accepted,
    /// The application has refused. The transfer is over.
    Failed,
}

/// The answer to the last job.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
enum DueAnswer {
    Answer(UpDownResponse, AnswerEffect),
    /// The answer of the application. It is read when it is sent.
    Application,
}

/// A slave node's side of up-/downloads. One transfer is possible at a time.
#[derive(Clone, Debug)]
pub(super) struct UpDownServer {
    has_single_frame_area: bool,
    transfer: Option<Transfer>,
    due: Option<(UpDownJob, DueAnswer)>,
    /// Job and answer on the wire, and the effect of the answer.
    sending: Option<(UpDownJob, UpDownResponse, AnswerEffect)>,
    /// The last frame that was accepted, and the answer to it. The answer may have been lost.
    accepted: Option<(UpDownJob, UpDownResponse)>,
}

snapshot_fields!(UpDownServer { values: transfer, due, sending, accepted; built: has_single_frame_area });

impl UpDownServer {
    pub(super) fn new(has_single_frame_area: bool) -> Self {
        UpDownServer { has_single_frame_area, transfer: None, due: None, sending: None, accepted: None }
    }

    /// Handles a job of the master.
    pub(super) fn job(&mut self, ctx: &mut Context, regs: &CANsync_SL_CTRL_BMSTRUCT, job: &UpDownJob) {
        let due = match (self.accepted, job.step()) {
            // The master has not received the answer, so it repeats the job (decision D-69).
            (Some((accepted, response)), _) if accepted == *job => {
                DueAnswer::Answer(response, AnswerEffect::None)
            }
            _ if job.is_cancel() => self.cancel(ctx, regs, job),
            (_, UpDownStep::Init { .. }) => self.init(ctx, regs, job),
            _ => self.block(ctx, regs, job),
        };
        self.due = Some((*job, due));
    }

    /// Returns an error number if the firmware must refuse the init job (decision D-68).
    fn init_refusal(job: &UpDownJob) -> Option<u16> {
        match job.step() {
            UpDownStep::Init { address, .. } if base_adr::SYSTEM.contains(&address) => {
                Some(updown_error::BASE_ADDRESS)
            }
            UpDownStep::Init { sub_slave: 1.., .. } => Some(updown_error::NOT_POSSIBLE),
            UpDownStep::Init { direction: Direction::Download, .. } if job.offset() == 0 => {
                Some(updown_error::NOT_POSSIBLE)
            }
            _ => None,
        }
    }

    fn init(&mut self, ctx: &mut Context, regs: &CANsync_SL_CTRL_BMSTRUCT, job: &UpDownJob) -> DueAnswer {
        if let Some(number) = Self::init_refusal(job) {
            return DueAnswer::Answer(job.answer(UpDownResult::Error(number)), AnswerEffect::None);
        }
        let area_kind = self.area_kind(regs, job);
        match (&mut self.transfer, area_kind) {
            (Some(transfer), _) if !transfer.is_given_up(regs) && transfer.repeats_init(job) => {}
            (_, Err(number)) => {
                return DueAnswer::Answer(job.answer(UpDownResult::Error(number)), AnswerEffect::None);
            }
            (Some(transfer), Ok(_)) if !transfer.is_given_up(regs) => {
                transfer.change(ctx, regs, Successor::Init(*job));
            }
            (_, Ok(area_kind)) => self.enter(ctx, regs, area_kind, job),
        }
        DueAnswer::Application
    }

    fn area_kind(&self, regs: &CANsync_SL_CTRL_BMSTRUCT, job: &UpDownJob) -> Result<AreaKind, u16> {
        AreaKind::of(regs, job.offset(), self.has_single_frame_area)
    }

    fn enter(
        &mut self,
        ctx: &mut Context,
        regs: &CANsync_SL_CTRL_BMSTRUCT,
        area_kind: AreaKind,
        job: &UpDownJob,
    ) {
        self.accepted = None;
        self.transfer = Some(Transfer::begin(ctx, regs, area_kind, *job));
    }

    /// Handles a cancellation. The firmware drops the transfer at once. The registers show a change to the
    /// application (decision D-70).
    fn cancel(&mut self, ctx: &mut Context, regs: &CANsync_SL_CTRL_BMSTRUCT, job: &UpDownJob) -> DueAnswer {
        self.accepted = None;
        match &mut self.transfer {
            Some(transfer) if !transfer.is_given_up(regs) => {
                transfer.change(ctx, regs, Successor::Nothing);
            }
            _ => self.transfer = None,
        }
        DueAnswer::Answer(job.answer(UpDownResult::Done), AnswerEffect::None)
    }

    fn block(&mut self, ctx: &mut Context, regs: &CANsync_SL_CTRL_BMSTRUCT, job: &UpDownJob) -> DueAnswer {
        let Some(transfer) = &mut self.transfer else {
            return DueAnswer::Answer(
                job.answer(UpDownResult::Error(updown_error::MODE)),
                AnswerEffect::None,
            );
        };
        if let Some(refusal) = transfer.refusal(job) {
            return DueAnswer::Answer(refusal, AnswerEffect::None);
        }
        if transfer.is_given_up(regs) {
            let number = transfer.error_number(regs);
            return DueAnswer::Answer(job.answer(UpDownResult::Error(number)), AnswerEffect::Failed);
        }
        match transfer.take(ctx, regs, job) {
            Some(response) => DueAnswer::Answer(response, AnswerEffect::Accepted),
            None => DueAnswer::Application,
        }
    }

    /// Returns true if there is a transfer. The application may cancel it.
    #[inline]
    pub(super) fn is_under_way(&self) -> bool {
        self.transfer.is_some()
    }

    /// Enters the job to which the master has changed, when the application has confirmed the change with bit
    /// 7 (decision D-62). Also moves a job that the application has not answered to block 1 as soon as block
    /// 1 is enabled (decision D-600).
    pub(super) fn poll(&mut self, ctx: &mut Context, regs: &CANsync_SL_CTRL_BMSTRUCT) {
        let is_over = |transfer: &mut Transfer| transfer.is_reset(regs) || transfer.belongs_to_block_1(regs);
        let Some(transfer) = self.transfer.take_if(is_over) else { return };
        transfer.clear(ctx, regs);
        // The new job is entered only if an area is enabled for it. If the application has disabled the registers of
        // block 1 (`..._UPDOWNBLK1`), the firmware refuses the job when the master repeats it.
        if let Some(job) = transfer.successor()
            && let Ok(area_kind) = self.area_kind(regs, &job)
        {
            self.enter(ctx, regs, area_kind, &job);
        }
    }

    /// Returns the present answer, at the start of the response slot.
    pub(super) fn response(
        &mut self,
        ctx: &mut Context,
        regs: &CANsync_SL_CTRL_BMSTRUCT,
    ) -> Option<UpDownResponse> {
        self.poll(ctx, regs);
        self.sending = None;
        let (job, due) = self.due.take()?;
        let (response, effect) = match due {
            DueAnswer::Answer(response, effect) => (response, effect),
            DueAnswer::Application => match self.transfer.as_mut()?.acknowledgement(regs) {
                None => (job.answer(UpDownResult::Busy), AnswerEffect::None),
                Some(Ok(response)) => (response, AnswerEffect::Accepted),
                Some(Err(response)) => (response, AnswerEffect::Failed),
            },
        };
        self.sending = Some((job, response, effect));
        Some(response)
    }

    /// Ends the answer, because it was sent completely.
    pub(super) fn response_sent(&mut self, ctx: &mut Context, regs: &CANsync_SL_CTRL_BMSTRUCT) {
        let Some((job, response, effect)) = self.sending.take() else { return };
        let Some(transfer) = &mut self.transfer else { return };
        match effect {
            AnswerEffect::None => {}
            AnswerEffect::Accepted => {
                self.accepted = Some((job, response));
                if transfer.accepted(ctx, regs, &job) {
                    self.transfer = None;
                }
            }
            AnswerEffect::Failed => {
                transfer.not_busy(ctx, regs);
                self.transfer = None;
                self.accepted = None;
            }
        }
    }

    /// Drops the transfer in progress. The registers then show no transfer (decision D-63).
    pub(super) fn drop_transfer(&mut self, ctx: &mut Context, regs: &CANsync_SL_CTRL_BMSTRUCT) {
        let dropped = core::mem::replace(self, UpDownServer::new(self.has_single_frame_area));
        if let Some(transfer) = dropped.transfer {
            transfer.clear(ctx, regs);
        }
    }
}
