//! What is plugged in at a bus: a port, or a guest.

use super::Controller;
use super::guest::Silent;
use super::port::{CanPort, CanSocket};
use crate::can::ErrorState;
use crate::check::OwnedWatch;
use crate::devices::{BuildError, Context};
use crate::journal::{Journal, Origin};
use crate::snapshot_fields;

/// A port at the bus, or a guest.
pub(super) struct End {
    pub(super) origin: Origin,
    base: usize,
    pub(super) port: Box<dyn CanPort>,
    pub(super) controller: Controller,
    /// None over a guest, which has no registers.
    pub(super) watch: Option<OwnedWatch>,
    /// Since when it has power, in ns.
    pub(super) on_since_ns: Option<u64>,
    /// Since when it takes part in the traffic, in ns.
    pub(super) member_since_ns: Option<u64>,
    /// It leaves as soon as its controller has nothing to send.
    pub(super) is_leaving: bool,
    /// It is in the list of those that have something to send.
    pub(super) is_waiting: bool,
    /// It is in the list of those with errors.
    pub(super) is_troubled: bool,
    /// The state that was last told of its controller.
    pub(super) told: ErrorState,
    /// Its frame is kept back until then, in ns.
    pub(super) held_until_ns: u64,
    /// A fault has delayed its frame already.
    pub(super) is_delayed: bool,
    /// How long after it copies of its frame follow, in us.
    pub(super) copies: Vec<u64>,
    /// Its frame has arrived already and is sent once more.
    pub(super) is_copy: bool,
    /// The journal has its frame, which nobody acknowledges, already.
    pub(super) is_unheard: bool,
}

snapshot_fields!(End {
    values: on_since_ns, member_since_ns, is_leaving, is_waiting, is_troubled, told, held_until_ns, is_delayed, copies,
        is_copy, is_unheard;
    parts: port, controller, watch;
    built: origin, base
});

impl End {
    fn new(origin: Origin, base: usize, port: Box<dyn CanPort>, watch: Option<OwnedWatch>) -> Self {
        End {
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
            told: ErrorState::default(),
            held_until_ns: 0,
            is_delayed: false,
            copies: Vec::new(),
            is_copy: false,
            is_unheard: false,
        }
    }

    /// A guest that does not take part yet.
    pub(super) fn guest(number: u8) -> Self {
        End::new(Origin::of_guest(number), 0, Box::new(Silent), None)
    }

    /// A port of a device.
    pub(super) fn port(socket: CanSocket) -> Result<Self, BuildError> {
        let CanSocket { origin, segment, layout, port } = socket;
        let area = layout.port_numbered(origin.node).ok_or(BuildError::OtherFamily)?.area;
        let watch = OwnedWatch::of_area(origin.plc, &segment, layout, area)?;
        Ok(End::new(origin, area.first as usize, port, Some(watch)))
    }

    /// Whether it takes part and has done so since `begin_ns`: what began before it has missed (decision D-356).
    #[inline]
    pub(super) fn was_there(&self, begin_ns: u64) -> bool {
        self.member_since_ns.is_some_and(|since| since <= begin_ns)
    }

    /// It is off: everything is forgotten.
    pub(super) fn switch_off(&mut self) {
        self.on_since_ns = None;
        self.is_leaving = false;
        self.told = ErrorState::default();
        self.forget_frame();
        self.controller.clear();
    }

    /// Its frame has arrived; the intermission behind it ends at `free_ns`. Tells whether it is the first time.
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

    /// Runs its firmware.
    pub(super) fn run(
        &mut self,
        now: u64,
        journal: &mut Journal,
        firmware: impl FnOnce(&mut dyn CanPort, &mut Context, &mut Controller),
    ) {
        self.controller.now = now;
        let ctx = &mut Context { now, journal, origin: self.origin, base: self.base };
        firmware(&mut *self.port, ctx, &mut self.controller);
    }
}
