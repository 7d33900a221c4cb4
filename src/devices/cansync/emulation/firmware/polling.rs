//! The set-up mode of the master: orders all slaves to synchronize and reads their status words.
//!
//! Manual 5.00005.03a p. 134, 168. The command channel carries one frame per interval. The first frame is the
//! action command "SYNC mode: on" (decision D-06). Then one read job on parameter 121 (status word) follows
//! for each expected slave, in ascending order. Then the sequence starts again (decision D-30), so that the
//! master also finds a slave that is switched on late.

use crate::devices::Context;
use crate::devices::cansync::frames::Frame;
use crate::devices::cansync::frames::codec::action::ActionCommand;
use crate::devices::cansync::frames::codec::parameter::{
    Access, ParameterJob, ParameterResponse, ParameterResult,
};
use crate::devices::cansync::records::SlaveStatus;
use crate::devices::cansync::registers::CANsync_MA_CTRL_BMSTRUCT;
use crate::devices::cansync::registers::values::{drive_status, stat_sl};
use serde::{Deserialize, Serialize};

/// Parameter number of the status word (manual 5.01010.01 p. 14; decision D-06).
pub(super) const STATUS_WORD: u16 = 121;

/// Read job on the status word.
const STATUS_WORD_JOB: ParameterJob = match ParameterJob::new(STATUS_WORD, Access::Read) {
    Ok(job) => job,
    Err(_) => panic!("121 is a parameter number"),
};

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum NextFrame {
    SyncModeOn,
    StatusWordOf(u8),
}

/// The polling sequence of set-up mode.
#[derive(Serialize, Deserialize)]
pub(super) struct Polling {
    /// The frame that the master sends next.
    next: NextFrame,
    /// Number of the slave from which an answer is expected.
    asked: Option<u8>,
    announced: bool,
}

impl Polling {
    pub(super) fn new() -> Self {
        Polling { next: NextFrame::SyncModeOn, asked: None, announced: false }
    }

    /// Restarts the sequence with "SYNC mode: on".
    pub(super) fn restart(&mut self) {
        *self = Polling::new();
    }

    /// Returns "SYNC mode: on" if this command has not been sent since the start.
    pub(super) fn announcement(&mut self) -> Option<Frame> {
        if self.announced { None } else { Some(self.sync_mode_on()) }
    }

    fn sync_mode_on(&mut self) -> Frame {
        self.asked = None;
        self.announced = true;
        ActionCommand::sync_mode(ActionCommand::ALL_SLAVES, true).frame()
    }

    /// Returns the frame for this interval's command channel.
    pub(super) fn frame(&mut self, expected: u32) -> Frame {
        match self.next {
            NextFrame::SyncModeOn => {
                self.advance(expected, 0);
                self.sync_mode_on()
            }
            NextFrame::StatusWordOf(slave) => {
                self.asked = Some(slave);
                self.advance(expected, slave + 1);
                STATUS_WORD_JOB.frame(slave)
            }
        }
    }

    fn advance(&mut self, expected: u32, from: u8) {
        let remaining = expected.checked_shr(u32::from(from)).unwrap_or(0);
        self.next = match remaining {
            0 => NextFrame::SyncModeOn,
            bits => NextFrame::StatusWordOf(from + bits.trailing_zeros() as u8),
        };
    }

    /// Handles a response frame of `slave`.
    pub(super) fn response(
        &mut self,
        ctx: &mut Context,
        regs: &CANsync_MA_CTRL_BMSTRUCT,
        slave: u8,
        frame: &Frame,
    ) {
        if self.asked != Some(slave) {
            return;
        }
        let Ok(response) = ParameterResponse::decode(&STATUS_WORD_JOB, frame.payload()) else { return };
        if response.number() != STATUS_WORD {
            return;
        }
        self.asked = None;
        let status = match response.result() {
            ParameterResult::Word(word) if word & drive_status::SYNCHRONIZED != 0 => {
                stat_sl::RESPONDS | stat_sl::SYNCHRONIZED
            }
            ParameterResult::Doubleword(value) if value & u32::from(drive_status::SYNCHRONIZED) != 0 => {
                stat_sl::RESPONDS | stat_sl::SYNCHRONIZED
            }
            // BUSY shows that the slave responds. The next poll requests its status word again.
            ParameterResult::Busy => {
                stat_sl::RESPONDS | regs.a_STAT_SL[usize::from(slave)].load() & stat_sl::SYNCHRONIZED
            }
            _ => stat_sl::RESPONDS,
        };
        show(ctx, regs, slave, status);
    }

    /// Called when t_RSPTO has passed and no answer has begun: the requested slave does not respond.
    pub(super) fn no_response(&mut self, ctx: &mut Context, regs: &CANsync_MA_CTRL_BMSTRUCT) {
        if let Some(slave) = self.asked.take() {
            show(ctx, regs, slave, 0);
        }
    }
}

fn show(ctx: &mut Context, regs: &CANsync_MA_CTRL_BMSTRUCT, slave: u8, status: u8) {
    let Some(cell) = regs.a_STAT_SL.get(usize::from(slave)) else { return };
    if cell.load() != status {
        cell.store(status);
        let origin = ctx.origin;
        ctx.report(SlaveStatus { origin, slave, status });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn asks_the_expected_slaves_in_turn_after_sync_mode_on() {
        let mut polling = Polling::new();
        let expected = 1 << 1 | 1 << 2 | 1 << 31;
        let ids: Vec<u16> = (0..6).map(|_| polling.frame(expected).id()).collect();
        assert_eq!(ids, [0x010, 0x501, 0x502, 0x51F, 0x010, 0x501]);
    }

    #[test]
    fn sync_mode_on_is_announced_until_it_was_sent() {
        let mut polling = Polling::new();
        assert_eq!(polling.announcement().map(|frame| frame.id()), Some(0x010));
        assert_eq!(polling.announcement(), None);
        polling.restart();
        polling.frame(0);
        assert_eq!(polling.announcement(), None);
    }

    #[test]
    fn without_slaves_only_sync_mode_on_goes_out() {
        let mut polling = Polling::new();
        assert!((0..3).all(|_| polling.frame(0).id() == 0x010));
    }
}
