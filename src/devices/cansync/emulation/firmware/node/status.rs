//! The register `w_CANsync_STATUS` of a node (manual 5.00005.03a p. 150).

use super::Node;
use crate::devices::Context;
use crate::devices::cansync::registers::CANsync_INIT_BMSTRUCT;
use crate::devices::cansync::registers::values::cansync_status;
use crate::journal::Register;
use core::mem::offset_of;

/// Bits of `w_CANsync_STATUS` that change with every frame.
const TRAFFIC: u16 = cansync_status::SEND_BUFFER_FREE
    | cansync_status::SEND_JOB_DONE
    | cansync_status::RECEIVING
    | cansync_status::SENDING;

impl Node {
    /// Returns true if `w_CANsync_STATUS` still contains the value of the last poll, except for the traffic
    /// bits. It may differ, because a program can write to this register.
    #[inline]
    pub(super) fn status_is_shown(&self) -> bool {
        self.regs.w_CANsync_STATUS.load() & !TRAFFIC == self.shown_status
    }

    /// Refreshes `w_CANsync_STATUS`. `on_wire` is the present activity of the controller: `None` idle,
    /// `Some(true)` sending, `Some(false)` receiving. If only the activity has changed, the journal has no
    /// record of it.
    pub(in super::super) fn refresh_status(&mut self, ctx: &mut Context, on_wire: Option<bool>) {
        let mut value = 0;
        if self.controller.is_off() {
            // In BUS-off no frame is sent or received, and no frame waits to be sent (decision D-121).
            value = cansync_status::BUS_OFF | cansync_status::WARNING;
        } else if self.init.is_some() {
            value = cansync_status::SEND_BUFFER_FREE | cansync_status::SEND_JOB_DONE;
        }
        if self.is_on_bus() && self.is_connected() {
            match on_wire {
                Some(true) => value = cansync_status::SENDING,
                Some(false) => value |= cansync_status::RECEIVING,
                None => {}
            }
        }
        if self.refused.is_some() || self.sync_is_unlike {
            value |= cansync_status::WARNING;
        }
        if self.controller.has_overrun() {
            value |= cansync_status::OVERRUN;
        }
        self.shown_status = value & !TRAFFIC;
        let before = self.regs.w_CANsync_STATUS.load();
        if before != value {
            self.regs.w_CANsync_STATUS.store(value);
        }
        if (before ^ value) & !TRAFFIC != 0 {
            let origin = ctx.origin;
            let offset = ctx.at(offset_of!(CANsync_INIT_BMSTRUCT, w_CANsync_STATUS));
            ctx.report(Register { origin, offset, from: before.into(), to: value.into() });
        }
    }
}
