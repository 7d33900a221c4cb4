//! Emulated CANsync intervals per second in stepped mode: 32 drives at 500 kbit/s, both reference value
//! and both actual value channels busy in every interval.

use commram::layout::omega_drive_line_2::{CANsync_INIT_BMSTRUCT, CANsync_MA_CTRL_BMSTRUCT, NODE2};
use commram::memory::{Segment, View};
use commram::plant::{Plant, PlantConfig, PlantError};
use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::fmt::Write;

const INTERVAL_US: u64 = 2000;

#[derive(Debug)]
struct Failed(#[expect(dead_code, reason = "shown by Debug")] String);

impl From<PlantError> for Failed {
    fn from(error: PlantError) -> Self {
        Failed(error.to_string())
    }
}

impl From<commram::memory::MemoryError> for Failed {
    fn from(error: commram::memory::MemoryError) -> Self {
        Failed(error.to_string())
    }
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
    let init = segment.view::<CANsync_INIT_BMSTRUCT>(NODE2).expect("node 2 is there");
    let master = segment.view::<CANsync_MA_CTRL_BMSTRUCT>(NODE2).expect("node 2 is there");

    init.w_CPU_CONTROL.store(0x0001);
    plant.advance_to(plant.now() + 1000);
    init.b_BT_1.store(0x1C);
    init.b_TIME_PATTERN.store(2);
    init.b_AC.store(0xFF);
    init.b_AM.store(0xFF);
    init.a_SL_TYP.iter().for_each(|cell| cell.store(1));
    for command in [0x0002, 0x0020] {
        init.w_CPU_CONTROL.store(command);
        plant.advance_to(plant.now() + 1000);
    }
    let cfg = &master._CFG_WRC_WORD;
    for (cell, byte) in [
        (&cfg.b_CFG_WRC1_WORD0, 0x01),
        (&cfg.b_CFG_WRC1_WORD1, 0x03),
        (&cfg.b_CFG_WRC1_WORD2, 0x05),
        (&cfg.b_CFG_WRC1_WORD3, 0x07),
        (&cfg.b_CFG_WRC2_WORD0, 0x11),
        (&cfg.b_CFG_WRC2_WORD1, 0x13),
        (&cfg.b_CFG_WRC2_WORD2, 0x15),
        (&cfg.b_CFG_WRC2_WORD3, 0x17),
    ] {
        cell.store(byte);
    }
    for slave in &master.a_CFG_RDC_WORD {
        slave.b_CFG_RDC1_WORD0.store(0x01);
        slave.b_CFG_RDC1_WORD1.store(0x03);
        slave.b_CFG_RDC2_WORD0.store(0x11);
        slave.b_CFG_RDC2_WORD1.store(0x13);
    }
    master.b_MAX_SL_NR.store(31);
    master.b_CTRLREG_RD_ORDER_RDC1.store(0x80);
    master.b_CTRLREG_RD_ORDER_RDC2.store(0x80);
    // Let all drives lock, then enable.
    plant.advance_to(plant.now() + 2_000_000);
    init.w_CPU_CONTROL.store(0x0040);
    plant.advance_to(plant.now() + 1000);
    assert_eq!(init.w_OPTION_STATUS.load(), 0x0080, "the master is active");
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
                master.b_CTRLREG_WRC1.store(0x05);
                master.b_CTRLREG_WRC2.store(0x05);
                plant.advance_to(plant.now() + INTERVAL_US);
            });
        });
        // The figure counts only if all four frames went out in every interval.
        assert_eq!(master.b_CTRLREG_WRC1.load(), 0x04);
        assert_eq!(master.b_CTRLREG_WRC2.load(), 0x04);
        assert_ne!(master.a_STATREG_RDC[drives as usize - 1].b_STATREG_RDC2.load(), 0);
    }
    group.finish();
}

criterion_group!(benches, intervals);
criterion_main!(benches);
