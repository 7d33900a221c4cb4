//! The state machine between `w_CPU_CONTROL` and `w_OPTION_STATUS` (manual 5.00005.03a p. 147-149, 173-174). Decision
//! D-05 defines which state follows which command.

use super::{Change, Node, NodeState, Role};
use crate::devices::Context;
use crate::devices::cansync::firmware::controller::Controller;
use crate::devices::cansync::firmware::init::{InitData, InitFault};
use crate::devices::cansync::firmware::orders::Order;
use crate::devices::cansync::records::InitRefused;
use crate::devices::cansync::registers::CANsync_INIT_BMSTRUCT;
use crate::devices::cansync::registers::values::{cpu_control, option_status};
use crate::journal::{Handshake, State};
use core::mem::offset_of;

impl Node {
    /// Polls `w_CPU_CONTROL` once. `clear` empties the cyclic area. It is called when initialization data
    /// have been taken over, before the node shows 16#0003 (decision D-03).
    pub(in super::super) fn poll_control(&mut self, ctx: &mut Context, clear: impl FnOnce()) -> Change {
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
                let used = self.init.take();
                self.last_init = used.or(self.last_init.take());
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
            (NodeState::WaitingForInit, cpu_control::TAKE_OVER_INIT_DATA) => {
                let data = self.read_init_data();
                self.take_over(ctx, data, NodeState::WaitingForStart, clear)
            }
            // Initialization data that were taken over before a restart are still valid (decision D-602).
            (NodeState::WaitingForInit, cpu_control::START_SYNCHRONOUS) => {
                let data = self.last_init.clone().map_or_else(|| self.read_init_data(), Ok);
                self.take_over(ctx, data, NodeState::SetUp, clear)
            }
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
                if is_new && !Self::is_command_of(state, value) {
                    self.report_ignored(ctx, value);
                }
                Change::None
            }
        }
    }

    /// Resets the controller. Bit 7 has this effect in every state; `answer` is the value of the register
    /// without bit 7.
    fn reset_controller(&mut self, ctx: &mut Context, answer: u16) {
        let kbit_per_s = self.init.as_ref().map_or(500, |init| init.timing.kbit_per_s);
        self.controller.reset(ctx.now, kbit_per_s);
        let (origin, offset, request) = (ctx.origin, ctx.at(0), answer | cpu_control::RESET_CONTROLLER);
        let more_answers_follow = self.role == Role::Master && answer & 1 != 0;
        ctx.report(Handshake { origin, offset, request, answer, more_answers_follow });
    }

    fn read_init_data(&self) -> Result<InitData, InitFault> {
        match self.role {
            Role::Master => InitData::of_master(&self.regs, self.rates),
            Role::Slave => InitData::of_slave(&self.regs, self.rates),
        }
    }

    /// Takes over initialization data and changes to state `next`. If the node refuses the data, the state
    /// does not change.
    fn take_over(
        &mut self,
        ctx: &mut Context,
        data: Result<InitData, InitFault>,
        next: NodeState,
        clear: impl FnOnce(),
    ) -> Change {
        match data {
            Ok(data) => {
                self.check_controller(ctx);
                self.init = Some(data);
                self.refused = None;
                clear();
                self.show(ctx, next);
                if next == NodeState::SetUp { Change::SetUpStarted } else { Change::Progressed }
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

    /// Returns true if `value` is the command that led to `state`: the command is still in the register.
    fn is_command_of(state: NodeState, value: u16) -> bool {
        match state {
            NodeState::StartUp => value == cpu_control::RESTART,
            NodeState::WaitingForInit => value == cpu_control::HANDSHAKE,
            NodeState::WaitingForStart => value == cpu_control::TAKE_OVER_INIT_DATA,
            NodeState::SetUp => value == cpu_control::START_SYNCHRONOUS,
            NodeState::Active => value & cpu_control::ENABLE_ACTIVE != 0,
        }
    }

    pub(super) fn show(&mut self, ctx: &mut Context, state: NodeState) {
        self.is_settled = false;
        let (from, to) = (self.code(self.state), self.code(state));
        self.state = state;
        self.regs.w_OPTION_STATUS.store(to);
        let origin = ctx.origin;
        let offset = ctx.at(offset_of!(CANsync_INIT_BMSTRUCT, w_OPTION_STATUS));
        let command = ctx.at(offset_of!(CANsync_INIT_BMSTRUCT, w_CPU_CONTROL));
        ctx.report(State { origin, offset, command, from, to, live: self.live() });
    }

    /// Returns the value of `w_OPTION_STATUS`.
    pub(in super::super) fn shown_state(&self) -> u16 {
        self.code(self.state)
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
}
