//! The running bus.
//!
//! On the wire times are exact in nanoseconds; the firmware of its ports, as everything in a plant, runs at whole
//! microseconds. What ends within a microsecond is seen at its end. A frame that begins within one begins when the wire was
//! free, and only those take part in its arbitration that were there by then.

use super::FAMILY;
use super::config::CanBusConfig;
use super::guest::Silent;
use super::port::{CanPort, CanSocket, Controller};
use super::records::{Lost, Transmitted};
use crate::can::{self, Event, Frame, Participants};
use crate::check::OwnedWatch;
use crate::devices::{BuildError, Context, GuestRefusal, Medium, SyncSignal, World};
use crate::fault::{Effect, Hit, Target};
use crate::journal::{Journal, Origin};
use core::any::Any;

/// Nothing is due.
const NEVER: u64 = u64::MAX;

/// A port at the bus, or a guest.
pub(super) struct End {
    pub(super) origin: Origin,
    base: usize,
    port: Box<dyn CanPort>,
    pub(super) controller: Controller,
    /// None over a guest, which has no registers.
    watch: Option<OwnedWatch>,
    /// Since when it takes part, in ns.
    pub(super) on_since_ns: Option<u64>,
    /// It leaves as soon as its controller has nothing to send.
    pub(super) is_leaving: bool,
    /// The frame that has just arrived and passed its filters, until the firmware is called.
    arrived: Option<Frame>,
}

impl End {
    /// A guest that does not take part yet.
    pub(super) fn guest(number: u8) -> Self {
        End {
            origin: Origin::of_guest(number),
            base: 0,
            port: Box::new(Silent),
            controller: Controller::default(),
            watch: None,
            on_since_ns: None,
            is_leaving: false,
            arrived: None,
        }
    }

    /// Whether it takes part in a bus with so many bit/s.
    pub(super) fn is_on(&self, bit_s: u32) -> bool {
        self.on_since_ns.is_some() && self.controller.hears(bit_s)
    }

    /// Runs its firmware.
    fn run(
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

/// The ports as participants of a frame.
struct Ends<'a> {
    ends: &'a mut [End],
    /// The beginning of the frame: who came later has missed it (decision D-356).
    begin_ns: u64,
    /// Whose frame was cut off.
    cut_off: Option<usize>,
    /// The rate of the bus.
    bit_s: u32,
}

impl Participants for Ends<'_> {
    fn count(&self) -> usize {
        self.ends.len()
    }

    fn is_on(&self, who: usize) -> bool {
        let since = self.ends.get(who).filter(|end| end.is_on(self.bit_s)).and_then(|end| end.on_since_ns);
        since.is_some_and(|since| since <= self.begin_ns) && self.cut_off != Some(who)
    }

    fn offer(&self, who: usize) -> Option<Frame> {
        self.ends.get(who)?.controller.offer(self.begin_ns)
    }

    fn sent(&mut self, who: usize, _: u64, _: &Frame) {
        self.ends[who].controller.take();
    }

    fn received(&mut self, who: usize, _: u64, frame: &Frame) {
        let end = &mut self.ends[who];
        // Who brings the guest in tells it everything.
        end.arrived = (end.origin.guest().is_none() && end.controller.accepts(frame)).then_some(*frame);
    }
}

/// A CAN bus with the ports at it.
pub struct CanBus {
    index: u16,
    name: String,
    /// None where ports are that no bus is plugged in at.
    pub(super) wire: Option<can::Medium>,
    /// The ports, then the guests. A guest that has left keeps its place for the next one of its number.
    pub(super) ends: Vec<End>,
    /// How many of them are to leave.
    pub(super) leaving: usize,
    /// The sender of the frame on the wire, if it has gone off meanwhile.
    cut_off: Option<usize>,
    next: u64,
}

impl CanBus {
    /// Where ports are that no bus is plugged in at: their firmware runs, and nobody hears it.
    pub fn unplugged() -> Self {
        CanBus {
            index: u16::MAX,
            name: String::new(),
            wire: None,
            ends: Vec::new(),
            leaving: 0,
            cut_off: None,
            next: NEVER,
        }
    }

    /// Bus number `index` of the plant, without ports.
    pub fn new(index: usize, config: &CanBusConfig) -> Self {
        let wire = Some(can::Medium::new(config.rate));
        CanBus { index: index as u16, name: config.name.clone(), wire, ..Self::unplugged() }
    }

    /// Finds when there is something to do, after whatever has happened at `now`.
    pub(super) fn plan(&mut self, now: u64) {
        if self.leaving > 0 {
            self.let_guests_leave();
        }
        let of_ports = self.ends.iter().filter(|end| end.on_since_ns.is_some());
        let of_ports = of_ports.map(|end| end.port.next_time()).fold(NEVER, u64::min);
        let of_wire = match self.wire.as_ref().map(can::Medium::next_ns) {
            None => NEVER,
            Some(Some(ns)) => ns.div_ceil(1000),
            Some(None) if self.somebody_can_begin(now) => now,
            Some(None) => NEVER,
        };
        self.next = of_ports.min(of_wire).max(now);
    }

    /// Whether on an idle wire somebody has a frame, and somebody else hears it.
    fn somebody_can_begin(&self, now: u64) -> bool {
        let bit_s = self.bit_s();
        let on = || self.ends.iter().filter(move |end| end.is_on(bit_s));
        on().count() > 1 && on().any(|end| end.controller.offer(now * 1000).is_some())
    }

    /// Does one thing that is due on the wire; tells whether there was one.
    fn wire_event(&mut self, now: u64, journal: &mut Journal) -> bool {
        let Some(wire) = &mut self.wire else { return false };
        let at_ns = wire.next_ns().unwrap_or(now * 1000);
        if at_ns > now * 1000 {
            return false;
        }
        let begin_ns = wire.on_wire().map_or(at_ns, |frame| frame.begin_ns);
        let bit_s = wire.rate().bit_s();
        let mut ends = Ends { ends: &mut self.ends, begin_ns, cut_off: self.cut_off, bit_s };
        let was_busy = wire.next_ns().is_some();
        match wire.advance(at_ns, &mut ends) {
            None => return was_busy,
            Some(Event::Begun(_)) => {}
            Some(Event::Delivered(it)) => {
                let (bus, sender) = (self.index, self.ends[it.sender].origin);
                journal.push(now, Transmitted { bus, frame: it.frame, sender });
                self.hand_over(now, it.sender, &it.frame, journal);
            }
            Some(Event::Lost(it)) => {
                self.cut_off = None;
                let (bus, sender) = (self.index, self.ends[it.sender].origin);
                journal.push(now, Lost { bus, frame: it.frame, sender });
            }
        }
        true
    }

    /// Tells everybody's firmware of a frame that has arrived.
    fn hand_over(&mut self, now: u64, sender: usize, frame: &Frame, journal: &mut Journal) {
        for (who, end) in self.ends.iter_mut().enumerate() {
            if who == sender {
                end.run(now, journal, |port, ctx, controller| port.sent(ctx, controller, frame));
            } else if let Some(frame) = end.arrived.take() {
                end.run(now, journal, |port, ctx, controller| port.received(ctx, controller, &frame));
            }
        }
    }
}

impl Medium for CanBus {
    fn name(&self) -> &str {
        &self.name
    }

    fn family(&self) -> &'static str {
        FAMILY
    }

    fn attach(&mut self, socket: Box<dyn Any + Send>) -> Result<usize, BuildError> {
        let socket = socket.downcast::<CanSocket>().map_err(|_| BuildError::OtherFamily)?;
        let CanSocket { origin, segment, layout, port } = *socket;
        let area = layout.port_numbered(origin.node).ok_or(BuildError::OtherFamily)?.area;
        self.ends.push(End {
            origin,
            base: area.first as usize,
            port,
            controller: Controller::default(),
            watch: Some(OwnedWatch::of_area(origin.plc, &segment, layout, area)?),
            on_since_ns: None,
            is_leaving: false,
            arrived: None,
        });
        Ok(self.ends.len() - 1)
    }

    fn power_on(&mut self, place: usize, address: u8, now: u64, journal: &mut Journal) -> bool {
        let end = &mut self.ends[place];
        end.on_since_ns = Some(now * 1000);
        end.run(now, journal, |port, ctx, controller| port.power_on(ctx, controller, address));
        self.plan(now);
        true
    }

    fn power_off(&mut self, place: usize, now: u64, _: &mut Journal) {
        let end = &mut self.ends[place];
        end.on_since_ns = None;
        end.controller.clear();
        end.port.power_off();
        let on_wire = self.wire.as_ref().and_then(can::Medium::on_wire);
        if on_wire.is_some_and(|frame| frame.sender == place) {
            self.cut_off = Some(place);
        }
        self.plan(now);
    }

    fn processor_cycle(&mut self, place: usize, now: u64, journal: &mut Journal) -> bool {
        let end = &mut self.ends[place];
        end.run(now, journal, |port, ctx, controller| port.look(ctx, controller));
        self.plan(now);
        self.wire.is_some()
    }

    fn control_changed(&self) -> bool {
        self.ends.iter().any(|end| end.port.has_changed())
    }

    fn judge_writes(&mut self, place: usize, now: u64, journal: &mut Journal) {
        if let Some(watch) = &mut self.ends[place].watch {
            watch.look(now, journal);
        }
    }

    fn leave(&mut self, place: usize) {
        if let Some(watch) = &mut self.ends[place].watch {
            watch.leave();
        }
    }

    fn judge_write(&mut self, place: usize, offset: u32, bytes: u32, now: u64, journal: &mut Journal) {
        if let Some(watch) = &mut self.ends[place].watch {
            watch.written(offset, bytes, now, journal);
        }
    }

    fn bit_s(&self) -> u32 {
        self.wire.as_ref().map_or(0, |wire| wire.rate().bit_s())
    }

    fn guest_joins(&mut self, guest: u8, now: u64) -> bool {
        self.let_in(guest, now)
    }

    fn guest_leaves(&mut self, guest: u8, now: u64) {
        self.see_off(guest, now);
    }

    fn guest_sends(
        &mut self,
        guest: u8,
        frame: &Frame,
        now: u64,
        _: &mut Journal,
    ) -> Result<(), GuestRefusal> {
        self.take_guests_frame(guest, frame, now)
    }

    fn next_time(&self) -> u64 {
        self.next
    }

    /// The bus itself has no faults; those of its ports are their devices'.
    fn strike(&mut self, now: u64, target: Target, effect: &Effect) -> Option<Hit> {
        let Target::Port { device: plc, port: node } = target else { return None };
        let end = self.ends.iter_mut().find(|end| end.origin == Origin { plc, node })?;
        let hit = end.port.strike(now, effect);
        self.plan(now);
        hit
    }

    fn event(&mut self, world: &mut World) -> Option<SyncSignal> {
        let now = world.now;
        // What is due on the wire was due before the microsecond's end.
        if !self.wire_event(now, world.journal) {
            for end in self.ends.iter_mut().filter(|end| end.on_since_ns.is_some()) {
                if end.port.next_time() <= now {
                    end.run(now, world.journal, |port, ctx, controller| port.due(ctx, controller));
                }
            }
        }
        self.plan(now);
        None
    }
}
