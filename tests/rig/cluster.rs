//! A cluster: a tree of PLCs, each slave on the bus above it and master of a bus of its own, drives on the
//! lowest buses. Each PLC runs the same task in every interval: reference values go down, sums of actual
//! values come up.

use commram::devices::omega_drive_line_2::registers::*;
use commram::memory::{MemoryError, Segment, View};
use commram::plant::{Plant, PlantConfig, PlantError};
use std::fmt::Write;

/// Length of an interval at 500 kbit/s.
pub(crate) const INTERVAL_US: u64 = 2000;
/// `b_MA_SL_MODE`: a master with SYNC of its own, a slave, a master that takes its SYNC over (D-12).
const OWN_SYNC: u8 = 0x00;
const SLAVE: u8 = 0x01;
const TAKES_SYNC: u8 = 0x02;
/// Control registers of frames: released, taken over and sent, received, re-armed.
const RELEASED: u8 = 0x05;
const RECEIVED: u8 = 0x02;
const RE_ARMED: u8 = 0xFF;
/// A slave number register that counts by itself.
const AUTOMATIC: u8 = 0x80;
/// Low and high word of value 0.
const LOW: u8 = 0x01;
const HIGH: u8 = 0x03;

/// The running cluster. PLC 0 is the top; children come after their parents.
pub(crate) struct Cluster {
    pub plant: Plant,
    pub plcs: Vec<ClusterPlc>,
}

/// A PLC of the cluster.
pub(crate) struct ClusterPlc {
    /// Node 1; none at the top.
    slave: Option<View<CANsync_SL_CTRL_BMSTRUCT>>,
    /// Node 2.
    pub master: View<CANsync_MA_CTRL_BMSTRUCT>,
    inits: Vec<(View<CANsync_INIT_BMSTRUCT>, u8)>,
    /// Participants on the bus of node 2; they have the numbers from 0 on.
    pub children: usize,
}

#[derive(Debug, thiserror::Error)]
#[error(transparent)]
enum Failed {
    Memory(#[from] MemoryError),
    Plant(#[from] PlantError),
}

/// Every test ends with a look at what the access checker has found: a cluster does nothing against the manual.
impl Drop for Cluster {
    fn drop(&mut self) {
        let errors = self.plant.journal().findings().errors();
        assert!(std::thread::panicking() || errors.is_empty(), "{errors:?}");
    }
}

impl Cluster {
    /// `widths[n]`: participants on each bus of level n; those of the last level are drives.
    pub(crate) fn new(widths: &[usize]) -> Cluster {
        let (text, children) = plant_text(widths);
        let config = PlantConfig::parse("cluster", &text).expect("the plant is a good one");
        let plant = Plant::new(&config, |_plc, device| Ok::<_, Failed>(Segment::of(device)))
            .expect("it can be built");
        let plcs = plant.devices().iter().zip(children).enumerate();
        let plcs = plcs.map(|(index, (plc, children))| plc_of(plc.segment(), index == 0, children));
        Cluster { plcs: plcs.collect(), plant }
    }

    /// From restart to active operation, all PLCs level with each other; ends at a SYNC edge.
    pub(crate) fn activate(&mut self) {
        self.command(0x0000, [0x0001; 2]);
        self.command(0x0001, [0x0002; 2]);
        for plc in &self.plcs {
            for (init, mode) in &plc.inits {
                write_init_data(init, *mode, plc.children);
            }
        }
        self.command(0x0002, [0x0003; 2]);
        for plc in &self.plcs {
            plc.configure();
        }
        self.command(0x0020, [0x0013, 0x0043]);
        // All participants lock within this time, see `plant_text`, and have been polled.
        self.plant.advance_to(self.plant.now() + 200_000);
        for plc in &self.plcs {
            let status = &plc.master.a_STAT_SL[..plc.children];
            assert!(status.iter().all(|slave| slave.load() == 0x03), "each responds and is synchronized");
        }
        self.command(0x0040, [0x0020, 0x0080]);
        self.run_to_sync();
    }

    /// Writes `value` to all nodes' `w_CPU_CONTROL` and expects `[slaves', masters']` `w_OPTION_STATUS`.
    fn command(&mut self, value: u16, expected: [u16; 2]) {
        let nodes = || self.plcs.iter().flat_map(|plc| &plc.inits);
        nodes().for_each(|(init, _)| init.w_CPU_CONTROL.store(value));
        self.plant.advance_to(self.plant.now() + 1000);
        for (init, mode) in nodes() {
            assert_eq!(init.w_OPTION_STATUS.load(), expected[usize::from(*mode != SLAVE)]);
        }
    }

    pub(crate) fn run_to_sync(&mut self) {
        let edge = self.plant.next_sync(0, 2).expect("there is a SYNC signal");
        self.plant.advance_to(edge);
    }

    /// The task of all PLCs, then the rest of the interval. Call it at a SYNC edge.
    pub(crate) fn interval(&mut self) {
        self.plcs.iter().for_each(ClusterPlc::task);
        self.plant.advance_to(self.plant.now() + INTERVAL_US);
    }
}

impl ClusterPlc {
    fn configure(&self) {
        if let Some(slave) = &self.slave {
            slave._CFG_WRC_WORD.b_CFG_WRC1_WORD0.store(LOW);
            slave._CFG_WRC_WORD.b_CFG_WRC1_WORD1.store(HIGH);
            slave._CFG_RDC_WORD.b_CFG_RDC1_WORD0.store(LOW);
            slave._CFG_RDC_WORD.b_CFG_RDC1_WORD1.store(HIGH);
        }
        let master = &self.master;
        master._CFG_WRC_WORD.b_CFG_WRC1_WORD0.store(LOW);
        master._CFG_WRC_WORD.b_CFG_WRC1_WORD1.store(HIGH);
        for slave in &master.a_CFG_RDC_WORD[..self.children] {
            slave.b_CFG_RDC1_WORD0.store(LOW);
            slave.b_CFG_RDC1_WORD1.store(HIGH);
        }
        master.b_MAX_SL_NR.store(self.children as u8 - 1);
        master.b_CTRLREG_RD_ORDER_RDC1.store(AUTOMATIC);
    }

    /// Slave side before master side, right after the SYNC edge (manual 5.00005.03a p. 132).
    fn task(&self) {
        if let Some(slave) = &self.slave {
            if slave.b_CTRLREG_WRC1.load() == RECEIVED {
                self.master.a_WR_VALUE[0].store(slave.a_WR_VALUE_RECEIVE[0].load());
                slave.b_CTRLREG_WRC1.store(RE_ARMED);
            }
            slave.a_RD_VALUE_SEND[0].store(self.sum());
            slave.b_CTRLREG_RD_RDC1.store(RELEASED);
        }
        self.master.b_CTRLREG_WRC1.store(RELEASED);
    }

    /// What all participants below this PLC report.
    pub(crate) fn sum(&self) -> u32 {
        let values = &self.master.a_RD_BMARRAY[..self.children];
        values.iter().fold(0, |sum: u32, values| sum.wrapping_add(values[0].load()))
    }
}

fn plc_of(segment: &Segment, is_top: bool, children: usize) -> ClusterPlc {
    let init = |node| segment.view(node).expect("the node is there");
    let inits = match is_top {
        true => vec![(init(NODE2), OWN_SYNC)],
        false => vec![(init(NODE1), SLAVE), (init(NODE2), TAKES_SYNC)],
    };
    ClusterPlc {
        slave: (!is_top).then(|| segment.view(NODE1).expect("node 1 is there")),
        master: segment.view(NODE2).expect("node 2 is there"),
        inits,
        children,
    }
}

fn write_init_data(init: &CANsync_INIT_BMSTRUCT, mode: u8, children: usize) {
    init.b_MA_SL_MODE.store(mode);
    init.b_AC.store(0xFF);
    init.b_AM.store(0xFF);
    init.b_BT_1.store(0x1C);
    init.b_OUTPUT_CONTROL.store(0xFA);
    init.b_CLOCK_DIVIDER.store(0x07);
    init.b_TIME_PATTERN.store((INTERVAL_US / 1000) as u8);
    if mode != SLAVE {
        init.a_SL_TYP[..children].iter().for_each(|slave| slave.store(1));
    }
}

/// The plant file, and the number of participants on each PLC's bus.
fn plant_text(widths: &[usize]) -> (String, Vec<usize>) {
    let (mut plcs, mut buses, mut children) = (String::new(), String::new(), Vec::new());
    // Bus on which the PLCs of a level are slaves, and how many they are.
    let mut level = vec![(None, 1)];
    for (depth, below) in widths.iter().enumerate() {
        let mut next = Vec::new();
        for (above, plc_count) in level {
            for dip in 0..plc_count {
                let name = format!("p{}", children.len());
                let _ = writeln!(plcs, "[[plc]]\nname = '{name}'\ndip = {dip}\nnode2 = '{name}'");
                if let Some(above) = &above {
                    let _ = writeln!(plcs, "node1 = '{above}'\nlock_time_us = 20000");
                }
                let _ = writeln!(buses, "[[bus]]\nname = '{name}'");
                if depth + 1 == widths.len() {
                    for number in 0..*below {
                        let _ = writeln!(
                            buses,
                            "[[bus.drive]]\nname = '{name}-{number}'\nslave_number = {number}\nlock_time_us = 20000"
                        );
                    }
                }
                children.push(*below);
                next.push((Some(name), *below));
            }
        }
        level = next;
    }
    (plcs + &buses, children)
}
