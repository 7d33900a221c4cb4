//! Commands of the programming system (p. 13-17).

use crate::devices::Context;
use crate::devices::canopen::nmt::State;
use crate::devices::cs0015::emulation::port::{Firmware, Program};
use crate::devices::cs0015::emulation::records::{CommandRefused, RefusalReason};
use crate::devices::cs0015::registers::FRONT_S1;
use crate::devices::cs0015::registers::values::{loaded, program, s1, state};

/// Conditions for commands of the programming system.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Readiness {
    /// True if S1 is at UNLOCK.
    pub is_unlocked: bool,
    /// True if a program is loaded.
    pub has_program: bool,
    /// True if the operating system was erased since the last reset.
    pub has_been_erased: bool,
    /// Operating state: a value of the register `front.state`.
    pub state: u32,
}

impl Readiness {
    /// Checks whether `command`, a value of the register `front.program`, is permitted (p. 11-17).
    ///
    /// # Errors
    /// The reason for a refusal.
    pub(crate) fn check(self, command: u32) -> Result<(), RefusalReason> {
        match (command, self.state) {
            _ if !self.is_unlocked => Err(RefusalReason::Locked),
            (program::RUN | program::STOP, _) if !self.has_program => Err(RefusalReason::NoProgram),
            (program::RUN | program::STOP | program::ERASE | program::RESET, state::RUN | state::STOP) => {
                Ok(())
            }
            (program::LOAD, state::NO_OPERATING_SYSTEM) if self.has_been_erased => {
                Err(RefusalReason::NeedsReset)
            }
            (program::LOAD, state::NO_OPERATING_SYSTEM) => Ok(()),
            _ => Err(RefusalReason::State),
        }
    }
}

impl Firmware {
    /// Carries out a command of the programming system, or reports the reason for a refusal.
    pub(crate) fn look_at_command(&mut self, ctx: &mut Context) {
        let registers = &self.node.registers;
        let Some(command) = registers.take_command() else { return };
        let readiness = Readiness {
            is_unlocked: registers.turned(FRONT_S1) == s1::UNLOCK,
            has_program: self.program != Program::None,
            has_been_erased: self.shared.defects().has_been_erased,
            state: self.state,
        };
        match readiness.check(command) {
            Ok(()) => self.carry_out(ctx, command),
            Err(why) => {
                ctx.report(CommandRefused { plc: ctx.origin.plc, command: command as u8, why: why as u8 });
            }
        }
    }

    /// Carries out a command that [`Readiness::check`] permits.
    fn carry_out(&mut self, ctx: &mut Context, command: u32) {
        match command {
            program::STOP => {
                self.is_stopped = true;
                self.go(ctx, State::Stopped, state::STOP);
            }
            program::RUN if self.state == state::STOP => {
                self.is_stopped = false;
                self.go(ctx, State::PreOperational, state::RUN);
            }
            // Manual p. 16: the operating system is erased, and the device no longer answers.
            program::ERASE => {
                self.shared.erased();
                self.node.registers.parameters.b_OPERATING_SYSTEM.store(loaded::NO);
                self.fall_silent(ctx, state::NO_OPERATING_SYSTEM);
            }
            program::LOAD => {
                self.node.registers.parameters.b_OPERATING_SYSTEM.store(loaded::YES);
                self.shared.restart();
            }
            // Manual p. 28: after the command the device is not a CANopen node. It becomes a node when the
            // program switches CANopen on.
            program::RESET => self.shared.restart(),
            _ => {}
        }
    }

    /// Changes the state of the controller. If the device is a CANopen node, also changes the state of the
    /// node.
    fn go(&mut self, ctx: &mut Context, node: State, to: u32) {
        if self.node.state() != State::Initialising {
            self.node.set_state(node, ctx.now);
        }
        self.enter(ctx, to);
    }
}
