//! The CANsync master: process data in active operation (manual 5.00005.03a p. 151-160), and the use of the command
//! channel.

use super::actual::ActualValueRegisters;
use super::auto::Counter;
use super::command::CommandChannel;
use super::deadlines::DeadlineTracker;
use super::init::SyncSource;
use super::node::{Change, Node, NodeLocation, NodeState, Role};
use super::polling::Polling;
use super::word_config::WordConfigs;
use crate::devices::cansync::BaudRate;
use crate::devices::cansync::emulation::watch::Facts;
use crate::devices::cansync::frames::codec::process::FrameConfig;
use crate::devices::cansync::frames::{Channel, Frame, FrameKind};
use crate::devices::cansync::records::{Missed, OmittedFrame};
use crate::devices::cansync::registers::CANsync_MA_CTRL_BMSTRUCT;
use crate::devices::cansync::registers::values::send;
use crate::devices::{Context, SyncSignal};
use crate::journal::Handshake;
use crate::memory::{Cell8, MemoryError, Segment, View};
use crate::snapshot_fields;
use core::mem::offset_of;
use serde::{Deserialize, Serialize};

/// Start of the cyclic area, after the general registers.
const CYCLIC_AREA: usize = offset_of!(CANsync_MA_CTRL_BMSTRUCT, b_CTRLREG_WRC1);

/// Slave number in a reference value frame that requests no actual values. The seven bits of the identifier
/// allow more numbers than the 32 possible slaves (decision D-25).
const NO_SLAVE: u8 = 0x7F;

/// A reference value frame that was built and waits for its slot.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Built {
    /// The frame that was built, including its identifier.
    pub frame: Frame,
    /// Number of used words. The firmware needs 15 us for each word to build the frame.
    pub used_words: u8,
}

/// Firmware of a node in the role of the master.
pub struct Master {
    node: Node,
    regs: View<CANsync_MA_CTRL_BMSTRUCT>,
    polling: Polling,
    commands: CommandChannel,
    request: [Counter; 2],
    /// Configuration bytes as read at the start of the interval.
    config: [FrameConfig; 2],
    /// True if the present interval began in active operation.
    interval_is_active: bool,
    /// Deadlines of the two reference value frames.
    deadlines: [DeadlineTracker; 2],
}

snapshot_fields!(Master {
    values: polling, commands, request, config, interval_is_active, deadlines;
    parts: node;
    built: regs
});

impl Master {
    /// Creates the master at `location` of `segment`.
    ///
    /// # Errors
    /// The memory segment is too small for the master.
    pub fn new(segment: &Segment, location: NodeLocation) -> Result<Self, MemoryError> {
        Ok(Master {
            node: Node::new(Role::Master, segment, location)?,
            regs: segment.view::<CANsync_MA_CTRL_BMSTRUCT>(location.base)?,
            polling: Polling::new(),
            commands: CommandChannel::default(),
            request: [Counter::default(); 2],
            config: [FrameConfig::master_reference([0; 4]); 2],
            interval_is_active: false,
            deadlines: [DeadlineTracker::default(); 2],
        })
    }

    /// Switches the power on; `omega_nr` is the number at the DIP switches.
    pub fn power_on(&mut self, omega_nr: u8) {
        self.regs.reset_from(0);
        self.node.power_on(omega_nr);
    }

    /// Switches the power off. The node leaves the bus. Its registers are empty until [`Master::power_on`].
    pub fn power_off(&mut self, ctx: &mut Context) {
        self.node.power_off(ctx);
        self.regs.reset_from(0);
    }

    /// Returns the present state.
    pub fn state(&self) -> NodeState {
        self.node.state()
    }

    /// Returns the value of `w_OPTION_STATUS`.
    pub fn option_status(&self) -> u16 {
        self.node.shown_state()
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

    /// Returns true if this master passes on the SYNC signal of its PLC's node 1.
    pub fn forwards_sync(&self) -> bool {
        self.node.init().is_some_and(|init| init.sync == SyncSource::Forwarded)
    }

    /// Handles an edge of `signal`, which this master passes on to its bus.
    #[inline]
    pub fn passes_sync_on(&mut self, ctx: &mut Context, signal: SyncSignal) {
        self.node.judge_sync(ctx, signal);
    }

    /// Returns true if the master is in set-up mode or active operation.
    #[inline]
    pub fn is_on_bus(&self) -> bool {
        self.node.is_on_bus()
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

    /// Returns true if processor cycles have nothing to do.
    pub fn is_quiescent(&self) -> bool {
        self.node.is_quiescent()
    }

    /// Returns true if a processor cycle would change only the traffic bits. `is_seen`: no register was written since
    /// the last poll.
    #[inline]
    pub(in crate::devices::cansync) fn poll_changes_nothing(&self, is_seen: bool) -> bool {
        self.node.poll_changes_nothing(is_seen)
    }

    /// Runs one processor cycle. `Node::refresh_status` describes `on_wire`.
    pub fn processor_cycle(&mut self, ctx: &mut Context, on_wire: Option<bool>) -> Change {
        let regs = &self.regs;
        let change = self.node.poll_control(ctx, || regs.reset_from(CYCLIC_AREA));
        match change {
            Change::SetUpStarted | Change::Disabled => {
                self.polling.restart();
                self.commands.restart();
                self.interval_is_active = false;
            }
            Change::Enabled => {
                self.request.iter_mut().for_each(Counter::restart);
                self.commands.restart();
            }
            Change::Restarted => {
                self.commands.restart();
                self.interval_is_active = false;
            }
            Change::None | Change::Progressed => {}
        }
        self.node.refresh_status(ctx, on_wire);
        change
    }

    /// Handles a falling edge of SYNC: reads the configuration and advances the automatic slave numbers (manual p. 154;
    /// D-08).
    pub fn sync_edge(&mut self) {
        self.interval_is_active = self.node.state() == NodeState::Active;
        self.deadlines.iter_mut().for_each(DeadlineTracker::next_interval);
        if !self.interval_is_active {
            self.deadlines = [DeadlineTracker::default(); 2];
            return;
        }
        self.config = self.regs._CFG_WRC_WORD.of_both_frames().map(FrameConfig::master_reference);
        let max = self.regs.b_MAX_SL_NR.load();
        self.request.iter_mut().for_each(|counter| counter.next_interval(max));
        self.commands.next_interval(max);
    }

    /// Handles the deadline of a reference value frame. Builds the frame if the PLC has released it with
    /// 16#05. Otherwise this interval has neither the frame nor its actual value request. The journal reports
    /// this, unless the frame is unused: no word is assigned, and the PLC has not released the frame since
    /// active operation began.
    pub fn build_reference(&mut self, ctx: &mut Context, channel: Channel) -> Option<Built> {
        if !self.is_exchanging() {
            return None;
        }
        let released = self.control_register(channel).load() == send::RELEASED;
        let deadline = &mut self.deadlines[channel.index()];
        deadline.deadline(ctx.now, released);
        if !released {
            if deadline.is_used() || self.config[channel.index()].used_words() > 0 {
                let origin = ctx.origin;
                ctx.report(Missed { origin, what: OmittedFrame::ReferenceValue(channel.number()) });
            }
            return None;
        }
        let values = &self.regs.a_WR_VALUE;
        let built = self.config[channel.index()]
            .build(|number| values.get(usize::from(number)).map_or(0, |cell| cell.load()));
        let order = match channel {
            Channel::One => &self.regs.b_CTRLREG_RD_ORDER_RDC1,
            Channel::Two => &self.regs.b_CTRLREG_RD_ORDER_RDC2,
        };
        let slave = self.request[channel.index()].resolve(order.load()).unwrap_or(NO_SLAVE);
        let frame = Frame::of(FrameKind::ReferenceValue(channel, slave), built.payload);
        Some(Built { frame, used_words: built.used_words })
    }

    /// Acknowledges a frame that was built: 16#05 becomes 16#04, unless the PLC has written another value in
    /// the meantime.
    pub fn acknowledge_reference(&mut self, ctx: &mut Context, channel: Channel) {
        let offset = match channel {
            Channel::One => offset_of!(CANsync_MA_CTRL_BMSTRUCT, b_CTRLREG_WRC1),
            Channel::Two => offset_of!(CANsync_MA_CTRL_BMSTRUCT, b_CTRLREG_WRC2),
        };
        acknowledge(ctx, self.control_register(channel), offset);
    }

    /// Returns the frame for the command channel of this interval, if there is one. The job in the frame
    /// counts as sent from now on (decision D-40).
    #[inline]
    pub fn command(&mut self, ctx: &mut Context) -> Option<Frame> {
        if !self.node.is_connected() {
            return None;
        }
        match (self.node.state(), self.node.init()) {
            (NodeState::SetUp, Some(init)) => Some(self.polling.frame(init.expected)),
            // A PLC may enable active operation before the first command slot. The master must still order
            // the slaves to synchronize (decision D-38).
            (NodeState::Active, _) => self.polling.announcement().or_else(|| self.job(ctx)),
            _ => None,
        }
    }

    /// Returns the job of this interval. Jobs begin with the first interval that is completely in active
    /// operation, as process data do (decision D-31).
    #[inline]
    fn job(&mut self, ctx: &mut Context) -> Option<Frame> {
        if self.is_exchanging() { self.commands.frame(ctx, &self.regs) } else { None }
    }

    /// Handles a response frame.
    pub fn response(&mut self, ctx: &mut Context, slave: u8, frame: &Frame) {
        if !self.node.accepts(frame.id()) {
            return;
        }
        if !self.commands.response(ctx, &self.regs, slave, frame.payload()) {
            self.polling.response(ctx, &self.regs, slave, frame);
        }
    }

    /// Handles the end of t_RSPTO without an answer to the last command.
    pub fn response_timeout(&mut self, ctx: &mut Context) {
        self.commands.no_response();
        self.polling.no_response(ctx, &self.regs);
    }

    /// Handles an actual value frame: first stores the words in `a_RD_BMARRAY`, then the acknowledgements.
    pub fn actual_value(&mut self, channel: Channel, slave: u8, frame: &Frame) {
        if !self.is_exchanging() || !self.node.accepts(frame.id()) {
            return;
        }
        self.regs.receive(channel, slave, frame);
    }

    fn is_exchanging(&self) -> bool {
        self.interval_is_active && self.node.state() == NodeState::Active && self.node.is_connected()
    }

    /// Switches a working CAN controller to BUS-off. Returns true if it was working.
    pub fn go_bus_off(&mut self) -> bool {
        self.node.go_bus_off()
    }

    /// Makes the node lose the arriving frame in an overrun, until [`Master::frame_is_past`]. Returns true if
    /// the node would have received the frame.
    pub fn overrun(&mut self) -> bool {
        self.node.overrun()
    }

    /// Ends the overrun, because the lost frame has ended.
    pub fn frame_is_past(&mut self) {
        self.node.controller.frame_is_past();
    }

    fn control_register(&self, channel: Channel) -> &Cell8 {
        match channel {
            Channel::One => &self.regs.b_CTRLREG_WRC1,
            Channel::Two => &self.regs.b_CTRLREG_WRC2,
        }
    }
}

/// Replaces 16#05 by 16#04 in a register with this handshake. Returns true if the register still contained
/// 16#05.
pub(super) fn acknowledge(ctx: &mut Context, register: &Cell8, offset: usize) -> bool {
    let acknowledged = register.compare_exchange(send::RELEASED, send::SENT).is_ok();
    if acknowledged {
        let origin = ctx.origin;
        ctx.report(Handshake {
            origin,
            offset: ctx.at(offset),
            request: u16::from(send::RELEASED),
            answer: u16::from(send::SENT),
            more_answers_follow: false,
        });
    }
    acknowledged
}
