//! Emulated CANsync intervals per second in stepped mode: drives at 500 kbit/s, both reference value and
//! both actual value channels busy in every interval. Also the cost of advancing the clock in parts, of a day without
//! activity, and of a snapshot.

#[path = "support/active.rs"]
mod active;
#[path = "support/line.rs"]
mod line;

use commram::plant::PlantConfig;
use criterion::{Criterion, SamplingMode, Throughput, criterion_group, criterion_main};
use line::{INTERVAL_US, active_plant, plant_of, release};
use std::time::Duration;

/// Value of the register when the firmware has taken a released frame.
const TAKEN: u8 = 0x04;
/// Value of the register when an actual value frame has arrived.
const RECEIVED: u8 = 0x02;

fn intervals(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("intervals");
    group.throughput(Throughput::Elements(1));
    for drives in [1, 3, 8, 16, 32] {
        let (mut plant, master) = active_plant(drives);
        let mut value = 0u32;
        group.bench_function(format!("{drives} drives, WRC1 RDC1 WRC2 RDC2"), |bencher| {
            bencher.iter(|| {
                value = value.wrapping_add(0x0001_0001);
                release(&master, value);
                plant.advance_to(plant.now() + INTERVAL_US);
            });
        });
        // The figure is valid only if all four frames are sent in every interval.
        for slave in &master.a_STATREG_RDC {
            slave.b_STATREG_RDC1.store(0);
            slave.b_STATREG_RDC2.store(0);
        }
        let written = plant.journal().written();
        for _ in 0..drives {
            release(&master, 0);
            plant.advance_to(plant.now() + INTERVAL_US);
            assert_eq!([&master.b_CTRLREG_WRC1, &master.b_CTRLREG_WRC2].map(|c| c.load()), [TAKEN; 2]);
        }
        assert!(plant.journal().written() - written >= 5 * u64::from(drives), "a SYNC edge and four frames");
        for slave in &master.a_STATREG_RDC[..usize::from(drives)] {
            assert_eq!([&slave.b_STATREG_RDC1, &slave.b_STATREG_RDC2].map(|c| c.load()), [RECEIVED; 2]);
        }
    }
    group.finish();
}

/// Advances the clock in one piece and in parts. The emulator uses parts so that a request does not keep other clients
/// waiting.
fn parts(criterion: &mut Criterion) {
    const LONG_US: u64 = 5_000_000;
    let mut group = criterion.benchmark_group("five seconds at work");
    group.sample_size(20);
    for (name, part_us) in [("in one go", LONG_US), ("in parts of 100 ms", 100_000)] {
        let (mut plant, _) = active_plant(3);
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                for _ in 0..LONG_US / part_us {
                    plant.advance_to(plant.now() + part_us);
                }
            });
        });
    }
    group.finish();
}

/// Advances the clock of the built-in plant after power-on in parts of a minute, as a request does. No program writes.
fn rest(criterion: &mut Criterion) {
    const MINUTE_US: u64 = 60_000_000;
    let mut group = criterion.benchmark_group("rest");
    group.sample_size(10).sampling_mode(SamplingMode::Flat).warm_up_time(Duration::from_millis(500));
    let config = PlantConfig::built_in().expect("the built-in plant is a good one");
    let mut plant = plant_of(&config);
    group.bench_function("24 h", |bencher| {
        bencher.iter(|| (0..24 * 60).for_each(|_| plant.advance_to(plant.now() + MINUTE_US)));
    });
    group.finish();
}

/// Measures a snapshot of an active plant, and its restoration.
fn snapshots(criterion: &mut Criterion) {
    let (mut plant, master) = active_plant(3);
    release(&master, 1);
    plant.advance_to(plant.now() + 10 * INTERVAL_US);
    let snapshot = plant.snapshot();
    assert!(snapshot.size() < 64 * 1024, "{} bytes", snapshot.size());
    let mut group = criterion.benchmark_group("snapshots");
    group.bench_function("save, 3 drives", |bencher| bencher.iter(|| plant.snapshot()));
    group.bench_function("go back, 3 drives", |bencher| bencher.iter(|| plant.go_back(&snapshot).unwrap()));
    group.finish();
}

criterion_group! {
    name = benches;
    // Plots need a font of the system.
    config = Criterion::default().without_plots();
    targets = intervals, parts, rest, snapshots
}
criterion_main!(benches);
