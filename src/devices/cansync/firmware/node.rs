//! What master and slave node share: general registers and the state machine between `w_CPU_CONTROL`
//! and `w_OPTION_STATUS` (manual 5.00005.03a p. 147-150, 173-175; which state follows which command:
//! decision D-05).

use super::controller::Controller;
use super::init::{InitData, InitFault, Kept};
use super::orders::{Order, Orders};
use super::punctual::Punctual;
use crate::devices::cansync::records::{BaudRateMismatch, Command, CommandIgnored, InitRefused};
use crate::devices::cansync::registers::CANsync_INIT_BMSTRUCT;
use crate::devices::cansync::registers::values::{
    cansync_status, clock_divider, cpu_control, option_status, output_control,
};
use crate::devices::cansync::watch::Facts;
use crate::devices::cansync::{BaudRate, rules};
use crate::devices::{Context, SyncSignal};
use crate::journal;
use crate::journal::{Handshake, Register};
use crate::layout::{Live, Port};
use crate::memory::{MemoryError, Segment, View};
use crate::state::{Damaged, Saved, Saving, State};
use core::mem::offset_of;
use serde::{Deserialize, Serialize};

/// The bits of `w_CANsync_STATUS` that change with every frame.
const TRAFFIC: u16 = cansync_status::SEND_BUFFER_FREE
    | cansync_status::SEND_JOB_DONE
    | cansync_status::RECEIVING
    | cansync_status::SENDING;

/// What a node is on its bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Slave,
    Master,
}

/// Where a node's registers lie, which of its device's nodes it is, and at what rates it can run.
#[derive(Clone, Copy, Debug)]
pub struct Seat {
    /// First byte of its area.
    pub base: usize,
    /// Its place among the ports of the header page, from 0.
    pub place: usize,
    /// The baud rates of its device.
    pub rates: &'static [BaudRate],
    /// Whether a slave there has the single-frame area.
    pub has_single_frame_area: bool,
}

impl Seat {
    /// The seat of the node at `port` of a device with these baud rates.
    #[must_use]
    pub fn of(port: &Port, rates: &'static [BaudRate]) -> Self {
        let mut registers = port.area.structures.iter().flat_map(|placed| placed.structure.registers);
        Seat {
            base: port.area.first as usize,
            place: usize::from(port.number) - 1,
            rates,
            has_single_frame_area: registers.any(|register| register.name == "b_STEUREG_UPDOWN_SINGLE"),
        }
    }
}

/// The state a node shows in `w_OPTION_STATUS`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum NodeState {
    /// 16#0001.
    StartUp,
    /// 16#0002, waiting for "take over initialization data".
    WaitingForInit,
    /// 16#0003, waiting for start.
    WaitingForStart,
    /// 16#0013 on a slave, 16#0043 on a master.
    SetUp,
    /// 16#0020 on a slave, 16#0080 on a master.
    Active,
}

/// What a look at `w_CPU_CONTROL` changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// Nothing.
    None,
    /// The node was restarted; the bus is released.
    Restarted,
    /// Some step towards set-up mode that concerns nobody else.
    Progressed,
    /// Initialization data were taken over; the cyclic area is to be cleared before 16#0003 is shown.
    SetUpStarted,
    /// Active operation was enabled.
    Enabled,
    /// Active operation ended, set-up mode goes on.
    Disabled,
}

/// State machine and general registers of a node.
pub(super) struct Node {
    role: Role,
    pub(super) regs: View<CANsync_INIT_BMSTRUCT>,
    rates: &'static [BaudRate],
    state: NodeState,
    init: Option<InitData>,
    refused: Option<InitFault>,
    orders: Orders,
    pub(super) controller: Controller,
    /// The SYNC signal that this node passes on has another interval than its bus (decision D-282).
    sync_is_unlike: bool,
    /// The last look has changed nothing, and `w_CANsync_STATUS` shows what there is but for the traffic.
    is_settled: bool,
}

impl State for Node {
    fn save(&self, to: &mut Saving) {
        let Self {
            role: _,
            regs: _,
            rates,
            state,
            init,
            refused,
            orders,
            controller,
            sync_is_unlike,
            is_settled: _,
        } = self;
        to.value(&(state, refused, controller, sync_is_unlike));
        to.value(&init.as_ref().map(|init| init.kept(rates)));
        orders.save(to);
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        (self.state, self.refused, self.controller, self.sync_is_unlike) = from.value()?;
        self.is_settled = false;
        self.init = match from.value::<Option<Kept>>()? {
            Some(kept) => {
                Some(InitData::of_kept(kept, self.rates).ok_or_else(|| from.no("rate of the device"))?)
            }
            None => None,
        };
        self.orders.restore(from)
    }
}

impl Node {
    /// The node at `seat` of `segment`, in start-up.
    ///
    /// # Errors
    /// If the segment is too small for it, or read-only.
    pub(super) fn new(role: Role, segment: &Segment, seat: Seat) -> Result<Self, MemoryError> {
        Ok(Node {
            orders: Orders::new(segment, seat.place)?,
            role,
            regs: segment.view(seat.base)?,
            rates: seat.rates,
            state: NodeState::StartUp,
            init: None,
            refused: None,
            controller: Controller::default(),
            sync_is_unlike: false,
            is_settled: false,
        })
    }

    /// Power-on: shows the number set at the DIP switches. All other registers hold their reset values.
    pub(super) fn power_on(&mut self, omega_nr: u8) {
        self.is_settled = false;
        self.regs.w_OMEGA_NR.store(u16::from(omega_nr));
    }

    /// Power-off: whatever it did, it is in start-up again.
    pub(super) fn power_off(&mut self, ctx: &mut Context) {
        if self.state != NodeState::StartUp {
            self.show(ctx, NodeState::StartUp);
        }
    }

    /// The present state.
    #[inline]
    pub(super) fn state(&self) -> NodeState {
        self.state
    }

    /// What the access checker must know; `punctual` are the deadlines of the node's two process data frames.
    #[inline]
    pub(super) fn facts(&self, punctual: [Punctual; 2]) -> Facts {
        let ordered = || {
            let others = self.regs.w_CPU_CONTROL.load() & !cpu_control::RESET_CONTROLLER;
            others == cpu_control::TAKE_OVER_INIT_DATA
        };
        Facts {
            is_master: self.role == Role::Master,
            live: self.live(),
            takes_over_init: self.state == NodeState::WaitingForInit && ordered(),
            is_active: self.state == NodeState::Active,
            missed: punctual.map(|frame| frame.missed_at()),
            expected: self.init.as_ref().map_or(0, |init| init.expected),
        }
    }

    /// Which structure is valid (decision D-03).
    fn live(&self) -> Live {
        match self.state {
            NodeState::StartUp | NodeState::WaitingForInit => Live::Init,
            NodeState::WaitingForStart | NodeState::SetUp | NodeState::Active => Live::Cyclic,
        }
    }

    /// The initialization data taken over; `None` before that.
    #[inline]
    pub(super) fn init(&self) -> Option<&InitData> {
        self.init.as_ref()
    }

    /// Whether the node takes part in bus traffic: set-up mode or active operation.
    #[inline]
    pub(super) fn is_on_bus(&self) -> bool {
        matches!(self.state, NodeState::SetUp | NodeState::Active)
    }

    /// Whether the PLC has written `w_CPU_CONTROL` since the last look. For busy polling.
    #[inline]
    pub(super) fn control_changed(&self) -> bool {
        self.orders.is_waiting(&self.regs.w_CPU_CONTROL)
    }

    /// Whether the CAN controller takes part in bus traffic, as far as the PLC wants it to.
    #[inline]
    pub(super) fn is_connected(&self) -> bool {
        self.controller.is_connected()
    }

    /// Whether a frame with this identifier is received: it reaches the controller and passes its acceptance
    /// filter.
    #[inline]
    pub(super) fn accepts(&self, identifier: u16) -> bool {
        self.is_connected() && self.init.as_ref().is_some_and(|init| init.accepts(identifier))
    }

    /// The CAN controller goes BUS-off, if it is working; tells whether it was.
    pub(super) fn go_bus_off(&mut self) -> bool {
        self.is_settled = false;
        self.is_on_bus() && self.controller.go_off()
    }

    /// An overrun loses the frame that is arriving; tells whether the node would have received it.
    pub(super) fn overrun(&mut self) -> bool {
        self.is_settled = false;
        self.is_on_bus() && self.controller.overrun()
    }

    /// Whether looks at `w_CPU_CONTROL` that follow one find nothing to do: on the bus they show the traffic, and a recovery
    /// ends at one of them.
    #[inline]
    pub(super) fn rests(&self) -> bool {
        !self.is_on_bus() && !self.controller.recovers() && !self.control_changed()
    }

    /// Whether a look as the register stands now finds nothing to do and shows but the traffic of the moment. While a node
    /// waits for initialization data, others than `w_CPU_CONTROL` matter: then nobody may have written since a look
    /// (`is_seen`).
    #[inline]
    pub(super) fn looks_in_vain(&self, is_seen: bool) -> bool {
        self.is_settled
            && !self.controller.recovers()
            && (is_seen || self.state != NodeState::WaitingForInit && !self.control_changed())
    }

    /// One look at `w_CPU_CONTROL`. `clear` empties the cyclic area; it is called when initialization
    /// data were taken over and before 16#0003 is shown (decision D-03).
    pub(super) fn look_at_control(&mut self, ctx: &mut Context, clear: impl FnOnce()) -> Change {
        self.is_settled = true;
        self.controller.recover(ctx.now);
        let Order { value, is_new, with_reset } = self.orders.take(&self.regs.w_CPU_CONTROL);
        if with_reset {
            self.reset_controller(ctx, value);
        }
        if self.orders.are_left_behind() {
            if is_new && self.state != NodeState::StartUp {
                self.report_left_behind(ctx);
            }
            return Change::None;
        }
        match (self.state, value) {
            (NodeState::StartUp, cpu_control::RESTART) => Change::None,
            (_, cpu_control::RESTART) => {
                self.init = None;
                self.refused = None;
                self.controller = Controller::default();
                self.sync_is_unlike = false;
                self.show(ctx, NodeState::StartUp);
                Change::Restarted
            }
            (NodeState::StartUp, cpu_control::HANDSHAKE) => {
                self.show(ctx, NodeState::WaitingForInit);
                Change::Progressed
            }
            (NodeState::WaitingForInit, cpu_control::TAKE_OVER_INIT_DATA) => self.take_over(ctx, clear),
            (NodeState::WaitingForStart, cpu_control::START_SYNCHRONOUS) => {
                self.show(ctx, NodeState::SetUp);
                Change::SetUpStarted
            }
            (NodeState::SetUp, value) if value & cpu_control::ENABLE_ACTIVE != 0 => {
                self.show(ctx, NodeState::Active);
                Change::Enabled
            }
            (NodeState::Active, cpu_control::START_SYNCHRONOUS) => {
                self.show(ctx, NodeState::SetUp);
                Change::Disabled
            }
            (state, value) => {
                if is_new && !Self::is_at_rest(state, value) {
                    self.report_ignored(ctx, value);
                }
                Change::None
            }
        }
    }

    /// Bit 7 acts in every state; clearing it left `answer`.
    fn reset_controller(&mut self, ctx: &mut Context, answer: u16) {
        let kbit_per_s = self.init.as_ref().map_or(500, |init| init.timing.kbit_per_s);
        self.controller.reset(ctx.now, kbit_per_s);
        let (origin, offset, request) = (ctx.origin, ctx.at(0), answer | cpu_control::RESET_CONTROLLER);
        let goes_on = self.role == Role::Master && answer & 1 != 0;
        ctx.report(Handshake { origin, offset, request, answer, goes_on });
    }

    /// From here on a restart in the RAM alone cannot be told from what stands there.
    fn report_left_behind(&self, ctx: &mut Context) {
        let (origin, value) = (ctx.origin, cpu_control::RESTART);
        ctx.report(CommandIgnored { origin, value, why: Command::LeftBehind });
        ctx.find(&rules::LEFT_BEHIND, self.live(), 0, cpu_control::RESET_CONTROLLER.into());
    }

    fn take_over(&mut self, ctx: &mut Context, clear: impl FnOnce()) -> Change {
        let data = match self.role {
            Role::Master => InitData::of_master(&self.regs, self.rates),
            Role::Slave => InitData::of_slave(&self.regs, self.rates),
        };
        match data {
            Ok(data) => {
                self.check_controller(ctx);
                self.init = Some(data);
                self.refused = None;
                clear();
                self.show(ctx, NodeState::WaitingForStart);
                Change::Progressed
            }
            Err(fault) => {
                if self.refused.replace(fault) != Some(fault) {
                    let origin = ctx.origin;
                    ctx.report(InitRefused { origin, fault });
                    self.report_refused(ctx, fault);
                }
                Change::None
            }
        }
    }

    fn report_refused(&self, ctx: &mut Context, fault: InitFault) {
        let regs = &self.regs;
        let (rule, offset, value) = match fault {
            InitFault::Mode => {
                (&rules::INIT_MODE, offset_of!(CANsync_INIT_BMSTRUCT, b_MA_SL_MODE), regs.b_MA_SL_MODE.load())
            }
            InitFault::BitTiming => {
                (&rules::INIT_BAUD_RATE, offset_of!(CANsync_INIT_BMSTRUCT, b_BT_0), regs.b_BT_0.load())
            }
            InitFault::TimePattern => (
                &rules::INIT_INTERVAL,
                offset_of!(CANsync_INIT_BMSTRUCT, b_TIME_PATTERN),
                regs.b_TIME_PATTERN.load(),
            ),
        };
        ctx.find(rule, Live::Init, offset, value.into());
    }

    /// The two values that the manual gives for the CAN controller (p. 149). The bus is simulated, so other ones
    /// do no harm here; on the device they would.
    fn check_controller(&self, ctx: &mut Context) {
        let output = (
            &self.regs.b_OUTPUT_CONTROL,
            offset_of!(CANsync_INIT_BMSTRUCT, b_OUTPUT_CONTROL),
            output_control::REQUIRED,
        );
        let clock = (
            &self.regs.b_CLOCK_DIVIDER,
            offset_of!(CANsync_INIT_BMSTRUCT, b_CLOCK_DIVIDER),
            clock_divider::REQUIRED,
        );
        for (register, offset, right) in [output, clock] {
            let value = register.load();
            if value != right {
                ctx.find(&rules::INIT_CONTROLLER, Live::Init, offset, value.into());
            }
        }
    }

    /// The node passes on a SYNC signal `signal`: says so once if its own rate is another one.
    #[inline]
    pub(super) fn judge_sync(&mut self, ctx: &mut Context, signal: SyncSignal) {
        let Some(timing) = self.init.as_ref().map(|init| init.timing) else { return };
        let is_unlike = u32::from(timing.b_TIME_PATTERN) * 1000 != signal.interval_us;
        let is_news = is_unlike && !self.sync_is_unlike;
        self.is_settled &= self.sync_is_unlike == is_unlike;
        self.sync_is_unlike = is_unlike;
        if is_news {
            let (origin, node_kbit_s, bus_kbit_s) = (ctx.origin, timing.kbit_per_s, signal.kbit_s);
            ctx.report(BaudRateMismatch { origin, node_kbit_s, bus_kbit_s, passes_on: true });
            let offset = offset_of!(CANsync_INIT_BMSTRUCT, b_BT_0);
            ctx.find(&rules::CLUSTER_BAUD_RATE, Live::Init, offset, timing.b_BT_0.into());
        }
    }

    /// Whether `value` is simply the command that led to `state` and still stands in the register.
    fn is_at_rest(state: NodeState, value: u16) -> bool {
        match state {
            NodeState::StartUp => value == cpu_control::RESTART,
            NodeState::WaitingForInit => value == cpu_control::HANDSHAKE,
            NodeState::WaitingForStart => value == cpu_control::TAKE_OVER_INIT_DATA,
            NodeState::SetUp => value == cpu_control::START_SYNCHRONOUS,
            NodeState::Active => value & cpu_control::ENABLE_ACTIVE != 0,
        }
    }

    fn report_ignored(&self, ctx: &mut Context, value: u16) {
        let known = matches!(
            value,
            cpu_control::HANDSHAKE
                | cpu_control::TAKE_OVER_INIT_DATA
                | cpu_control::START_SYNCHRONOUS
                | cpu_control::ENABLE_ACTIVE
        );
        let why = if known { Command::NotNow } else { Command::Unknown };
        let origin = ctx.origin;
        ctx.report(CommandIgnored { origin, value, why });
        ctx.find(&rules::COMMAND, self.live(), 0, value.into());
    }

    fn show(&mut self, ctx: &mut Context, state: NodeState) {
        self.is_settled = false;
        let (from, to) = (self.code(self.state), self.code(state));
        self.state = state;
        self.regs.w_OPTION_STATUS.store(to);
        let origin = ctx.origin;
        let offset = ctx.at(offset_of!(CANsync_INIT_BMSTRUCT, w_OPTION_STATUS));
        let command = ctx.at(offset_of!(CANsync_INIT_BMSTRUCT, w_CPU_CONTROL));
        ctx.report(journal::State { origin, offset, command, from, to, live: self.live() });
    }

    fn code(&self, state: NodeState) -> u16 {
        match (state, self.role) {
            (NodeState::StartUp, _) => option_status::START_UP,
            (NodeState::WaitingForInit, _) => option_status::WAITING_FOR_INIT,
            (NodeState::WaitingForStart, _) => option_status::WAITING_FOR_START,
            (NodeState::SetUp, Role::Slave) => option_status::SLAVE_SET_UP,
            (NodeState::SetUp, Role::Master) => option_status::MASTER_SET_UP,
            (NodeState::Active, Role::Slave) => option_status::SLAVE_ACTIVE,
            (NodeState::Active, Role::Master) => option_status::MASTER_ACTIVE,
        }
    }

    /// Refreshes `w_CANsync_STATUS`. `on_wire` says what the controller is doing at this moment: `None`
    /// idle, `Some(true)` sending, `Some(false)` receiving. That alone is not worth a record.
    pub(super) fn refresh_status(&self, ctx: &mut Context, on_wire: Option<bool>) {
        let mut value = 0;
        if self.controller.is_off() {
            // Nothing is sent or received, nothing waits to be sent (decision D-121).
            value = cansync_status::BUS_OFF | cansync_status::WARNING;
        } else if self.init.is_some() {
            value = cansync_status::SEND_BUFFER_FREE | cansync_status::SEND_JOB_DONE;
        }
        if self.is_on_bus() && self.is_connected() {
            match on_wire {
                Some(true) => value = cansync_status::SENDING,
                Some(false) => value |= cansync_status::RECEIVING,
                None => {}
            }
        }
        if self.refused.is_some() || self.sync_is_unlike {
            value |= cansync_status::WARNING;
        }
        if self.controller.has_overrun() {
            value |= cansync_status::OVERRUN;
        }
        let before = self.regs.w_CANsync_STATUS.load();
        if before != value {
            self.regs.w_CANsync_STATUS.store(value);
        }
        if (before ^ value) & !TRAFFIC != 0 {
            let origin = ctx.origin;
            let offset = ctx.at(offset_of!(CANsync_INIT_BMSTRUCT, w_CANsync_STATUS));
            ctx.report(Register { origin, offset, from: before.into(), to: value.into() });
        }
    }
}
