//! Guests on a CAN bus: stations with a controller and without firmware.

use super::station::Station;
use super::{CanBus, CanPort, Controller};
use crate::can::{ErrorState, Frame};
use crate::devices::{Context, GuestRefusal};
use crate::snapshot_fields;

/// The firmware of a guest, which does nothing: the program of the guest receives frames through its door.
pub(super) struct NoFirmware;

snapshot_fields!(NoFirmware {});

impl CanPort for NoFirmware {
    fn look(&mut self, _: &mut Context, _: &mut Controller) {}

    fn received(&mut self, _: &mut Context, _: &mut Controller, _: &Frame) {}
}

impl CanBus {
    /// Returns the index of guest number `guest` among the stations if the guest has ever taken part.
    fn place_of(&self, guest: u8) -> Option<usize> {
        self.stations.all().iter().position(|end| end.origin.guest() == Some(guest))
    }

    /// Returns the index of guest number `guest` if the guest takes part now.
    fn present(&self, guest: u8) -> Option<usize> {
        self.place_of(guest).filter(|place| self.stations.all()[*place].on_since_ns.is_some())
    }

    /// Lets guest number `guest` join the bus. Returns `false` if the guest takes part already.
    pub(super) fn join(&mut self, guest: u8, now: u64) -> bool {
        let place = self.place_of(guest).unwrap_or_else(|| self.stations.add(Station::guest(guest)));
        let end = self.stations.get_mut(place);
        let was_leaving = core::mem::take(&mut end.is_leaving);
        let was_in = end.on_since_ns.replace(end.on_since_ns.unwrap_or(now * 1000)).is_some();
        self.leaving -= usize::from(was_leaving);
        self.settle(place, now * 1000);
        self.plan(now);
        !was_in || was_leaving
    }

    /// Returns the error state of guest number `guest`.
    pub(super) fn errors_of_guest(&self, guest: u8) -> ErrorState {
        let errors = self.place_of(guest).map(|place| self.stations.all()[place].controller.errors());
        errors.unwrap_or_default().state()
    }

    /// Lets guest number `guest` leave when its queue is empty.
    pub(super) fn begin_leaving(&mut self, guest: u8, now: u64) {
        let Some(place) = self.present(guest) else { return };
        let was_leaving = core::mem::replace(&mut self.stations.get_mut(place).is_leaving, true);
        self.leaving += usize::from(!was_leaving);
        self.plan(now);
    }

    /// Does the same as `begin_leaving`, but only if no other station can receive the guest's frames. A guest
    /// that has just joined does not take part yet, so the only participating station may be another one.
    pub(super) fn begin_leaving_if_alone(&mut self, guest: u8, now: u64) {
        let is_member = |place: usize| self.stations.all()[place].member_since_ns.is_some();
        if self.present(guest).is_some_and(is_member) && self.stations.members() == 1 {
            self.begin_leaving(guest, now);
        }
    }

    /// Removes the leaving guests with an empty queue, and the leaving guests without a station that could
    /// receive their frames.
    pub(super) fn remove_leaving_guests(&mut self, now: u64) {
        for place in 0..self.stations.all().len() {
            let end = &self.stations.all()[place];
            let is_alone = end.member_since_ns.is_none() || self.stations.members() == 1;
            if end.is_leaving && (end.controller.to_send() == 0 || is_alone) {
                self.stations.get_mut(place).switch_off();
                self.stations.end_recovery(place);
                self.settle(place, now * 1000);
                self.leaving -= 1;
            }
        }
    }

    /// Puts a frame into a guest's queue.
    pub(super) fn queue_guest_frame(
        &mut self,
        guest: u8,
        frame: &Frame,
        now: u64,
    ) -> Result<(), GuestRefusal> {
        let place = self.present(guest).ok_or(GuestRefusal::NotHere)?;
        let controller = &mut self.stations.get_mut(place).controller;
        controller.now = now;
        controller.send(*frame).map_err(|_| GuestRefusal::Full)?;
        self.settle(place, now * 1000);
        self.plan(now);
        Ok(())
    }
}
