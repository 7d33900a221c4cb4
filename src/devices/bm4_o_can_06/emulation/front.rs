//! Front of the b maXX PLC outside its modules: supply, start of the program, events. The manual of the
//! modules describes only event 11 (p. 25). The emulator has the other functions only to the extent that a
//! program needs them (decision D-366).

use crate::devices::Events;
use crate::devices::emulation::program::Starts;
use crate::devices::emulation::supply::Supply;
use crate::devices::{Context, FrontAction, Power};
use crate::memory::FirmwareHeader;
use crate::memory::header::{Interrupt, InterruptResult, Start};
use crate::snapshot_fields;

/// The only event: SYNC signal 1 of an option module.
const SYNC_EVENT: usize = 11;

/// Supply, program and events.
pub(super) struct Front {
    pub(super) face: FirmwareHeader,
    pub events: Events,
    supply: Supply,
    starts: Starts,
    /// [`board_requests`](crate::memory::Header::board_requests) as last seen.
    requests: u32,
}

snapshot_fields!(Front { values: requests; parts: events, supply, starts; built: face });

impl Front {
    pub(crate) fn new(face: FirmwareHeader) -> Self {
        let (supply, starts) = (Supply::new(&face), Starts::new(&face));
        let requests = face.requested().board_requests.load();
        Front { face, events: Events::default(), supply, starts, requests }
    }

    pub(crate) fn is_up(&self) -> bool {
        self.supply.is_up()
    }

    #[inline]
    pub(crate) fn has_changed(&self) -> bool {
        self.supply.has_changed(&self.face) || self.starts.has_changed(&self.face)
    }

    /// Called at power-on.
    pub(crate) fn start(&mut self, ctx: &mut Context) {
        self.events.disable_all();
        self.face.both(|page| page.interrupts.iter().for_each(Interrupt::clear));
        self.supply.start(ctx, &self.face);
        let ordered = self.starts.start(ctx, &self.face);
        self.follow(ordered);
    }

    /// Called at power-off.
    pub(crate) fn stop(&mut self, ctx: &mut Context) {
        self.events.disable_all();
        self.supply.stop(ctx);
    }

    pub(crate) fn set_power(&mut self, power: Power) -> FrontAction {
        self.supply.set(&self.face, power)
    }

    /// Polls switches and requests once.
    pub(crate) fn look(&mut self, ctx: &mut Context) -> FrontAction {
        if !self.has_changed() {
            return FrontAction::Nothing;
        }
        let requests = self.face.requested().board_requests.load();
        let is_asked = core::mem::replace(&mut self.requests, requests) != requests;
        let look = self.supply.look(&self.face);
        let is_up = look == FrontAction::Nothing && self.is_up();
        let ordered = self.starts.look(ctx, &self.face, is_up, true);
        self.follow(ordered);
        if !is_up {
            return look;
        }
        if is_asked {
            self.events.answer(ctx, &self.face, set);
        }
        FrontAction::Answered
    }

    /// Carries out an order of the board. No event occurs while the program is stopped (decision D-300).
    fn follow(&mut self, ordered: Option<Start>) {
        if let Some(kind) = ordered {
            self.events.held = kind == Start::Stop;
            self.events.note_order();
        }
    }

    /// Called at an edge of the SYNC signal at the module that raises the event.
    #[inline]
    pub(crate) fn sync(&mut self, now: u64) {
        self.events.fire(&self.face, SYNC_EVENT, now);
    }
}

/// Returns the interrupt level of an event. There is only one event, so the level has no effect.
pub(super) fn level(event: usize) -> Option<u8> {
    (event == SYNC_EVENT).then_some(0)
}

/// Executes `INTR_SET` (p. 25).
fn set(events: &mut Events, event: usize, _: i16, enable: bool) -> InterruptResult {
    if level(event).is_none() {
        return InterruptResult::NoSuchEvent;
    }
    let bit = 1 << SYNC_EVENT;
    events.enabled = if enable { events.enabled | bit } else { events.enabled & !bit };
    InterruptResult::Done
}
