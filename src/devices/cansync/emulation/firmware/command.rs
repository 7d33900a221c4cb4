//! The master's command channel in active operation. It selects the job for the one frame of an interval, and
//! assigns the response to its job (manual 5.00005.03a p. 160-162).
//!
//! In every interval the areas are checked in one fixed order, independent of earlier intervals: broadcast
//! commands 0, 1, 2, control word, parameter, up-/download. The first area with a job gets the frame.
//! According to the manual, an area with a job in every interval blocks all later areas without limit.

use super::auto::Counter;
use super::updown_job::BlockJob;
use super::{broadcast, parameter_job};
use crate::can::Payload;
use crate::devices::Context;
use crate::devices::cansync::frames::Frame;
use crate::devices::cansync::frames::codec::{ParameterJob, UpDownJob};
use crate::devices::cansync::registers::CANsync_MA_CTRL_BMSTRUCT;
use serde::{Deserialize, Serialize};

/// A job that waits for its answer.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
enum PendingJob {
    Parameter(ParameterJob),
    UpDown(UpDownJob),
}

/// Scheduler of the command channel.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct CommandChannel {
    // Automatic slave numbers, one for each configuration register (decision D-08).
    control_word: Counter,
    parameter: Counter,
    updown: Counter,
    block: BlockJob,
    /// Slave and job of the last frame. They are kept until the answer, or until the end of t_RSPTO.
    asked: Option<(u8, PendingJob)>,
}

impl CommandChannel {
    /// Returns to the state before active operation. Jobs in the registers are not deleted: they start again
    /// when active operation begins again (decision D-46).
    pub(super) fn restart(&mut self) {
        *self = CommandChannel::default();
    }

    /// Starts an interval; `max` is `b_MAX_SL_NR`.
    #[inline]
    pub(super) fn next_interval(&mut self, max: u8) {
        self.control_word.next_interval(max);
        self.parameter.next_interval(max);
        self.updown.next_interval(max);
    }

    /// Returns the frame of this interval, if there is a job.
    #[inline]
    pub(super) fn frame(&mut self, ctx: &mut Context, regs: &CANsync_MA_CTRL_BMSTRUCT) -> Option<Frame> {
        self.asked = None;
        if let Some(frame) = broadcast::broadcast(ctx, regs) {
            return Some(frame);
        }
        if let Some(slave) = self.control_word.resolve(regs.b_SL_NR_CONTROLWORD.load())
            && let Some(frame) = broadcast::control_word(ctx, regs, slave)
        {
            return Some(frame);
        }
        if let Some(slave) = self.parameter.resolve(regs.b_SL_NR_PARAMETER.load())
            && let Some(job) = parameter_job::next(ctx, regs, slave)
        {
            self.asked = Some((slave, PendingJob::Parameter(job)));
            return Some(job.frame(slave));
        }
        let slave = self.updown.resolve(regs.b_SL_NR_UPDOWN.load())?;
        let job = self.block.next(ctx, regs, slave)?;
        self.asked = Some((slave, PendingJob::UpDown(job)));
        Some(job.frame(slave))
    }

    /// Handles a response of `slave`. Returns true if a job of this channel waited for it.
    pub(super) fn response(
        &mut self,
        ctx: &mut Context,
        regs: &CANsync_MA_CTRL_BMSTRUCT,
        slave: u8,
        payload: &Payload,
    ) -> bool {
        match self.asked.take_if(|(asked, _)| *asked == slave) {
            None => return false,
            Some((_, PendingJob::Parameter(job))) => parameter_job::answered(ctx, regs, slave, &job, payload),
            Some((_, PendingJob::UpDown(job))) => self.block.answered(ctx, regs, &job, payload),
        }
        true
    }

    /// Handles the end of t_RSPTO without an answer. The job does not change. The master repeats it when it
    /// polls the slave again (decision D-11).
    pub(super) fn no_response(&mut self) {
        self.asked = None;
    }
}
