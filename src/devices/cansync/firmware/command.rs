//! The master's command channel in active operation: which job gets the one frame of an interval, and
//! whose answer it is that comes back (manual 5.00005.03a p. 160-162).
//!
//! In every interval the areas are asked in the same order, whatever happened before: broadcast commands
//! 0, 1, 2, control word, parameter, up-/download. The first area with a job gets the frame; a job in a
//! higher area in every interval keeps the lower ones waiting for ever, as the manual says.

use super::auto::Counter;
use super::updown_job::BlockJob;
use super::{broadcast, parameter_job};
use crate::can::Payload;
use crate::devices::Context;
use crate::devices::cansync::bus::Frame;
use crate::devices::cansync::bus::codec::{ParameterJob, UpDownJob};
use crate::devices::cansync::registers::CANsync_MA_CTRL_BMSTRUCT;
use serde::{Deserialize, Serialize};

/// A job whose answer is due.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
enum Asked {
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
    /// Slave and job of the last frame, until the answer came or t_RSPTO passed.
    asked: Option<(u8, Asked)>,
}

impl CommandChannel {
    /// Back to the state before active operation. Jobs that stand in the registers stay there; with the
    /// next active operation they begin anew (decision D-46).
    pub(super) fn restart(&mut self) {
        *self = CommandChannel::default();
    }

    /// Begins an interval; `max` is `b_MAX_SL_NR`.
    #[inline]
    pub(super) fn next_interval(&mut self, max: u8) {
        self.control_word.next_interval(max);
        self.parameter.next_interval(max);
        self.updown.next_interval(max);
    }

    /// The frame of this interval, if there is a job.
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
            self.asked = Some((slave, Asked::Parameter(job)));
            return Some(job.frame(slave));
        }
        let slave = self.updown.resolve(regs.b_SL_NR_UPDOWN.load())?;
        let job = self.block.next(ctx, regs, slave)?;
        self.asked = Some((slave, Asked::UpDown(job)));
        Some(job.frame(slave))
    }

    /// A response of `slave`. Tells whether a job of this channel waited for it.
    pub(super) fn response(
        &mut self,
        ctx: &mut Context,
        regs: &CANsync_MA_CTRL_BMSTRUCT,
        slave: u8,
        payload: &Payload,
    ) -> bool {
        match self.asked.take_if(|(asked, _)| *asked == slave) {
            None => return false,
            Some((_, Asked::Parameter(job))) => parameter_job::answered(ctx, regs, slave, &job, payload),
            Some((_, Asked::UpDown(job))) => self.block.answered(ctx, regs, &job, payload),
        }
        true
    }

    /// t_RSPTO passed without an answer: the job stays as it is and is repeated on the slave's next turn
    /// (decision D-11).
    pub(super) fn no_response(&mut self) {
        self.asked = None;
    }
}
