//! The running line.
//!
//! Times on the line are exact to one tick. The firmware of the ports runs at whole microseconds, like all firmware in a
//! plant. A sender that has more to send begins the next character at the end of the last one.

use super::FAMILY;
use super::config::SerialConfig;
use super::drives::{self, BusDrive};
use super::faults;
use super::guests::{self, BusGuest, Guests, guest_of};
use super::port::{LineState, SerialPort, SerialSocket};
use super::records::{Disturbance, SerialError, SerialOctets};
use crate::can::ErrorCounters;
use crate::check::RegisterWatch;
use crate::devices::cansync::records::DriveSet;
use crate::devices::emulation::traffic_receivers::TrafficReceivers;
use crate::devices::{
    BuildError, Bus, BusGuests, BusView, Context, DriveDetails, DriveState, Drives, Faulty, GuestRefusal,
    ParameterRefusal, PortWatch, Shaft, StationState, SyncSignal, World,
};
use crate::door::{BusMessage, Guest};
use crate::fault::{Effect, Hit, Owner, Target};
use crate::identity::BusIndex;
use crate::journal::{Event, Journal, Origin};
use crate::profibus::Burst;
use crate::serial::{CharacterFormat, Line, OnLine, Pair, Signal, Time, Wires, ticks_from, us_at};
use crate::snapshot_fields;
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use core::any::Any;
use std::sync::Arc;

/// The time of an event that does not occur.
const NEVER: u64 = u64::MAX;

/// Sender number of a disturbance on the line.
const NOISE: usize = 1 << 17;

/// Most octets of a record in the journal.
const MOST_OCTETS: usize = 255;

/// A port on the line.
struct BusPort {
    origin: Origin,
    base: u32,
    port: Box<dyn SerialPort>,
    watch: RegisterWatch,
    /// True while the device has power.
    is_on: bool,
    /// True if the port has sent a character since it was switched on.
    is_judged: bool,
    /// Tick at which the port's last character has ended.
    free_from: u64,
    /// Octets that were sent without a pause and are not in the journal yet.
    burst: Vec<u8>,
}

snapshot_fields!(BusPort {
    values: is_on, is_judged, free_from, burst;
    parts: port, watch;
    built: origin, base
});

impl BusPort {
    /// Runs the firmware.
    fn run<T>(
        &mut self,
        now: Time,
        journal: &mut Journal,
        firmware: impl FnOnce(&mut dyn SerialPort, &mut Context) -> T,
    ) -> T {
        let ctx = &mut Context { now, journal, origin: self.origin, base: self.base };
        firmware(&mut *self.port, ctx)
    }
}

/// A serial line with its ports.
pub(crate) struct SerialBus {
    index: BusIndex,
    name: String,
    format: CharacterFormat,
    wires: Wires,
    /// Resistors on the line, without those of the ports.
    terminators: u32,
    pulls: u32,
    /// False for the placeholder of ports that are not connected to a line.
    is_plugged: bool,
    line: Line,
    ends: Vec<BusPort>,
    drives: Vec<BusDrive>,
    guests: Guests,
    /// Guests that receive the traffic.
    receivers_of_traffic: TrafficReceivers,
    next: u64,
}

impl SerialBus {
    /// Returns the placeholder for ports that are not connected to a line. Their firmware runs, and no participant
    /// receives their characters.
    pub(crate) fn unplugged() -> Self {
        SerialBus {
            index: BusIndex::of_number(u16::MAX),
            name: String::new(),
            format: CharacterFormat::DEFAULT,
            wires: Wires::Four,
            terminators: 0,
            pulls: 0,
            is_plugged: false,
            line: Line::default(),
            ends: Vec::new(),
            drives: Vec::new(),
            guests: Guests::default(),
            receivers_of_traffic: TrafficReceivers::default(),
            next: NEVER,
        }
    }

    /// Creates bus number `index` of the plant with its drives, without ports.
    ///
    /// # Errors
    /// The settings of a drive are wrong.
    pub(crate) fn new(index: BusIndex, config: &SerialConfig) -> Result<Self, BuildError> {
        let drives: Result<Vec<_>, _> = config.drives().collect();
        let mut bus = SerialBus {
            index,
            name: config.name.clone(),
            format: config.format,
            wires: config.wires,
            terminators: config.terminators.into(),
            pulls: config.has_pull.into(),
            is_plugged: true,
            drives: drives?,
            ..Self::unplugged()
        };
        bus.plan(0);
        Ok(bus)
    }

    /// Returns the participant of a sender on the line; `None` for a disturbance.
    fn origin_of(&self, sender: usize) -> Option<Origin> {
        let of_port = self.ends.get(sender).map(|end| end.origin);
        let of_drive = || Some(self.drives.get(drives::place_of(sender)?)?.origin());
        of_port.or_else(of_drive).or_else(|| guests::origin_of(sender))
    }

    /// True if the port can send and receive.
    fn is_active(&self, place: usize) -> bool {
        let end = &self.ends[place];
        end.is_on && end.port.setup().is_some()
    }

    /// Returns the next participant that has something to send and is not sending.
    fn next_sender(&self) -> Option<usize> {
        let of_ports = self.ends.iter().enumerate().filter(|(_, end)| end.is_on && end.port.has_to_send());
        let of_ports = of_ports.map(|(place, _)| place);
        let of_guests = self.guests.all().filter(|guest| guest.has_to_send()).map(BusGuest::sender);
        let of_drives = self.drives.iter().enumerate().filter(|(_, drive)| drive.has_to_send());
        let of_drives = of_drives.map(|(place, _)| drives::sender_at(place));
        of_ports.chain(of_drives).chain(of_guests).find(|sender| self.line.of_sender(*sender).is_none())
    }

    /// Plans the next event, after a change at `now`.
    fn plan(&mut self, now: Time) {
        if !self.is_plugged {
            return;
        }
        self.next = match self.next_sender() {
            Some(_) => now,
            None => {
                let of_line = self.line.next_end().map(us_at);
                let of_drives = self.drives.iter().filter_map(BusDrive::due);
                of_line.into_iter().chain(of_drives).min().map_or(NEVER, |time| time.max(now))
            }
        };
    }

    /// Properties of the line at present.
    fn state(&self) -> LineState {
        let setups = self.ends.iter().filter(|end| end.is_on).filter_map(|end| end.port.setup());
        let (mut terminators, mut pulls) = (self.terminators, self.pulls);
        for setup in setups {
            terminators += u32::from(setup.is_terminated);
            pulls += u32::from(setup.has_pull);
        }
        LineState { format: self.format, wires: self.wires, terminators, pulls }
    }

    /// Lets a participant begin its next character.
    fn begin(&mut self, sender: usize, world: &mut World) {
        let now = world.now;
        let line = self.state();
        let (format, signal, free_from) = if let Some(end) = self.ends.get_mut(sender) {
            let (Some(setup), Some(signal)) = (end.port.setup(), end.port.take_to_send()) else { return };
            if !core::mem::replace(&mut end.is_judged, true) {
                end.run(now, world.journal, |port, ctx| port.judge_line(ctx, &line));
            }
            (setup.format, signal, end.free_from)
        } else if let Some(drive) = drives::place_of(sender).and_then(|place| self.drives.get_mut(place)) {
            let Some(octet) = drive.take_to_send() else { return };
            (self.format, Signal::Octet(octet), drive.free_from)
        } else {
            let Some(guest) = self.guests.of_sender(sender) else { return };
            let Some(octet) = guest.take_to_send() else { return };
            (self.format, Signal::Octet(octet), guest.free_from)
        };
        // A character follows the last one without a pause if the last one has ended in this microsecond.
        let begin = if us_at(free_from) == now { free_from } else { ticks_from(now) };
        let pair = self.wires.pair_of(sender == 0);
        let mut character = OnLine::new(sender, pair, format, signal, begin);
        character.has_collided = self.is_blocked_for(sender);
        if !world.faults.is_empty() {
            self.disturb(&mut character, world);
        }
        self.line.begin(character);
    }

    /// True if the transmitter of another port is always active on the only pair of wires.
    fn is_blocked_for(&self, sender: usize) -> bool {
        let others = self.ends.iter().enumerate().filter(|(place, end)| *place != sender && end.is_on);
        let mut setups = others.filter_map(|(_, end)| end.port.setup());
        self.wires == Wires::Two && setups.any(|setup| setup.wires == Wires::Four)
    }

    /// Applies the faults that act on a character.
    #[cold]
    fn disturb(&self, character: &mut OnLine, world: &mut World) {
        let Signal::Octet(octet) = character.signal else { return };
        let drive = drives::place_of(character.sender).and_then(|place| self.drives.get(place));
        let address = drive.map(BusDrive::address);
        let seen = faults::Traits { is_port: character.sender < self.ends.len(), octet, address };
        let mut delay = None;
        let (now, owner) = (world.now, Owner::Bus(self.index));
        world.faults.fire(now, owner, world.journal, |_, effect: &faults::Effect, _| {
            let faults::Effect::Character(characters, effect) = *effect else { return None };
            if !characters.include(&seen) || character.is_lost {
                return None;
            }
            match effect {
                faults::CharacterEffect::Lose => character.is_lost = true,
                faults::CharacterEffect::Garble if !character.is_inverted => character.is_inverted = true,
                faults::CharacterEffect::Delay(us) if delay.is_none() => delay = Some(us),
                faults::CharacterEffect::Garble | faults::CharacterEffect::Delay(_) => return None,
            }
            Some(Hit::Plain)
        });
        let ticks = delay.map_or(0, |us: u32| ticks_from(us.into()));
        (character.begin, character.end) = (character.begin + ticks, character.end + ticks);
    }

    /// Gives a character that has ended to the other participants, and to the journal.
    fn deliver(&mut self, now: Time, character: &OnLine, journal: &mut Journal) {
        let sender = character.sender;
        for place in 0..self.ends.len() {
            let Some(setup) = self.ends[place].port.setup().filter(|_| self.is_active(place)) else {
                continue;
            };
            // On two wires the receiver of a port is off while the port sends (D-856).
            let has_sent =
                self.line.of_sender(place).is_some() || self.ends[place].free_from > character.begin;
            let is_deaf = self.wires == Wires::Two && has_sent;
            if place == sender || is_deaf || !self.wires.hears(place == 0, character.pair) {
                continue;
            }
            if let Some(received) = character.received_as(setup.format) {
                self.ends[place].run(now, journal, |port, ctx| port.received(ctx, received));
            }
        }
        if let Some(received) = character.received_as(self.format)
            && self.wires.hears(false, character.pair)
        {
            for place in 0..self.drives.len() {
                let own = drives::sender_at(place);
                let has_sent =
                    self.line.of_sender(own).is_some() || self.drives[place].free_from > character.begin;
                if own != sender && !(self.wires == Wires::Two && has_sent) {
                    self.drives[place].received(now, received.into());
                }
            }
            let burst = || BusMessage::Burst(Burst { begin: 0, octets: vec![received.octet] });
            self.receivers_of_traffic.send(now, guest_of(sender), burst);
        }
        if let Some(end) = self.ends.get_mut(sender) {
            end.free_from = character.end;
            if end.is_on {
                end.run(now, journal, |port, ctx| port.sent(ctx, character.has_collided));
            }
        } else if let Some(drive) = drives::place_of(sender).and_then(|place| self.drives.get_mut(place)) {
            drive.free_from = character.end;
        } else if let Some(guest) = self.guests.of_sender(sender) {
            guest.free_from = character.end;
        }
        self.record(now, character, journal);
    }

    /// Writes a character that has ended into the journal, together with the characters before and after it.
    fn record(&mut self, now: Time, character: &OnLine, journal: &mut Journal) {
        let sender = character.sender;
        let (bus, Some(origin)) = (self.index, self.origin_of(sender)) else { return };
        let disturbance = match character.signal {
            _ if character.has_collided => Some(Disturbance::Collision),
            Signal::Break => Some(Disturbance::Break),
            Signal::Octet(_) if character.is_inverted => Some(Disturbance::Garbled),
            Signal::Octet(_) => None,
        };
        let octet = match character.signal {
            Signal::Octet(octet) if disturbance.is_none() && !character.is_lost => Some(octet),
            _ => None,
        };
        let drive = drives::place_of(sender).and_then(|place| self.drives.get_mut(place));
        let (burst, continues) = match (self.ends.get_mut(sender), drive) {
            (Some(end), _) => (&mut end.burst, end.is_on && end.port.has_to_send()),
            (None, Some(drive)) => {
                let continues = drive.has_to_send();
                (&mut drive.burst, continues)
            }
            (None, None) => match self.guests.of_sender(sender) {
                Some(guest) => {
                    let continues = guest.has_to_send();
                    (&mut guest.burst, continues)
                }
                None => return,
            },
        };
        burst.extend(octet);
        if octet.is_none() || !continues || burst.len() >= MOST_OCTETS {
            flush(burst, bus, origin, now, journal);
        }
        if let Some(reason) = disturbance.filter(|_| !character.is_lost) {
            journal.push(now, SerialError { bus, sender: origin, reason });
        }
    }
}

/// Writes the octets of a burst into the journal, and empties the burst.
fn flush(burst: &mut Vec<u8>, bus: BusIndex, sender: Origin, now: Time, journal: &mut Journal) {
    if !burst.is_empty() {
        let event = SerialOctets::new(bus, sender, burst);
        journal.push_octets(now, event, event.lacks_some().then_some(burst.as_slice()));
        burst.clear();
    }
}

impl SnapshotFields for SerialBus {
    fn save(&self, to: &mut Saving) {
        let Self {
            index: _,
            name: _,
            format: _,
            wires: _,
            terminators: _,
            pulls: _,
            is_plugged: _,
            line,
            ends,
            drives,
            guests,
            receivers_of_traffic: _,
            next,
        } = self;
        ends.save(to);
        // Without a length: the plant file has the number of the drives.
        drives.iter().for_each(|drive| drive.save(to));
        guests.save(to);
        to.value(&(line, next));
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        self.receivers_of_traffic.clear();
        self.ends.restore(from)?;
        self.drives.iter_mut().try_for_each(|drive| drive.restore(from))?;
        self.guests.restore(from)?;
        (self.line, self.next) = from.value()?;
        let is_there = |sender: usize| {
            sender < self.ends.len()
                || guest_of(sender).is_some()
                || sender == NOISE
                || drives::place_of(sender).is_some_and(|place| place < self.drives.len())
        };
        from.check(self.line.senders().all(is_there), "sender")
    }
}

impl BusView for SerialBus {
    fn name(&self) -> &str {
        &self.name
    }

    fn family(&self) -> &'static str {
        FAMILY
    }

    fn bit_s(&self) -> u32 {
        self.format.baud_rate().into()
    }

    fn ports(&self) -> Vec<Origin> {
        self.ends.iter().map(|end| end.origin).collect()
    }

    fn stations(&self) -> Vec<StationState> {
        let state = |origin, does| StationState {
            origin,
            address: None,
            does: Some(does),
            errors: ErrorCounters::default(),
        };
        let on = self.ends.iter().filter(|end| end.is_on);
        let ports = on.map(|end| state(end.origin, if end.port.setup().is_some() { "ready" } else { "off" }));
        let guests = self.guests.present().map(|number| state(Origin::of_guest(number), "guest"));
        let drives = self.drives.iter();
        let drives = drives
            .map(|drive| StationState { address: Some(drive.address()), ..state(drive.origin(), "drive") });
        ports.chain(drives).chain(guests).collect()
    }

    fn busy_ns(&self, event: &Event) -> u64 {
        let octets = event.get::<SerialOctets>().map_or(0, |it| it.octets.into());
        octets * u64::from(self.format.bits()) * 1_000_000_000 / u64::from(self.format.baud_rate())
    }
}

impl Bus for SerialBus {
    fn attach(&mut self, socket: Box<dyn Any + Send>) -> Result<usize, BuildError> {
        let socket = socket.downcast::<SerialSocket>().map_err(|_| BuildError::OtherFamily)?;
        let SerialSocket { origin, segment, layout, port } = *socket;
        let area = layout.port_numbered(origin.node).ok_or(BuildError::OtherFamily)?.area;
        self.ends.push(BusPort {
            origin,
            base: area.first,
            port,
            watch: RegisterWatch::of_area(origin.plc, &segment, area)?,
            is_on: false,
            is_judged: false,
            free_from: 0,
            burst: Vec::new(),
        });
        Ok(self.ends.len() - 1)
    }

    fn power_on(&mut self, place: usize, _: u8, now: u64, _: &mut Journal) -> bool {
        self.ends[place].is_on = true;
        self.plan(now);
        true
    }

    fn power_off(&mut self, place: usize, now: u64, journal: &mut Journal) {
        let bus = self.index;
        let end = &mut self.ends[place];
        (end.is_on, end.is_judged) = (false, false);
        flush(&mut end.burst, bus, end.origin, now, journal);
        end.port.power_off();
        self.line.cut_off(place);
        self.plan(now);
    }

    fn processor_cycle(&mut self, place: usize, now: u64, journal: &mut Journal) -> bool {
        let is_plugged = self.is_plugged;
        let end = &mut self.ends[place];
        end.run(now, journal, |port, ctx| port.look(ctx));
        end.is_judged &= end.port.setup().is_some();
        if !is_plugged {
            // Without a line no participant receives the characters, and they take no time.
            while end.port.take_to_send().is_some() {
                end.run(now, journal, |port, ctx| port.sent(ctx, false));
            }
        }
        self.plan(now);
        is_plugged
    }

    /// The firmware acts only when a program has written a register, and at events on the line.
    fn is_quiescent(&self, place: usize) -> bool {
        !self.ends[place].port.has_changed()
    }

    fn poll_changes_nothing(&self, place: usize, _: u64, is_seen: bool) -> bool {
        is_seen || self.is_quiescent(place)
    }

    fn control_changed(&self) -> bool {
        self.ends.iter().any(|end| end.is_on && end.port.has_changed())
    }

    fn next_time(&self) -> u64 {
        self.next
    }

    fn event(&mut self, world: &mut World) -> Option<SyncSignal> {
        let now = world.now;
        // Characters that have ended come first: they were due before the end of the microsecond.
        let is_due = self.line.next_end().is_some_and(|end| us_at(end) <= now);
        let ended = if is_due { self.line.end(u64::MAX) } else { None };
        if let Some(character) = ended {
            self.deliver(now, &character, world.journal);
            let line = &self.line;
            self.guests.remove_left(|sender| line.of_sender(sender).is_some());
        } else if let Some(sender) = self.next_sender() {
            self.begin(sender, world);
        } else {
            let is_due = |drive: &&mut BusDrive| drive.due().is_some_and(|due| due <= now);
            self.drives.iter_mut().filter(is_due).for_each(|drive| drive.poll(now));
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

    fn drives(&self) -> Option<&dyn Drives> {
        Some(self)
    }

    fn drives_mut(&mut self) -> Option<&mut dyn Drives> {
        Some(self)
    }

    fn faults(&mut self) -> Option<&mut dyn Faulty> {
        Some(self)
    }
}

impl Drives for SerialBus {
    fn list(&self) -> Vec<(&str, DriveState)> {
        self.drives.iter().map(|drive| (drive.name(), drive.state())).collect()
    }

    fn details(&self, drive: usize) -> Option<DriveDetails> {
        self.drives.get(drive).map(BusDrive::details)
    }

    fn set_parameter(
        &mut self,
        drive: usize,
        number: u16,
        value: i64,
        now: u64,
        journal: &mut Journal,
    ) -> Result<(), ParameterRefusal> {
        let bus = self.index;
        let drive = self.drives.get_mut(drive).ok_or(ParameterRefusal::NotThere)?;
        drive.set_parameter(now, number, value)?;
        journal.push(now, DriveSet { bus, slave: drive.address(), number, value: value as u32 });
        self.plan(now);
        Ok(())
    }

    fn shaft(&self, drive: usize) -> Option<Shaft> {
        self.drives.get(drive).map(BusDrive::shaft)
    }

    fn turn_shaft(&mut self, drive: usize, speed: Option<i32>, now: u64) {
        if let Some(drive) = self.drives.get_mut(drive) {
            drive.turn_shaft(now, speed);
            self.plan(now);
        }
    }
}

impl PortWatch for SerialBus {
    fn judge_writes(&mut self, place: usize, now: u64, journal: &mut Journal) {
        self.ends[place].watch.look(now, journal);
    }

    fn store_baseline(&mut self, place: usize) {
        self.ends[place].watch.leave();
    }

    fn judge_write(&mut self, place: usize, offset: u32, bytes: u32, now: u64, journal: &mut Journal) {
        self.ends[place].watch.written(offset, bytes, now, journal);
    }
}

impl BusGuests for SerialBus {
    fn guest_joins(&mut self, guest: u8, _: u64) -> bool {
        self.guests.join(guest)
    }

    fn guest_leaves(&mut self, guest: u8, now: u64) {
        self.receivers_of_traffic.set(guest, None);
        self.guests.leave(guest);
        let line = &self.line;
        self.guests.remove_left(|sender| line.of_sender(sender).is_some());
        self.plan(now);
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
        let BusMessage::Burst(burst) = message else { return Err(GuestRefusal::NotHere) };
        let taken = self.guests.enqueue(guest, &burst.octets);
        self.plan(now);
        taken
    }
}

impl Faulty for SerialBus {
    /// Makes a break. Faults of characters act when a character begins.
    fn fire(&mut self, now: u64, target: Target, effect: &Effect) -> Option<Hit> {
        let (Target::Bus(_), Some(faults::Effect::Break(us))) = (target, effect.get()) else { return None };
        if self.line.of_sender(NOISE).is_some() {
            return None;
        }
        let begin = ticks_from(now);
        let end = begin + ticks_from(u64::from(*us)).max(self.format.ticks());
        let disturbance = OnLine::new(NOISE, Pair::Both, self.format, Signal::Break, begin);
        self.line.begin(OnLine { end, ..disturbance });
        self.plan(now);
        Some(Hit::Plain)
    }
}
