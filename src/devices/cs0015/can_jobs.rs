//! Functions of CAN as such (p. 30-36).

use super::communication::is_rate;
use super::jobs::{Answer, Desk, Job, Outcome, Refusal};
use super::registers::values::job;

pub(super) fn carry_out(desk: Desk, job: &Job) -> Outcome {
    match job.function {
        job::CAN_BAUDRATE => can_baudrate(desk, job),
        _ => Err(Refusal::Function),
    }
}

/// In force at once, and stored (p. 31); what an SDO enters is in force after a reset (p. 41, D-437).
fn can_baudrate(desk: Desk, job: &Job) -> Outcome {
    let kbit_s = job.argument(0, 0..=u32::from(u16::MAX))? as u16;
    if !is_rate(kbit_s) {
        return Err(Refusal::Arguments);
    }
    desk.firmware.node.set_rate(kbit_s);
    desk.controller.set_bit_rate(u32::from(kbit_s) * 1000);
    Ok(Answer::default())
}
