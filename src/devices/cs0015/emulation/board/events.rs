//! Events of the program, in the slots of the header page (D-436).

use crate::devices::Events;
use std::sync::{Arc, Mutex, PoisonError};

/// A cycle of the program begins; inputs and flags are updated.
pub(crate) const CYCLE: usize = 1;

/// The interrupt program of 1 ms runs (p. 118).
pub(crate) const INTERRUPT: usize = 2;

/// Marks an order to the program to start or stop. It is not an event.
const ORDER: usize = 15;

/// Returns the interrupt level of an event; `None` if the event does not exist.
pub(crate) fn level(event: usize) -> Option<u8> {
    match event {
        CYCLE => Some(1),
        INTERRUPT => Some(2),
        _ => None,
    }
}

/// Events that the port reports to the device, bit n for event n. The port needs to report them because it
/// counts the cycles of the program.
#[derive(Clone, Default)]
pub(crate) struct Pulses(Arc<Mutex<u16>>);

impl Pulses {
    /// Adds an occurrence of event `event`.
    pub(crate) fn add(&self, event: usize) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) |= 1 << event;
    }

    /// Adds an order to the program to start.
    pub(crate) fn add_order(&self) {
        self.add(ORDER);
    }

    /// Returns the events on their way.
    pub(crate) fn waiting(&self) -> u16 {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Replaces the events that were not passed on yet.
    pub(crate) fn replace(&self, pulses: u16) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = pulses;
    }

    /// Passes the events since the last call on.
    pub(crate) fn pass_to(&self, events: &mut Events) {
        let fired = core::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner));
        events.fired |= fired & !(1 << ORDER);
        events.stop |= fired & events.watched != 0;
        if fired & 1 << ORDER != 0 {
            events.note_order();
        }
    }
}
