//! A slave node alone: the test plays bus and master, frame by frame.

use super::bring_up::{CYCLE_US, Mode, Node, Stage, bring_up};
use super::{Memory, Rate, segment};
use commram::devices::Context;
use commram::devices::cansync::firmware::{NodeLocation, Slave};
use commram::devices::cansync::frames::codec::{
    ActionCommand, ParameterJob, ParameterResponse, UpDownJob, UpDownResponse,
};
use commram::devices::cansync::frames::{Frame, SyncLock};
use commram::devices::cansync::registers::CANsync_SL_CTRL_BMSTRUCT;
use commram::identity::DeviceIndex;
use commram::journal::{Journal, Origin};
use commram::memory::{Image, View};
use std::ops::RangeBounds;

/// The node's slave number.
pub(crate) const NUMBER: u8 = 5;
/// Time the node needs to lock.
pub(crate) const LOCK_US: u64 = 20_000;

pub(crate) struct Bench {
    pub slave: Slave,
    rate: Rate,
    pub regs: View<CANsync_SL_CTRL_BMSTRUCT>,
    node: Node,
    journal: Journal,
    now: u64,
    _images: Vec<Image>,
}

impl Bench {
    /// Returns a node in set-up mode after the first SYNC edge.
    pub(crate) fn in_set_up(memory: Memory, rate: Rate) -> Bench {
        let (kind, base) = (rate.kind, rate.kind.slave.base);
        let mut images = Vec::new();
        let segment = segment(memory, "b", kind.layout, &mut images).unwrap();
        let mut slave = Slave::new(
            &segment,
            NodeLocation::of(kind.layout.port_numbered(kind.slave.port).unwrap(), kind.rates),
            NUMBER,
            SyncLock::new(LOCK_US, None),
        )
        .unwrap();
        slave.power_on();
        let node = Node::at(&segment, base, rate.timing, Mode::Slave);
        let regs = segment.view(base).unwrap();
        let mut bench =
            Bench { slave, rate, regs, node, journal: Journal::default(), now: 0, _images: images };
        bench.set_up([0xFF, 0xFF]);
        bench
    }

    /// Brings the node from restart to set-up mode with these values of `b_AC` and `b_AM`, and advances beyond the next
    /// SYNC edge.
    fn set_up(&mut self, [code, mask]: [u8; 2]) {
        self.bring_up(..=Stage::WaitingForInit);
        self.node.write_init_data();
        self.node.init.b_AC.store(code);
        self.node.init.b_AM.store(mask);
        self.command(Stage::WaitingForStart.command());
        self.bring_up(Stage::SetUp..=Stage::SetUp);
        self.edge();
    }

    fn bring_up(&mut self, stages: impl RangeBounds<Stage>) {
        bring_up(&[&self.node.clone()], stages, |us| self.pass(us));
    }

    /// The PLC restarts the node and brings it back into active operation.
    pub(crate) fn start_over(&mut self, acceptance: [u8; 2]) {
        self.set_up(acceptance);
        self.enable();
    }

    fn enable(&mut self) {
        self.bring_up(Stage::Active..);
        self.edge();
    }

    /// Returns a node in active operation after a SYNC edge; its PLC is ready for jobs in block 1.
    pub(crate) fn active(memory: Memory, rate: Rate) -> Bench {
        let mut bench = Self::in_set_up(memory, rate);
        bench.enable();
        bench.regs.b_EN_UPDOWNBLK1.store(1);
        bench
    }

    /// Writes `w_CPU_CONTROL` and lets the firmware poll it.
    pub(crate) fn command(&mut self, value: u16) {
        self.regs.w_CPU_CONTROL.store(value);
        self.pass(CYCLE_US);
    }

    /// Advances the clock without SYNC, with a processor cycle every 500 us.
    pub(crate) fn pass(&mut self, us: u64) {
        for _ in 0..us / CYCLE_US {
            self.now += CYCLE_US;
            self.with(|slave, ctx| slave.processor_cycle(ctx, None));
        }
    }

    /// Runs one interval; ends just after the next SYNC edge.
    pub(crate) fn edge(&mut self) {
        let interval_us = self.rate.interval_us;
        self.pass(interval_us);
        self.slave.sync_edge(self.now, interval_us as u32);
    }

    pub(crate) fn with<R>(&mut self, f: impl FnOnce(&mut Slave, &mut Context) -> R) -> R {
        let at = self.rate.kind.slave;
        let origin = Origin { plc: DeviceIndex(0), node: at.port };
        let Bench { now, journal, .. } = self;
        f(&mut self.slave, &mut Context { now: *now, journal, origin, base: at.base })
    }

    /// Delivers a job frame and ends the interval.
    pub(crate) fn deliver(&mut self, frame: &Frame) {
        self.with(|slave, ctx| slave.job(ctx, frame));
        self.edge();
    }

    /// Runs the response slot: the node sends its answer.
    pub(crate) fn answer(&mut self) -> Option<Frame> {
        let frame = self.with(|slave, ctx| slave.response(ctx));
        if frame.is_some() {
            self.with(|slave, ctx| slave.response_sent(ctx));
        }
        frame
    }

    /// Runs one exchange on the command and response channel.
    pub(crate) fn turn(&mut self, frame: &Frame) -> Option<Frame> {
        self.deliver(frame);
        self.answer()
    }

    /// Runs one exchange with a parameter job.
    pub(crate) fn parameter(&mut self, job: &ParameterJob) -> ParameterResponse {
        let frame = self.turn(&job.frame(NUMBER)).expect("the slave answers");
        assert_eq!(frame.id(), 0x580 + u16::from(NUMBER));
        ParameterResponse::decode(job, frame.payload()).unwrap()
    }

    /// Runs one exchange with an up-/download job.
    pub(crate) fn updown(&mut self, job: &UpDownJob) -> UpDownResponse {
        let frame = self.turn(&job.frame(NUMBER)).expect("the slave answers");
        assert_eq!(frame.id(), 0x580 + u16::from(NUMBER));
        UpDownResponse::decode(job, frame.payload()).unwrap()
    }

    pub(crate) fn action(&mut self, command: ActionCommand) {
        self.with(|slave, ctx| slave.action(ctx, &command.frame(), &command));
    }
}
