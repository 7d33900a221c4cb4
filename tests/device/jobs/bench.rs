//! The master's firmware on its registers, without a bus. The functions return the frames that it sends, and the test
//! makes the answers.

use crate::rig::bring_up::{CYCLE_US, Mode, Node, Stage, bring_up};
use crate::rig::{Memory, Rate, segment};
use commram::devices::Context;
use commram::devices::cansync::firmware::{Change, Master, NodeLocation, NodeState};
use commram::devices::cansync::frames::Frame;
use commram::devices::cansync::frames::codec::{ParameterJob, ParameterResult, UpDownJob, UpDownResult};
use commram::devices::cansync::registers::CANsync_MA_CTRL_BMSTRUCT;
use commram::identity::DeviceIndex;
use commram::journal::{Journal, Origin};
use commram::memory::{Image, View};
use std::ops::RangeBounds;

/// A master in active operation, at the start of an interval.
pub(crate) struct Bench {
    pub regs: View<CANsync_MA_CTRL_BMSTRUCT>,
    node: Node,
    master: Master,
    rate: Rate,
    journal: Journal,
    now: u64,
    _images: Vec<Image>,
}

impl Bench {
    pub(crate) fn new(memory: Memory, rate: Rate) -> Self {
        let (kind, base) = (rate.kind, rate.kind.master.base);
        let mut images = Vec::new();
        let segment = segment(memory, "a", kind.layout, &mut images).unwrap();
        let mut bench = Bench {
            rate,
            regs: segment.view(base).unwrap(),
            node: Node::at(&segment, base, rate.timing, Mode::Master).expecting(0..0),
            master: Master::new(
                &segment,
                NodeLocation::of(kind.layout.port_numbered(kind.master.port).unwrap(), kind.rates),
            )
            .unwrap(),
            journal: Journal::default(),
            now: 0,
            _images: images,
        };
        bench.master.power_on(0);
        bench.initialize();
        bench.activate();
        bench
    }

    fn with<R>(&mut self, f: impl FnOnce(&mut Master, &mut Context) -> R) -> R {
        let at = self.rate.kind.master;
        let origin = Origin { plc: DeviceIndex(0), node: at.port };
        let Bench { now, journal, .. } = self;
        f(&mut self.master, &mut Context { now: *now, journal, origin, base: at.base })
    }

    /// Writes a command to `w_CPU_CONTROL` and lets the firmware see it.
    pub(crate) fn command_node(&mut self, command: u16) -> Change {
        self.node.init.w_CPU_CONTROL.store(command);
        self.cycle()
    }

    fn cycle(&mut self) -> Change {
        self.now += CYCLE_US;
        self.with(|master, ctx| master.processor_cycle(ctx, None))
    }

    fn bring_up(&mut self, stages: impl RangeBounds<Stage>) {
        bring_up(&[&self.node.clone()], stages, |_| {
            self.cycle();
        });
    }

    /// Brings the master from restart to set-up mode; no slave is expected.
    pub(crate) fn initialize(&mut self) {
        self.bring_up(..=Stage::SetUp);
        assert_eq!(self.master.state(), NodeState::SetUp);
        assert_eq!(self.interval().map(|frame| frame.id()), Some(0x010), "SYNC mode: on");
    }

    /// Brings the master from set-up mode to active operation.
    pub(crate) fn activate(&mut self) {
        self.bring_up(Stage::Active..);
        assert_eq!(self.master.state(), NodeState::Active);
    }

    /// Runs an interval up to its command slot; returns the sent frame.
    pub(crate) fn interval(&mut self) -> Option<Frame> {
        self.now += self.rate.interval_us;
        self.master.sync_edge();
        self.with(|master, ctx| master.command(ctx))
    }

    /// Runs an interval in which the master sends a parameter job; returns its slave and the job.
    pub(crate) fn parameter_job(&mut self) -> Option<(u8, ParameterJob)> {
        let frame = self.interval()?;
        assert_eq!(frame.id() & 0x780, 0x500, "{frame:?} is no job");
        Some(((frame.id() & 0x7F) as u8, ParameterJob::decode(frame.payload()).unwrap()))
    }

    /// Runs an interval in which the master sends a frame of an up-/download; returns its slave and the job.
    pub(crate) fn updown_job(&mut self) -> Option<(u8, UpDownJob)> {
        let frame = self.interval()?;
        assert_eq!(frame.id() & 0x780, 0x500, "{frame:?} is no job");
        Some(((frame.id() & 0x7F) as u8, UpDownJob::decode(frame.payload()).unwrap()))
    }

    /// Delivers `frame` in the response slot.
    pub(crate) fn respond(&mut self, frame: Frame) {
        let slave = (frame.id() & 0x7F) as u8;
        self.with(|master, ctx| master.response(ctx, slave, &frame));
    }

    pub(crate) fn answer(&mut self, slave: u8, job: &ParameterJob, result: ParameterResult) {
        self.respond(job.answer(result).frame(slave));
    }

    pub(crate) fn answer_block(&mut self, slave: u8, job: &UpDownJob, result: UpDownResult) {
        self.respond(job.answer(result).frame(slave));
    }

    /// Advances the clock until t_RSPTO has passed.
    pub(crate) fn no_answer(&mut self) {
        self.with(|master, ctx| master.response_timeout(ctx));
    }

    /// Enters a parameter job by the rule: data, status register, control register.
    pub(crate) fn enter_parameter(&self, slave: usize, control: u8, number: u16, value: u32) {
        let data = &self.regs.a_DATA_PARAMETER[slave];
        data.d_PAR_VALUE.store(value);
        data.w_PAR_NR.store(number);
        self.put(slave, control, control);
    }

    /// Writes status and control register of a parameter job.
    pub(crate) fn put(&self, slave: usize, control: u8, status: u8) {
        let registers = &self.regs.a_CTRLREG_PAR_CMD_SL[slave];
        registers.b_STATREG_PAR_CMD.store(status);
        registers.b_STEUREG_PAR_CMD.store(control);
    }

    /// Returns the control register of a parameter job, and checks that the status register has the same value.
    pub(crate) fn parameter(&self, slave: usize) -> u8 {
        let registers = &self.regs.a_CTRLREG_PAR_CMD_SL[slave];
        let (control, status) = (registers.b_STEUREG_PAR_CMD.load(), registers.b_STATREG_PAR_CMD.load());
        assert_eq!(control, status, "control and status register differ");
        control
    }

    pub(crate) fn value(&self, slave: usize) -> u32 {
        self.regs.a_DATA_PARAMETER[slave].d_PAR_VALUE.load()
    }

    /// Enters an up-/download of block 1.
    pub(crate) fn enter_block(&self, control: u8, slave: u8, address: u32, length: u16) {
        self.regs.b_SL_NR_UPDOWNBLK1.store(slave);
        self.regs.d_BASE_ADR_UPDOWNBLK1.store(address);
        self.regs.w_LENGTH_UPDOWNBLK1.store(length);
        self.regs.b_STATREG_UPDOWNBLK1.store(control);
        self.regs.b_STEUREG_UPDOWNBLK1.store(control);
    }

    /// Returns the control register of block 1, and checks that the status register has the same value.
    pub(crate) fn block(&self) -> u8 {
        let control = self.regs.b_STEUREG_UPDOWNBLK1.load();
        assert_eq!(control, self.regs.b_STATREG_UPDOWNBLK1.load(), "control and status register differ");
        control
    }

    pub(crate) fn counter(&self) -> u16 {
        self.regs.w_COUNTER_UPDOWNBLK1.load()
    }

    pub(crate) fn error(&self) -> u16 {
        self.regs.w_ERR_NR_UPDOWNBLK1.load()
    }
}
