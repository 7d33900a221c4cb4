//! Guests at a CAN bus: stations like the ports, with a controller and nothing behind it.

use super::medium::End;
use super::{CanBus, CanPort, Controller};
use crate::can::Frame;
use crate::devices::{Context, GuestRefusal, Medium};

/// Nobody's firmware: a guest is told by who brings it in.
pub(super) struct Silent;

impl CanPort for Silent {
    fn look(&mut self, _: &mut Context, _: &mut Controller) {}

    fn received(&mut self, _: &mut Context, _: &mut Controller, _: &Frame) {}
}

impl CanBus {
    fn guest(&mut self, guest: u8) -> Option<&mut End> {
        self.ends.iter_mut().find(|end| end.origin.guest() == Some(guest))
    }

    /// Guest number `guest` takes part; `false` if it does so already.
    pub(super) fn let_in(&mut self, guest: u8, now: u64) -> bool {
        if self.guest(guest).is_none() {
            self.ends.push(End::guest(guest));
        }
        let Some(end) = self.guest(guest) else { return false };
        let was_leaving = core::mem::take(&mut end.is_leaving);
        let was_in = end.on_since_ns.replace(end.on_since_ns.unwrap_or(now * 1000)).is_some();
        self.leaving -= usize::from(was_leaving);
        self.plan(now);
        !was_in || was_leaving
    }

    /// Guest number `guest` leaves, as soon as what it has given to its controller is sent.
    pub(super) fn see_off(&mut self, guest: u8, now: u64) {
        let Some(end) = self.guest(guest).filter(|end| end.on_since_ns.is_some()) else { return };
        let was_leaving = core::mem::replace(&mut end.is_leaving, true);
        self.leaving += usize::from(!was_leaving);
        self.plan(now);
    }

    /// Guests that are to leave do so if they have nothing to send, or nobody to send it to.
    pub(super) fn let_guests_leave(&mut self) {
        let bit_s = self.bit_s();
        let on = self.ends.iter().filter(|end| end.is_on(bit_s)).count();
        let is_busy = self.wire.as_ref().is_some_and(|wire| wire.on_wire().is_some());
        for end in self.ends.iter_mut().filter(|end| end.is_leaving) {
            if end.controller.to_send() == 0 || on == 1 && !is_busy {
                end.is_leaving = false;
                end.on_since_ns = None;
                end.controller.clear();
                self.leaving -= 1;
            }
        }
    }

    /// A guest's controller takes a frame.
    pub(super) fn take_guests_frame(
        &mut self,
        guest: u8,
        frame: &Frame,
        now: u64,
    ) -> Result<(), GuestRefusal> {
        let end = self.guest(guest).filter(|end| end.on_since_ns.is_some());
        let end = end.ok_or(GuestRefusal::NotHere)?;
        end.controller.send_at(now, *frame).map_err(|_| GuestRefusal::Full)?;
        self.plan(now);
        Ok(())
    }
}
