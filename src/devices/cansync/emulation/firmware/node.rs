//! Common part of master and slave nodes: general registers and the state machine between `w_CPU_CONTROL` and
//! `w_OPTION_STATUS` (manual 5.00005.03a p. 147-150, 173-175). Decision D-05 defines which state follows which command.

mod control;
mod findings;
mod location;
mod status;

pub(crate) use findings::report_number_taken;
pub use location::NodeLocation;

use super::controller::Controller;
use super::deadlines::DeadlineTracker;
use super::init::{InitData, InitFault, InitSnapshot};
use super::orders::Orders;
use crate::devices::Context;
use crate::devices::cansync::BaudRate;
use crate::devices::cansync::emulation::watch::Facts;
use crate::devices::cansync::registers::CANsync_INIT_BMSTRUCT;
use crate::devices::cansync::registers::phases;
use crate::devices::cansync::registers::values::cpu_control;
use crate::layout::RegisterPhase;
use crate::memory::{MemoryError, Segment, View};
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use serde::{Deserialize, Serialize};

/// Role of a node on its bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Slave,
    Master,
}

/// State of a node, as shown in `w_OPTION_STATUS`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum NodeState {
    /// The node has restarted and waits for command 16#0001; `w_OPTION_STATUS` is 16#0001.
    StartUp,
    /// 16#0002, waiting for "take over initialization data".
    WaitingForInit,
    /// 16#0003, waiting for start.
    WaitingForStart,
    /// Set-up mode: 16#0013 on a slave, 16#0043 on a master.
    SetUp,
    /// Active operation: 16#0020 on a slave, 16#0080 on a master.
    Active,
}

/// Effect of a poll of `w_CPU_CONTROL`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// The program has not changed the register.
    None,
    /// The node was restarted. It no longer uses the bus.
    Restarted,
    /// The node has made a step towards set-up mode that does not affect the bus.
    Progressed,
    /// Initialization data were taken over. The cyclic area must be cleared before the node shows 16#0003.
    SetUpStarted,
    /// Active operation was enabled.
    Enabled,
    /// Active operation ended; set-up mode continues.
    Disabled,
}

/// State machine and general registers of a node.
pub(super) struct Node {
    role: Role,
    pub(super) regs: View<CANsync_INIT_BMSTRUCT>,
    rates: &'static [BaudRate],
    state: NodeState,
    init: Option<InitData>,
    /// Initialization data before the last restart.
    last_init: Option<InitData>,
    refused: Option<InitFault>,
    orders: Orders,
    pub(super) controller: Controller,
    /// True if this node passes on a SYNC signal with an interval that differs from the interval of the
    /// node's bus (decision D-282).
    sync_is_unlike: bool,
    /// True if the last poll changed nothing, and `w_CANsync_STATUS` is up to date except for the traffic bits.
    is_settled: bool,
    /// The bits of `w_CANsync_STATUS` other than the traffic bits, as the last poll stored them.
    shown_status: u16,
}

impl SnapshotFields for Node {
    fn save(&self, to: &mut Saving) {
        let Self {
            role: _,
            regs: _,
            rates,
            state,
            init,
            last_init,
            refused,
            orders,
            controller,
            sync_is_unlike,
            is_settled: _,
            shown_status: _,
        } = self;
        to.value(&(state, refused, controller, sync_is_unlike));
        to.value(&[init, last_init].map(|data| data.as_ref().map(|init| init.to_snapshot(rates))));
        orders.save(to);
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        (self.state, self.refused, self.controller, self.sync_is_unlike) = from.value()?;
        self.is_settled = false;
        let rates = self.rates;
        let [init, last_init] = from.value::<[Option<InitSnapshot>; 2]>()?.map(|kept| {
            kept.map(|kept| InitData::from_snapshot(kept, rates).ok_or_else(|| from.no("rate of the device")))
        });
        (self.init, self.last_init) = (init.transpose()?, last_init.transpose()?);
        self.orders.restore(from)
    }
}

impl Node {
    /// Creates the node at `location` of `segment`, in start-up.
    ///
    /// # Errors
    /// The memory segment is too small for the node, or read-only.
    pub(super) fn new(role: Role, segment: &Segment, location: NodeLocation) -> Result<Self, MemoryError> {
        Ok(Node {
            orders: Orders::new(segment, location.place)?,
            role,
            regs: segment.view(location.base)?,
            rates: location.rates,
            state: NodeState::StartUp,
            init: None,
            last_init: None,
            refused: None,
            controller: Controller::default(),
            sync_is_unlike: false,
            is_settled: false,
            shown_status: 0,
        })
    }

    /// Switches the power on: shows the number at the DIP switches. All other registers contain their reset
    /// values.
    pub(super) fn power_on(&mut self, omega_nr: u8) {
        self.is_settled = false;
        self.regs.w_OMEGA_NR.store(u16::from(omega_nr));
    }

    /// Switches the power off: the node returns to start-up from every state.
    pub(super) fn power_off(&mut self, ctx: &mut Context) {
        if self.state != NodeState::StartUp {
            self.show(ctx, NodeState::StartUp);
        }
    }

    /// Returns the present state.
    #[inline]
    pub(super) fn state(&self) -> NodeState {
        self.state
    }

    /// Returns the facts that the access checker needs. `deadlines` has the deadlines of the node's two
    /// process data frames.
    #[inline]
    pub(super) fn facts(&self, deadlines: [DeadlineTracker; 2]) -> Facts {
        let ordered = || {
            let others = self.regs.w_CPU_CONTROL.load() & !cpu_control::RESET_CONTROLLER;
            matches!(others, cpu_control::TAKE_OVER_INIT_DATA | cpu_control::START_SYNCHRONOUS)
        };
        Facts {
            is_master: self.role == Role::Master,
            live: self.live(),
            takes_over_init: self.state == NodeState::WaitingForInit && ordered(),
            is_on_bus: self.is_on_bus(),
            is_active: self.state == NodeState::Active,
            missed: deadlines.map(|frame| frame.missed_at()),
            expected: self.init.as_ref().map_or(0, |init| init.expected),
        }
    }

    /// Returns the present phase, which selects the valid structure (decision D-03).
    fn live(&self) -> RegisterPhase {
        match self.state {
            NodeState::StartUp | NodeState::WaitingForInit => phases::INIT,
            NodeState::WaitingForStart | NodeState::SetUp | NodeState::Active => phases::CYCLIC,
        }
    }

    /// Returns the initialization data that the node has taken over; `None` before that.
    #[inline]
    pub(super) fn init(&self) -> Option<&InitData> {
        self.init.as_ref()
    }

    /// Returns true if the node takes part in bus traffic: in set-up mode or active operation.
    #[inline]
    pub(super) fn is_on_bus(&self) -> bool {
        matches!(self.state, NodeState::SetUp | NodeState::Active)
    }

    /// Returns true if the PLC has written `w_CPU_CONTROL` since the last poll.
    #[inline]
    pub(super) fn control_changed(&self) -> bool {
        self.orders.is_waiting(&self.regs.w_CPU_CONTROL)
    }

    /// Returns true if the CAN controller takes part in bus traffic, provided that the PLC permits it.
    #[inline]
    pub(super) fn is_connected(&self) -> bool {
        self.controller.is_connected()
    }

    /// Returns true if the node receives a frame with this identifier: the frame reaches the controller and
    /// passes the acceptance filter.
    #[inline]
    pub(super) fn accepts(&self, identifier: u16) -> bool {
        self.is_connected() && self.init.as_ref().is_some_and(|init| init.accepts(identifier))
    }

    /// Switches a working CAN controller to BUS-off. Returns true if it was working.
    pub(super) fn go_bus_off(&mut self) -> bool {
        self.is_settled = false;
        self.is_on_bus() && self.controller.go_off()
    }

    /// Makes the node lose the arriving frame in an overrun. Returns true if the node would have received the
    /// frame.
    pub(super) fn overrun(&mut self) -> bool {
        self.is_settled = false;
        self.is_on_bus() && self.controller.overrun()
    }

    /// Returns true if further polls of `w_CPU_CONTROL` would change nothing. A node on the bus is not quiescent: polls
    /// show the traffic, and a poll ends the recovery from BUS-off.
    #[inline]
    pub(super) fn is_quiescent(&self) -> bool {
        !self.is_on_bus() && !self.controller.recovers() && !self.control_changed()
    }

    /// Returns true if a poll now would change only the traffic bits of `w_CANsync_STATUS`. `is_seen`: no
    /// register was written since the last poll. If `is_seen` is false, the registers that a poll reads or
    /// refreshes are compared. While the node waits for initialization data, a poll reads more registers than
    /// these, so only `is_seen` decides.
    #[inline]
    pub(super) fn poll_changes_nothing(&self, is_seen: bool) -> bool {
        self.is_settled
            && !self.controller.recovers()
            && (is_seen
                || self.state != NodeState::WaitingForInit
                    && !self.control_changed()
                    && self.status_is_shown())
    }
}
