//! For each rule something that breaks it, and next to it something much alike that is right.

mod baps;
mod jobs;
mod mapping;
mod registers;
mod start;

use crate::rig::Rig;
use commram::devices::omega_drive_line_2::registers::{BAPS, BAPS_CTRL_BMSTRUCT};
use commram::journal::Rule;
use commram::memory::View;

/// How a rule is broken, and how its correct neighbour goes. Both start from a fresh plant.
pub(crate) struct Case {
    pub rule: &'static Rule,
    /// Name of the register that the finding is about.
    pub register: &'static str,
    /// Value in the finding.
    pub value: u32,
    pub wrong: fn(&mut Rig),
    pub right: fn(&mut Rig),
}

/// All of them.
pub(crate) fn cases() -> impl Iterator<Item = &'static Case> {
    [registers::CASES, mapping::CASES, jobs::CASES, start::CASES, baps::CASES].into_iter().flatten()
}

/// BAPS registers of PLC `a`, at whose drive the clock has been running.
fn baps(rig: &mut Rig) -> View<BAPS_CTRL_BMSTRUCT> {
    rig.step(5000);
    rig.plant.devices()[0].segment().view(BAPS).unwrap()
}
