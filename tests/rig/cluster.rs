//! A cluster: a tree of PLCs. Each PLC is a slave on the bus above it and the master of its own bus. The lowest buses
//! have drives. Each PLC runs the same task in every interval: reference values go down, sums of actual values come up.

use super::bring_up::{Mode, Node, Stage, bring_up_in};
use super::{Memory, NodeDevice, Rate, segment};
use commram::devices::cansync::registers::{CANsync_MA_CTRL_BMSTRUCT, CANsync_SL_CTRL_BMSTRUCT};
use commram::identity::DeviceIndex;
use commram::memory::{Image, Segment, View};
use commram::plant::{Plant, PlantConfig};

/// Control registers of frames: released, taken over and sent, received, re-armed.
const RELEASED: u8 = 0x05;
const RECEIVED: u8 = 0x02;
const RE_ARMED: u8 = 0xFF;
/// Value of a slave number register for automatic counting.
const AUTOMATIC: u8 = 0x80;
/// Low and high word of value 0.
const LOW: u8 = 0x01;
const HIGH: u8 = 0x03;

/// The running cluster. PLC 0 is the top; children come after their parents.
pub(crate) struct Cluster {
    pub plant: Plant,
    pub rate: Rate,
    pub plcs: Vec<ClusterPlc>,
    _images: Vec<Image>,
}

/// A PLC of the cluster.
pub(crate) struct ClusterPlc {
    /// The slave node on the bus above; the top PLC has none.
    slave: Option<(View<CANsync_SL_CTRL_BMSTRUCT>, Node)>,
    /// Registers of the master of the PLC's own bus.
    pub master: View<CANsync_MA_CTRL_BMSTRUCT>,
    node: Node,
    /// Number of participants on the PLC's own bus. Their slave numbers begin at 0.
    pub children: usize,
}

/// Every test ends with a check of the access checker's findings: a cluster never violates the manual.
impl Drop for Cluster {
    fn drop(&mut self) {
        let errors = self.plant.journal().findings().errors();
        assert!(std::thread::panicking() || errors.is_empty(), "{errors:?}");
    }
}

impl Cluster {
    /// Creates a cluster. `widths[n]` is the number of participants on each bus of level n. The participants of the
    /// last level are drives.
    pub(crate) fn new(rate: Rate, widths: &[usize]) -> Cluster {
        Self::of(rate, plant_text(rate, widths), Memory::Heap)
    }

    /// Returns a cluster with `participants` participants, filled level by level: a bus gets stations when all buses
    /// before it are full.
    pub(crate) fn filled(rate: Rate, participants: usize, memory: Memory) -> Cluster {
        Self::of(rate, filled_text(rate, participants), memory)
    }

    fn of(rate: Rate, (text, children): (String, Vec<usize>), memory: Memory) -> Cluster {
        let config = PlantConfig::parse("rig", &text).unwrap();
        let mut images = Vec::new();
        let plant = Plant::new(&config, |plc, device| segment(memory, plc, device, &mut images)).unwrap();
        let plcs = plant.devices().iter().zip(children).enumerate();
        let plcs = plcs.map(|(index, (plc, children))| plc_of(rate, plc.segment(), index == 0, children));
        Cluster { plcs: plcs.collect(), plant, rate, _images: images }
    }

    /// Brings all PLCs together from restart to active operation; ends at a SYNC edge.
    pub(crate) fn activate(&mut self) {
        let nodes: Vec<&Node> = self.plcs.iter().flat_map(ClusterPlc::nodes).collect();
        bring_up_in(&mut self.plant, &nodes, ..=Stage::WaitingForStart);
        for plc in &self.plcs {
            plc.configure();
        }
        bring_up_in(&mut self.plant, &nodes, Stage::SetUp..=Stage::SetUp);
        // Within this time, all participants lock (see `NodeDevice::plc` and `plant_text`) and are polled.
        self.plant.advance_to(self.plant.now() + 100 * self.rate.interval_us);
        for plc in &self.plcs {
            let status = &plc.master.a_STAT_SL[..plc.children];
            assert!(status.iter().all(|slave| slave.load() == 0x03), "each responds and is synchronized");
        }
        bring_up_in(&mut self.plant, &nodes, Stage::Active..);
        self.run_to_sync();
    }

    pub(crate) fn run_to_sync(&mut self) {
        let edge = self.next_sync(0).expect("there is a SYNC signal");
        self.plant.advance_to(edge);
    }

    /// Returns the time of the next SYNC edge of a PLC's own bus.
    pub(crate) fn next_sync(&self, plc: usize) -> Option<u64> {
        self.plant.next_sync(DeviceIndex::at(plc), self.rate.kind.master.port)
    }

    /// Runs the task of all PLCs, then the rest of the interval. Call it at a SYNC edge.
    pub(crate) fn interval(&mut self) {
        self.interval_by(self.rate.interval_us);
    }

    /// Runs an interval in steps of `step_us` microseconds.
    pub(crate) fn interval_by(&mut self, step_us: u64) {
        self.plcs.iter().for_each(ClusterPlc::task);
        let end = self.plant.now() + self.rate.interval_us;
        while self.plant.now() < end {
            self.plant.advance_to(end.min(self.plant.now() + step_us));
        }
    }
}

impl ClusterPlc {
    fn nodes(&self) -> impl Iterator<Item = &Node> {
        self.slave.iter().map(|(_, node)| node).chain([&self.node])
    }

    fn configure(&self) {
        if let Some((slave, _)) = &self.slave {
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

    /// Runs the task of a PLC directly after the SYNC edge: first its slave side, then its master side (manual
    /// 5.00005.03a p. 132).
    fn task(&self) {
        if let Some((slave, _)) = &self.slave {
            if slave.b_CTRLREG_WRC1.load() == RECEIVED {
                self.master.a_WR_VALUE[0].store(slave.a_WR_VALUE_RECEIVE[0].load());
                slave.b_CTRLREG_WRC1.store(RE_ARMED);
            }
            slave.a_RD_VALUE_SEND[0].store(self.sum());
            slave.b_CTRLREG_RD_RDC1.store(RELEASED);
        }
        self.master.b_CTRLREG_WRC1.store(RELEASED);
    }

    /// Returns the sum of the values that all participants below this PLC report.
    pub(crate) fn sum(&self) -> u32 {
        let values = &self.master.a_RD_BMARRAY[..self.children];
        values.iter().fold(0, |sum: u32, values| sum.wrapping_add(values[0].load()))
    }
}

fn plc_of(rate: Rate, segment: &Segment, is_top: bool, children: usize) -> ClusterPlc {
    let Rate { timing, kind: NodeDevice { master, slave, .. }, .. } = rate;
    let own = if is_top { Mode::Master } else { Mode::SyncIn };
    let above = || {
        let regs = segment.view(slave.base).expect("the slave is there");
        (regs, Node::at(segment, slave.base, timing, Mode::Slave))
    };
    ClusterPlc {
        slave: (!is_top).then(above),
        master: segment.view(master.base).expect("the master is there"),
        node: Node::at(segment, master.base, timing, own).expecting(0..children),
        children,
    }
}

/// Returns the plant file, and the number of participants on each PLC's bus.
fn plant_text(rate: Rate, widths: &[usize]) -> (String, Vec<usize>) {
    let (mut plcs, mut buses, mut children) = (String::new(), String::new(), Vec::new());
    // Bus on which the PLCs of a level are slaves, and the number of these PLCs.
    let mut level = vec![(None, 1)];
    for (depth, below) in widths.iter().enumerate() {
        let mut next = Vec::new();
        for (above, plc_count) in level {
            for dip in 0..plc_count {
                let name = format!("p{}", children.len());
                plcs += &rate.kind.plc(&name, dip as u8, above.as_deref(), Some(&name));
                let mut drives = String::new();
                if depth + 1 == widths.len() {
                    drives = (0..*below).map(|number| drive_text(&name, number)).collect();
                }
                buses += &rate.bus(&name, &drives);
                children.push(*below);
                next.push((Some(name), *below));
            }
        }
        level = next;
    }
    (plcs + &buses, children)
}

fn drive_text(bus: &str, number: usize) -> String {
    format!("[[bus.drive]]\nname = '{bus}-{number}'\nslave_number = {number}\nlock_time_us = 20000\n")
}

/// Does the same as [`plant_text`], with 32 participants on each bus except the last one. The first participants are
/// PLCs, one for each further bus.
fn filled_text(rate: Rate, participants: usize) -> (String, Vec<usize>) {
    const MOST: usize = 32;
    let below = participants - 1;
    let plc_count = below.div_ceil(MOST);
    let (mut plcs, mut buses, mut children) = (String::new(), String::new(), Vec::new());
    for plc in 0..plc_count {
        let above = (plc > 0).then(|| (plc - 1) / MOST).map(|above| format!("p{above}"));
        let (name, dip) = (format!("p{plc}"), plc.saturating_sub(1) % MOST);
        plcs += &rate.kind.plc(&name, dip as u8, above.as_deref(), Some(&name));
        let first = plc * MOST;
        let own = MOST.min(below - first);
        let first_drive = (plc_count - 1).saturating_sub(first).min(own);
        let drives: String = (first_drive..own).map(|number| drive_text(&name, number)).collect();
        buses += &rate.bus(&name, &drives);
        children.push(own);
    }
    (plcs + &buses, children)
}
