//! One up- or download, from its init frame to its end, in the registers of its area (manual 5.00005.03a p.
//! 141-143, 190-193).

use super::area::{Area, AreaKind};
use crate::devices::Context;
use crate::devices::cansync::firmware::block;
use crate::devices::cansync::frames::codec::updown::{BLOCK, MAX_OFFSET};
use crate::devices::cansync::frames::codec::{
    Direction, UpDownJob, UpDownResponse, UpDownResult, UpDownStep,
};
use crate::devices::cansync::registers::CANsync_SL_CTRL_BMSTRUCT;
use crate::devices::cansync::registers::values::{
    updown_error,
    updown_slave::{ACTIVE, BUSY, CHANGED, DOWNLOAD, ERROR, MODE, MODE_END, MODE_INIT, MODE_TRANSFER, RESET},
};
use serde::{Deserialize, Serialize};

/// Data bytes of one frame.
const STEP: u16 = BLOCK as u16;

/// The master's change of a transfer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Successor {
    /// The init job of another transfer, which starts when the application has confirmed the change.
    Init(UpDownJob),
    /// The master has cancelled the transfer.
    Nothing,
}

/// A transfer in progress.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Transfer {
    area_kind: AreaKind,
    init: UpDownJob,
    /// Number of bytes of the block. In an upload it is 0 until the application has set the length (p. 141).
    length: u16,
    /// Offset of the next block.
    next: u16,
    /// The frame that the application must acknowledge.
    shown: Option<UpDownJob>,
    changed: Option<Successor>,
}

impl Transfer {
    /// Enters a transfer in its area: 16#55 for a download, 16#45 for an upload (decision D-14).
    pub(super) fn begin(
        ctx: &mut Context,
        regs: &CANsync_SL_CTRL_BMSTRUCT,
        area_kind: AreaKind,
        init: UpDownJob,
    ) -> Self {
        let length = init.offset();
        let transfer = Transfer { area_kind, init, length, next: 0, shown: Some(init), changed: None };
        let area = transfer.area(regs);
        if let UpDownStep::Init { address, .. } = init.step() {
            area.base.store(address);
        }
        area.length.store(length);
        area.counter.store(0);
        area.job.show(ctx, transfer.direction_bit() | MODE_INIT | BUSY | ACTIVE);
        transfer
    }

    fn area<'a>(&self, regs: &'a CANsync_SL_CTRL_BMSTRUCT) -> Area<'a> {
        self.area_kind.area(regs)
    }

    fn direction_bit(&self) -> u8 {
        match self.init.direction() {
            Direction::Upload => 0,
            Direction::Download => DOWNLOAD,
        }
    }

    /// Returns true if `init` repeats the init frame that the application has not answered yet.
    pub(super) fn repeats_init(&self, init: &UpDownJob) -> bool {
        self.changed.is_none() && self.shown == Some(*init)
    }

    /// Shows the application that the master has changed or cancelled the transfer. The change remains
    /// visible until the application confirms it with bit 7 (p. 192; decision D-61).
    pub(super) fn change(
        &mut self,
        ctx: &mut Context,
        regs: &CANsync_SL_CTRL_BMSTRUCT,
        successor: Successor,
    ) {
        self.changed = Some(successor);
        self.area(regs).job.change(ctx, |value| value | CHANGED);
    }

    /// Returns true if the application has confirmed a change.
    pub(super) fn is_reset(&self, regs: &CANsync_SL_CTRL_BMSTRUCT) -> bool {
        self.changed.is_some() && self.area(regs).job.control() & RESET != 0
    }

    /// Returns true if the job must move to block 1 (p. 191): the single-frame area shows the job, the
    /// application has not answered, and block 1 is now enabled and has room for the job.
    pub(super) fn belongs_to_block_1(&self, regs: &CANsync_SL_CTRL_BMSTRUCT) -> bool {
        self.area_kind == AreaKind::Single
            && self.shown == Some(self.init)
            && self.area(regs).job.control() & ACTIVE != 0
            && AreaKind::of(regs, self.length, true) == Ok(AreaKind::Block1)
    }

    /// Returns the job to enter when this area has been cleared: the job to which the master has changed, or
    /// otherwise the present job. `None` if the master has cancelled the transfer.
    pub(super) fn successor(&self) -> Option<UpDownJob> {
        match self.changed {
            None => Some(self.init),
            Some(Successor::Init(job)) => Some(job),
            Some(Successor::Nothing) => None,
        }
    }

    /// Empties the registers of the area.
    pub(super) fn clear(&self, ctx: &mut Context, regs: &CANsync_SL_CTRL_BMSTRUCT) {
        self.area(regs).job.show(ctx, 0);
    }

    /// Returns true if the application has given up between two frames by setting bit 5 (decision D-71).
    pub(super) fn is_given_up(&self, regs: &CANsync_SL_CTRL_BMSTRUCT) -> bool {
        self.shown.is_none() && self.area(regs).job.control() & ERROR != 0
    }

    /// Returns the application's error number. Numbers up to 16#00FF are reserved for the firmware (p. 192).
    /// If the application uses one of them, the firmware sends "slave cancels" instead (decision D-71).
    pub(super) fn error_number(&self, regs: &CANsync_SL_CTRL_BMSTRUCT) -> u16 {
        match self.area(regs).error.load() {
            0..=0x00FF => updown_error::SLAVE_CANCELS,
            number => number,
        }
    }

    /// If a body or last frame comes at the wrong time, returns the refusal as a complete answer. The refusal
    /// does not change the transfer: the master may continue with the right frame (p. 142-143).
    pub(super) fn refusal(&self, job: &UpDownJob) -> Option<UpDownResponse> {
        let last = match job.step() {
            UpDownStep::Upload { last } | UpDownStep::Download { last, .. } => last,
            UpDownStep::Init { .. } => return None,
        };
        let init_is_shown = matches!(self.shown.map(|job| job.step()), Some(UpDownStep::Init { .. }));
        let wrong_phase = init_is_shown || self.changed.is_some();
        if wrong_phase || job.direction() != self.init.direction() {
            return Some(job.answer(UpDownResult::Error(updown_error::MODE)));
        }
        if job.offset() != self.next {
            // `next` is below the 12-bit length of the transfer, so it is a valid offset and no error is
            // possible.
            return job.expects_instead(self.next).ok();
        }
        let number = match (last, self.next + STEP >= self.length) {
            (false, true) => updown_error::EXPECTS_END,
            (true, false) => updown_error::END_TOO_EARLY,
            _ => return None,
        };
        Some(job.answer(UpDownResult::Error(number)))
    }

    /// Takes the expected body or last frame. Returns the answer, or `None` if the application must
    /// acknowledge the frame. In the single-frame area it must acknowledge every frame, in block 1 only the
    /// last frame (p. 191, 193; uploads: decision D-65).
    pub(super) fn take(
        &mut self,
        ctx: &mut Context,
        regs: &CANsync_SL_CTRL_BMSTRUCT,
        job: &UpDownJob,
    ) -> Option<UpDownResponse> {
        if self.shown.is_some() {
            return None; // A repetition.
        }
        let area = self.area(regs);
        let (mode, answer) = match job.step() {
            UpDownStep::Download { last, data } => {
                area.put(self.next, data, self.length);
                (if last { MODE_END } else { MODE_TRANSFER }, UpDownResult::Done)
            }
            UpDownStep::Upload { last } => (
                if last { MODE_END } else { MODE_TRANSFER },
                UpDownResult::Data(area.get(self.next, self.length)),
            ),
            UpDownStep::Init { .. } => return None,
        };
        let direction = self.direction_bit();
        if self.area_kind == AreaKind::Block1 {
            if job.direction() == Direction::Download {
                area.counter.store(self.end_of_next_block());
            }
            if mode == MODE_TRANSFER {
                area.job.change(ctx, |value| value & !MODE | MODE_TRANSFER);
                return Some(job.answer(answer));
            }
        }
        self.shown = Some(*job);
        area.job.show(ctx, direction | mode | BUSY | ACTIVE);
        None
    }

    /// Returns the application's present answer to the frame in the registers; `None` while the application
    /// is working. `Err` ends the transfer.
    pub(super) fn acknowledgement(
        &mut self,
        regs: &CANsync_SL_CTRL_BMSTRUCT,
    ) -> Option<Result<UpDownResponse, UpDownResponse>> {
        let shown = self.shown.filter(|_| self.changed.is_none())?;
        let area = self.area(regs);
        let control = area.job.control();
        if control & ACTIVE != 0 {
            return None;
        }
        let refuse = |number| Some(Err(shown.answer(UpDownResult::Error(number))));
        if control & ERROR != 0 {
            return refuse(self.error_number(regs));
        }
        Some(Ok(match shown.step() {
            UpDownStep::Init { .. } if self.length == 0 => {
                // In an upload the application has set the length (p. 141; decision D-67).
                let limit = if self.area_kind == AreaKind::Block1 { block::MAX_LENGTH } else { MAX_OFFSET };
                match area.length.load() {
                    0 => return refuse(updown_error::NOT_POSSIBLE),
                    length if length > limit => return refuse(updown_error::TOO_LONG),
                    length => {
                        self.length = length;
                        shown.answer_with_length(length).ok()?
                    }
                }
            }
            UpDownStep::Init { .. } | UpDownStep::Download { .. } => shown.answer(UpDownResult::Done),
            UpDownStep::Upload { .. } => shown.answer(UpDownResult::Data(area.get(self.next, self.length))),
        }))
    }

    /// Handles the end of the answer that accepts `job`. Returns true if the transfer is complete.
    pub(super) fn accepted(
        &mut self,
        ctx: &mut Context,
        regs: &CANsync_SL_CTRL_BMSTRUCT,
        job: &UpDownJob,
    ) -> bool {
        self.not_busy(ctx, regs);
        self.shown = None;
        if matches!(job.step(), UpDownStep::Init { .. }) {
            return false;
        }
        let end = self.end_of_next_block();
        self.area(regs).counter.store(end);
        self.next += STEP;
        end == self.length
    }

    /// Clears bit 6, because the answer to the frame has been sent (p. 191).
    pub(super) fn not_busy(&self, ctx: &mut Context, regs: &CANsync_SL_CTRL_BMSTRUCT) {
        self.area(regs).job.change(ctx, |value| value & !BUSY);
    }

    /// Returns the number of bytes that will be transferred when the next block is complete.
    fn end_of_next_block(&self) -> u16 {
        (self.next + STEP).min(self.length)
    }
}
