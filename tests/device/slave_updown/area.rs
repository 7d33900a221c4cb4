//! The frames of a master, and the two register areas of a slave that take them.

use crate::rig::bench::Bench;
use crate::rig::{Memory, Rate};
use commram::devices::cansync::frames::codec::{Direction, UpDownJob, UpDownResult, UpDownStep};
use commram::devices::cansync::registers::CANsync_SL_CTRL_BMSTRUCT;
use commram::memory::{Cell8, Cell16, Cell32};

pub(crate) const BASE: u32 = 0x0001_0000;

pub(crate) fn init_at(direction: Direction, address: u32, sub_slave: u16, length: u16) -> UpDownJob {
    UpDownJob::new(length, UpDownStep::Init { direction, address, sub_slave }).unwrap()
}

pub(crate) fn init(direction: Direction, length: u16) -> UpDownJob {
    init_at(direction, BASE, 0, length)
}

pub(crate) fn up(offset: u16, last: bool) -> UpDownJob {
    UpDownJob::new(offset, UpDownStep::Upload { last }).unwrap()
}

pub(crate) fn down(offset: u16, last: bool) -> UpDownJob {
    UpDownJob::new(offset, UpDownStep::Download { last, data: bytes(offset) }).unwrap()
}

pub(crate) fn block(direction: Direction, offset: u16, last: bool) -> UpDownJob {
    match direction {
        Direction::Upload => up(offset, last),
        Direction::Download => down(offset, last),
    }
}

/// Returns the six bytes at `offset` of a block in which byte n is n + 1, cut to eight bits.
pub(crate) fn bytes(offset: u16) -> [u8; 6] {
    core::array::from_fn(|n| (offset + n as u16 + 1) as u8)
}

/// Returns the frames that follow the init frame of a block of `length` bytes.
pub(crate) fn blocks(length: u16) -> impl Iterator<Item = (u16, bool)> {
    (0..length).step_by(6).map(move |offset| (offset, offset + 6 >= length))
}

/// Registers that block 1 and the single-frame area have in common.
#[derive(Clone, Copy)]
pub(crate) struct Area {
    pub control: fn(&CANsync_SL_CTRL_BMSTRUCT) -> &Cell8,
    pub status: fn(&CANsync_SL_CTRL_BMSTRUCT) -> &Cell8,
    pub error: fn(&CANsync_SL_CTRL_BMSTRUCT) -> &Cell16,
    pub base: fn(&CANsync_SL_CTRL_BMSTRUCT) -> &Cell32,
    pub length: fn(&CANsync_SL_CTRL_BMSTRUCT) -> &Cell16,
    pub counter: fn(&CANsync_SL_CTRL_BMSTRUCT) -> &Cell16,
    pub enable: u8,
}

pub(crate) const BLOCK_1: Area = Area {
    control: |regs| &regs.b_STEUREG_UPDOWNBLK1,
    status: |regs| &regs.b_STATREG_UPDOWNBLK1,
    error: |regs| &regs.w_ERR_NR_UPDOWNBLK1,
    base: |regs| &regs.d_BASE_ADR_UPDOWNBLK1,
    length: |regs| &regs.w_LENGTH_UPDOWNBLK1,
    counter: |regs| &regs.w_COUNTER_UPDOWNBLK1,
    enable: 1,
};

pub(crate) const SINGLE: Area = Area {
    control: |regs| &regs.b_STEUREG_UPDOWN_SINGLE,
    status: |regs| &regs.b_STATREG_UPDOWN_SINGLE,
    error: |regs| &regs.w_ERR_NR_UPDOWN_SINGLE,
    base: |regs| &regs.d_BASE_ADR_UPDOWN_SINGLE,
    length: |regs| &regs.w_LENGTH_UPDOWN_SINGLE,
    counter: |regs| &regs.w_COUNTER_UPDOWN_SINGLE,
    enable: 0,
};

/// Returns the areas that the device has (D-296).
pub(crate) fn areas(rate: Rate) -> &'static [Area] {
    if rate.kind.is_omega() { &[BLOCK_1, SINGLE] } else { &[BLOCK_1] }
}

impl Area {
    pub(crate) fn bench(&self, memory: Memory, rate: Rate) -> Bench {
        let bench = Bench::active(memory, rate);
        bench.regs.b_EN_UPDOWNBLK1.store(self.enable);
        bench
    }

    /// Returns the control register, and checks that the status register has the same value.
    pub(crate) fn job(&self, bench: &Bench) -> u8 {
        let control = (self.control)(&bench.regs).load();
        assert_eq!((self.status)(&bench.regs).load(), control);
        control
    }

    /// Writes like the application: status register first.
    pub(crate) fn write(&self, bench: &Bench, value: u8) {
        (self.status)(&bench.regs).store(value);
        (self.control)(&bench.regs).store(value);
    }

    /// Clears bit 0 like the application.
    pub(crate) fn acknowledge(&self, bench: &Bench) {
        self.write(bench, self.job(bench) & !0x01);
    }

    pub(crate) fn counter(&self, bench: &Bench) -> u16 {
        (self.counter)(&bench.regs).load()
    }

    /// Returns a bench with a transfer that the application has allowed and whose init frame was answered.
    pub(crate) fn started(&self, rate: Rate, direction: Direction, length: u16) -> Bench {
        let mut bench = self.bench(Memory::Heap, rate);
        let init = init(direction, length);
        assert_eq!(bench.updown(&init).result(), UpDownResult::Busy);
        self.acknowledge(&bench);
        assert_eq!(bench.updown(&init).result(), UpDownResult::Done);
        bench
    }
}

/// Returns the bytes of block 1.
pub(crate) fn data(bench: &Bench) -> Vec<u8> {
    bench.regs.a_DATA_UPDOWNBLK1.iter().flat_map(|cell| cell.load().to_le_bytes()).collect()
}
