//! What of the b maXX PLC stands around its modules: supply, start of the program, events. The manual of the modules
//! tells nothing of it but event 11 (p. 25); the rest is as far as a program needs it (decision D-366).

use crate::devices::Events;
use crate::devices::records::{BoardEvent, OnBoard};
use crate::devices::supply::Supply;
use crate::devices::{Context, Look, Power};
use crate::memory::header::{Interrupt, InterruptResult, ProgramState, Start};
use crate::memory::{Face, Header};
use crate::state;
use serde::{Deserialize, Serialize};

/// The one event there is: SYNC signal 1 of an option module.
const SYNC_EVENT: usize = 11;

/// Supply, program and events.
pub(super) struct Front {
    pub(super) face: Face,
    pub events: Events,
    supply: Supply,
    /// Cells that clients write, as last seen.
    seen: Seen,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Seen {
    requests: u32,
    program: u32,
}

impl Seen {
    #[inline]
    fn now(asked: &Header) -> Self {
        Seen { requests: asked.board_requests.load(), program: asked.program.state.load() }
    }
}

state!(Front { values: seen; parts: events, supply; built: face });

impl Front {
    pub(crate) fn new(face: Face) -> Self {
        let (supply, seen) = (Supply::new(&face), Seen::now(face.asked()));
        Front { face, events: Events::default(), supply, seen }
    }

    pub(crate) fn is_up(&self) -> bool {
        self.supply.is_up()
    }

    #[inline]
    pub(crate) fn has_changed(&self) -> bool {
        self.supply.has_changed(&self.face) || Seen::now(self.face.asked()) != self.seen
    }

    /// Power-on.
    pub(crate) fn start(&mut self, ctx: &mut Context) {
        self.events.disable_all();
        self.face.both(|page| page.interrupts.iter().for_each(Interrupt::clear));
        self.supply.start(ctx, &self.face);
    }

    /// Power-off.
    pub(crate) fn stop(&mut self, ctx: &mut Context) {
        self.events.disable_all();
        self.supply.stop(ctx);
    }

    pub(crate) fn set_power(&mut self, power: Power) -> Look {
        self.supply.set(&self.face, power)
    }

    /// One look at switches and requests.
    pub(crate) fn look(&mut self, ctx: &mut Context) -> Look {
        if !self.has_changed() {
            return Look::Nothing;
        }
        let seen = Seen::now(self.face.asked());
        let before = core::mem::replace(&mut self.seen, seen);
        let look = self.supply.look(&self.face);
        if look != Look::Nothing || !self.is_up() {
            return look;
        }
        let stopped = ProgramState::Stopped.code();
        if seen.program != before.program && seen.program == stopped {
            // Nothing remembers a program that was loaded before, so it starts with initial values.
            self.order(ctx, Start::Cold);
        }
        if seen.requests != before.requests {
            self.look_at_start_request(ctx);
            self.events.answer(ctx, &self.face, set);
        }
        Look::Answered
    }

    fn look_at_start_request(&mut self, ctx: &mut Context) {
        let Some(code) = self.face.take(|page| &page.program.start_request) else { return };
        let has_program = self.face.asked().program.state.load() != ProgramState::None.code();
        match Start::from_code(code) {
            Some(kind) if has_program => self.order(ctx, kind),
            _ => {
                let what = BoardEvent::StartRefused { code: code as u8 };
                ctx.report(OnBoard { plc: ctx.origin.plc, what });
            }
        }
    }

    fn order(&mut self, ctx: &mut Context, kind: Start) {
        self.events.held = kind == Start::Stop;
        self.face.program.start_kind.store(kind.code());
        self.face.program.start.ring();
        ctx.report(OnBoard { plc: ctx.origin.plc, what: BoardEvent::Start { kind } });
    }

    /// An edge of the SYNC signal at the module that raises the event.
    #[inline]
    pub(crate) fn sync(&mut self, now: u64) {
        self.events.fire(&self.face, SYNC_EVENT, now);
    }
}

/// Interrupt level of an event. There is only one, so that there is nothing for it to be higher or lower than.
pub(super) fn level(event: usize) -> Option<u8> {
    (event == SYNC_EVENT).then_some(0)
}

/// `INTR_SET` (p. 25).
fn set(events: &mut Events, event: usize, _: i16, enable: bool) -> InterruptResult {
    if level(event).is_none() {
        return InterruptResult::NoSuchEvent;
    }
    let bit = 1 << SYNC_EVENT;
    events.enabled = if enable { events.enabled | bit } else { events.enabled & !bit };
    InterruptResult::Done
}
