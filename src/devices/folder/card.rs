//! Access to the registers and events of a device in a folder, for its tables and its script.

use super::phase::KnownPhase;
use super::port::BusLink;
#[cfg(feature = "script")]
use super::port::{Arrival, Unsendable};
#[cfg(feature = "script")]
use crate::can::{ErrorState, Filter, Frame};
use crate::devices::{CardPulses, Context, Events};
use crate::identity::DeviceIndex;
use crate::journal::{Origin, Register, State};
#[cfg(feature = "script")]
use crate::layout::place::{is_live, status_of};
#[cfg(feature = "script")]
use crate::layout::{Area, RegisterPhase};
use crate::layout::{DeviceFit, DeviceLayout, Owner, RegisterRef, Width};
use crate::memory::header::InterruptResult;
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

    /// True if the register is a word of the front panel.
    #[cfg(feature = "script")]
    pub(super) fn is_front(self) -> bool {
        self.front.is_some()
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

/// A write of a program: the register, its old value and its new value.
#[cfg(feature = "script")]
pub(super) type Written = (RegisterRef, u32, u32);

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

    /// Moves registers and events to a new card for a call of the script. [`Card::give_back`] takes them back
    /// with their changes.
    #[cfg(feature = "script")]
    pub(super) fn lend(&mut self) -> Card {
        Card {
            memory: self.memory.clone(),
            face: Arc::clone(&self.face),
            watched: mem::take(&mut self.watched),
            link: self.link.clone(),
            ..*self
        }
    }

    #[cfg(feature = "script")]
    pub(super) fn give_back(&mut self, lent: Card) {
        (self.watched, self.events, self.pulses) = (lent.watched, lent.events, lent.pulses);
        self.phase = lent.phase;
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

    /// Copies `bytes` bytes of registers to other registers. The two blocks may overlap. Both blocks must
    /// consist of registers of the image.
    #[cfg(feature = "script")]
    pub(super) fn copy(&mut self, from: u32, to: u32, bytes: u32) {
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

    /// Watches registers like [`Card::watch`], for a changed script. Registers that were compared before keep their
    /// last known value.
    #[cfg(feature = "script")]
    pub(super) fn watch_again(&mut self, layout: &'static DeviceLayout, names: Option<&[String]>) {
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
    #[cfg(feature = "script")]
    pub(super) fn forget_changes(&mut self) {
        let _ = self.changes();
    }

    /// Returns the writes of programs since the last call, in the order of addresses. Only registers of
    /// structures that are valid now are included.
    #[cfg(feature = "script")]
    pub(super) fn changes(&mut self) -> Vec<Written> {
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
    #[cfg(feature = "script")]
    pub(super) fn phase(&self, area: &'static Area) -> RegisterPhase {
        let status = status_of(area).map(|status| self.load(Place::of(&status)));
        area.phase(status)
    }

    /// Sets the declared kinds of faults: bit n is set if a fault of kind n acts.
    pub(super) fn set_faults(&mut self, mask: u16) {
        self.faults = mask;
    }

    /// True if a fault of the declared kind with this index acts.
    pub(super) fn has_fault(&self, index: usize) -> bool {
        self.faults >> index & 1 != 0
    }

    /// Handles power-on: no event is enabled.
    pub(super) fn start(&mut self) {
        self.reset_registers();
        self.events.disable_all();
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

    /// Returns the pulses for the controller, so that the script can add pulses.
    #[cfg(feature = "script")]
    pub(super) fn pulses(&mut self) -> &mut CardPulses {
        &mut self.pulses
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

    /// Removes and returns the first event of the port that was not handled.
    #[cfg(feature = "script")]
    pub(super) fn take_arrival(&self) -> Option<Arrival> {
        self.link.as_ref()?.take_arrival()
    }

    /// Puts a frame into the transmit queue of the port.
    ///
    /// # Errors
    /// The frame is lost.
    #[cfg(feature = "script")]
    pub(super) fn send(&self, frame: Frame) -> Result<(), Unsendable> {
        self.link.as_ref().ok_or(Unsendable::NoBus)?.send(frame)
    }

    /// Replaces the filters of the port.
    #[cfg(feature = "script")]
    pub(super) fn accept(&self, filters: Vec<Filter>) {
        if let Some(link) = &self.link {
            link.accept(filters);
        }
    }

    /// Returns the error state of the port; `None` if the port is not connected to a bus.
    #[cfg(feature = "script")]
    pub(super) fn bus_state(&self) -> Option<ErrorState> {
        self.link.as_ref()?.state()
    }

    /// Raises an event at `now`; returns false if the device has no such event.
    #[cfg(feature = "script")]
    pub(super) fn raise(&mut self, event: usize, now: u64) -> bool {
        if event < EVENTS {
            self.events.fire(&self.face, event, now);
        }
        event < EVENTS
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
