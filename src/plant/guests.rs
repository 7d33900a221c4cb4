//! Guests, as whoever runs the doors brings them in. They are nobody's inputs but their own: the same acts at the same
//! emulated times give the same journal.

use super::Plant;
use crate::can::Frame;
use crate::check::rules;
use crate::devices::{Attendance, GuestNews, GuestRefusal, Medium};
use crate::journal::Finding;

impl Plant {
    fn medium_of(&mut self, bus: u16) -> Option<&mut Box<dyn Medium>> {
        self.media[..self.named_media].get_mut(usize::from(bus))
    }

    /// Guest number `guest` takes part in bus number `bus` from now on. `is_stepped`: what it sends enters at the next step
    /// only, which the journal says.
    pub fn guest_joins(&mut self, bus: u16, guest: u8, is_stepped: bool) {
        let now = self.now;
        let Some(medium) = self.medium_of(bus) else { return };
        medium.guest_joins(guest, now);
        let news = if is_stepped { Attendance::TakesPartStepped } else { Attendance::TakesPart };
        self.journal.push(now, GuestNews { bus, guest, news });
    }

    /// It does so no longer. What it has given to its controller is still sent.
    pub fn guest_leaves(&mut self, bus: u16, guest: u8) {
        let now = self.now;
        let Some(medium) = self.medium_of(bus) else { return };
        medium.guest_leaves(guest, now);
        self.journal.push(now, GuestNews { bus, guest, news: Attendance::Left });
    }

    /// A guest that takes part sends a frame.
    ///
    /// # Errors
    /// [`GuestRefusal`].
    pub fn guest_sends(&mut self, bus: u16, guest: u8, frame: &Frame) -> Result<(), GuestRefusal> {
        let now = self.now;
        let index = usize::from(bus);
        let medium = self.media[..self.named_media].get_mut(index).ok_or(GuestRefusal::NotHere)?;
        medium.guest_sends(guest, frame, now, &mut self.journal)
    }

    /// Whoever asks by requests, which is guest 0, takes part in bus number `bus` from now on, and sends a frame if there is
    /// one.
    ///
    /// # Errors
    /// [`GuestRefusal`].
    pub fn take_part(&mut self, bus: u16, frame: Option<&Frame>) -> Result<(), GuestRefusal> {
        let now = self.now;
        let medium = self.medium_of(bus).ok_or(GuestRefusal::NotHere)?;
        if medium.guest_joins(0, now) {
            self.journal.push(now, GuestNews { bus, guest: 0, news: Attendance::TakesPart });
        }
        frame.map_or(Ok(()), |frame| self.guest_sends(bus, 0, frame))
    }

    /// A guest would take part, but has named another rate than the bus has: the one with this `S` code (decision D-316).
    pub fn guest_is_deaf(&mut self, bus: u16, guest: u8, code: u8) {
        self.journal.find(self.now, Finding::at_bus(&rules::GUEST_BIT_RATE, bus, guest, code.into()));
    }
}
