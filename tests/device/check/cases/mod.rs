//! For each rule: one case that breaks it, and a similar case that is correct.

mod jobs;
mod mapping;
mod omega;
mod registers;
mod start;

use crate::rig::{NodeDevice, Rate, Rig};
use commram::journal::Rule;

/// A case that breaks a rule, and a correct neighbour. Both start from a fresh plant.
pub(crate) struct Case {
    pub rule: &'static Rule,
    /// Name of the register that the finding is about, with `MASTER` or `SLAVE` for the area of a node.
    pub register: &'static str,
    /// Value in the finding.
    pub value: fn(Rate) -> u32,
    pub wrong: fn(&mut Rig),
    pub right: fn(&mut Rig),
}

/// Returns all cases that a device has.
pub(crate) fn cases(kind: &NodeDevice) -> impl Iterator<Item = &'static Case> {
    let own = if kind.is_omega() { omega::CASES } else { &[] };
    [registers::CASES, mapping::CASES, jobs::CASES, start::CASES, own].into_iter().flatten()
}
