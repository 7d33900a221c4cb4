//! The slave's end of up-/downloads: which frames go to the application and which the firmware answers
//! by itself (manual 5.00005.03a p. 141-143, 190-193).

use super::area::Place;
use super::transfer::{Successor, Transfer};
use crate::devices::Context;
use crate::devices::cansync::bus::codec::{Direction, UpDownJob, UpDownResponse, UpDownResult, UpDownStep};
use crate::devices::cansync::registers::CANsync_SL_CTRL_BMSTRUCT;
use crate::devices::cansync::registers::values::{base_adr, updown_error};
use crate::snapshot_fields;
use serde::{Deserialize, Serialize};

/// What an answer does to the transfer once it has left the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum Effect {
    None,
    /// The frame is done.
    Accepted,
    /// The application has refused; the transfer is over.
    Failed,
}

/// The answer to the last job.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
enum Due {
    Answer(UpDownResponse, Effect),
    /// Whatever the application has come to by then.
    Application,
}

/// A slave node's side of up-/downloads; there is one at a time.
#[derive(Clone, Debug)]
pub(super) struct UpDownServer {
    has_single_frame_area: bool,
    transfer: Option<Transfer>,
    due: Option<(UpDownJob, Due)>,
    /// What the answer on the wire does when it is through.
    sending: Option<(UpDownJob, UpDownResponse, Effect)>,
    /// The frame accepted last and its answer, which may have been lost.
    accepted: Option<(UpDownJob, UpDownResponse)>,
}

snapshot_fields!(UpDownServer { values: transfer, due, sending, accepted; built: has_single_frame_area });

impl UpDownServer {
    pub(super) fn new(has_single_frame_area: bool) -> Self {
        UpDownServer { has_single_frame_area, transfer: None, due: None, sending: None, accepted: None }
    }

    /// A job of the master.
    pub(super) fn job(&mut self, ctx: &mut Context, regs: &CANsync_SL_CTRL_BMSTRUCT, job: &UpDownJob) {
        let due = match (self.accepted, job.step()) {
            // The master missed the answer (decision D-69).
            (Some((accepted, response)), _) if accepted == *job => Due::Answer(response, Effect::None),
            _ if job.is_cancel() => self.cancel(ctx, regs, job),
            (_, UpDownStep::Init { .. }) => self.init(ctx, regs, job),
            _ => self.block(ctx, regs, job),
        };
        self.due = Some((*job, due));
    }

    /// What the firmware answers to an init job by itself (decision D-68).
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

    fn init(&mut self, ctx: &mut Context, regs: &CANsync_SL_CTRL_BMSTRUCT, job: &UpDownJob) -> Due {
        if let Some(number) = Self::init_refusal(job) {
            return Due::Answer(job.answer(UpDownResult::Error(number)), Effect::None);
        }
        let place = self.place(regs, job);
        match (&mut self.transfer, place) {
            (Some(transfer), _) if !transfer.is_given_up(regs) && transfer.repeats_init(job) => {}
            (_, Err(number)) => return Due::Answer(job.answer(UpDownResult::Error(number)), Effect::None),
            (Some(transfer), Ok(_)) if !transfer.is_given_up(regs) => {
                transfer.change(ctx, regs, Successor::Init(*job));
            }
            (_, Ok(place)) => self.enter(ctx, regs, place, job),
        }
        Due::Application
    }

    fn place(&self, regs: &CANsync_SL_CTRL_BMSTRUCT, job: &UpDownJob) -> Result<Place, u16> {
        Place::of(regs, job.offset(), self.has_single_frame_area)
    }

    fn enter(&mut self, ctx: &mut Context, regs: &CANsync_SL_CTRL_BMSTRUCT, place: Place, job: &UpDownJob) {
        self.accepted = None;
        self.transfer = Some(Transfer::begin(ctx, regs, place, *job));
    }

    /// The firmware drops the transfer at once; the application sees it as a change (decision D-70).
    fn cancel(&mut self, ctx: &mut Context, regs: &CANsync_SL_CTRL_BMSTRUCT, job: &UpDownJob) -> Due {
        self.accepted = None;
        match &mut self.transfer {
            Some(transfer) if !transfer.is_given_up(regs) => {
                transfer.change(ctx, regs, Successor::Nothing);
            }
            _ => self.transfer = None,
        }
        Due::Answer(job.answer(UpDownResult::Done), Effect::None)
    }

    fn block(&mut self, ctx: &mut Context, regs: &CANsync_SL_CTRL_BMSTRUCT, job: &UpDownJob) -> Due {
        let Some(transfer) = &mut self.transfer else {
            return Due::Answer(job.answer(UpDownResult::Error(updown_error::MODE)), Effect::None);
        };
        if let Some(refusal) = transfer.refusal(job) {
            return Due::Answer(refusal, Effect::None);
        }
        if transfer.is_given_up(regs) {
            let number = transfer.error_number(regs);
            return Due::Answer(job.answer(UpDownResult::Error(number)), Effect::Failed);
        }
        match transfer.take(ctx, regs, job) {
            Some(response) => Due::Answer(response, Effect::Accepted),
            None => Due::Application,
        }
    }

    /// Whether there is a transfer, which the application may cancel.
    #[inline]
    pub(super) fn is_under_way(&self) -> bool {
        self.transfer.is_some()
    }

    /// Enters what the master has changed to as soon as the application has confirmed with bit 7 (decision D-62), and takes
    /// a job that the application has left alone to block 1 once that is enabled (decision D-600).
    pub(super) fn look(&mut self, ctx: &mut Context, regs: &CANsync_SL_CTRL_BMSTRUCT) {
        let is_over = |transfer: &mut Transfer| transfer.is_reset(regs) || transfer.belongs_to_block_1(regs);
        let Some(transfer) = self.transfer.take_if(is_over) else { return };
        transfer.clear(ctx, regs);
        // Where block 1 has been disabled meanwhile, the master's repetition is refused.
        if let Some(job) = transfer.successor()
            && let Ok(place) = self.place(regs, &job)
        {
            self.enter(ctx, regs, place, &job);
        }
    }

    /// Start of the response slot: the answer as things stand now.
    pub(super) fn response(
        &mut self,
        ctx: &mut Context,
        regs: &CANsync_SL_CTRL_BMSTRUCT,
    ) -> Option<UpDownResponse> {
        self.look(ctx, regs);
        self.sending = None;
        let (job, due) = self.due.take()?;
        let (response, effect) = match due {
            Due::Answer(response, effect) => (response, effect),
            Due::Application => match self.transfer.as_mut()?.acknowledgement(regs) {
                None => (job.answer(UpDownResult::Busy), Effect::None),
                Some(Ok(response)) => (response, Effect::Accepted),
                Some(Err(response)) => (response, Effect::Failed),
            },
        };
        self.sending = Some((job, response, effect));
        Some(response)
    }

    /// The answer has left the bus.
    pub(super) fn response_sent(&mut self, ctx: &mut Context, regs: &CANsync_SL_CTRL_BMSTRUCT) {
        let Some((job, response, effect)) = self.sending.take() else { return };
        let Some(transfer) = &mut self.transfer else { return };
        match effect {
            Effect::None => {}
            Effect::Accepted => {
                self.accepted = Some((job, response));
                if transfer.accepted(ctx, regs, &job) {
                    self.transfer = None;
                }
            }
            Effect::Failed => {
                transfer.not_busy(ctx, regs);
                self.transfer = None;
                self.accepted = None;
            }
        }
    }

    /// Drops the transfer under way; the registers show none (decision D-63).
    pub(super) fn drop_transfer(&mut self, ctx: &mut Context, regs: &CANsync_SL_CTRL_BMSTRUCT) {
        let dropped = core::mem::replace(self, UpDownServer::new(self.has_single_frame_area));
        if let Some(transfer) = dropped.transfer {
            transfer.clear(ctx, regs);
        }
    }
}
