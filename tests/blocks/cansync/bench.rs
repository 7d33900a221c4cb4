//! A test rig with PLCs that are driven by function blocks alone: PLC `a` is master, PLC `b` slave 0, a drive slave 1.

use super::device::*;
use crate::rig::{Memory, NodePlace, Rig};
use commram::memory::{Segment, View};

const DRIVE: &str = "[[bus.drive]]\nname = 'd1'\nslave_number = 1\nlock_time_us = 30000\n\
    [[bus.drive.parameters]]\nnumber = 1000\nformat = 'word'\ninitial = 100\nmax = 500\n";
/// Duration of a PLC cycle.
const CYCLE_US: u64 = 1000;
/// Time limit for a block. A block needs much less, unless it waits for a monitoring time.
const PATIENCE_US: u64 = 60_000_000;

pub(crate) struct Bench {
    pub rig: Rig,
    pub ma: Base<Master>,
    pub sl: Base<Slave>,
    pub ma_init: Base<Init>,
    pub sl_init: Base<Init>,
}

impl Bench {
    /// Returns a bench after power-on.
    pub(crate) fn new(memory: Memory) -> Bench {
        let rig = Rig::of(memory, rate(), DRIVE);
        let ram = |at: NodePlace| Ram::of(rig.plant.devices()[at.plc].segment()).unwrap();
        let (master, slave) = (rig.master_at, rig.slave_at);
        let (a, b) = (ram(master), ram(slave));
        Bench {
            ma: a.at(master.base).unwrap(),
            ma_init: a.at(master.base).unwrap(),
            sl: b.at(slave.base).unwrap(),
            sl_init: b.at(slave.base).unwrap(),
            rig,
        }
    }

    /// Returns a bench with both nodes in active operation, synchronized slaves, and all jobs enabled for slaves 0 and
    /// 1.
    pub(crate) fn active(memory: Memory) -> Bench {
        let mut bench = Bench::new(memory);
        let mut types = CANsync_SL_TYP_INIT { us_SL_TYP0: 1, us_SL_TYP1: 1, ..Default::default() };
        types.call();
        let mut init_sl = init();
        init_sl.x_SL = true;
        let mut init_ma = CANsync_INIT { a_SL_TYP: types.a_SL_TYP, ..init() };
        bench.until(|b| {
            init_sl.call(&b.sl_init);
            init_sl.x_OK
        });
        bench.until(|b| {
            init_ma.call(&b.ma_init);
            init_ma.x_OK
        });
        CANsync_COMM_CONTROL_MA {
            x_EN_CTRL: true,
            x_EN_PAR: true,
            x_EN_UDL: true,
            si_MAX_SL_NR: 1,
            ..Default::default()
        }
        .call(&bench.ma);
        let mut mode_sl = CANsync_MODE_SL { x_SYNC_MODE: true, ..Default::default() };
        let mut mode_ma = CANsync_MODE_MA { x_SYNC_MODE: true, ..Default::default() };
        bench.until(|b| {
            mode_sl.call(&b.sl);
            mode_ma.call(&b.ma);
            b.ma.a_STAT_SL.iter().take(2).all(|state| state.load() == 0x03)
        });
        (mode_sl.x_CANsync_RUN, mode_ma.x_CANsync_RUN) = (true, true);
        bench.until(|b| {
            mode_sl.call(&b.sl);
            mode_ma.call(&b.ma);
            mode_sl.x_CANsync_ACTIV && mode_ma.x_CANsync_ACTIV
        });
        bench
    }

    /// Runs PLC cycles until `done` returns true; the test fails if it never does.
    pub(crate) fn until(&mut self, mut done: impl FnMut(&mut Bench) -> bool) {
        let start = self.rig.plant.now();
        while !done(self) {
            self.rig.step(CYCLE_US);
            assert!(self.rig.plant.now() - start < PATIENCE_US, "it never ends");
        }
    }

    /// Runs `count` PLC cycles.
    pub(crate) fn cycles(&mut self, count: u32, mut cycle: impl FnMut(&mut Bench)) {
        for _ in 0..count {
            cycle(self);
            self.rig.step(CYCLE_US);
        }
    }
}

/// Returns `CANsync_INIT` with the device's highest rate.
pub(crate) fn init() -> CANsync_INIT {
    let timing = rate().timing;
    let (us_BAUDRATE, us_SYNC_INTERVAL) = (timing.us_BAUDRATE, timing.b_TIME_PATTERN);
    CANsync_INIT { us_BAUDRATE, us_SYNC_INTERVAL, ..Default::default() }
}

/// Returns RAM without firmware, with a clock that the test sets.
pub(crate) struct Dead {
    pub ram: Ram,
    header: View<commram::memory::Header>,
}

impl Dead {
    pub(crate) fn new() -> Dead {
        let segment = Segment::of(rate().kind.layout);
        Dead { ram: Ram::of(&segment).unwrap(), header: segment.header().unwrap() }
    }

    pub(crate) fn init(&self) -> Base<Init> {
        self.ram.at(rate().kind.master.base).unwrap()
    }

    pub(crate) fn master(&self) -> Base<Master> {
        self.ram.at(rate().kind.master.base).unwrap()
    }

    pub(crate) fn slave(&self) -> Base<Slave> {
        self.ram.at(rate().kind.slave.base).unwrap()
    }

    pub(crate) fn pass(&self, us: u64) {
        self.header.virtual_time_us.store(self.header.virtual_time_us.load() + us);
    }
}
