//! The running segment.
//!
//! Times on the line are exact to one bit. The firmware of the stations runs at whole microseconds, like all
//! firmware in a plant. Events within a microsecond are handled in their order at the end of this
//! microsecond.

use super::FAMILY;
use super::config::ProfibusConfig;
use super::disturbance::{HeldTelegram, NOISE};
use super::faults;
use super::guests;
use super::guests::{Guests, guest_of};
use super::port::{Intent, ProfibusPort, ProfibusSocket, Station};
use super::records::{DpGarbled, DpShort, DpTelegram, short};
use crate::can::ErrorCounters;
use crate::check::{RegisterWatch, rules};
use crate::devices::emulation::traffic_receivers::TrafficReceivers;
use crate::devices::{
    BuildError, Bus, BusGuests, BusView, Context, Faulty, GuestRefusal, PortWatch, StationState, SyncSignal,
    World,
};
use crate::door::{BusMessage, Guest};
use crate::fault::{Effect, Hit, Target};
use crate::identity::BusIndex;
use crate::journal::{Event, Finding, Journal, Origin};
use crate::profibus::{
    Burst, BusRate, FunctionCode, Line, MIN_TSDR_BITS, Passage, SYN_BITS, Sending, Telegram,
};
use crate::snapshot_fields;
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use core::any::Any;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// The time of an event that does not occur.
const NEVER: u64 = u64::MAX;

/// A port on the PROFIBUS segment.
pub(super) struct BusPort {
    origin: Origin,
    base: u32,
    pub(super) port: Box<dyn ProfibusPort>,
    station: Station,
    watch: RegisterWatch,
    is_on: bool,
}

snapshot_fields!(BusPort { values: is_on; parts: port, station, watch; built: origin, base });

impl BusPort {
    /// Runs the firmware at this bit time.
    fn run(
        &mut self,
        now: u64,
        bits: u64,
        journal: &mut Journal,
        firmware: impl FnOnce(&mut dyn ProfibusPort, &mut Context, &mut Station),
    ) {
        self.station.now = bits;
        let ctx = &mut Context { now, journal, origin: self.origin, base: self.base };
        firmware(&mut *self.port, ctx, &mut self.station);
    }
}

/// A request that was sent. The line is reserved for the answer to it.
#[derive(Clone, Copy, Serialize, Deserialize)]
struct PendingAnswer {
    sender: usize,
    /// Bit time until which no other station may send a request.
    until: u64,
}

/// The next step on the line.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum LineStep {
    /// The telegram on the line ends.
    End,
    /// The alarm of the port with this index occurs.
    Alarm(usize),
    /// The sender with this index begins to send.
    Begin(usize),
    /// A telegram that a fault has held back begins. The field is the index of the telegram.
    Held(usize),
}

/// A PROFIBUS segment with its ports.
pub(crate) struct ProfibusBus {
    pub(super) index: BusIndex,
    name: String,
    pub(super) rate: BusRate,
    /// Time within which an answer must begin, in bit times.
    slot_bits: u64,
    /// False for the placeholder of ports that are not connected to a PROFIBUS segment.
    is_plugged: bool,
    pub(super) line: Line,
    pub(super) ends: Vec<BusPort>,
    pub(super) guests: Guests,
    /// Guests that receive the traffic.
    receivers_of_traffic: TrafficReceivers,
    /// Telegrams that faults hold back.
    pub(super) held: Vec<HeldTelegram>,
    /// The request that waits for its answer. The line is reserved for this answer.
    asked: Option<PendingAnswer>,
    next: u64,
}

impl ProfibusBus {
    /// Returns the placeholder for ports that are not connected to a PROFIBUS segment. Their firmware runs, but no
    /// station receives their telegrams.
    pub(crate) fn unplugged() -> Self {
        let [slowest, ..] = BusRate::ALL;
        ProfibusBus {
            index: BusIndex::of_number(u16::MAX),
            name: String::new(),
            rate: slowest,
            slot_bits: slowest.slot_bits(),
            is_plugged: false,
            line: Line::default(),
            ends: Vec::new(),
            guests: Guests::default(),
            receivers_of_traffic: TrafficReceivers::default(),
            held: Vec::new(),
            asked: None,
            next: NEVER,
        }
    }

    /// Creates bus number `index` of the plant, without ports.
    pub(crate) fn new(index: BusIndex, config: &ProfibusConfig) -> Self {
        let name = config.name.clone();
        let slot_bits = config.rate.slot_bits() * u64::from(config.slot_factor);
        ProfibusBus { index, name, rate: config.rate, slot_bits, is_plugged: true, ..Self::unplugged() }
    }

    /// Returns the port or guest of a sender on the line.
    fn origin_of(&self, sender: usize) -> Origin {
        guests::origin_of(sender).unwrap_or_else(|| self.ends[sender].origin)
    }

    /// Returns the next step on the line, and its bit time.
    fn next_step(&self) -> Option<(u64, LineStep)> {
        let on = || self.ends.iter().enumerate().filter(|(_, end)| end.is_on);
        let ends = self.line.next_end().map(|at| (at, LineStep::End));
        let alarms =
            on().filter_map(|(participant, end)| Some((end.station.alarm?, LineStep::Alarm(participant))));
        let answers = on().filter_map(|(participant, end)| match end.station.intent {
            Some(Intent::At(at, _)) => Some((at, LineStep::Begin(participant))),
            _ => None,
        });
        let exact = self.guests.next_exact().map(|(at, participant)| (at, LineStep::Begin(participant)));
        let held = self.next_held().map(|(at, index)| (at, LineStep::Held(index)));
        let step = ends.into_iter().chain(alarms).chain(answers).chain(exact).chain(held).min();
        // A request must wait while a station is sending or will soon answer.
        let is_quiet = on().all(|(_, end)| !matches!(end.station.intent, Some(Intent::At(..))));
        let Some(since) = self.line.idle_since().filter(|_| is_quiet) else { return step };
        // A request must also wait while another sender waits for an answer. An answer need not wait for
        // this.
        let kept = |participant| {
            self.asked.filter(|asked| asked.sender != participant).map_or(0, |asked| asked.until)
        };
        let requests = on().filter_map(|(participant, end)| match end.station.intent {
            Some(Intent::WhenIdle(from, _)) => {
                Some((from.max(since + SYN_BITS).max(kept(participant)), LineStep::Begin(participant)))
            }
            _ => None,
        });
        let of_guests =
            self.guests.next_idle(since, kept).map(|(at, participant)| (at, LineStep::Begin(participant)));
        step.into_iter().chain(requests).chain(of_guests).min()
    }

    /// If other ports answer at the address of the port at `place`, notifies this port and the other ports.
    fn judge_address(&mut self, place: usize, now: u64, journal: &mut Journal) {
        let address = |end: &BusPort| {
            let presence = end.port.presence().filter(|presence| end.is_on && presence.answers);
            presence.map(|presence| presence.address)
        };
        let Some(own) = address(&self.ends[place]).filter(|_| self.is_plugged) else { return };
        let same = |&participant: &usize| address(&self.ends[participant]) == Some(own);
        let sharing: Vec<usize> = (0..self.ends.len()).filter(same).collect();
        if sharing.len() < 2 {
            return;
        }
        let bits = self.rate.bits_at(now);
        for participant in sharing {
            self.ends[participant].run(now, bits, journal, |port, ctx, _| port.shares_address(ctx));
        }
    }

    /// Plans the next event, after a change at `now`.
    pub(super) fn plan(&mut self, now: u64) {
        let of_ports = self.ends.iter().filter(|end| end.is_on).map(|end| end.port.next_time());
        let of_ports = of_ports.fold(NEVER, u64::min);
        let of_line = match self.next_step() {
            Some((at, _)) if self.is_plugged => self.rate.us_at(at),
            _ => NEVER,
        };
        self.next = of_ports.min(of_line).max(now);
    }

    /// Performs one due step on the line. Returns true if a step was due.
    fn line_event(&mut self, world: &mut World) -> bool {
        let now = world.now;
        let due = |at: &u64| *at <= self.rate.bits_at(now);
        let Some((at, step)) = self.next_step().filter(|(at, _)| self.is_plugged && due(at)) else {
            return false;
        };
        match step {
            LineStep::End => {
                if let Some(sending) = self.line.end(at) {
                    self.deliver(now, &sending, world.journal);
                }
            }
            LineStep::Alarm(participant) => {
                self.ends[participant].station.alarm = None;
                let end = &mut self.ends[participant];
                end.run(now, at, world.journal, |port, ctx, station| port.alarm(ctx, station));
            }
            LineStep::Begin(participant) => {
                let octets = match self.ends.get_mut(participant) {
                    Some(end) => end.station.intent.take().map(Intent::octets),
                    None => self.guests.take(participant),
                };
                if let Some(octets) = octets {
                    self.judge_pause(participant, at, &octets, now, world.journal);
                    self.asked = None;
                    self.begin(participant, at, octets, world);
                }
            }
            LineStep::Held(index) => self.begin_held(index),
        }
        true
    }

    /// Reports a guest's telegram that begins too soon after the previous telegram. Ports are not checked,
    /// because they always keep the pause.
    fn judge_pause(&self, sender: usize, at: u64, octets: &[u8], now: u64, journal: &mut Journal) {
        let (Some(guest), Some(since @ 1..)) = (guest_of(sender), self.line.idle_since()) else { return };
        let needed = match Telegram::parse(octets) {
            Ok(Telegram::ShortAck) => MIN_TSDR_BITS,
            Ok(Telegram::Frame(frame)) if FunctionCode::is_answer(frame.fc) => MIN_TSDR_BITS,
            Ok(_) => SYN_BITS,
            // The journal reports these octets as garbled.
            Err(_) => return,
        };
        let pause = at.saturating_sub(since);
        if pause < needed {
            journal.find(now, Finding::at_bus(&rules::GUEST_EARLY, self.index, guest, pause as u32));
        }
    }

    /// Passes a telegram that has ended to the journal, the guests and the ports.
    fn deliver(&mut self, now: u64, sending: &Sending, journal: &mut Journal) {
        let Sending { sender, end: at, ref octets, is_garbled, passage, .. } = *sending;
        let telegram = Telegram::parse(octets).ok().filter(|_| !is_garbled);
        if passage != Passage::Lost {
            self.record(now, sending, telegram.as_ref(), journal);
        }
        for (participant, end) in self.ends.iter_mut().enumerate().filter(|(_, end)| end.is_on) {
            if participant == sender {
                if passage != Passage::Copy {
                    end.run(now, at, journal, |port, ctx, station| port.sent(ctx, station));
                }
            } else if let Some(telegram) = telegram.as_ref().filter(|_| passage != Passage::Lost) {
                end.run(now, at, journal, |port, ctx, station| port.heard(ctx, station, telegram));
            }
        }
    }

    /// Passes a telegram that has ended to the guests and to the journal.
    fn record(&mut self, now: u64, sending: &Sending, telegram: Option<&Telegram>, journal: &mut Journal) {
        let Sending { sender, end: at, ref octets, is_garbled, .. } = *sending;
        match telegram {
            Some(Telegram::Frame(frame)) => {
                self.guests.note_address(sender, frame.sa);
                if FunctionCode::wants_answer(frame.fc) {
                    self.asked = Some(PendingAnswer { sender, until: at + self.slot_bits });
                }
            }
            Some(Telegram::Token { sa, .. }) => self.guests.note_address(sender, *sa),
            _ => {}
        }
        // Guests do not receive the octets of a collision.
        if !is_garbled {
            let burst = || BusMessage::Burst(Burst { begin: sending.begin, octets: sending.octets.clone() });
            self.receivers_of_traffic.send(now, guest_of(sender), burst);
        }
        // Noise is not recorded here, because the journal already has the hit of the fault that has made the
        // noise.
        if sender == NOISE {
            return;
        }
        let (bus, origin) = (self.index, self.origin_of(sender));
        match telegram {
            Some(Telegram::Frame(frame)) => {
                let event = DpTelegram::new(bus, origin, frame);
                journal.push_octets(now, event, event.lacks(octets).then_some(octets));
            }
            Some(other) => {
                if let Some(event) = short(bus, origin, other) {
                    journal.push(now, event);
                }
            }
            None => {
                let event = DpGarbled { bus, sender: origin, octets: octets.len() as u32 };
                journal.push_octets(now, event, Some(octets));
            }
        }
    }
}

impl SnapshotFields for ProfibusBus {
    fn save(&self, to: &mut Saving) {
        let Self {
            index: _,
            name: _,
            rate: _,
            slot_bits: _,
            is_plugged: _,
            line,
            ends,
            guests,
            receivers_of_traffic: _,
            held,
            asked,
            next,
        } = self;
        ends.save(to);
        guests.save(to);
        to.value(&(line, held, asked, next));
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        self.receivers_of_traffic.clear();
        self.ends.restore(from)?;
        self.guests.restore(from)?;
        (self.line, self.held, self.asked, self.next) = from.value()?;
        let is_there =
            |sender: usize| sender < self.ends.len() || guest_of(sender).is_some() || sender == NOISE;
        from.check(self.held.iter().all(|held| is_there(held.sender)), "sender of a delayed telegram")?;
        from.check(self.line.senders().all(is_there), "sender")?;
        from.check(self.asked.is_none_or(|asked| is_there(asked.sender)), "sender of the last request")
    }
}

impl BusView for ProfibusBus {
    fn name(&self) -> &str {
        &self.name
    }

    fn family(&self) -> &'static str {
        FAMILY
    }

    fn bit_s(&self) -> u32 {
        self.rate.bit_s()
    }

    fn ports(&self) -> Vec<Origin> {
        self.ends.iter().map(|end| end.origin).collect()
    }

    fn stations(&self) -> Vec<StationState> {
        let state = |origin, address, does| StationState {
            origin,
            address,
            does: Some(does),
            errors: ErrorCounters::default(),
        };
        let on = self.ends.iter().filter(|end| end.is_on);
        let ports = on.filter_map(|end| {
            let presence = end.port.presence()?;
            Some(state(end.origin, Some(presence.address), presence.does))
        });
        let guests =
            self.guests.present().map(|(number, address)| state(Origin::of_guest(number), address, "guest"));
        ports.chain(guests).collect()
    }

    fn busy_ns(&self, event: &Event) -> u64 {
        let octets = event.get::<DpTelegram>().map(|it| it.octets_on_line());
        let octets = octets.or_else(|| event.get::<DpShort>().map(|it| it.octets_on_line()));
        Telegram::bits(octets.unwrap_or(0)) * 1_000_000_000 / u64::from(self.rate.bit_s().max(1))
    }
}

impl Bus for ProfibusBus {
    fn attach(&mut self, socket: Box<dyn Any + Send>) -> Result<usize, BuildError> {
        let socket = socket.downcast::<ProfibusSocket>().map_err(|_| BuildError::OtherFamily)?;
        let ProfibusSocket { origin, segment, layout, port } = *socket;
        let area = layout.port_numbered(origin.node).ok_or(BuildError::OtherFamily)?.area;
        self.ends.push(BusPort {
            origin,
            base: area.first,
            port,
            station: Station::new(self.slot_bits),
            watch: RegisterWatch::of_area(origin.plc, &segment, area)?,
            is_on: false,
        });
        Ok(self.ends.len() - 1)
    }

    fn power_on(&mut self, place: usize, _: u8, now: u64, journal: &mut Journal) -> bool {
        let bits = self.rate.bits_at(now);
        let end = &mut self.ends[place];
        end.is_on = true;
        end.run(now, bits, journal, |port, ctx, station| port.power_on(ctx, station));
        self.judge_address(place, now, journal);
        self.plan(now);
        true
    }

    fn power_off(&mut self, place: usize, now: u64, _: &mut Journal) {
        let end = &mut self.ends[place];
        end.is_on = false;
        end.station.clear();
        end.port.power_off();
        self.line.cut_off(place);
        self.held.retain(|held| held.sender != place);
        self.plan(now);
    }

    fn processor_cycle(&mut self, place: usize, now: u64, journal: &mut Journal) -> bool {
        let bits = self.rate.bits_at(now);
        self.ends[place].run(now, bits, journal, |port, ctx, station| port.look(ctx, station));
        self.plan(now);
        self.is_plugged
    }

    fn control_changed(&self) -> bool {
        self.ends.iter().any(|end| end.port.has_changed())
    }

    fn next_time(&self) -> u64 {
        self.next
    }

    fn event(&mut self, world: &mut World) -> Option<SyncSignal> {
        let now = world.now;
        // Events on the line were due before the end of the microsecond. So they are handled before the
        // events of the ports.
        if !self.line_event(world) {
            let bits = self.rate.bits_at(now);
            for end in self.ends.iter_mut().filter(|end| end.is_on && end.port.next_time() <= now) {
                end.run(now, bits, world.journal, |port, ctx, station| port.due(ctx, station));
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

impl PortWatch for ProfibusBus {
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

impl BusGuests for ProfibusBus {
    fn guest_joins(&mut self, guest: u8, _: u64) -> bool {
        self.guests.join(guest)
    }

    fn guest_leaves(&mut self, guest: u8, now: u64) {
        self.receivers_of_traffic.set(guest, None);
        self.guests.leave(guest, self.rate.bits_at(now));
        self.plan(now);
    }

    fn guest_has_gone(&mut self, guest: u8, now: u64) {
        self.guests.give_up_later(guest, self.rate.bits_at(now));
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
        journal: &mut Journal,
    ) -> Result<(), GuestRefusal> {
        let taken = self.guests.enqueue(guest, message, self.rate.bits_at(now), self.rate);
        if let Err(GuestRefusal::TooFarAhead { seconds }) = taken {
            let value = u32::try_from(seconds).unwrap_or(u32::MAX);
            journal.find(now, Finding::at_bus(&rules::GUEST_TIME, self.index, guest, value));
        }
        self.plan(now);
        taken
    }
}

impl Faulty for ProfibusBus {
    /// Applies a fault that makes noise. All other faults are applied elsewhere: faults of telegrams when a
    /// telegram begins, and faults of ports in their devices.
    fn fire(&mut self, now: u64, target: Target, effect: &Effect) -> Option<Hit> {
        if let (Target::Bus(_), Some(faults::Effect::Noise(octets))) = (target, effect.get()) {
            self.make_noise(*octets, now);
            return Some(Hit::Plain);
        }
        let Target::Port { device: plc, port: node } = target else { return None };
        let end = self.ends.iter_mut().find(|end| end.origin == Origin { plc, node })?;
        let hit = end.port.fire(now, effect);
        self.plan(now);
        hit
    }
}

#[cfg(test)]
mod tests;
