//! Brings CANsync nodes from restart to active operation (manual 5.00005.03a p. 147-150, 173-175; 5.02066.01a p. 50,
//! 79), for all tests and benchmarks.

use commram::devices::cansync::BaudRate;
use commram::devices::cansync::registers::CANsync_INIT_BMSTRUCT;
use commram::memory::{Segment, View};
use commram::plant::Plant;
use core::ops::{Range, RangeBounds};

/// Period in which a node's firmware polls its registers.
pub(crate) const CYCLE_US: u64 = 500;

/// `b_MA_SL_MODE`; a master may take its SYNC signal from a slave of its PLC (D-12).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mode {
    Master = 0x00,
    Slave = 0x01,
    SyncIn = 0x02,
}

/// Stages of a node, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Stage {
    StartUp,
    WaitingForInit,
    WaitingForStart,
    SetUp,
    Active,
}

impl Stage {
    pub(crate) const ALL: [Stage; 5] =
        [Stage::StartUp, Stage::WaitingForInit, Stage::WaitingForStart, Stage::SetUp, Stage::Active];

    /// Returns the value of `w_CPU_CONTROL` that requests this stage.
    pub(crate) fn command(self) -> u16 {
        match self {
            Stage::StartUp => 0x0000,
            Stage::WaitingForInit => 0x0001,
            Stage::WaitingForStart => 0x0002,
            Stage::SetUp => 0x0020,
            Stage::Active => 0x0040,
        }
    }

    /// Returns the value of `w_OPTION_STATUS` in this stage.
    pub(crate) fn status(self, mode: Mode) -> u16 {
        match (self, mode) {
            (Stage::StartUp, _) => 0x0001,
            (Stage::WaitingForInit, _) => 0x0002,
            (Stage::WaitingForStart, _) => 0x0003,
            (Stage::SetUp, Mode::Slave) => 0x0013,
            (Stage::SetUp, _) => 0x0043,
            (Stage::Active, Mode::Slave) => 0x0020,
            (Stage::Active, _) => 0x0080,
        }
    }
}

/// A node and its start parameters.
#[derive(Clone)]
pub(crate) struct Node {
    pub init: View<CANsync_INIT_BMSTRUCT>,
    pub timing: &'static BaudRate,
    pub mode: Mode,
    /// Slaves that a master expects.
    pub slaves: Range<usize>,
}

impl Node {
    /// Returns the node with registers that begin at `base`; a master expects slaves 0 to 3.
    pub(crate) fn at(segment: &Segment, base: u32, timing: &'static BaudRate, mode: Mode) -> Node {
        let slaves = if mode == Mode::Slave { 0..0 } else { 0..4 };
        Node { init: segment.view(base).expect("the node is there"), timing, mode, slaves }
    }

    pub(crate) fn expecting(self, slaves: Range<usize>) -> Node {
        Node { slaves, ..self }
    }

    pub(crate) fn write_init_data(&self) {
        let init = &self.init;
        init.b_MA_SL_MODE.store(self.mode as u8);
        init.b_AC.store(0xFF);
        init.b_AM.store(0xFF);
        init.b_BT_0.store(self.timing.b_BT_0);
        init.b_BT_1.store(self.timing.b_BT_1);
        init.b_OUTPUT_CONTROL.store(0xFA);
        init.b_CLOCK_DIVIDER.store(0x07);
        init.b_TIME_PATTERN.store(self.timing.b_TIME_PATTERN);
        for (number, slave) in init.a_SL_TYP.iter().enumerate() {
            slave.store(u8::from(self.slaves.contains(&number)));
        }
    }
}

/// Brings `nodes` through `stages` together; `pass` advances the clock by microseconds.
#[track_caller]
pub(crate) fn bring_up(nodes: &[&Node], stages: impl RangeBounds<Stage>, mut pass: impl FnMut(u64)) {
    for stage in Stage::ALL.into_iter().filter(|stage| stages.contains(stage)) {
        for node in nodes {
            if stage == Stage::WaitingForStart {
                node.write_init_data();
            }
            node.init.w_CPU_CONTROL.store(stage.command());
        }
        pass(CYCLE_US);
        for node in nodes {
            let status = node.init.w_OPTION_STATUS.load();
            assert_eq!(status, stage.status(node.mode), "{:?} on the way to {stage:?}", node.mode);
        }
    }
}

/// Brings nodes of a plant through the stages, as [`bring_up`] does.
#[track_caller]
pub(crate) fn bring_up_in(plant: &mut Plant, nodes: &[&Node], stages: impl RangeBounds<Stage>) {
    bring_up(nodes, stages, |us| plant.advance_to(plant.now() + us));
}
