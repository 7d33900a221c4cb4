//! Events on the wire of a bus, and their effects on the controllers.

use super::records::{Lost, StateChange, Transmitted};
use super::{CanBus, CanPort, Controller};
use crate::can::{ErrorCounters, ErrorState, Event, Fate, OnWire, Participants};
use crate::devices::{Context, World};
use crate::door::BusMessage;
use crate::journal::Journal;

impl CanBus {
    /// Runs the firmware of a station.
    pub(super) fn run(
        &mut self,
        station: usize,
        now: u64,
        journal: &mut Journal,
        firmware: impl FnOnce(&mut dyn CanPort, &mut Context, &mut Controller),
    ) {
        self.stations.get_mut(station).run(now, journal, firmware);
        self.settle(station, now * 1000);
    }

    /// Updates the indexes after a change of a station.
    pub(super) fn settle(&mut self, station: usize, at_ns: u64) {
        self.stations.settle(station, at_ns);
        if self.stations.take_changed() {
            self.check_frame_on_wire(at_ns);
        }
    }

    /// Called when a station has begun or ceased to take part. Checks whether the frame on the wire still has
    /// a sender and receivers.
    fn check_frame_on_wire(&mut self, now_ns: u64) {
        let Some(wire) = &mut self.wire else { return };
        let Some(it) = wire.on_wire().copied() else { return };
        let sender = &self.stations.all()[it.sender];
        if !sender.took_part_since(it.begin_ns) {
            self.sender_gone = true;
            match sender.controller.error_state() {
                ErrorState::BusOff => wire.sender_is_off(now_ns),
                _ => wire.sender_gone(now_ns),
            }
        } else if !self.stations.is_heard(it.sender, it.begin_ns) {
            wire.nobody_left(now_ns);
        }
    }

    /// Performs one due event on the wire. Returns true if an event was due.
    pub(super) fn wire_event(&mut self, world: &mut World) -> bool {
        let now_ns = world.now * 1000;
        let Some(wire) = &mut self.wire else { return false };
        let at_ns = match wire.next_ns().filter(|ns| *ns <= now_ns) {
            Some(ns) => ns,
            None if wire.can_begin(now_ns, &self.stations) => now_ns,
            None => return false,
        };
        let quiet_ns = wire.quiet_ns().unwrap_or(at_ns);
        let event = if world.faults.is_empty() {
            wire.advance(at_ns, &self.stations)
        } else {
            self.advance_disturbed(at_ns, world)
        };
        match event {
            None => {}
            Some(Event::Begun(it)) => {
                (self.sender_gone, self.is_lost) = (false, false);
                self.stations.get_mut(it.sender).controller.is_sending = true;
                self.stations.frame_begins(it.begin_ns, quiet_ns);
                if !world.faults.is_empty() {
                    self.disturb(&it, world);
                }
            }
            Some(Event::Delivered(it)) => self.delivered(&it, world),
            Some(Event::Failed(it)) => self.failed(&it, world.now, world.journal),
        }
        true
    }

    /// Called when a frame has arrived. The journal records the frame before any station answers it.
    fn delivered(&mut self, it: &OnWire, world: &mut World) {
        let (bus, frame, sender) = (self.index, it.frame, self.stations.all()[it.sender].origin);
        self.stations.get_mut(it.sender).controller.is_sending = false;
        if !self.is_lost {
            self.receivers_of_traffic.send(world.now, sender.guest(), || BusMessage::Frame(frame));
            world.journal.push(world.now, Transmitted { bus, frame, sender });
        }
        if self.stations.has_errors() {
            self.stations.count_good(it.sender, it.begin_ns);
        }
        // If the sender is switched off after the checksum, the frame still arrives. Its sender is then not
        // notified.
        let is_news = !self.sender_gone && self.stations.get_mut(it.sender).frame_is_through(it.free_ns);
        self.deliver(it, is_news, world);
        self.settle(it.sender, it.end_ns);
        self.report_states(world.now, world.journal);
    }

    /// Runs the firmware of all receivers of a frame, and of its sender if this is the frame's first arrival.
    fn deliver(&mut self, it: &OnWire, is_news: bool, world: &mut World) {
        let mut receivers = core::mem::take(&mut self.receivers);
        if self.is_lost {
            receivers.clear();
        } else {
            self.stations.receivers(&it.frame, &mut receivers);
        }
        let first_after_sender = receivers.partition_point(|station| usize::from(*station) < it.sender);
        self.receive(&receivers[..first_after_sender], it, world);
        if is_news {
            let (now, frame) = (world.now, &it.frame);
            self.run(it.sender, now, world.journal, |port, ctx, controller| {
                port.sent(ctx, controller, frame)
            });
        }
        self.receive(&receivers[first_after_sender..], it, world);
        self.receivers = receivers;
    }

    fn receive(&mut self, receivers: &[u16], it: &OnWire, world: &mut World) {
        let (now, frame) = (world.now, &it.frame);
        for station in
            receivers.iter().map(|station| usize::from(*station)).filter(|station| *station != it.sender)
        {
            if !self.stations.all()[station].took_part_since(it.begin_ns) {
                continue;
            }
            let overruns = !world.faults.is_empty() && self.overruns(station, frame, world);
            self.run(station, now, world.journal, |port, ctx, controller| {
                if overruns {
                    port.overrun(ctx, controller, frame);
                } else {
                    port.received(ctx, controller, frame);
                }
            });
        }
    }

    /// A frame ends in an error frame.
    fn failed(&mut self, it: &OnWire, now: u64, journal: &mut Journal) {
        let (bus, frame, sender) = (self.index, it.frame, self.stations.all()[it.sender].origin);
        self.stations.get_mut(it.sender).controller.is_sending = false;
        // A station alone on the bus repeats its frame without a limit. The journal records only the first
        // attempt.
        let unheard = it.fate == Fate::NotAcknowledged;
        let is_known = core::mem::replace(&mut self.stations.get_mut(it.sender).is_unheard, unheard);
        if !(unheard && is_known) {
            journal.push(now, Lost { bus, frame: (frame, it.fate), sender });
        }
        self.stations.count_errors(it.begin_ns, |station, end| {
            let errors = end.controller.errors_mut();
            match it.fate {
                Fate::Withdrawn => errors.receive_error(),
                _ if station != it.sender => errors.receive_error(),
                Fate::NotAcknowledged => errors.not_acknowledged(),
                _ => errors.transmit_error(),
            }
        });
        self.report_states(now, journal);
    }

    /// Reports the changed error states, first to the journal, then to the firmware.
    pub(super) fn report_states(&mut self, now: u64, journal: &mut Journal) {
        if !self.stations.has_errors() {
            return;
        }
        while let Some((station, state)) = self.stations.take_state_change() {
            let end = &self.stations.all()[station];
            let (errors, origin) = (end.controller.errors(), end.origin);
            let (transmit, receive) = (errors.transmit(), errors.receive());
            journal.push(now, StateChange { bus: self.index, station: origin, state, transmit, receive });
            self.run(station, now, journal, |port, ctx, controller| port.error_state(ctx, controller, state));
        }
    }

    /// Lets a station that was BUS-off take part again when its waiting time has ended. Returns true if there was such
    /// a station.
    pub(super) fn recover(&mut self, now: u64, journal: &mut Journal) -> bool {
        let Some((at_ns, station)) = self.next_back().filter(|(at_ns, _)| *at_ns <= now * 1000) else {
            return false;
        };
        self.stations.end_recovery(station);
        let end = self.stations.get_mut(station);
        if end.controller.error_state() == ErrorState::BusOff {
            *end.controller.errors_mut() = ErrorCounters::default();
            self.settle(station, at_ns);
            self.report_states(now, journal);
        }
        true
    }

    /// Returns the station that returns from BUS-off first, and the time in ns. The result is valid if no
    /// frame begins before this time.
    pub(super) fn next_back(&self) -> Option<(u64, usize)> {
        self.stations.next_back(self.wire.as_ref()?.quiet_ns()?)
    }
}
