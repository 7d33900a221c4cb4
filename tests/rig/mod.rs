//! A plant under test: PLC `a` is the master of a bus. PLC `b`, a device of the same kind, is slave 0. If a test needs
//! drives, they are slaves 1 to 3.

#![allow(dead_code, reason = "each test binary uses its own part of the rig")]

pub(crate) mod bench;
pub(crate) mod bring_up;
pub(crate) mod cluster;
mod kinds;

use bring_up::{Mode, Node, Stage, bring_up_in};
use commram::devices::cansync::frames::Frame;
use commram::devices::cansync::records::Transmitted;
use commram::devices::cansync::registers::{
    CANsync_INIT_BMSTRUCT, CANsync_MA_CTRL_BMSTRUCT, CANsync_SL_CTRL_BMSTRUCT,
};
use commram::devices::fault_kinds;
use commram::fault::FaultSpec;
use commram::identity::DeviceIndex;
use commram::journal::{Record, Rule, Severity};
use commram::layout::DeviceFit;
use commram::memory::{ClockMode, Image, ImageSpec, Segment, View};
use commram::plant::{Plant, PlantConfig, PlantError};
#[allow(unused_imports, reason = "each test binary uses its own part of the rig")]
pub(crate) use kinds::{FASTEST, NodeDevice, NodePlace, OMEGA_RATES, RATES, Rate};
use std::ops::RangeBounds;
use std::sync::atomic::{AtomicU32, Ordering};

/// Adds a fault that begins now; returns its number. `fields` are words as on the command line.
pub(crate) fn add_fault(plant: &mut Plant, kind: &str, fields: &[&str]) -> u16 {
    let spec = FaultSpec::from_words(fault_kinds(), kind, fields).unwrap();
    let fault = spec.resolve(fault_kinds(), &plant.names()).unwrap();
    plant.add_fault(fault).unwrap()
}

/// Returns the value of a parameter of a drive.
pub(crate) fn drive_parameter(plant: &Plant, drive: usize, number: u16) -> i64 {
    let details = plant.drive(drive).unwrap();
    details.parameters.iter().find(|it| it.number == number).unwrap().value
}

/// Kind of memory in which the plant has its RAM.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Memory {
    /// Heap memory of this process.
    Heap,
    /// Image files in shared memory.
    Mapped,
}

/// Both kinds of memory: a test that goes through this list runs with both.
pub(crate) const BOTH: [Memory; 2] = [Memory::Heap, Memory::Mapped];

pub(crate) struct Rig {
    pub plant: Plant,
    pub rate: Rate,
    /// Place of the master of PLC `a`.
    pub master_at: NodePlace,
    /// Place of the slave of PLC `b`.
    pub slave_at: NodePlace,
    pub master: View<CANsync_MA_CTRL_BMSTRUCT>,
    pub master_init: View<CANsync_INIT_BMSTRUCT>,
    pub slave: View<CANsync_SL_CTRL_BMSTRUCT>,
    pub slave_init: View<CANsync_INIT_BMSTRUCT>,
    /// Errors that the access checker must find in this test; any other error, or a missing error, fails the test.
    expected: Vec<&'static Rule>,
    /// Errors that the access checker may find in addition.
    tolerated: Vec<&'static Rule>,
    _images: Vec<Image>,
}

/// Every test ends with a check of the access checker's findings.
impl Drop for Rig {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("this was {:?}", self.rate);
            return;
        }
        let findings = self.plant.journal().findings();
        let mut errors = findings.errors();
        errors.retain(|rule| !self.tolerated.contains(rule));
        let wrong = errors != self.expected;
        let name = |entry: &commram::journal::Entry| entry.last.name(self.fitted(entry.last.plc));
        let all: String =
            findings.iter().map(|entry| format!("{:?} {}\n", name(entry), self.describe(entry))).collect();
        assert!(!wrong, "{:?}: expected {:?}, found\n{all}", self.rate, self.expected);
    }
}

impl Rig {
    fn describe(&self, entry: &commram::journal::Entry) -> String {
        let value = entry.last.value_text(self.fitted(entry.last.plc));
        format!("{} {value} x {}", entry.last.rule, entry.count)
    }

    /// Returns the device of a PLC, with its options.
    pub(crate) fn fitted(&self, plc: DeviceIndex) -> DeviceFit {
        self.plant.names().fitted(plc)
    }

    /// Names errors that the access checker may find, because the test is about something else.
    pub(crate) fn tolerate_errors(&mut self, rules: &[&'static Rule]) {
        self.tolerated = rules.to_vec();
    }

    /// Names the errors that the access checker must find in this test. Warnings are ignored.
    pub(crate) fn expect_errors(&mut self, rules: &[&'static Rule]) {
        self.expected =
            commram::devices::catalogue().rules.iter().copied().filter(|rule| rules.contains(rule)).collect();
        self.expected.retain(|rule| rule.severity() == Severity::Error);
    }

    pub(crate) fn new(memory: Memory, rate: Rate) -> Rig {
        Self::of(memory, rate, "")
    }

    /// `drives` is TOML text that follows the bus.
    pub(crate) fn of(memory: Memory, rate: Rate, drives: &str) -> Rig {
        Self::of_plant(memory, rate, &rate.plant(drives))
    }

    /// `text` is a plant file that has PLCs `a` and `b` as [`Rate::plant`] has them.
    pub(crate) fn of_plant(memory: Memory, rate: Rate, text: &str) -> Rig {
        let config = PlantConfig::parse("rig", text).unwrap();
        let mut images = Vec::new();
        let plant = Plant::new(&config, |plc, device| segment(memory, plc, device, &mut images)).unwrap();
        let segment = |at: NodePlace| plant.devices()[at.plc].segment().clone();
        let NodeDevice { master, slave, .. } = *rate.kind;
        Rig {
            rate,
            master_at: master,
            slave_at: slave,
            master: segment(master).view(master.base).unwrap(),
            master_init: segment(master).view(master.base).unwrap(),
            slave: segment(slave).view(slave.base).unwrap(),
            slave_init: segment(slave).view(slave.base).unwrap(),
            plant,
            expected: Vec::new(),
            tolerated: Vec::new(),
            _images: images,
        }
    }

    /// Advances the clock by `us` microseconds.
    pub(crate) fn step(&mut self, us: u64) {
        self.plant.advance_to(self.plant.now() + us);
    }

    /// Runs to the next SYNC edge of the bus and handles it.
    pub(crate) fn run_to_sync(&mut self) {
        let edge = self.next_sync().expect("the bus has a SYNC signal");
        self.plant.advance_to(edge);
    }

    /// Returns the time of the master's next SYNC edge.
    pub(crate) fn next_sync(&self) -> Option<u64> {
        self.plant.next_sync(DeviceIndex::at(self.master_at.plc), self.master_at.port)
    }

    /// Returns the master node, which expects slaves 0 to 3.
    pub(crate) fn master_node(&self) -> Node {
        self.node(self.master_at, Mode::Master)
    }

    pub(crate) fn slave_node(&self) -> Node {
        self.node(self.slave_at, Mode::Slave)
    }

    fn node(&self, at: NodePlace, mode: Mode) -> Node {
        Node::at(self.plant.devices()[at.plc].segment(), at.base, self.rate.timing, mode)
    }

    #[track_caller]
    pub(crate) fn bring_up(&mut self, nodes: &[&Node], stages: impl RangeBounds<Stage>) {
        bring_up_in(&mut self.plant, nodes, stages);
    }

    /// Brings the master from restart to "waiting for start".
    pub(crate) fn initialize_master(&mut self) {
        self.bring_up(&[&self.master_node()], ..=Stage::WaitingForStart);
    }

    /// Brings the slave node from restart to "waiting for start".
    pub(crate) fn initialize_slave(&mut self) {
        self.bring_up(&[&self.slave_node()], ..=Stage::WaitingForStart);
    }

    /// Brings both nodes into set-up mode.
    pub(crate) fn set_up(&mut self) {
        self.initialize_slave();
        self.initialize_master();
        self.bring_up(&[&self.slave_node(), &self.master_node()], Stage::SetUp..=Stage::SetUp);
    }

    /// Brings both nodes into active operation; ends at the first SYNC edge of active operation.
    pub(crate) fn activate(&mut self) {
        self.set_up();
        self.bring_up(&[&self.slave_node(), &self.master_node()], Stage::Active..);
        self.run_to_sync();
    }

    /// Configuration bytes of reference value frame 1 at the master.
    pub(crate) fn configure_wrc1(&self, bytes: [u8; 4]) {
        let cfg = &self.master._CFG_WRC_WORD;
        cfg.b_CFG_WRC1_WORD0.store(bytes[0]);
        cfg.b_CFG_WRC1_WORD1.store(bytes[1]);
        cfg.b_CFG_WRC1_WORD2.store(bytes[2]);
        cfg.b_CFG_WRC1_WORD3.store(bytes[3]);
    }

    /// Releases WRC1 in this interval and runs to the next SYNC edge. Call it at a SYNC edge.
    pub(crate) fn send_wrc1(&mut self) {
        self.master.b_CTRLREG_WRC1.store(0x05);
        self.run_to_sync();
    }

    pub(crate) fn records(&self) -> impl DoubleEndedIterator<Item = Record> {
        self.plant.journal().records()
    }

    /// Returns all frames so far with the time of their end.
    pub(crate) fn frames(&self) -> Vec<(u64, Frame)> {
        self.records()
            .filter_map(|record| Some((record.time_us, record.event.get::<Transmitted>()?.frame)))
            .collect()
    }

    /// Returns the last frame with an identifier in `ids`.
    pub(crate) fn last_frame(&self, ids: core::ops::RangeInclusive<u16>) -> Option<Frame> {
        self.frames().into_iter().rev().map(|(_, frame)| frame).find(|frame| ids.contains(&frame.id()))
    }
}

/// Returns a plant on heap memory.
pub(crate) fn plant_of(text: &str) -> Plant {
    let config = PlantConfig::parse("rig", text).unwrap();
    Plant::new(&config, |_plc, device| Ok::<_, RigError>(Segment::of(device))).unwrap()
}

/// Returns RAM for a PLC. An image stays in `images`, and its file is removed when `images` is dropped.
pub(crate) fn segment(
    memory: Memory,
    plc: &str,
    device: &'static commram::layout::DeviceLayout,
    images: &mut Vec<Image>,
) -> Result<Segment, RigError> {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    match memory {
        Memory::Heap => Ok(Segment::of(device)),
        Memory::Mapped => {
            let count = COUNT.fetch_add(1, Ordering::Relaxed);
            let instance = format!("rig-{}-{count}", std::process::id());
            let spec =
                ImageSpec { device, clock_mode: ClockMode::Stepped, speed: 0, processor_cycle_us: 500 };
            let image = Image::create(&instance, plc, &spec)?;
            let segment = image.segment().clone();
            images.push(image);
            Ok(segment)
        }
    }
}

/// Errors of building a test rig.
#[derive(Debug)]
pub(crate) struct RigError(#[expect(dead_code, reason = "shown by Debug")] String);

impl From<commram::memory::MemoryError> for RigError {
    fn from(error: commram::memory::MemoryError) -> Self {
        RigError(error.to_string())
    }
}

impl From<PlantError> for RigError {
    fn from(error: PlantError) -> Self {
        RigError(error.to_string())
    }
}
