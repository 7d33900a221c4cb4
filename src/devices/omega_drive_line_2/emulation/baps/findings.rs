//! Errors that the drive finds when it accepts a command; the access checker counts them.

use super::cycle::Cycle;
use crate::check;
use crate::devices::Context;
use crate::devices::cansync;
use crate::devices::cansync::drive::{BuiltInDrive, pwm_objection};
use crate::devices::omega_drive_line_2::registers::BAPS_CTRL_BMSTRUCT;
use crate::journal::Rule;
use crate::layout::RegisterPhase;
use crate::memory::Header;
use crate::memory::header::ProgramState;
use core::mem::offset_of;

/// Number of cycles that the PLC program must have ended before the first configuration (manual 5.00005.03a
/// p. 63).
const CYCLES_BEFORE: u32 = 5;

/// True if the PLC program reports its cycles but has not reached its sixth cycle yet (decision D-313).
pub(super) fn is_too_early(asked: &Header) -> bool {
    match ProgramState::from_code(asked.program.state.load()) {
        Some(ProgramState::Initializing) => true,
        Some(ProgramState::Cyclic) => (1..=CYCLES_BEFORE).contains(&asked.program_cycles.load()),
        _ => false,
    }
}

/// Reports that the register at `offset` of the BAPS breaks a rule.
pub(super) fn find(ctx: &mut Context, rule: &'static Rule, offset: usize, value: u32) {
    ctx.find(rule, RegisterPhase::ALWAYS, offset, value);
}

/// Returns the cycle times in `w_COMMAND_REG`. If they are reserved values, reports this and returns `None`.
/// The watch over registers reports reserved bits.
pub(super) fn cycle_of(ctx: &mut Context, regs: &BAPS_CTRL_BMSTRUCT) -> Option<Cycle> {
    let word = regs.w_COMMAND_REG.load();
    let cycle = Cycle::from_register(word);
    if cycle.is_none() {
        let offset = offset_of!(BAPS_CTRL_BMSTRUCT, w_COMMAND_REG);
        find(ctx, &check::rules::RESERVED_VALUE, offset, word.into());
    }
    cycle
}

/// Reports a PWM frequency (P103) for which the manual has no masks of P258. The finding names the register
/// through which the PLC sets the frequency (decision D-292).
pub(super) fn find_wrong_pwm(ctx: &mut Context, drive: &BuiltInDrive) {
    let khz = drive.regler().pwm_khz();
    if pwm_objection(khz).is_some() {
        find(ctx, &cansync::rules::DRIVE_PWM, offset_of!(BAPS_CTRL_BMSTRUCT, ud_PAR_VALUE), khz);
    }
}
