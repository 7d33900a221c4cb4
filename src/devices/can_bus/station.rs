//! A station of a bus: a port, or a guest.

use super::Controller;
use super::guest::NoFirmware;
use super::port::{CanPort, CanSocket};
use crate::can::ErrorState;
use crate::check::RegisterWatch;
use crate::devices::{BuildError, Context};
use crate::journal::{Journal, Origin};
use crate::snapshot_fields;

/// A port on the bus, or a guest.
pub(super) struct Station {
    pub(super) origin: Origin,
    base: u32,
    pub(super) port: Box<dyn CanPort>,
    pub(super) controller: Controller,
    /// The watch over the station's registers; `None` for a guest, which has no registers.
    pub(super) watch: Option<RegisterWatch>,
    /// Time at which the station got power, in ns.
    pub(super) on_since_ns: Option<u64>,
    /// Time since which the station takes part in the traffic, in ns.
    pub(super) member_since_ns: Option<u64>,
    /// True if the guest leaves when its queue is empty.
    pub(super) is_leaving: bool,
    /// True if the station is in the list of stations with a frame to send.
    pub(super) is_waiting: bool,
    /// True if the station is in the list of stations with errors.
    pub(super) is_troubled: bool,
    /// The error state that was last reported.
    pub(super) reported: ErrorState,
    /// Time until which a fault holds back the station's first frame, in ns.
    pub(super) held_until_ns: u64,
    /// True if a fault has already delayed the station's first frame.
    pub(super) is_delayed: bool,
    /// Delays of the copies that follow the station's first frame, in us.
    pub(super) copies: Vec<u64>,
    /// True if the station's first frame has already arrived and is sent once more.
    pub(super) is_copy: bool,
    /// True if the journal already has a record that the station's first frame was not acknowledged.
    pub(super) is_unheard: bool,
}

snapshot_fields!(Station {
    values: on_since_ns, member_since_ns, is_leaving, is_waiting, is_troubled, reported, held_until_ns, is_delayed, copies,
        is_copy, is_unheard;
    parts: port, controller, watch;
    built: origin, base
});

impl Station {
    fn new(origin: Origin, base: u32, port: Box<dyn CanPort>, watch: Option<RegisterWatch>) -> Self {
        Station {
            origin,
            base,
            port,
            controller: Controller::default(),
            watch,
            on_since_ns: None,
            member_since_ns: None,
            is_leaving: false,
            is_waiting: false,
            is_troubled: false,
            reported: ErrorState::default(),
            held_until_ns: 0,
            is_delayed: false,
            copies: Vec::new(),
            is_copy: false,
            is_unheard: false,
        }
    }

    /// Returns a guest that does not take part yet.
    pub(super) fn guest(number: u8) -> Self {
        Station::new(Origin::of_guest(number), 0, Box::new(NoFirmware), None)
    }

    pub(super) fn port(socket: CanSocket) -> Result<Self, BuildError> {
        let CanSocket { origin, segment, layout, port } = socket;
        let area = layout.port_numbered(origin.node).ok_or(BuildError::OtherFamily)?.area;
        let watch = RegisterWatch::of_area(origin.plc, &segment, area)?;
        Ok(Station::new(origin, area.first, port, Some(watch)))
    }

    /// True if the station has taken part since `begin_ns`. A station that has joined later has missed a
    /// frame that began at `begin_ns` (decision D-356).
    #[inline]
    pub(super) fn took_part_since(&self, begin_ns: u64) -> bool {
        self.member_since_ns.is_some_and(|since| since <= begin_ns)
    }

    /// Switches the station off and resets it.
    pub(super) fn switch_off(&mut self) {
        self.on_since_ns = None;
        self.is_leaving = false;
        self.reported = ErrorState::default();
        self.forget_frame();
        self.controller.clear();
    }

    /// Called when the frame of this station has arrived. The intermission that follows the frame ends at
    /// `free_ns`. Returns true if this is the first arrival of the frame.
    pub(super) fn frame_is_through(&mut self, free_ns: u64) -> bool {
        let is_copy = self.is_copy;
        if self.copies.is_empty() {
            self.controller.take();
            self.forget_frame();
        } else {
            let us = self.copies.remove(0);
            self.held_until_ns = free_ns.saturating_add(us * 1000);
            self.is_copy = true;
        }
        !is_copy
    }

    fn forget_frame(&mut self) {
        self.held_until_ns = 0;
        (self.is_delayed, self.is_copy, self.is_unheard) = (false, false, false);
        self.copies.clear();
    }

    pub(super) fn run(
        &mut self,
        now: u64,
        journal: &mut Journal,
        firmware: impl FnOnce(&mut dyn CanPort, &mut Context, &mut Controller),
    ) {
        self.controller.now = now;
        let ctx = &mut Context { now, journal, origin: self.origin, base: self.base };
        firmware(&mut *self.port, ctx, &mut self.controller);
        if self.controller.take_discarded() {
            self.forget_frame();
        }
    }
}
