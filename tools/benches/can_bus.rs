//! A CAN bus of 1 Mbit/s: 127 stations with acceptance filters send frames of eight bytes, at 80 % load. For
//! comparison, 8 stations send the same number of frames. The benchmark measures the bus as a plant runs it, with
//! journal, filters, controllers and error counters; the firmware of its stations only counts the frames that it
//! receives.

use commram::can::{BitRate, Filter, Frame, Payload, StandardId};
use commram::devices::can_bus::{CanBus, CanBusConfig, CanPort, CanSocket, Controller};
use commram::devices::cs0015::registers::DEVICE;
use commram::devices::{Bus, Context, World};
use commram::fault::Faults;
use commram::identity::{BusIndex, DeviceIndex, PortNumber};
use commram::journal::{Journal, Origin};
use commram::memory::Segment;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::hint::black_box;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Number of frames per second, for all stations together.
const FRAMES: u64 = 6_400;
/// Emulated time of one measurement, in us.
const PIECE_US: u64 = 100_000;

/// Frames that a station sends, and frames that it receives from others.
struct Station {
    frame_id: u16,
    takes: Vec<u16>,
    next_us: u64,
    period_us: u64,
    count: u64,
    received: Arc<AtomicU64>,
}

commram::snapshot_fields!(Station { built: frame_id, takes, next_us, period_us, count, received });

impl CanPort for Station {
    fn power_on(&mut self, _: &mut Context, controller: &mut Controller, _: u8) {
        let ids = self.takes.iter().filter_map(|id| StandardId::new(*id));
        controller.set_filters(ids.map(Filter::exactly));
    }

    fn look(&mut self, _: &mut Context, _: &mut Controller) {}

    fn received(&mut self, _: &mut Context, _: &mut Controller, frame: &Frame) {
        black_box(frame);
        self.received.fetch_add(1, Ordering::Relaxed);
    }

    fn next_time(&self) -> u64 {
        self.next_us
    }

    fn due(&mut self, _: &mut Context, controller: &mut Controller) {
        self.count += 1;
        let data = Payload::from_padded((self.count * 0x0101_0301).to_le_bytes(), 8);
        controller.send(Frame::standard(self.frame_id, data)).expect("the bus takes them in time");
        self.next_us += self.period_us;
    }
}

struct Bench {
    bus: CanBus,
    journal: Journal,
    faults: Faults,
    now: u64,
    received: Arc<AtomicU64>,
}

impl Bench {
    /// Makes a bus with `count` stations. Each receives its neighbour's frames and the frames that every CANopen node
    /// receives.
    fn new(count: u16) -> Self {
        let rate = BitRate::new(1_000_000).expect("not 0");
        let mut bus =
            CanBus::new(BusIndex(0), &CanBusConfig { name: "open".to_owned(), rate, doors: Vec::new() });
        let (mut journal, received) = (Journal::default(), Arc::default());
        for number in 0..count {
            let takes = [0, 0x80, 0x180 + (number + 1) % count, 0x200 + number, 0x600 + number];
            let period_us = u64::from(count) * 1_000_000 / FRAMES;
            let station = Station {
                frame_id: 0x180 + number,
                takes: takes.to_vec(),
                next_us: 1 + u64::from(number) * 1_000_000 / FRAMES,
                period_us,
                count: 0,
                received: Arc::clone(&received),
            };
            let origin = Origin { plc: DeviceIndex(number), node: PortNumber(1) };
            let segment = Segment::of(&DEVICE);
            let socket = CanSocket { origin, segment, layout: &DEVICE, port: Box::new(station) };
            let place = bus.attach(Box::new(socket)).expect("a CAN port fits");
            bus.power_on(place, 0, 0, &mut journal);
        }
        Bench { bus, journal, faults: Faults::default(), now: 0, received }
    }

    /// Executes all events up to a time, in the same way as a plant.
    fn piece(&mut self) {
        self.now += PIECE_US;
        let edges = &mut Vec::new();
        loop {
            let now = self.bus.next_time();
            if now > self.now {
                return;
            }
            self.bus.event(&mut World { now, journal: &mut self.journal, faults: &mut self.faults, edges });
        }
    }
}

fn can_bus(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("can_bus");
    group.throughput(Throughput::Elements(FRAMES * PIECE_US / 1_000_000));
    for count in [8, 127] {
        let mut bench = Bench::new(count);
        group.bench_function(format!("100 ms, {count} stations"), |bencher| bencher.iter(|| bench.piece()));
        // The figure is valid only if the stations have sent this number of frames, and each frame has reached its one
        // receiver.
        let before = bench.received.load(Ordering::Relaxed);
        (0..10).for_each(|_| bench.piece());
        let frames = bench.received.load(Ordering::Relaxed) - before;
        assert!((FRAMES - 60..FRAMES + 60).contains(&frames), "{frames} frames in a second");
    }
    group.finish();
}

criterion_group! {
    name = benches;
    // Plots need a font of the system.
    config = Criterion::default().without_plots();
    targets = can_bus
}
criterion_main!(benches);
