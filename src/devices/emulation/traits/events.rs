//! Interrupt events of a device: which events are enabled, and which have occurred. All devices enable events
//! in one way, with the function block `INTR_SET`, but each device has different events.

use crate::devices::Context;
use crate::devices::records::{BoardEvent, OnBoard};
use crate::memory::header::InterruptResult;
use crate::memory::{FirmwareHeader, Header};
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};

/// Enabled events and events that have occurred: bit n for event n.
#[derive(Clone, Copy, Debug, Default)]
pub struct Events {
    /// Events that a program has enabled; bit n for event n.
    pub enabled: u16,
    /// True if no event can occur, because the switch or the program is at STOP (decision D-300).
    pub held: bool,
    /// Events that have occurred since the last query.
    pub fired: u16,
    /// Events that stop the plant for lockstep.
    pub watched: u16,
    /// True if a watched event has occurred.
    pub stop: bool,
}

/// The watched events are not saved: clients in lockstep are not a part of the plant.
impl SnapshotFields for Events {
    fn save(&self, to: &mut Saving) {
        let Self { enabled, held, fired, watched: _, stop: _ } = self;
        to.value(&(enabled, held, fired));
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        (self.enabled, self.held, self.fired) = from.value()?;
        self.stop = false;
        Ok(())
    }
}

impl Events {
    /// Fires an event once if it is enabled and the program may run.
    #[inline]
    pub fn fire(&mut self, header: &Header, event: usize, now: u64) {
        let bit = 1u16 << event;
        if self.enabled & bit == 0 || self.held {
            return;
        }
        if let Some(slot) = header.events.get(event) {
            slot.fire(now);
        }
        self.fired |= bit;
        self.stop |= self.watched & bit != 0;
    }

    /// Called when the board has requested a start or stop. Tasks in lockstep obey it immediately, so it
    /// stops the plant like a watched event.
    pub(in crate::devices) fn note_order(&mut self) {
        self.stop |= self.watched != 0;
    }

    /// Disables all events, as at power-on. The watched events and the events that have occurred do not
    /// change.
    pub fn disable_all(&mut self) {
        self.enabled = 0;
    }

    /// True if a watched event has occurred since the last call.
    #[inline]
    pub fn take_stop(&mut self) -> bool {
        core::mem::take(&mut self.stop)
    }

    /// Returns the events that have occurred since the last call.
    #[inline]
    pub fn take_fired(&mut self) -> u16 {
        core::mem::take(&mut self.fired)
    }

    /// Answers the pending requests, in ascending order of event numbers. `set` receives the event number,
    /// `i_PAR1` and `x_EN`.
    pub fn answer(
        &mut self,
        ctx: &mut Context,
        face: &FirmwareHeader,
        mut set: impl FnMut(&mut Self, usize, i16, bool) -> InterruptResult,
    ) {
        for (event, (slot, asked)) in face.interrupts.iter().zip(&face.requested().interrupts).enumerate() {
            let request = asked.request.load();
            if request == slot.answer.load() {
                continue;
            }
            let (factor, enable) = ((request >> 16) as u16 as i16, request & 1 != 0);
            let result = set(self, event, factor, enable);
            slot.result.store(result.code());
            slot.answer.store(request);
            let what = BoardEvent::Interrupt { event: event as u8, factor, enable, result };
            ctx.report(OnBoard { plc: ctx.origin.plc, what });
        }
    }
}
