//! Commands of the programming system (p. 13-17).

use super::port::{Firmware, Program};
use super::records::{CommandRefused, Refused};
use super::registers::FRONT_S1;
use super::registers::values::{loaded, program, s1, state};
use crate::devices::Context;
use crate::devices::canopen::nmt::State;

impl Firmware {
    /// A command, for which S1 has to stand at UNLOCK (p. 11, 13, 17).
    pub(super) fn look_at_command(&mut self, ctx: &mut Context) {
        let registers = &self.node.registers;
        let Some(command) = registers.take_command() else { return };
        let is_locked = registers.turned(FRONT_S1) != s1::UNLOCK;
        let done = if is_locked { Err(Refused::Locked) } else { self.carry_out(ctx, command) };
        if let Err(why) = done {
            ctx.report(CommandRefused { plc: ctx.origin.plc, command: command as u8, why: why as u8 });
        }
    }

    fn carry_out(&mut self, ctx: &mut Context, command: u32) -> Result<(), Refused> {
        let has_program = self.program != Program::None;
        match (command, self.state) {
            (program::RUN | program::STOP, _) if !has_program => Err(Refused::NoProgram),
            (program::STOP, state::RUN | state::STOP) => {
                self.is_stopped = true;
                self.go(ctx, State::Stopped, state::STOP);
                Ok(())
            }
            (program::RUN, state::STOP) => {
                self.is_stopped = false;
                self.go(ctx, State::PreOperational, state::RUN);
                Ok(())
            }
            (program::RUN, state::RUN) => Ok(()),
            // P. 16: the operating system is erased, and nobody answers any more.
            (program::ERASE, state::RUN | state::STOP) => {
                self.has_been_erased = true;
                self.node.registers.parameters.b_OPERATING_SYSTEM.store(loaded::NO);
                self.fall_silent(ctx, state::NO_OPERATING_SYSTEM);
                Ok(())
            }
            (program::LOAD, state::NO_OPERATING_SYSTEM) if self.has_been_erased => Err(Refused::NeedsReset),
            (program::LOAD, state::NO_OPERATING_SYSTEM) => {
                self.node.registers.parameters.b_OPERATING_SYSTEM.store(loaded::YES);
                self.shared.restart();
                Ok(())
            }
            _ => Err(Refused::State),
        }
    }

    /// The controller goes into another state, and the node, if it is one, as well.
    fn go(&mut self, ctx: &mut Context, node: State, to: u32) {
        if self.node.state() != State::Initialising {
            self.node.set_state(node, ctx.now);
        }
        self.enter(ctx, to);
    }
}
