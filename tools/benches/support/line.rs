//! One PLC with its drives on a bus at 500 kbit/s, and the writes of its program in each interval.

use crate::active::activate;
use commram::devices::omega_drive_line_2::registers::CANsync_MA_CTRL_BMSTRUCT;
use commram::identity::{DeviceIndex, PortNumber};
use commram::memory::{MemoryError, Segment, View};
use commram::plant::{Plant, PlantConfig, PlantError};
use std::fmt::Write;

/// Length of an interval at 500 kbit/s.
pub(crate) const INTERVAL_US: u64 = 2000;
/// Value of the register that releases a reference value frame.
const RELEASED: u8 = 0x05;

#[derive(Debug, thiserror::Error)]
#[error(transparent)]
enum LineError {
    Memory(#[from] MemoryError),
    Plant(#[from] PlantError),
}

/// Makes the plant, with its images in memory of this process.
pub(crate) fn plant_of(config: &PlantConfig) -> Plant {
    Plant::new(config, |_plc, device| Ok::<_, LineError>(Segment::of(device)))
        .expect("the plant can be built")
}

/// Returns a plant with `drives` drives in active operation, at a SYNC edge.
pub(crate) fn active_plant(drives: u8) -> (Plant, View<CANsync_MA_CTRL_BMSTRUCT>) {
    let mut text = "[[plc]]\nname = 'line'\nnode2 = 'bus'\n[[bus]]\nname = 'bus'\n".to_owned();
    for number in 0..drives {
        let _ = writeln!(text, "[[bus.drive]]\nname = 'drive{number}'\nslave_number = {number}");
    }
    let config = PlantConfig::parse("bench", &text).expect("the plant is a good one");
    let mut plant = plant_of(&config);
    let segment = plant.devices()[0].segment().clone();
    let master = activate(&segment, 0..=drives - 1, |us| plant.advance_to(plant.now() + us));
    let edge = plant.next_sync(DeviceIndex(0), PortNumber(2)).expect("SYNC runs");
    plant.advance_to(edge);
    (plant, master)
}

/// Writes new reference values and releases both frames.
pub(crate) fn release(master: &View<CANsync_MA_CTRL_BMSTRUCT>, value: u32) {
    master.a_WR_VALUE[0].store(value);
    master.a_WR_VALUE[1].store(!value);
    master.a_WR_VALUE[4].store(value);
    master.b_CTRLREG_WRC1.store(RELEASED);
    master.b_CTRLREG_WRC2.store(RELEASED);
}
