//! The controller at the CAN interface: its operating states, its program, LED STAT and terminals (p. 13-19).

use super::board::events::{self, Pulses};
use super::board::hardware::Shared;
use super::board::interrupt::Interrupt;
use super::board::peripherals::Peripherals;
use super::board::watch;
use super::canopen::can_errors::CanErrors;
use super::canopen::communication::{PdoConfig, PdoDirection};
use super::canopen::diagnosis::Diagnosis;
use super::canopen::master::{Master, MasterConfig};
use super::canopen::nmt::Nmt;
use super::canopen::node::{GuardingConfig, Node};
use super::jobs::StartedOrders;
use super::records::{ControllerState, Watchdog};
use crate::can::{ErrorState, Frame};
use crate::devices::Context;
use crate::devices::can_bus::{CanPort, Controller};
use crate::devices::canopen::nmt::{Command, State};
use crate::devices::canopen::records::NodeState;
use crate::devices::cs0015::registers::values::{bool, key, loaded, program as command, s1, stat, state};
use crate::devices::cs0015::registers::{
    FRONT_OUTPUTS, FRONT_PROGRAM, FRONT_S1, FRONT_S2, FRONT_S3, FRONT_S4, FRONT_S5, FRONT_STAT, FRONT_STATE,
};
use crate::devices::emulation::program;
use crate::devices::records::BoardEvent;
use crate::journal::Finding;
use crate::layout::RegisterPhase;
use crate::memory::header::{ProgramState, Start};
use embedded_can::{Frame as _, Id, StandardId};

/// Duration of the checks in the reset, in us (D-429).
const RESET_US: u64 = 200_000;
/// Longest cycle of a program that the watchdog allows, in us (p. 7).
pub(super) const WATCHDOG_US: u64 = 200_000;

/// The program of the controller.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Program {
    /// No program is loaded.
    None,
    /// A built-in program, which switches CANopen on.
    BuiltIn {
        /// Requests for PDOs that the program makes in its second cycle: direction, PDO counted from 0,
        /// settings.
        pdos: Vec<(PdoDirection, usize, PdoConfig)>,
        /// Cycle time in us.
        cycle_us: u64,
        /// Configuration of how the device supervises its master; `None` keeps the stored settings.
        guarding: Option<GuardingConfig>,
        /// Settings of a master; `None` for a slave.
        master: Option<MasterConfig>,
    },
    /// The program is a process that attaches, a script or a test. It calls all functions itself.
    Attached {
        /// Cycle time in us.
        cycle_us: u64,
    },
}

/// The firmware of a CS0015.
pub(super) struct Firmware {
    pub(super) node: Node,
    pub(super) program: Program,
    /// Operating state: a value of the register `front.state`.
    pub(super) state: u32,
    /// State of the node that the journal has last recorded.
    reported: State,
    /// True if the programming system has stopped the program.
    pub(super) is_stopped: bool,
    /// Time in microseconds at which the reset or the program's present cycle ends; `None` if neither runs.
    end_at: Option<u64>,
    /// Start of the present cycle, in microseconds.
    begun_at: u64,
    /// True if the present cycle is overdue; the watchdog resets the device at `end_at`.
    is_overdue: bool,
    /// Network management; `Some` if the device is the master of the network.
    pub(super) nmt: Option<Nmt>,
    /// The built-in program as master.
    pub(super) master: Option<Master>,
    /// Orders of the job block that have been started.
    pub(super) under_way: StartedOrders,
    /// Number of cycles since power-on; it stops at three.
    cycles: u8,
    /// Outputs at the end of the last cycle.
    outputs: u16,
    /// State shared with the device.
    pub(super) shared: Shared,
    pub(super) peripherals: Peripherals,
    /// Faults of the hardware at the last check.
    diagnosis: Diagnosis,
    pub(super) interrupt: Interrupt,
    pub(super) can_errors: CanErrors,
    pulses: Pulses,
}

crate::snapshot_fields!(Firmware {
    values: state, reported, is_stopped, end_at, begun_at, is_overdue, nmt, master, under_way, cycles, outputs, diagnosis, interrupt, can_errors;
    parts: node, peripherals;
    // The device saves its own state.
    built: program, shared, pulses
});

impl Firmware {
    pub(super) fn new(node: Node, program: Program, shared: Shared, pulses: Pulses) -> Self {
        Firmware {
            node,
            program,
            state: state::OFF,
            reported: State::Initialising,
            is_stopped: false,
            end_at: None,
            begun_at: 0,
            is_overdue: false,
            nmt: None,
            master: None,
            under_way: StartedOrders::default(),
            cycles: 0,
            outputs: 0,
            shared,
            peripherals: Peripherals::default(),
            diagnosis: Diagnosis::default(),
            interrupt: Interrupt::default(),
            can_errors: CanErrors::default(),
            pulses,
        }
    }

    fn cycle_us(&self) -> Option<u64> {
        match self.program {
            Program::None => None,
            Program::BuiltIn { cycle_us, .. } | Program::Attached { cycle_us } => Some(cycle_us),
        }
    }

    /// Changes the state of the controller; the program runs only in Run.
    pub(super) fn enter(&mut self, ctx: &mut Context, to: u32) {
        let before = core::mem::replace(&mut self.state, to);
        if before == to {
            return;
        }
        self.end_at = None;
        ctx.report(ControllerState { plc: ctx.origin.plc, to: to as u8 });
        self.order_program(before);
        if to == state::RUN {
            self.begin_cycle(ctx.now);
        }
    }

    /// Orders the program to start after the reset, to continue after a stop, and to stop when the state Run
    /// ends (p. 13-14, D-630).
    fn order_program(&self, before: u32) {
        match (before, self.state) {
            _ if self.program == Program::None => {}
            (state::RESET, state::RUN) => self.node.registers.order(Start::Warm),
            (_, state::RUN) => self.node.registers.order(Start::Hot),
            (state::RUN, _) => self.node.registers.order(Start::Stop),
            _ => {}
        }
    }

    /// Handles a request of a client for a start. For example, a client makes such a request if it attaches
    /// its program while the controller runs.
    fn look_at_start_request(&mut self, ctx: &mut Context) {
        let Some(code) = self.node.registers.take_start_request() else { return };
        match Start::from_code(code) {
            Some(kind @ (Start::Cold | Start::Warm | Start::Hot)) if self.runs_program() => {
                self.node.registers.order(kind);
                self.pulses.add_order();
                program::report(ctx, BoardEvent::Start { kind });
            }
            _ => program::refuse_start(ctx, code),
        }
    }

    fn runs_program(&self) -> bool {
        self.state == state::RUN && self.program != Program::None
    }

    /// Returns the state of the program for the board.
    fn program_state(&self) -> ProgramState {
        match (&self.program, self.state) {
            (Program::None, _) => ProgramState::None,
            (_, state::RUN) => ProgramState::Cyclic,
            _ => ProgramState::Stopped,
        }
    }

    /// Enters Run or Stop when the node's state has changed (p. 13-14, D-428).
    fn follow_node(&mut self, ctx: &mut Context) {
        let to = if self.node.state() == State::Stopped { state::STOP } else { state::RUN };
        self.enter(ctx, to);
    }

    /// Handles a network management command.
    fn command(&mut self, ctx: &mut Context, command: Command) {
        if self.node.state() == State::Initialising {
            return;
        }
        let flags = &self.node.registers.flags;
        match command {
            Command::Stop => self.node.set_state(State::Stopped, ctx.now),
            // Manual p. 28: network management does not start a controller that the programming system has stopped.
            Command::Start | Command::EnterPreOperational if self.is_stopped => return,
            Command::Start => self.node.set_state(State::Operational, ctx.now),
            Command::EnterPreOperational => self.node.set_state(State::PreOperational, ctx.now),
            Command::ResetNode | Command::ResetCommunication => {
                let flag = match command {
                    Command::ResetNode => &flags.COP_EVENT_RESETNODE,
                    _ => &flags.COP_EVENT_RESETCOM,
                };
                flag.store(bool::TRUE);
                self.node.forget_identifiers();
                let state = if self.is_stopped { State::Stopped } else { State::PreOperational };
                self.node.restart(state, ctx.now);
            }
        }
        self.follow_node(ctx);
    }

    /// Ends the work of the operating system: the program stops, and the device is no longer a CANopen node.
    pub(super) fn fall_silent(&mut self, ctx: &mut Context, to: u32) {
        self.node.fall_silent();
        self.end_master();
        self.enter(ctx, to);
    }

    /// Checks the hardware as the operating system does.
    fn diagnose(&mut self, ctx: &mut Context) {
        let defects = self.shared.defects();
        let is_at_work = matches!(self.state, state::RESET | state::RUN | state::STOP);
        if is_at_work && defects.is_fatal {
            self.fall_silent(ctx, state::FATAL_ERROR);
        }
        let found = match self.state {
            state::RUN => Diagnosis::of(&defects, self.wanted()),
            state::STOP => Diagnosis::of(&defects, 0),
            _ => Diagnosis::default(),
        };
        // This sets the common flag, because no other flag reports this error to the program (p. 18, D-461).
        if found.has_more_than(&self.diagnosis) {
            self.node.registers.flags.ERROR.store(bool::TRUE);
        }
        self.diagnosis = found;
    }

    /// Begins a cycle: updates inputs and flags, and notifies the program.
    fn begin_cycle(&mut self, now: u64) {
        self.read_inputs(now);
        (self.begun_at, self.is_overdue) = (now, false);
        self.end_at = self.cycle_us().map(|cycle_us| now + cycle_us);
        self.node.registers.fire_event(events::CYCLE, now);
        self.pulses.add(events::CYCLE);
    }

    /// Updates the inputs and the SYNC flag for a cycle of the program.
    fn read_inputs(&mut self, now: u64) {
        let registers = &self.node.registers;
        registers.inputs.I0.store(self.peripherals.inputs(registers, now));
        registers.inputs.S2.store((registers.turned(FRONT_S2) & 0xF) as u8);
        let keys = [
            (&registers.inputs.S3, FRONT_S3),
            (&registers.inputs.S4, FRONT_S4),
            (&registers.inputs.S5, FRONT_S5),
        ];
        keys.into_iter()
            .for_each(|(register, word)| register.store(u8::from(registers.turned(word) == key::PRESSED)));
        let has_sync = core::mem::take(&mut self.node.has_sync);
        registers.flags.COP_SYNC.store(if has_sync { bool::TRUE } else { bool::FALSE });
    }

    /// Runs the built-in program in its first cycles.
    fn run_built_in(&mut self, ctx: &mut Context) {
        let Program::BuiltIn { pdos, guarding, master, .. } = &self.program else { return };
        match self.cycles {
            0 => self.node.registers.flags.CAN_OPEN.store(bool::TRUE),
            1 => {
                if let Some(guarding) = guarding {
                    self.node.set_guarding(guarding, ctx.now);
                }
                // Each request would reset the communication, and only the result of the last reset would
                // remain (p. 155). So the device is reset only once, after all requests.
                if !pdos.is_empty() {
                    pdos.iter().for_each(|(way, pdo, config)| self.node.ask_pdo(*way, *pdo, *config));
                    self.node.restart(State::PreOperational, ctx.now);
                }
            }
            // The role of master begins in this cycle. A reset in an earlier cycle would have ended it (p.
            // 48).
            2 => {
                if let Some(config) = master.clone() {
                    self.master = Some(Master::new(config, self.make_master(), ctx.now));
                }
            }
            _ => {}
        }
        self.cycles = self.cycles.saturating_add(1).min(3);
    }

    /// Ends a cycle of the program: executes the requests that the program has made in this cycle, and begins
    /// the next cycle.
    fn end_cycle(&mut self, ctx: &mut Context) {
        self.run_built_in(ctx);
        self.open(ctx.now);
        if let (Some(master), Some(nmt)) = (&mut self.master, &mut self.nmt) {
            master.start(nmt, &mut self.node, ctx.now);
        }
        let outputs = self.node.registers.outputs.Q0.load();
        let Peripherals { pwm, findings, .. } = &mut self.peripherals;
        findings.extend(watch::pwm_outputs(self.outputs, outputs, pwm.outputs()));
        self.outputs = outputs;
        self.node.cycle(ctx.now);
        self.begin_cycle(ctx.now);
    }

    /// Handles a cycle that does not end. The watchdog resets the device 200 ms after the start of the cycle
    /// (p. 7).
    fn overdue(&mut self, ctx: &mut Context) {
        let bites_at = self.begun_at + WATCHDOG_US;
        self.is_overdue = true;
        self.end_at = Some(bites_at).filter(|at| ctx.now < *at);
        if self.end_at.is_none() {
            ctx.report(Watchdog { plc: ctx.origin.plc });
            self.shared.restart();
        }
    }

    /// Returns the outputs that the program has switched on. %QW0 has no effect on PWM outputs (p. 91).
    fn wanted(&self) -> u16 {
        self.outputs & !self.peripherals.pwm.outputs() | self.peripherals.pwm.on()
    }

    fn stat(&self, has_error: bool) -> u32 {
        let is_slow = self.node.state() == State::PreOperational;
        match (self.state, has_error, is_slow) {
            (state::OFF, ..) => stat::DARK,
            (state::RESET, ..) => stat::GREEN_AND_RED,
            (state::STOP, ..) => stat::GREEN,
            (state::NO_OPERATING_SYSTEM, ..) => stat::GREEN_5_HZ,
            (state::RUN, false, true) => stat::GREEN_0_5_HZ,
            (state::RUN, false, false) => stat::GREEN_2_HZ,
            (state::RUN, true, true) => stat::RED_0_5_HZ,
            (state::RUN, true, false) => stat::RED_2_HZ,
            _ => stat::RED,
        }
    }

    /// Updates flags, front panel, journal and frames after any change.
    fn show(&mut self, ctx: &mut Context, controller: &mut Controller) {
        self.can_errors.look(&self.node.registers.flags, controller);
        self.diagnose(ctx);
        for (rule, offset, value) in self.peripherals.findings.drain(..) {
            let (plc, live) = (ctx.origin.plc, RegisterPhase::ALWAYS);
            ctx.journal.find(ctx.now, Finding { rule, plc, offset, live, value, late_us: 0 });
        }
        let has_error = self.node.registers.flags.ERROR.load() != bool::FALSE;
        if self.node.state() != State::Initialising {
            let has_can_error = self.node.registers.flags.CAN_ERROR.load() != bool::FALSE;
            self.node.set_errors(&self.diagnosis, has_can_error, has_error);
        }
        let (state, node) = (self.node.state(), self.node.number());
        if core::mem::replace(&mut self.reported, state) != state {
            ctx.report(NodeState { plc: ctx.origin.plc, to: state.code(), node });
        }
        let registers = &self.node.registers;
        let is = |so: bool| if so { bool::TRUE } else { bool::FALSE };
        registers.flags.COP_PREOPERATIONAL.store(is(state == State::PreOperational));
        registers.flags.UNLOCK.store(is(registers.turned(FRONT_S1) == s1::UNLOCK));
        let is_driven = self.state == state::RUN && !has_error;
        let outputs = self.wanted() & !self.diagnosis.short_circuits;
        registers.shown(FRONT_OUTPUTS).store(if is_driven { outputs.into() } else { 0 });
        self.peripherals.show(registers, is_driven);
        registers.shown(FRONT_STATE).store(self.state);
        registers.show_program(self.program_state());
        registers.shown(FRONT_STAT).store(self.stat(has_error));
        if let Some(filters) = self.node.take_filters() {
            controller.set_filters(filters);
        }
        for frame in self.node.take_frames() {
            if controller.send(frame).is_err() {
                self.can_errors.lost_to_send(&self.node.registers.flags);
            }
        }
    }
}

impl CanPort for Firmware {
    fn power_on(&mut self, ctx: &mut Context, controller: &mut Controller, _: u8) {
        self.node.registers.clear_flags();
        self.peripherals.power_on(&self.node.registers, ctx.now);
        self.node.power_on();
        self.end_master();
        self.under_way = StartedOrders::default();
        (self.reported, self.is_stopped, self.cycles, self.outputs) = (State::Initialising, false, 0, 0);
        self.diagnosis = Diagnosis::default();
        (self.interrupt, self.can_errors) = (Interrupt::default(), CanErrors::default());
        if self.node.registers.parameters.b_OPERATING_SYSTEM.load() == loaded::NO {
            self.enter(ctx, state::NO_OPERATING_SYSTEM);
        } else {
            self.enter(ctx, state::RESET);
            self.end_at = Some(ctx.now + RESET_US);
        }
        controller.set_bit_rate(u32::from(self.node.registers.flags.CANBAUDRATE.load()) * 1000);
        self.show(ctx, controller);
    }

    fn power_off(&mut self) {
        let before = core::mem::replace(&mut self.state, state::OFF);
        self.order_program(before);
        (self.end_at, self.is_overdue) = (None, false);
        for word in [FRONT_STATE, FRONT_STAT, FRONT_OUTPUTS] {
            self.node.registers.shown(word).store(0);
        }
        self.peripherals.power_off(&self.node.registers);
    }

    fn look(&mut self, ctx: &mut Context, controller: &mut Controller) {
        if self.state == state::OFF {
            return;
        }
        self.look_at_command(ctx);
        self.look_at_start_request(ctx);
        // If the program no longer hangs, it ends its cycle.
        if self.is_overdue && self.end_at.is_some() && !self.shared.defects().is_hanging {
            self.end_at = Some(ctx.now);
        }
        self.peripherals.look(&self.node.registers, ctx.now);
        self.look_at_jobs(ctx, controller);
        self.show(ctx, controller);
    }

    fn has_changed(&self) -> bool {
        let registers = &self.node.registers;
        registers.turned(FRONT_PROGRAM) != command::NOTHING
            || self.state != state::OFF
                && (registers.has_start_request()
                    || registers.reported_program() != self.program_state().code())
            || self.state == state::RUN && self.under_way.has_new_orders(registers)
    }

    fn received(&mut self, ctx: &mut Context, controller: &mut Controller, frame: &Frame) {
        if !self.node.keep(frame) {
            self.can_errors.lost_received(&self.node.registers.flags);
        }
        if frame.id() == Id::Standard(StandardId::ZERO) {
            if let Some(command) = Command::parse(frame.data(), self.node.number()) {
                self.command(ctx, command);
            }
        } else {
            self.node.received(ctx.now, frame);
            if let (Some(nmt), Id::Standard(id), false) = (&mut self.nmt, frame.id(), frame.is_remote_frame())
            {
                nmt.received(&mut self.node, ctx.now, id.as_raw(), frame.data());
            }
        }
        self.continue_jobs(ctx, controller);
        self.show(ctx, controller);
    }

    /// Only `CAN_RESTART` ends BUS-off (p. 35).
    fn error_state(&mut self, ctx: &mut Context, controller: &mut Controller, state: ErrorState) {
        if self.state != state::OFF {
            self.can_errors.state(&self.node.registers.flags, state);
            self.show(ctx, controller);
        }
    }

    fn overrun(&mut self, ctx: &mut Context, controller: &mut Controller, _: &Frame) {
        self.can_errors.lost_received(&self.node.registers.flags);
        self.show(ctx, controller);
    }

    fn next_time(&self) -> u64 {
        let of_nmt = self.nmt.as_ref().map_or(u64::MAX, Nmt::next_time);
        // Manual p. 28: if the programming system has stopped the program, the device does not act as a
        // master.
        let of_master = match (&self.master, &self.nmt) {
            (Some(master), Some(nmt)) if self.state == state::RUN => master.next_time(nmt),
            _ => u64::MAX,
        };
        let of_interrupt = if self.state == state::RUN { self.interrupt.next_time() } else { u64::MAX };
        let own = self.end_at.unwrap_or(u64::MAX).min(self.peripherals.next_time()).min(of_interrupt);
        own.min(self.node.next_time()).min(of_nmt).min(of_master)
    }

    fn due(&mut self, ctx: &mut Context, controller: &mut Controller) {
        if self.end_at.is_some_and(|end| end <= ctx.now) {
            // The orders of a cycle must be carried out before the cycle ends.
            self.look_at_jobs(ctx, controller);
            if self.state == state::RESET {
                self.init_can(controller);
            }
            match self.state {
                state::RESET if self.program == Program::None => self.enter(ctx, state::STOP),
                state::RESET => self.enter(ctx, state::RUN),
                _ if self.shared.defects().is_hanging => self.overdue(ctx),
                _ => {
                    // Every program should call CAN_ERRORHANDLER in each cycle (p. 19, 36), so the built-in
                    // program does this, too.
                    if matches!(self.program, Program::BuiltIn { .. }) {
                        self.can_errors.handle(controller, false);
                    }
                    self.end_cycle(ctx);
                }
            }
        }
        self.node.due(ctx.now);
        self.peripherals.due(&self.node.registers, ctx.now);
        if self.state == state::RUN {
            let Firmware { interrupt, node, peripherals, pulses, outputs, .. } = self;
            interrupt.due(&node.registers, peripherals, pulses, outputs, ctx.now);
        }
        if let Some(nmt) = &mut self.nmt {
            nmt.due(&mut self.node, ctx.now);
            if let Some(master) = self.master.as_mut().filter(|_| self.state == state::RUN) {
                master.due(nmt, &mut self.node, ctx.now);
            }
        }
        self.continue_jobs(ctx, controller);
        self.show(ctx, controller);
    }
}
