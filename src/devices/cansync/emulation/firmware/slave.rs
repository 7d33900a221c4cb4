//! A CANsync slave (manual 5.00005.03a p. 169-193).
//!
//! This module contains the node state, process data and action commands. `jobs` distributes the frames of the command
//! channel to `parameter` and `updown`.

mod area;
mod jobs;
mod parameter;
mod transfer;
mod updown;

use super::actual::{ActualValueRegisters, store_word};
use super::deadlines::DeadlineTracker;
use super::master::acknowledge;
use super::node::{Change, Node, NodeLocation, NodeState, Role};
use super::word_config::WordConfigs;
use crate::can::Payload;
use crate::devices::Context;
use crate::devices::cansync::BaudRate;
use crate::devices::cansync::emulation::watch::Facts;
use crate::devices::cansync::frames::codec::action::{Action, ActionCommand};
use crate::devices::cansync::frames::codec::process::FrameConfig;
use crate::devices::cansync::frames::{Channel, Frame, FrameKind, SyncLock};
use crate::devices::cansync::records::{Missed, OmittedFrame};
use crate::devices::cansync::registers::CANsync_SL_CTRL_BMSTRUCT;
use crate::devices::cansync::registers::values::{drive_status, receive, send};
use crate::devices::emulation::recorded_register::RecordedRegister;
use crate::memory::{MemoryError, Segment, View};
use crate::snapshot_fields;
use core::mem::offset_of;
use jobs::Jobs;

/// Start of the cyclic area, after the general registers.
const CYCLIC_AREA: usize = offset_of!(CANsync_SL_CTRL_BMSTRUCT, b_CTRLREG_WRC1);

/// Firmware of a node in the role of a slave.
pub struct Slave {
    node: Node,
    regs: View<CANsync_SL_CTRL_BMSTRUCT>,
    number: u8,
    lock: SyncLock,
    jobs: Jobs,
    /// Configuration of the reference value frames as read at the start of the interval.
    config: [FrameConfig; 2],
    /// Own actual value frames that were built and released for this interval.
    ready: [Option<Payload>; 2],
    interval_is_active: bool,
    /// True if the present interval began with its SYNC edge. The slave can then send its actual value frames in time.
    has_edge: bool,
    /// Time in microseconds at which the interval ends if neither the next edge comes nor the loss of an edge
    /// is reported.
    interval_ends: u64,
    interval_us: u32,
    /// Deadlines of the two actual value frames.
    deadlines: [DeadlineTracker; 2],
}

snapshot_fields!(Slave {
    values: number, config, ready, interval_is_active, has_edge, interval_ends, interval_us, deadlines;
    parts: node, lock, jobs;
    built: regs
});

impl Slave {
    /// Creates the slave with slave number `number` at `location` of `segment`. `lock` contains its rules for
    /// synchronizing.
    ///
    /// # Errors
    /// The memory segment is too small for the slave.
    pub fn new(
        segment: &Segment,
        location: NodeLocation,
        number: u8,
        lock: SyncLock,
    ) -> Result<Self, MemoryError> {
        Ok(Slave {
            node: Node::new(Role::Slave, segment, location)?,
            regs: segment.view::<CANsync_SL_CTRL_BMSTRUCT>(location.base)?,
            number,
            lock,
            jobs: Jobs::new(number, location.has_single_frame_area),
            config: [FrameConfig::new([0; 4]); 2],
            ready: [None; 2],
            interval_is_active: false,
            has_edge: false,
            interval_ends: 0,
            interval_us: 0,
            deadlines: [DeadlineTracker::default(); 2],
        })
    }

    /// Switches the power on. The DIP number is the slave number.
    pub fn power_on(&mut self) {
        self.regs.reset_from(0);
        self.node.power_on(self.number);
    }

    /// Switches the power off. The node leaves the bus. Its registers are empty until [`Slave::power_on`].
    pub fn power_off(&mut self, ctx: &mut Context) {
        self.node.power_off(ctx);
        self.regs.reset_from(0);
    }

    /// Returns the slave number.
    #[inline]
    pub fn number(&self) -> u8 {
        self.number
    }

    /// Returns the present state.
    pub fn state(&self) -> NodeState {
        self.node.state()
    }

    /// Returns the slot times; `None` until the node has taken over initialization data.
    pub fn timing(&self) -> Option<&'static BaudRate> {
        self.node.init().map(|init| init.timing)
    }

    /// Returns the facts for the access checker.
    #[inline]
    pub(in crate::devices::cansync::emulation) fn facts(&self) -> Facts {
        self.node.facts(self.deadlines)
    }

    /// Returns true if the node receives frames at `kbit_s`: it is in set-up mode or active operation at this
    /// baud rate, and is not BUS-off.
    #[inline]
    pub fn hears(&self, kbit_s: u16) -> bool {
        self.node.is_on_bus()
            && self.node.is_connected()
            && self.timing().is_some_and(|timing| timing.kbit_per_s == kbit_s)
    }

    /// Returns true if the node is in set-up mode or active operation, at any baud rate.
    pub fn is_on_bus(&self) -> bool {
        self.node.is_on_bus()
    }

    /// Switches a working CAN controller to BUS-off. Returns true if it was working.
    pub fn go_bus_off(&mut self) -> bool {
        self.node.go_bus_off()
    }

    /// Makes the node lose the arriving frame in an overrun, until [`Slave::frame_is_past`]. Returns true if
    /// the node would have received the frame.
    pub fn overrun(&mut self) -> bool {
        self.node.overrun()
    }

    /// Ends the overrun, because the lost frame has ended.
    pub fn frame_is_past(&mut self) {
        self.node.controller.frame_is_past();
    }

    /// Handles a SYNC edge that was due at `now` and was lost on the line. A locked node runs through this
    /// interval, but does not send its actual value frames. A node that is not locked has no interval
    /// (decision D-124).
    pub fn edge_lost(&mut self, now: u64) {
        if self.lock.runs_through(now) {
            self.ready = [None; 2];
            self.has_edge = false;
            self.interval_ends = self.longest_interval(now);
        } else {
            self.end_interval();
        }
        self.lock.pass(now);
    }

    /// Returns the latest possible time of the next edge. If no edge has come until this time, edges are
    /// missing.
    fn longest_interval(&self, now: u64) -> u64 {
        now + u64::from(self.interval_us) * 3 / 2
    }

    /// Returns true if a frame with this identifier reaches the node: its controller works and its acceptance filter
    /// accepts the frame.
    #[inline]
    pub fn accepts(&self, identifier: u16) -> bool {
        self.node.accepts(identifier)
    }

    /// Returns true if the PLC wrote `w_CPU_CONTROL` since the last poll.
    pub fn control_changed(&self) -> bool {
        self.node.control_changed()
    }

    /// Returns true if the node is locked to the SYNC signal.
    pub fn is_synchronized(&self) -> bool {
        self.lock.is_locked()
    }

    /// Returns true if processor cycles would change nothing. A node that is not on the bus also has no jobs.
    pub fn is_quiescent(&self) -> bool {
        self.node.is_quiescent() && !self.interval_is_active && !self.lock.is_locked()
    }

    /// Returns true if a processor cycle at `now` would change only the traffic bits. `is_seen`: no register was
    /// written since the last poll.
    #[inline]
    pub(in crate::devices::cansync) fn poll_changes_nothing(&self, now: u64, is_seen: bool) -> bool {
        self.node.poll_changes_nothing(is_seen)
            && !self.jobs.are_watched()
            && (now <= self.interval_ends || !self.interval_is_active)
            && self.lock.lost_at().is_none_or(|time| now < time)
    }

    /// Runs one processor cycle. `Node::refresh_status` describes `on_wire`.
    pub fn processor_cycle(&mut self, ctx: &mut Context, on_wire: Option<bool>) -> Change {
        let regs = &self.regs;
        let change = self.node.poll_control(ctx, || regs.reset_from(CYCLIC_AREA));
        match change {
            Change::Restarted => {
                self.lock.set_mode(false);
                self.leave_active(ctx);
            }
            Change::SetUpStarted | Change::Disabled => self.leave_active(ctx),
            Change::None | Change::Progressed | Change::Enabled => {}
        }
        self.watch_signal(ctx.now);
        self.jobs.poll(ctx, &self.regs);
        self.node.refresh_status(ctx, on_wire);
        change
    }

    fn leave_active(&mut self, ctx: &mut Context) {
        self.end_interval();
        self.jobs.drop_all(ctx, &self.regs);
    }

    /// Ends the interval if SYNC is missing: without SYNC there are no deadlines and no frames. The state of
    /// the node remains as the PLC has set it. Jobs also remain in their registers: their answers wait until
    /// the master repeats or changes the job (decision D-64).
    fn watch_signal(&mut self, now: u64) {
        self.lock.pass(now);
        if now > self.interval_ends {
            self.end_interval();
        }
    }

    fn end_interval(&mut self) {
        self.interval_is_active = false;
        self.ready = [None; 2];
    }

    /// Handles a falling edge of SYNC: an interval begins, and the firmware reads the configuration (manual
    /// p. 178).
    pub fn sync_edge(&mut self, now: u64, interval_us: u32) {
        self.lock.edge(now, interval_us, interval_us / 4);
        self.interval_us = interval_us;
        self.interval_ends = self.longest_interval(now);
        self.has_edge = true;
        self.ready = [None; 2];
        self.interval_is_active = self.node.state() == NodeState::Active;
        self.deadlines.iter_mut().for_each(DeadlineTracker::next_interval);
        if !self.interval_is_active {
            self.deadlines = [DeadlineTracker::default(); 2];
            return;
        }
        self.config = self.regs._CFG_WRC_WORD.of_both_frames().map(FrameConfig::new);
    }

    /// Returns the number of words that this slave takes from reference value frame 1. The firmware needs 15
    /// us for each word.
    pub fn words_taken(&self) -> u8 {
        self.config[Channel::One.index()].used_words()
    }

    /// Handles the deadline of an own actual value frame (manual p. 181-182). Builds the frame if the PLC has
    /// released it with 16#05, and acknowledges the release with 16#04.
    pub fn build_actual(&mut self, ctx: &mut Context, channel: Channel) {
        if !self.is_exchanging() || !self.has_edge {
            return;
        }
        let (register, offset) = match channel {
            Channel::One => {
                (&self.regs.b_CTRLREG_RD_RDC1, offset_of!(CANsync_SL_CTRL_BMSTRUCT, b_CTRLREG_RD_RDC1))
            }
            Channel::Two => {
                (&self.regs.b_CTRLREG_RD_RDC2, offset_of!(CANsync_SL_CTRL_BMSTRUCT, b_CTRLREG_RD_RDC2))
            }
        };
        let released = register.load() == send::RELEASED;
        self.deadlines[channel.index()].deadline(ctx.now, released);
        if !released {
            return;
        }
        let values = &self.regs.a_RD_VALUE_SEND;
        let built = FrameConfig::new(self.regs._CFG_RDC_WORD.words(channel))
            .build(|number| values.get(usize::from(number)).map_or(0, |cell| cell.load()));
        self.ready[channel.index()] = Some(built.payload);
        acknowledge(ctx, register, offset);
    }

    /// Handles a reference value frame: first stores the words, then 16#02 in the status register.
    pub fn reference_value(&mut self, channel: Channel, frame: &Frame) {
        if !self.is_exchanging() || !self.node.accepts(frame.id()) {
            return;
        }
        self.config[channel.index()].scatter(frame.payload(), |number, high_word, word| {
            if let Some(cell) = self.regs.a_WR_VALUE_RECEIVE.get(usize::from(number)) {
                store_word(cell, high_word, word);
            }
        });
        match channel {
            Channel::One => self.regs.b_CTRLREG_WRC1.store(receive::RECEIVED),
            Channel::Two => self.regs.b_CTRLREG_WRC2.store(receive::RECEIVED),
        }
    }

    /// Returns the own actual value frame that the master requested.
    pub fn requested_actual(&mut self, ctx: &mut Context, channel: Channel) -> Option<Frame> {
        if !self.is_exchanging() || !self.has_edge {
            return None;
        }
        let Some(payload) = self.ready[channel.index()].take() else {
            let origin = ctx.origin;
            ctx.report(Missed { origin, what: OmittedFrame::ActualValue(channel.number()) });
            return None;
        };
        Some(Frame::of(FrameKind::ActualValue(channel, self.number), payload))
    }

    /// Handles another slave's actual value frame.
    pub fn overheard_actual(&mut self, channel: Channel, slave: u8, frame: &Frame) {
        if self.is_exchanging() && slave != self.number && self.node.accepts(frame.id()) {
            self.regs.receive(channel, slave, frame);
        }
    }

    /// Handles an action command. The registers show a command only if it has this slave's bit (manual p.
    /// 188).
    pub fn action(&mut self, ctx: &mut Context, frame: &Frame, command: &ActionCommand) {
        if !self.node.accepts(frame.id()) || !command.concerns(self.number) {
            return;
        }
        let regs = &self.regs;
        // Stores a value, and records it in the journal if it differs.
        macro_rules! show {
            ($register:ident, $value:expr) => {
                regs.$register.show(ctx, offset_of!(CANsync_SL_CTRL_BMSTRUCT, $register), $value)
            };
        }
        match command.action() {
            Action::ControlWord(word) => {
                show!(w_CONTROLWORD, word);
                show!(b_STATREG_CONTROLWORD, receive::RECEIVED);
            }
            Action::SyncMode(on) => {
                self.lock.set_mode(on);
                show!(b_SYNC_MODUS, command.data_byte);
                show!(b_STATREG_SYNC_MODUS, receive::RECEIVED);
            }
            Action::Other => {
                show!(b_AKT_CMD, command.command);
                show!(b_DATA_BYTE_AKT_CMD, command.data_byte);
                show!(w_DATAWORD_AKT_CMD, command.data_word);
                show!(b_STATREG_AKT_CMD, receive::RECEIVED);
            }
        }
    }

    /// Handles a job frame for this slave. In active operation the application answers; in set-up mode the firmware
    /// answers. In both modes the firmware answers jobs on the status word (decision D-06).
    pub fn job(&mut self, ctx: &mut Context, frame: &Frame) {
        if !self.node.accepts(frame.id()) {
            return;
        }
        if self.node.state() == NodeState::Active {
            self.jobs.arrive(ctx, &self.regs, frame.payload(), self.status_word());
        } else {
            self.jobs.arrive_early(frame.payload(), self.status_word());
        }
    }

    /// Returns the answer to the last job, at the start of the response slot.
    pub fn response(&mut self, ctx: &mut Context) -> Option<Frame> {
        if !self.node.is_on_bus() {
            return None;
        }
        self.jobs.response(ctx, &self.regs)
    }

    /// Ends the answer, because it was sent completely.
    pub fn response_sent(&mut self, ctx: &mut Context) {
        self.jobs.response_sent(ctx, &self.regs);
    }

    /// Returns the status word. Bit 15 is set if the node is synchronized (p. 136). The firmware has no
    /// information about the other bits.
    fn status_word(&self) -> u16 {
        if self.lock.is_locked() { drive_status::SYNCHRONIZED } else { 0 }
    }

    fn is_exchanging(&self) -> bool {
        self.interval_is_active && self.node.state() == NodeState::Active
    }
}
