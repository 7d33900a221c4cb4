//! A bus between scripted ports: receivers and times of frames, to the nanosecond.

use super::records::{Lost, StateChange, Transmitted};
use super::{CanBus, CanBusConfig, CanPort, CanSocket, Controller, QueueFull};
use crate::can::{BitRate, ErrorState, Fate, Filter, Frame, Payload, wire};
use crate::devices::samples::tables::STATION;
use crate::devices::{Bus, BusView, Context, Faulty, StationState, World};
use crate::fault::{Effect, Faults, Hit, Target};
use crate::identity::{BusIndex, DeviceIndex, PortNumber};
use crate::journal::{Journal, Origin};
use crate::memory::{HEADER_SIZE, Segment};
use crate::snapshot_fields;
use crate::snapshot_fields::{Saved, Saving, SnapshotFields};
use embedded_can::StandardId;
use std::sync::{Arc, Mutex};

const MOST: usize = 4;

/// Reports of the ports. Each has the station, the time, the event and the first data byte.
type Log = Arc<Mutex<Vec<(u16, u64, &'static str, u8)>>>;

/// Filters of a port, and the frames that the port queues. The frames are in ascending order of their times.
type Script = (Vec<Filter>, Vec<(u64, Frame)>);

/// A port that sends frames at given times and notes what happens to them. The first data byte identifies a
/// frame.
struct Scripted {
    station: u16,
    log: Log,
    filters: Vec<Filter>,
    /// Times and frames to queue, ascending.
    script: Vec<(u64, Frame)>,
}

impl Scripted {
    fn note(&self, now: u64, what: &'static str, frame: &Frame) {
        self.log.lock().unwrap().push((self.station, now, what, frame.payload().data()[0]));
    }
}

snapshot_fields!(Scripted { built: station, log, filters, script });

impl CanPort for Scripted {
    fn power_on(&mut self, _: &mut Context, controller: &mut Controller, _: u8) {
        controller.set_filters(self.filters.iter().copied());
    }

    fn look(&mut self, _: &mut Context, _: &mut Controller) {}

    fn received(&mut self, ctx: &mut Context, _: &mut Controller, frame: &Frame) {
        self.note(ctx.now, "received", frame);
    }

    fn overrun(&mut self, ctx: &mut Context, _: &mut Controller, frame: &Frame) {
        self.note(ctx.now, "overrun", frame);
    }

    fn sent(&mut self, ctx: &mut Context, _: &mut Controller, frame: &Frame) {
        self.note(ctx.now, "sent", frame);
    }

    fn error_state(&mut self, ctx: &mut Context, controller: &mut Controller, state: ErrorState) {
        assert_eq!(state, controller.error_state());
        self.log.lock().unwrap().push((self.station, ctx.now, state.name(), 0));
        // Only the last port returns from BUS-off automatically.
        if self.station == 2 {
            controller.restart();
        }
    }

    fn next_time(&self) -> u64 {
        self.script.first().map_or(u64::MAX, |(at, _)| *at)
    }

    fn due(&mut self, _: &mut Context, controller: &mut Controller) {
        controller.send(self.script.remove(0).1).unwrap();
    }

    fn fire(&mut self, now: u64, effect: &Effect) -> Option<Hit> {
        let mark = *effect.get::<u8>()?;
        self.log.lock().unwrap().push((self.station, now, "struck", mark));
        Some(Hit::Plain)
    }
}

pub(super) fn frame(id: u16, mark: u8) -> Frame {
    Frame::standard(id, Payload::new(&[mark, 0x55]).unwrap())
}

pub(super) struct Bench {
    pub(super) bus: CanBus,
    pub(super) journal: Journal,
    pub(super) faults: Faults,
    log: Log,
}

impl Bench {
    /// Returns a bus at `bit_s` with ports that run these scripts. All ports are switched on.
    pub(super) fn new(bit_s: u32, scripts: Vec<Script>) -> Self {
        let rate = BitRate::new(bit_s).unwrap();
        let bus =
            CanBus::new(BusIndex(0), &CanBusConfig { name: "open".to_owned(), rate, doors: Vec::new() });
        Self::of(bus, scripts)
    }

    fn of(mut bus: CanBus, scripts: Vec<Script>) -> Self {
        assert!(scripts.len() <= MOST);
        let (log, mut journal) = (Log::default(), Journal::default());
        for (station, (filters, script)) in scripts.into_iter().enumerate() {
            let origin = Origin { plc: DeviceIndex(station as u16), node: PortNumber(1) };
            let port = Box::new(Scripted { station: origin.plc.0, log: log.clone(), filters, script });
            let segment = Segment::heap(2 * HEADER_SIZE);
            let socket = CanSocket { origin, segment, layout: &STATION, port };
            let place = bus.attach(Box::new(socket)).unwrap();
            assert!(bus.power_on(place, 0, 0, &mut journal));
        }
        Bench { bus, journal, faults: Faults::default(), log }
    }

    /// Runs all due events until `end`, as a plant does.
    pub(super) fn run(&mut self, end: u64) {
        let edges = &mut Vec::new();
        while self.bus.next_time() <= end {
            let now = self.bus.next_time();
            let (journal, faults) = (&mut self.journal, &mut self.faults);
            let signal = self.bus.event(&mut World { now, journal, faults, edges });
            assert_eq!(signal, None);
        }
    }

    /// Puts a station into BUS-off.
    fn switch_off(&mut self, station: usize, now: u64) {
        assert!(self.bus.switch_off(station));
        self.bus.settle(station, now * 1000);
        self.bus.plan(now);
    }

    /// Runs all events before `now`, then lets a port put a frame into its queue at `now`.
    pub(super) fn send(&mut self, station: usize, now: u64, frame: Frame) {
        self.run(now - 1);
        self.bus.run(station, now, &mut self.journal, |_, _, controller| controller.send(frame).unwrap());
        self.bus.plan(now);
    }

    /// Transmit and receive errors of the stations.
    pub(super) fn errors(&self) -> Vec<(u16, u16)> {
        let errors = |it: &StationState| (it.errors.transmit(), it.errors.receive());
        self.bus.stations().iter().map(errors).collect()
    }

    pub(super) fn log(&self) -> Vec<(u16, u64, &'static str, u8)> {
        core::mem::take(&mut self.log.lock().unwrap())
    }

    /// Returns times, frames and senders in the journal.
    pub(super) fn frames(&self) -> Vec<(u64, Frame, u16)> {
        let transmitted = |record: crate::journal::Record| {
            let it: Transmitted = record.event.get()?;
            Some((record.time_us, it.frame, it.sender.plc.0))
        };
        self.journal.records().filter_map(transmitted).collect()
    }

    pub(super) fn lost(&self) -> Vec<(u64, (Frame, Fate))> {
        let lost =
            |record: crate::journal::Record| record.event.get().map(|it: Lost| (record.time_us, it.frame));
        self.journal.records().filter_map(lost).collect()
    }
}

#[test]
fn a_frame_arrives_at_its_end_and_is_recorded_before_answers() {
    let it = frame(0x123, 7);
    let mut bench = Bench::new(125_000, vec![(vec![], vec![(500, it)]), (vec![], vec![])]);
    bench.run(1_000_000);
    let end = 500 + wire::airtime(&it, BitRate::new(125_000).unwrap()).delivery_ns / 1000;
    assert_eq!(bench.log(), [(0, end, "sent", 7), (1, end, "received", 7)]);
    assert_eq!(bench.frames(), [(end, it, 0)]);
    assert_eq!(bench.bus.next_time(), u64::MAX);
}

/// At 33.3 kbit/s no bit lasts a whole number of microseconds. If more than the journal rounded its times, a
/// hundred frames in a row would show this.
#[test]
fn times_on_the_wire_are_rounded_for_the_journal_only() {
    let rate = BitRate::new(33_300).unwrap();
    let script: Vec<_> = (0..60).map(|mark| (1, frame(0x100, mark))).collect();
    let mut bench = Bench::new(rate.bit_s(), vec![(vec![], script.clone()), (vec![], vec![])]);
    bench.run(10_000_000);
    let (mut begin_ns, mut expected) = (1000, Vec::new());
    for (_, it) in script {
        let airtime = wire::airtime(&it, rate);
        expected.push(((begin_ns + airtime.delivery_ns).div_ceil(1000), it, 0));
        begin_ns += airtime.occupation_ns;
    }
    assert_eq!(bench.frames(), expected);
}

#[test]
fn the_lower_identifier_goes_first_and_a_late_frame_waits() {
    let (low, high) = (frame(0x100, 1), frame(0x200, 2));
    let scripts = vec![(vec![], vec![(10, high)]), (vec![], vec![(10, low), (11, low)]), (vec![], vec![])];
    let mut bench = Bench::new(1_000_000, scripts);
    bench.run(9);
    assert_eq!(bench.bus.next_time(), 10);
    bench.run(100_000);
    // The firmware of the first port runs first. However, frames that are queued in the same microsecond take
    // part in the same arbitration.
    let order: Vec<_> =
        bench.frames().iter().map(|(_, it, sender)| (it.payload().data()[0], *sender)).collect();
    assert_eq!(order, [(1, 1), (1, 1), (2, 0)]);
}

/// The wire becomes free within a microsecond. A frame that is queued at the end of this microsecond is too
/// late for the arbitration.
#[test]
fn a_frame_takes_part_from_the_time_at_which_it_was_queued() {
    let rate = BitRate::new(666_600).unwrap();
    let (first, waiting, late) = (frame(0x300, 1), frame(0x200, 2), frame(0x100, 3));
    let free_ns = 10_000 + wire::airtime(&first, rate).occupation_ns;
    assert_ne!(free_ns % 1000, 0, "the test wants a time within a microsecond");
    let late_us = free_ns.div_ceil(1000);
    let scripts = |late_us| vec![(vec![], vec![(10, first), (20, waiting)]), (vec![], vec![(late_us, late)])];
    for (at_us, order) in [(late_us, [1, 2, 3]), (late_us - 1, [1, 3, 2])] {
        let mut bench = Bench::new(rate.bit_s(), scripts(at_us));
        bench.run(100_000);
        let marks: Vec<_> = bench.frames().iter().map(|(_, it, _)| it.payload().data()[0]).collect();
        assert_eq!(marks, order, "{at_us}");
    }
}

#[test]
fn filters_keep_frames_from_the_firmware() {
    let only = vec![Filter::exactly(StandardId::new(0x101).unwrap())];
    let script = vec![(1, frame(0x100, 1)), (2, frame(0x101, 2))];
    let mut bench = Bench::new(500_000, vec![(vec![], script), (only, vec![]), (vec![], vec![])]);
    bench.run(100_000);
    let heard = |station| {
        let log = bench.log.lock().unwrap();
        let of = log.iter().filter(|(port, _, what, _)| (*port, *what) == (station, "received"));
        of.map(|(.., mark)| *mark).collect::<Vec<_>>()
    };
    assert_eq!((heard(1), heard(2)), (vec![2], vec![1, 2]));
}

/// Decision D-350.
#[test]
fn a_station_alone_on_the_bus_becomes_passive_and_repeats_its_frame() {
    let (it, rate) = (frame(0x100, 1), BitRate::new(500_000).unwrap());
    let mut bench = Bench::new(rate.bit_s(), vec![(vec![], vec![(100, it)]), (vec![], vec![])]);
    bench.bus.power_off(1, 50, &mut bench.journal);
    bench.run(10_000);
    let to_flag = wire::bits_to_acknowledgement(&it) + 1;
    let round = to_flag + 6 + 8 + 3;
    let flag = |nth: u32| 100 + rate.time_ns((nth - 1) * round + to_flag) / 1000;
    assert_eq!(bench.log(), [(0, flag(12), "error_warning", 0), (0, flag(16), "error_passive", 0)]);
    // The journal has the frame once.
    assert_eq!((bench.frames(), bench.lost()), (vec![], vec![(flag(1), (it, Fate::NotAcknowledged))]));
    let changes = bench.journal.records().filter_map(|record| record.event.get::<StateChange>());
    assert_eq!(changes.map(|it| (it.transmit, it.receive)).collect::<Vec<_>>(), [(96, 0), (128, 0)]);
    // The error-passive station waits eight more bits between two attempts.
    let again = 100 + rate.time_ns(16 * round + 8) / 1000;
    let passive_round = rate.time_ns(round + 8) / 1000;
    let next = again + (20_000 - again).div_ceil(passive_round) * passive_round;
    bench.run(19_999);
    bench.bus.power_on(1, 0, 20_000, &mut bench.journal);
    bench.run(30_000);
    let end = next + wire::airtime(&it, rate).delivery_ns / 1000;
    assert_eq!(bench.frames(), [(end, it, 0)]);
    assert_eq!(bench.log(), [(0, end, "sent", 1), (1, end, "received", 1), (0, end, "error_warning", 0)]);
    assert_eq!(bench.bus.next_time(), u64::MAX);
}

#[test]
fn a_frame_whose_sender_goes_off_is_cut_off_even_if_it_comes_back() {
    let it = frame(0x100, 1);
    let mut bench = Bench::new(125_000, vec![(vec![], vec![(100, it)]), (vec![], vec![])]);
    bench.run(100);
    bench.bus.power_off(0, 110, &mut bench.journal);
    bench.bus.power_on(0, 0, 120, &mut bench.journal);
    bench.run(100_000);
    // When the sender is switched off, two recessive bits have begun. From then on the bus stays recessive.
    // After six recessive bits the receivers detect an error.
    let lost = (100 + 8 * 8, (it, Fate::SenderGone));
    assert_eq!((bench.frames(), bench.lost(), bench.log()), (vec![], vec![lost], vec![]));
    assert_eq!(bench.errors(), [(0, 0), (0, 1)]);
}

/// Returns a bus of 1 Mbit/s. Station 2 sends, and is BUS-off from 50 us on.
fn with_one_off(others: Vec<(u64, Frame)>) -> Bench {
    let scripts = vec![(vec![], others), (vec![], vec![]), (vec![], vec![(10, frame(0x100, 7))])];
    let mut bench = Bench::new(1_000_000, scripts);
    bench.run(50);
    bench.switch_off(2, 50);
    bench
}

#[test]
fn a_bus_off_station_returns_after_128_times_eleven_bits() {
    let mut bench = with_one_off(Vec::new());
    bench.run(100_000);
    // The sender is switched off during the frame, at 50 us. For the other stations the bus is then busy for
    // six more bits. The error flag and the rest of the frame do not count.
    let cut = 50 + 6;
    let back = cut + 6 + 128 * 11;
    let end = back + wire::airtime(&frame(0x100, 7), BitRate::new(1_000_000).unwrap()).delivery_ns / 1000;
    assert_eq!(bench.lost(), [(cut, (frame(0x100, 7), Fate::SenderGone))]);
    assert_eq!(
        bench.log(),
        [
            (2, 50, "bus_off", 0),
            (2, back, "error_active", 0),
            (0, end, "received", 7),
            (1, end, "received", 7),
            (2, end, "sent", 7)
        ]
    );
    assert_eq!(bench.errors(), [(0, 0); 3]);
}

/// Before the last bit of a frame, sender and receivers agree that it has not arrived (ISO 11898-1).
#[test]
fn only_in_its_last_bit_a_frame_arrives_without_its_sender() {
    let it = frame(0x100, 7);
    // A bit takes 8 us.
    let end = 10 + wire::airtime(&it, BitRate::new(125_000).unwrap()).delivery_ns / 1000;
    for before in [1, 7, 8, 9, 16, 40, 56, 64, 72, 80] {
        let mut bench =
            Bench::new(125_000, vec![(vec![], vec![]), (vec![], vec![]), (vec![], vec![(10, it)])]);
        bench.run(end - before);
        bench.switch_off(2, end - before);
        bench.run(100_000);
        let (log, lost) = (bench.log(), bench.lost().len());
        let count = |what: &str| log.iter().filter(|line| line.2 == what).count();
        let (received, sent) = (count("received"), count("sent"));
        let expected = if before < 8 { (4, 1, 0) } else { (2, 1, 1) };
        assert_eq!((received, sent, lost), expected, "{before} us before the end: {log:?}");
    }
}

#[test]
fn frames_of_others_delay_the_return() {
    let it = frame(0x200, 1);
    let bits = u64::from(wire::bits(&it));
    let mut bench = with_one_off((0..40).map(|_| (1000, it)).collect());
    bench.run(100_000);
    // 85 sequences of recessive bits pass before the frames, one at the end of each frame (its last eight
    // bits and the intermission), and three after the last frame.
    let before = (1000 - 62) / 11;
    let back = 1000 + 40 * bits + (128 - before - 40) * 11;
    let log = bench.log();
    assert!(log.contains(&(2, back, "error_active", 0)), "{back}: {log:?}");
}

#[test]
fn a_bus_off_station_without_a_restart_stays_off() {
    let mut bench = Bench::new(1_000_000, vec![(vec![], vec![(100, frame(0x100, 7))]), (vec![], vec![])]);
    bench.switch_off(0, 50);
    bench.run(1_000_000);
    assert_eq!((bench.log(), bench.frames()), (vec![(0, 50, "bus_off", 0)], vec![]));
    assert_eq!(bench.bus.stations().iter().map(|it| it.errors.state()).max(), Some(ErrorState::BusOff));
    // A station without power loses its error counters.
    bench.bus.power_off(0, 1_000_000, &mut bench.journal);
    bench.bus.power_on(0, 0, 1_000_000, &mut bench.journal);
    assert_eq!(bench.errors(), [(0, 0); 2]);
}

#[test]
fn a_station_that_joins_during_a_frame_misses_it() {
    let it = frame(0x100, 1);
    let scripts = vec![(vec![], vec![(100, it)]), (vec![], vec![]), (vec![], vec![])];
    let mut bench = Bench::new(125_000, scripts);
    bench.run(100);
    bench.bus.power_off(2, 110, &mut bench.journal);
    bench.bus.power_on(2, 0, 120, &mut bench.journal);
    bench.run(100_000);
    let heard: Vec<_> = bench.log().into_iter().map(|(station, _, what, _)| (station, what)).collect();
    assert_eq!(heard, [(0, "sent"), (1, "received")]);
}

#[test]
fn the_transmit_queue_is_limited() {
    let mut controller = Controller::default();
    for _ in 0..Controller::ROOM {
        assert_eq!(controller.send(frame(1, 1)), Ok(()));
    }
    assert_eq!((controller.send(frame(1, 1)), controller.to_send()), (Err(QueueFull), Controller::ROOM));
    assert_eq!(QueueFull.to_string(), "the transmit queue is full (64 frames)");
}

/// The firmware of a port may plan an event without a run of the port, because another port of its device has changed
/// their shared state. A bus learns of the event at the next run of the port, with or without a snapshot in between.
#[test]
fn a_restored_bus_knows_only_the_events_that_the_saved_bus_knew() {
    let mut saved = Saving::default();
    Bench::new(125_000, vec![(vec![], vec![]), (vec![], vec![])]).bus.save(&mut saved);
    let mut bench = Bench::new(125_000, vec![(vec![], vec![(500, frame(1, 1))]), (vec![], vec![])]);
    assert_eq!(bench.bus.next_time(), 500);
    bench.bus.restore(&mut Saved::new(saved.bytes())).unwrap();
    bench.bus.plan(600);
    assert_eq!(bench.bus.next_time(), u64::MAX);
    bench.bus.processor_cycle(0, 700, &mut bench.journal);
    assert_eq!(bench.bus.next_time(), 700);
}

#[test]
fn unplugged_ports_send_nothing() {
    let scripts = vec![(vec![], vec![]), (vec![], vec![])];
    let mut bench = Bench::of(CanBus::unplugged(), scripts);
    assert!(!bench.bus.processor_cycle(0, 10, &mut bench.journal));
    bench.run(1000);
    assert_eq!((bench.bus.next_time(), bench.frames()), (u64::MAX, vec![]));
}

#[test]
fn a_fault_of_a_port_reaches_its_own_firmware() {
    let mut bench = Bench::new(500_000, vec![(vec![], vec![]), (vec![], vec![])]);
    let port = |device, port| Target::Port { device, port: PortNumber(port) };
    assert_eq!(bench.bus.fire(7, port(DeviceIndex(1), 1), &Effect::new(9_u8)), Some(Hit::Plain));
    for target in [
        port(DeviceIndex(2), 1),
        port(DeviceIndex(1), 2),
        Target::Bus(BusIndex(0)),
        Target::Device(DeviceIndex(1)),
    ] {
        assert_eq!(bench.bus.fire(7, target, &Effect::new(9_u8)), None, "{target:?}");
    }
    assert_eq!(bench.bus.fire(7, port(DeviceIndex(1), 1), &Effect::new("another's")), None);
    assert_eq!(bench.log(), [(1, 7, "struck", 9)]);
}
