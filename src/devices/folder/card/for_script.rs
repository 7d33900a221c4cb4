//! Access of the device's script to the registers, the events and the port.

use super::{Card, EVENTS, Place};
use crate::can::{ErrorState, Filter, Frame};
use crate::devices::CardPulses;
use crate::devices::folder::port::{Arrival, Unsendable};
use crate::layout::place::{is_live, status_of};
use crate::layout::{Area, DeviceLayout, RegisterPhase, RegisterRef, Width};
use core::mem;
use std::sync::Arc;

/// A write of a program: the register, its old value and its new value.
pub(in crate::devices::folder) type Written = (RegisterRef, u32, u32);

impl Place {
    /// True if the register is a word of the front panel.
    pub(in crate::devices::folder) fn is_front(self) -> bool {
        self.front.is_some()
    }
}

impl Card {
    /// Moves registers and events to a new card for a call of the script. [`Card::give_back`] takes them back
    /// with their changes.
    pub(in crate::devices::folder) fn lend(&mut self) -> Card {
        Card {
            memory: self.memory.clone(),
            face: Arc::clone(&self.face),
            watched: mem::take(&mut self.watched),
            link: self.link.clone(),
            ..*self
        }
    }

    pub(in crate::devices::folder) fn give_back(&mut self, lent: Card) {
        (self.watched, self.events, self.pulses) = (lent.watched, lent.events, lent.pulses);
        self.phase = lent.phase;
    }

    /// Copies `bytes` bytes of registers to other registers. The two blocks may overlap. Both blocks must
    /// consist of registers of the image.
    pub(in crate::devices::folder) fn copy(&mut self, from: u32, to: u32, bytes: u32) {
        let mut copy = vec![0; bytes as usize];
        if self.memory.segment.read_range(self.memory.at(from), &mut copy).is_err() {
            return;
        }
        let (mut at, mut rest) = (to, copy.as_slice());
        while !rest.is_empty() {
            // The loop copies whole words if possible, because copying a byte takes as long as copying a
            // word.
            let width = match rest.len() {
                _ if at % 2 == 1 => Width::Byte,
                1 => Width::Byte,
                2 | 3 => Width::Word,
                _ if at % 4 == 2 => Width::Word,
                _ => Width::Dword,
            };
            let (part, others) = rest.split_at(width.bytes() as usize);
            let value = part.iter().rev().fold(0, |value, byte| value << 8 | u32::from(*byte));
            let _ = self.memory.segment.store(self.memory.at(at), width, value);
            (at, rest) = (at + width.bytes(), others);
        }
        let Card { memory, watched, .. } = self;
        let first = watched.partition_point(|watched| watched.place.offset < to);
        let written = watched.iter_mut().skip(first).take_while(|watched| watched.place.offset < to + bytes);
        written.for_each(|it| it.last = memory.load(it.place).unwrap_or(it.last));
    }

    /// Watches registers like [`Card::watch`], for a changed script. Registers that were compared before keep their
    /// last known value.
    pub(in crate::devices::folder) fn watch_again(
        &mut self,
        layout: &'static DeviceLayout,
        names: Option<&[String]>,
    ) {
        let known = mem::take(&mut self.watched);
        self.watch(layout, names);
        for watched in &mut self.watched {
            let Place { offset, .. } = watched.place;
            let before = known.get(known.partition_point(|it| it.place.offset < offset));
            watched.last = match before.filter(|it| it.place.offset == offset) {
                Some(before) => before.last,
                None => self.memory.load(watched.place).unwrap_or(0),
            };
        }
    }

    /// Called after power-on: takes the present values of the watched registers as their last known values.
    pub(in crate::devices::folder) fn forget_changes(&mut self) {
        let _ = self.changes();
    }

    /// Returns the writes of programs since the last call, in the order of addresses. Only registers of
    /// structures that are valid now are included.
    pub(in crate::devices::folder) fn changes(&mut self) -> Vec<Written> {
        let mut changes = Vec::new();
        for watched in &mut self.watched {
            let now = self.memory.load(watched.place).unwrap_or(watched.last);
            if now != watched.last {
                changes.push((watched.register, mem::replace(&mut watched.last, now), now));
            }
        }
        changes.retain(|(register, ..)| is_live(register, self.phase(register.area)));
        // Several structures of an area have the register that shows the phase.
        changes.dedup_by(|(next, ..), (first, ..)| {
            next.offset() == first.offset() && next.register.has_name_of(first.register)
        });
        changes
    }

    /// Returns the phase of an area.
    pub(in crate::devices::folder) fn phase(&self, area: &'static Area) -> RegisterPhase {
        let status = status_of(area).map(|status| self.load(Place::of(&status)));
        area.phase(status)
    }

    /// Returns the pulses for the controller, so that the script can add pulses.
    pub(in crate::devices::folder) fn pulses(&mut self) -> &mut CardPulses {
        &mut self.pulses
    }

    /// Removes and returns the first event of the port that was not handled.
    pub(in crate::devices::folder) fn take_arrival(&self) -> Option<Arrival> {
        self.link.as_ref()?.take_arrival()
    }

    /// Puts a frame into the transmit queue of the port.
    ///
    /// # Errors
    /// The frame is lost.
    pub(in crate::devices::folder) fn send(&self, frame: Frame) -> Result<(), Unsendable> {
        self.link.as_ref().ok_or(Unsendable::NoBus)?.send(frame)
    }

    /// Replaces the filters of the port.
    pub(in crate::devices::folder) fn accept(&self, filters: Vec<Filter>) {
        if let Some(link) = &self.link {
            link.accept(filters);
        }
    }

    /// Returns the error state of the port; `None` if the port is not connected to a bus.
    pub(in crate::devices::folder) fn bus_state(&self) -> Option<ErrorState> {
        self.link.as_ref()?.state()
    }

    /// Raises an event at `now`; returns false if the device has no such event.
    pub(in crate::devices::folder) fn raise(&mut self, event: usize, now: u64) -> bool {
        if event < EVENTS {
            self.events.fire(&self.face, event, now);
        }
        event < EVENTS
    }
}
