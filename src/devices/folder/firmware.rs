//! The firmware of a device in a folder.

use super::card::Card;
use super::part::Part;
use crate::devices::{Context, Events, Firmware};
use crate::memory::header::Start;
use crate::snapshot_fields;

/// Firmware of a device in a folder: its parts act on the same registers, one after the other.
pub(super) struct FolderFirmware {
    parts: Vec<Box<dyn Part>>,
    card: Card,
}

snapshot_fields!(FolderFirmware { parts: parts, card });

impl FolderFirmware {
    pub(super) fn new(parts: Vec<Box<dyn Part>>, card: Card) -> Self {
        FolderFirmware { parts, card }
    }

    /// Calls each part with the registers.
    fn each(&mut self, mut f: impl FnMut(&mut dyn Part, &mut Card)) {
        self.parts.iter_mut().for_each(|part| f(part.as_mut(), &mut self.card));
    }
}

impl Firmware for FolderFirmware {
    fn start(&mut self, ctx: &mut Context) {
        self.card.start();
        self.each(|part, card| part.start(ctx, card));
    }

    fn stop(&mut self, ctx: &mut Context) {
        self.each(|part, card| part.stop(ctx, card));
    }

    fn look(&mut self, ctx: &mut Context) {
        self.card.answer_requests(ctx);
        self.each(|part, card| part.look(ctx, card));
    }

    fn is_quiescent(&self) -> bool {
        self.parts.iter().all(|part| part.is_quiescent())
    }

    /// The next cycle is needed, because a part may have changed a register that another part reads.
    fn needs_each_cycle(&self) -> bool {
        !self.is_quiescent()
    }

    fn next_time(&self) -> u64 {
        self.parts.iter().map(|part| part.next_time()).min().unwrap_or(u64::MAX)
    }

    fn due(&mut self, ctx: &mut Context) {
        self.each(|part, card| part.due(ctx, card));
    }

    fn event_level(&self, event: usize) -> Option<u8> {
        self.card.event_level(event)
    }

    fn events(&mut self) -> Option<&mut Events> {
        self.card.events()
    }

    /// No event occurs while the program is stopped (D-300).
    fn ordered(&mut self, ctx: &mut Context, order: Start) {
        if let Some(events) = self.card.events() {
            events.held = order == Start::Stop;
        }
        self.each(|part, card| part.ordered(ctx, card, order));
    }
}
