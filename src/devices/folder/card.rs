//! Access to the registers and events of a device in a folder, for its tables and its script.

#[cfg(feature = "script")]
mod for_script;

use super::phase::KnownPhase;
use super::port::BusLink;
use crate::devices::{CardPulses, Context, Events};
use crate::identity::DeviceIndex;
use crate::journal::{Origin, Register, State};
use crate::layout::{DeviceFit, DeviceLayout, Owner, RegisterRef, Width};
use crate::memory::header::{Interrupt, InterruptResult};
use crate::memory::{Cell32, FirmwareHeader, HEADER_SIZE, Segment};
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use core::mem;
use std::sync::Arc;

/// Interrupt events of a device with a script (D-803).
const EVENTS: usize = 16;

/// The place of a register in the image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub(super) offset: u32,
    pub(super) width: Width,
    /// The cell in the header page, if the register is a word of the front panel.
    front: Option<FrontCell>,
}

#[derive(Clone, Copy, Debug)]
struct FrontCell {
    index: usize,
    /// True if programs write the register.
    is_request: bool,
}

impl Place {
    pub(super) fn of(register: &RegisterRef) -> Self {
        let is_front = (register.offset() as usize) < HEADER_SIZE;
        let is_request = register.register.owner == Owner::Plc;
        let index = (register.offset_in_structure() / 4) as usize;
        let front = is_front.then_some(FrontCell { index, is_request });
        Place { offset: register.offset(), width: register.address().width(), front }
    }

    /// Largest value of the register.
    pub(super) fn mask(self) -> u32 {
        self.width.max_value()
    }
}

/// Returns the registers that programs write, of these names or of all areas.
pub(super) fn written_registers(
    layout: &'static DeviceLayout,
    names: Option<&[String]>,
) -> impl Iterator<Item = RegisterRef> {
    // The script was checked, so each name is right.
    let named = names.into_iter().flatten().filter_map(|name| layout.registers(name).ok()).flatten();
    let areas = if names.is_none() { layout.areas } else { &[] };
    let all = areas.iter().flat_map(move |area| DeviceFit::unknown(layout).used_registers(area));
    named.chain(all).filter(|it| it.register.owner != Owner::Firmware && !it.is_reserved())
}

/// A register that programs write, with the last known value.
#[derive(Clone, Debug)]
struct Watched {
    register: RegisterRef,
    place: Place,
    /// The last known value of the register.
    last: u32,
}

/// The memory with the registers of a device: its image, or a part of the image of its controller.
#[derive(Clone)]
pub(super) struct Memory {
    segment: Segment,
    /// Number that is added to an offset of the layout; the sum wraps.
    shift: u32,
    /// The option interface of a card, and the layout of the card.
    controller: Option<(Origin, &'static DeviceLayout)>,
}

impl Memory {
    pub(super) fn own(segment: Segment) -> Self {
        Memory { segment, shift: 0, controller: None }
    }

    pub(super) fn of_controller(
        segment: Segment,
        shift: u32,
        controller: Origin,
        layout: &'static DeviceLayout,
    ) -> Self {
        Memory { segment, shift, controller: Some((controller, layout)) }
    }

    fn at(&self, offset: u32) -> u32 {
        offset.wrapping_add(self.shift)
    }

    fn load(&self, place: Place) -> Option<u32> {
        self.segment.load(self.at(place.offset), place.width).ok()
    }
}

/// Registers and events of the device.
pub(super) struct Card {
    memory: Memory,
    face: Arc<FirmwareHeader>,
    /// Registers for which changes by programs are reported, by offset. Empty if the script has no hook for
    /// changes.
    watched: Vec<Watched>,
    events: Events,
    /// True if the device has events.
    has_events: bool,
    /// Number of requests of clients that the device has handled.
    requests: u32,
    /// Pulses for the controller of an option card. The plant takes the pulses at the moment at which they
    /// occur.
    pulses: CardPulses,
    /// The part that the CAN port shares with the firmware; `None` if the device has no CAN port.
    link: Option<BusLink>,
    /// Declared kinds of faults. Bit n is set if a fault of kind n acts.
    faults: u16,
    phase: KnownPhase,
}

impl Card {
    pub(super) fn new(
        layout: &'static DeviceLayout,
        memory: Memory,
        face: FirmwareHeader,
        has_events: bool,
        link: Option<BusLink>,
    ) -> Self {
        let face = Arc::new(face);
        let (events, pulses) = (Events::default(), CardPulses::default());
        let watched = Vec::new();
        let phase = KnownPhase::first(layout);
        Card { memory, face, watched, events, has_events, requests: 0, pulses, link, faults: 0, phase }
    }

    fn front_cell(&self, cell: FrontCell) -> Option<&Cell32> {
        let page = if cell.is_request { self.face.requested() } else { &**self.face };
        page.front.get(cell.index)
    }

    /// Returns the present value. This cannot fail, because the image has all registers of the layout.
    pub(super) fn load(&self, place: Place) -> u32 {
        match place.front {
            Some(cell) => self.front_cell(cell).map_or(0, Cell32::load),
            None => self.memory.load(place).unwrap_or(0),
        }
    }

    /// Replaces the value `from` by `to`. Returns false if the value is no longer `from`, because the program
    /// has written another value.
    pub(super) fn exchange(&mut self, place: Place, from: u32, to: u32) -> bool {
        let is_done = match place.front {
            Some(cell) => self.front_cell(cell).is_some_and(|cell| cell.compare_exchange(from, to).is_ok()),
            None => {
                let Memory { segment, .. } = &self.memory;
                let offset = self.memory.at(place.offset);
                matches!(segment.compare_exchange(offset, place.width, from, to), Ok(Ok(_)))
            }
        };
        if is_done {
            self.note(place, to);
        }
        is_done
    }

    /// Replaces the value; returns the old and the new value.
    pub(super) fn update(&mut self, place: Place, f: impl Fn(u32) -> u32) -> (u32, u32) {
        let f = |value| f(value) & place.mask();
        let before = match place.front {
            Some(cell) => self.front_cell(cell).map_or(0, |cell| {
                let before = cell.load();
                cell.store(f(before));
                before
            }),
            None => {
                let Memory { segment, .. } = &self.memory;
                segment.update(self.memory.at(place.offset), place.width, f).unwrap_or(0)
            }
        };
        self.note(place, f(before));
        (before, f(before))
    }

    /// Does the same as [`Card::update`], and records a change in the journal.
    pub(super) fn show(&mut self, ctx: &mut Context, place: Place, f: impl Fn(u32) -> u32) {
        let (from, to) = self.update(place, f);
        if from != to {
            let (origin, offset) = self.located(place, ctx.origin);
            ctx.report(Register { origin, offset, from, to });
        }
        self.report_phase(ctx);
    }

    /// Returns the device that has a register in its image, and the offset there. `own` is the origin of this device.
    pub(super) fn located(&self, place: Place, own: Origin) -> (Origin, u32) {
        match self.memory.controller {
            Some((controller, _)) if place.front.is_none() => (controller, self.memory.at(place.offset)),
            _ => (own, place.offset),
        }
    }

    /// Gives the registers in the memory of a controller their values after power-on.
    fn reset_registers(&self) {
        let Some((_, layout)) = self.memory.controller else { return };
        let fitted = DeviceFit::unknown(layout);
        for register in layout.areas.iter().flat_map(|area| fitted.used_registers(area)) {
            let (offset, width) = (self.memory.at(register.offset()), register.address().width());
            let _ = self.memory.segment.store(offset, width, register.reset());
        }
    }

    /// Writes a record if the phase has changed.
    pub(super) fn report_phase(&mut self, ctx: &mut Context) {
        if let Some(state) = self.entered(ctx.origin.plc) {
            ctx.report(state);
        }
    }

    /// Returns the record for the journal if the phase has changed since the last call.
    pub(super) fn entered(&mut self, plc: DeviceIndex) -> Option<State> {
        let now = self.load(self.phase.place()?);
        self.phase.entered(plc, now)
    }

    /// True if structures overlay each other.
    pub(super) fn has_phases(&self) -> bool {
        self.phase.place().is_some()
    }

    /// True if the register at this byte of the image shows the phase.
    pub(super) fn shows_phase(&self, offset: u32) -> bool {
        let place = self.phase.place();
        place.is_some_and(|place| (place.offset..place.offset + place.width.bytes()).contains(&offset))
    }

    /// Notes a value that the device itself has written, so that it does not count as a write of a program.
    fn note(&mut self, place: Place, value: u32) {
        let first = self.watched.partition_point(|watched| watched.place.offset < place.offset);
        let same = self.watched.iter_mut().skip(first);
        same.take_while(|watched| watched.place.offset == place.offset).for_each(|it| it.last = value);
    }

    /// Begins to compare registers that programs write, to detect changes. These are the registers with these
    /// names, or all registers of the layout.
    pub(super) fn watch(&mut self, layout: &'static DeviceLayout, names: Option<&[String]>) {
        let watched = |register: RegisterRef| Watched { place: Place::of(&register), register, last: 0 };
        self.watched = written_registers(layout, names).map(watched).collect();
        self.watched.sort_by_key(|watched| watched.place.offset);
        if names.is_some() {
            // Two names may cover one register.
            self.watched.dedup_by_key(|watched| watched.register);
        }
    }

    /// Sets the declared kinds of faults: bit n is set if a fault of kind n acts.
    pub(super) fn set_faults(&mut self, mask: u16) {
        self.faults = mask;
    }

    /// True if a fault of the declared kind with this index acts.
    pub(super) fn has_fault(&self, index: usize) -> bool {
        self.faults >> index & 1 != 0
    }

    /// Handles power-on: no event is enabled, and requests from before are discarded.
    pub(super) fn start(&mut self) {
        self.reset_registers();
        self.events.disable_all();
        if self.has_events {
            self.face.both(|page| page.interrupts.iter().for_each(Interrupt::clear));
        }
        self.requests = self.face.requested().board_requests.load();
    }

    /// Answers requests of clients for events.
    pub(super) fn answer_requests(&mut self, ctx: &mut Context) {
        let requests = self.face.requested().board_requests.load();
        if !self.has_events || mem::replace(&mut self.requests, requests) == requests {
            return;
        }
        self.events.answer(ctx, &self.face, |events, event, _, enable| {
            if event >= EVENTS {
                return InterruptResult::NoSuchEvent;
            }
            let bit = 1 << event;
            events.enabled = if enable { events.enabled | bit } else { events.enabled & !bit };
            InterruptResult::Done
        });
    }

    /// Returns the events, if the device has events.
    pub(super) fn events(&mut self) -> Option<&mut Events> {
        self.has_events.then_some(&mut self.events)
    }

    /// Returns the interrupt level of an event. All events have the same level.
    pub(super) fn event_level(&self, event: usize) -> Option<u8> {
        (self.has_events && event < EVENTS).then_some(0)
    }

    /// Returns the pulses for the controller since the last call.
    pub(super) fn take_pulses(&mut self) -> CardPulses {
        mem::take(&mut self.pulses)
    }

    /// Returns the part that the CAN port shares with the firmware, if the device has a port.
    pub(super) fn link(&self) -> Option<&BusLink> {
        self.link.as_ref()
    }

    /// Returns the same part as [`Card::link`], but mutable.
    pub(super) fn link_mut(&mut self) -> Option<&mut BusLink> {
        self.link.as_mut()
    }
}

/// The registers themselves are not saved here, because the plant's snapshot contains them.
impl SnapshotFields for Card {
    fn save(&self, to: &mut Saving) {
        // The port saves the link.
        let Self {
            memory: _,
            face: _,
            watched,
            events,
            has_events: _,
            requests,
            pulses: _,
            link: _,
            faults,
            phase,
        } = self;
        to.value(&watched.iter().map(|watched| watched.last).collect::<Vec<_>>());
        to.value(requests);
        to.value(faults);
        if self.has_phases() {
            to.value(&phase.last);
        }
        events.save(to);
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        let last: Vec<u32> = from.value()?;
        from.check(last.len() == self.watched.len(), "value of each watched register")?;
        self.watched.iter_mut().zip(last).for_each(|(watched, last)| watched.last = last);
        self.requests = from.value()?;
        self.faults = from.value()?;
        if self.has_phases() {
            self.phase.last = from.value()?;
        }
        self.events.restore(from)
    }
}
