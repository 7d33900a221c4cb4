//! The running bus.
//!
//! Times on the wire are exact to a nanosecond. The firmware of the ports runs at whole microseconds, like
//! all firmware in a plant. If an event occurs within a microsecond, the firmware handles it at the end of
//! this microsecond. A frame begins at the exact time at which the wire becomes free. Only frames that are
//! queued before that time take part in the arbitration.

use super::FAMILY;
use super::config::CanBusConfig;
use super::port::CanSocket;
use super::station::Station;
use super::stations::Stations;
use crate::can;
use crate::can::ErrorState;
use crate::devices::emulation::can_faults;
use crate::devices::emulation::traffic_receivers::TrafficReceivers;
use crate::devices::{
    BuildError, Bus, BusGuests, BusView, Faulty, GuestRefusal, PortWatch, StationState, SyncSignal, World,
};
use crate::door::{BusMessage, Guest};
use crate::due_queue::NEVER;
use crate::fault::{Effect, Hit, Target};
use crate::identity::BusIndex;
use crate::journal::{Journal, Origin};
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use core::any::Any;
use std::sync::Arc;

/// A CAN bus with its ports.
pub struct CanBus {
    pub(super) index: BusIndex,
    name: String,
    /// The CAN line; `None` if the ports are not connected to a bus.
    pub(super) wire: Option<can::Line>,
    pub(super) stations: Stations,
    /// Number of guests that are leaving.
    pub(super) leaving: usize,
    /// True if the sender of the frame on the wire was switched off during the frame. The sender may already
    /// be on again.
    pub(super) sender_gone: bool,
    /// True if a fault loses the frame on the wire: no station will receive the frame, and the sender does
    /// not notice the loss.
    pub(super) is_lost: bool,
    /// True if an error state may have changed and the change was not reported yet.
    pub(super) has_state_changes: bool,
    /// Buffer for the receivers of a frame.
    pub(super) receivers: Vec<u16>,
    /// Guests that receive the traffic.
    pub(super) receivers_of_traffic: TrafficReceivers,
    /// Emulated time of the next event, in microseconds.
    next: u64,
}

impl CanBus {
    /// Returns the placeholder for ports that are not connected to a bus. Their firmware runs, but no station receives
    /// their frames.
    pub fn unplugged() -> Self {
        CanBus {
            index: BusIndex::of_number(u16::MAX),
            name: String::new(),
            wire: None,
            stations: Stations::new(None),
            leaving: 0,
            sender_gone: false,
            is_lost: false,
            has_state_changes: false,
            receivers: Vec::new(),
            receivers_of_traffic: TrafficReceivers::default(),
            next: NEVER,
        }
    }

    /// Creates bus number `index` of the plant, without ports.
    pub fn new(index: BusIndex, config: &CanBusConfig) -> Self {
        let (wire, stations) = (Some(can::Line::new(config.rate)), Stations::new(Some(config.rate)));
        CanBus { index, name: config.name.clone(), wire, stations, ..Self::unplugged() }
    }

    /// Plans the next event, after a change at `now`.
    pub(super) fn plan(&mut self, now: u64) {
        if self.leaving > 0 {
            self.remove_leaving_guests(now);
        }
        let mut next = self.stations.next_time();
        if let Some(wire) = &self.wire {
            let of_wire = wire.next_ns().map_or(NEVER, |ns| ns.div_ceil(1000));
            let begins = wire.can_begin(now * 1000, &self.stations);
            let back = self.next_back().map_or(NEVER, |(at_ns, _)| at_ns.div_ceil(1000));
            next = next.min(of_wire).min(back).min(if begins { now } else { NEVER });
            let held = self.stations.next_held(now * 1000);
            next = next.min(held.map_or(NEVER, |ns| ns.div_ceil(1000)));
        }
        if self.has_state_changes {
            next = now;
        }
        self.next = next.max(now);
    }
}

impl SnapshotFields for CanBus {
    fn save(&self, to: &mut Saving) {
        let Self {
            index: _,
            name: _,
            wire,
            stations,
            leaving,
            sender_gone,
            is_lost,
            has_state_changes,
            // The buffer is empty between two events.
            receivers: _,
            receivers_of_traffic: _,
            next,
        } = self;
        wire.save(to);
        stations.save(to);
        to.value(&(leaving, sender_gone, is_lost, has_state_changes, next));
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        self.receivers_of_traffic.clear();
        self.wire.restore(from)?;
        self.stations.restore(from)?;
        let count = self.stations.all().len();
        from.check(self.wire.as_ref().is_none_or(|wire| wire.is_among(count)), "sender")?;
        (self.leaving, self.sender_gone, self.is_lost, self.has_state_changes, self.next) = from.value()?;
        let leaving = self.stations.all().iter().filter(|end| end.is_leaving).count();
        from.check(self.leaving == leaving, "number of guests that leave")
    }
}

impl BusView for CanBus {
    fn name(&self) -> &str {
        &self.name
    }

    fn family(&self) -> &'static str {
        FAMILY
    }

    fn bit_s(&self) -> u32 {
        self.wire.as_ref().map_or(0, |wire| wire.rate().bit_s())
    }

    fn ports(&self) -> Vec<Origin> {
        let all = self.stations.all().iter().map(|end| end.origin);
        all.filter(|origin| origin.guest().is_none()).collect()
    }

    fn stations(&self) -> Vec<StationState> {
        let present = self.stations.all().iter().filter(|end| end.on_since_ns.is_some());
        let state = |origin, errors| StationState { origin, address: None, does: None, errors };
        present.map(|end| state(end.origin, end.controller.errors())).collect()
    }
}

impl Bus for CanBus {
    fn attach(&mut self, socket: Box<dyn Any + Send>) -> Result<usize, BuildError> {
        let socket = socket.downcast::<CanSocket>().map_err(|_| BuildError::OtherFamily)?;
        Ok(self.stations.add(Station::port(*socket)?))
    }

    fn power_on(&mut self, place: usize, address: u8, now: u64, journal: &mut Journal) -> bool {
        self.stations.get_mut(place).on_since_ns = Some(now * 1000);
        self.run(place, now, journal, |port, ctx, controller| port.power_on(ctx, controller, address));
        self.plan(now);
        true
    }

    fn power_off(&mut self, place: usize, now: u64, _: &mut Journal) {
        let end = self.stations.get_mut(place);
        end.switch_off();
        end.port.power_off();
        self.stations.end_recovery(place);
        self.settle(place, now * 1000);
        self.plan(now);
    }

    fn processor_cycle(&mut self, place: usize, now: u64, journal: &mut Journal) -> bool {
        self.run(place, now, journal, |port, ctx, controller| port.look(ctx, controller));
        self.plan(now);
        self.wire.is_some()
    }

    fn control_changed(&self) -> bool {
        self.stations.all().iter().any(|end| end.port.has_changed())
    }

    fn next_time(&self) -> u64 {
        self.next
    }

    fn event(&mut self, world: &mut World) -> Option<SyncSignal> {
        let now = world.now;
        if core::mem::take(&mut self.has_state_changes) {
            self.report_states(now, world.journal);
        }
        // Events on the wire were due before the end of the microsecond. So the bus handles them before the
        // events of the ports.
        if !self.wire_event(world) && !self.recover(now, world.journal) {
            let mut from = 0;
            while let Some(station) = self.stations.due(from, now) {
                self.run(station, now, world.journal, |port, ctx, controller| port.due(ctx, controller));
                from = station + 1;
            }
        }
        self.plan(now);
        None
    }

    fn watch(&mut self) -> Option<&mut dyn PortWatch> {
        Some(self)
    }

    fn guests(&mut self) -> Option<&mut dyn BusGuests> {
        Some(self)
    }

    fn faults(&mut self) -> Option<&mut dyn Faulty> {
        Some(self)
    }
}

impl PortWatch for CanBus {
    fn judge_writes(&mut self, place: usize, now: u64, journal: &mut Journal) {
        if let Some(watch) = &mut self.stations.get_mut(place).watch {
            watch.look(now, journal);
        }
    }

    fn store_baseline(&mut self, place: usize) {
        if let Some(watch) = &mut self.stations.get_mut(place).watch {
            watch.leave();
        }
    }

    fn judge_write(&mut self, place: usize, offset: u32, bytes: u32, now: u64, journal: &mut Journal) {
        if let Some(watch) = &mut self.stations.get_mut(place).watch {
            watch.written(offset, bytes, now, journal);
        }
    }
}

impl BusGuests for CanBus {
    fn guest_joins(&mut self, guest: u8, now: u64) -> bool {
        self.join(guest, now)
    }

    fn guest_leaves(&mut self, guest: u8, now: u64) {
        self.begin_leaving(guest, now);
    }

    fn guest_has_gone(&mut self, guest: u8, now: u64) {
        self.begin_leaving_if_alone(guest, now);
    }

    fn guest_errors(&self, guest: u8) -> ErrorState {
        self.errors_of_guest(guest)
    }

    fn guest_hears(&mut self, guest: u8, receiver: Option<Arc<Guest>>) {
        self.receivers_of_traffic.set(guest, receiver);
    }

    fn guest_sends(
        &mut self,
        guest: u8,
        message: &BusMessage,
        now: u64,
        _: &mut Journal,
    ) -> Result<(), GuestRefusal> {
        let BusMessage::Frame(frame) = message else { return Err(GuestRefusal::NotHere) };
        self.queue_guest_frame(guest, frame, now)
    }
}

impl Faulty for CanBus {
    /// Puts a working controller into BUS-off. The devices apply all other faults of their ports.
    fn fire(&mut self, now: u64, target: Target, effect: &Effect) -> Option<Hit> {
        let Target::Port { device: plc, port: node } = target else { return None };
        let origin = Origin { plc, node };
        let station = self.stations.all().iter().position(|end| end.origin == origin)?;
        let hit = if effect.get() == Some(&can_faults::Effect::BusOff) {
            self.switch_off(station).then_some(Hit::Plain)
        } else {
            self.stations.get_mut(station).port.fire(now, effect)
        };
        self.settle(station, now * 1000);
        self.plan(now);
        hit
    }
}
