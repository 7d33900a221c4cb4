//! Emulated CANsync intervals per second in stepped mode: drives at 500 kbit/s, both reference value and
//! both actual value channels busy in every interval.

#[path = "support/active.rs"]
mod active;

use active::activate;
use commram::layout::omega_drive_line_2::CANsync_MA_CTRL_BMSTRUCT;
use commram::memory::{MemoryError, Segment, View};
use commram::plant::{Plant, PlantConfig, PlantError};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::fmt::Write;

const INTERVAL_US: u64 = 2000;
/// A reference value frame is released, and has been taken.
const RELEASED: u8 = 0x05;
const TAKEN: u8 = 0x04;
/// An actual value frame has arrived.
const RECEIVED: u8 = 0x02;

#[derive(Debug, thiserror::Error)]
#[error(transparent)]
enum Failed {
    Memory(#[from] MemoryError),
    Plant(#[from] PlantError),
}

/// A plant with `drives` drives in active operation, at a SYNC edge.
fn active_plant(drives: u8) -> (Plant, View<CANsync_MA_CTRL_BMSTRUCT>) {
    let mut text = "[[plc]]\nname = 'line'\nnode2 = 'bus'\n[[bus]]\nname = 'bus'\n".to_owned();
    for number in 0..drives {
        let _ = writeln!(text, "[[bus.drive]]\nname = 'drive{number}'\nslave_number = {number}");
    }
    let config = PlantConfig::parse("bench", &text).expect("the plant is a good one");
    let mut plant =
        Plant::new(&config, |_| Ok::<_, Failed>(Segment::heap())).expect("the plant can be built");
    let segment = plant.plcs()[0].segment().clone();
    let master = activate(&segment, 0..=drives - 1, |us| plant.advance_to(plant.now() + us));
    let edge = plant.next_sync(0, 2).expect("SYNC runs");
    plant.advance_to(edge);
    (plant, master)
}

fn intervals(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("intervals");
    group.throughput(Throughput::Elements(1));
    for drives in [3, 32] {
        let (mut plant, master) = active_plant(drives);
        let mut value = 0u32;
        group.bench_function(format!("{drives} drives, WRC1 RDC1 WRC2 RDC2"), |bencher| {
            bencher.iter(|| {
                value = value.wrapping_add(0x0001_0001);
                master.a_WR_VALUE[0].store(value);
                master.a_WR_VALUE[1].store(!value);
                master.a_WR_VALUE[4].store(value);
                master.b_CTRLREG_WRC1.store(RELEASED);
                master.b_CTRLREG_WRC2.store(RELEASED);
                plant.advance_to(plant.now() + INTERVAL_US);
            });
        });
        // The figure counts only if all four frames go out in every interval.
        for slave in &master.a_STATREG_RDC {
            slave.b_STATREG_RDC1.store(0);
            slave.b_STATREG_RDC2.store(0);
        }
        let written = plant.journal().written();
        for _ in 0..drives {
            master.b_CTRLREG_WRC1.store(RELEASED);
            master.b_CTRLREG_WRC2.store(RELEASED);
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

criterion_group!(benches, intervals);
criterion_main!(benches);
