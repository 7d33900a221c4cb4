//! Guests on a CANsync bus. Guests have no slot, so their frames arrive outside of the slots, like frames
//! that a fault repeats (decision D-315).

use super::SimBus;
use super::disturbance::Stray;
use super::schedule::Slot;
use crate::can;
use crate::devices::GuestRefusal;
use crate::devices::cansync::frames::{Frame, wire};
use crate::devices::cansync::rules;
use crate::journal::{Finding, Journal};

impl SimBus {
    /// Schedules a guest's frame.
    pub(super) fn take_guests_frame(
        &mut self,
        guest: u8,
        frame: &can::Frame,
        now: u64,
        journal: &mut Journal,
    ) -> Result<(), GuestRefusal> {
        let field = frame.arbitration();
        let raw = match field.id() {
            can::Id::Standard(id) if !field.is_remote() => id.as_raw(),
            _ => return Err(GuestRefusal::NotHere),
        };
        let frame = Frame::new(raw, frame.payload().data()).ok_or(GuestRefusal::NotHere)?;
        let running = self.running.as_ref().ok_or(GuestRefusal::NotHere)?;
        let airtime = wire::airtime(&frame, u32::from(running.timing.kbit_per_s));
        journal.find(now, Finding::at_bus(&rules::FOREIGN_FRAME, self.index, guest, raw.into()));
        // A guest sends over one line, so only one of its frames can be in progress at a time.
        let of_guest = self.disturbance.strays.iter().filter(|stray| stray.guest == Some(guest));
        let begin = of_guest.map(|stray| stray.end).fold(now, u64::max);
        let end = begin + u64::from(airtime.occupation_us);
        self.disturbance.strays.push(Stray { end, frame, copy: true, guest: Some(guest) });
        self.schedule_strays();
        self.next = self.schedule.next();
        Ok(())
    }

    /// Schedules the end of the next frame outside of the slots.
    pub(super) fn schedule_strays(&mut self) {
        match self.disturbance.strays.iter().map(|stray| stray.end).min() {
            Some(end) => self.schedule.set(Slot::Stray, end),
            None => self.schedule.cancel(Slot::Stray),
        }
    }
}
