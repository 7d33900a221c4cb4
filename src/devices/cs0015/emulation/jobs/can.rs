//! Functions for plain CAN (p. 30-36).

use crate::can::StandardId;
use crate::devices::cs0015::emulation::canopen::communication::is_rate;
use crate::devices::cs0015::emulation::jobs::{Answer, Job, JobContext, Outcome, Refusal};
use crate::devices::cs0015::registers::values::job;

pub(crate) fn carry_out(job_context: JobContext, job: &Job) -> Outcome {
    match job.function {
        job::CAN_BAUDRATE => can_baudrate(job_context, job),
        job::CAN_TRANSMIT => can_transmit(job_context, job),
        job::CAN_RECEIVE => can_receive(job_context, job),
        job::CAN_RESTART => {
            job_context.firmware.init_can(job_context.controller);
            job_context.controller.restart();
            Ok(Answer::default())
        }
        job::CAN_ERRORHANDLER => can_errorhandler(job_context, job),
        _ => Err(Refusal::Function),
    }
}

/// Sets the bit rate. It takes effect at once and is stored (p. 31). In contrast, a bit rate that is written
/// by SDO takes effect after a reset (p. 41, D-437).
fn can_baudrate(job_context: JobContext, job: &Job) -> Outcome {
    let kbit_s = job.argument(0, 0..=u32::from(u16::MAX))? as u16;
    if !is_rate(kbit_s) {
        return Err(Refusal::Arguments);
    }
    job_context.firmware.node.set_rate(kbit_s);
    job_context.firmware.init_can(job_context.controller);
    Ok(Answer::default())
}

/// Returns an identifier argument. The manual also allows 2048, which does not fit in eleven bits (D-438).
fn identifier(job: &Job, argument: usize) -> Result<StandardId, Refusal> {
    let id = job.argument(argument, 0..=0x7FF)?;
    StandardId::new(id as u16).ok_or(Refusal::Arguments)
}

/// Runs `CAN_TRANSMIT`. RESULT is FALSE while the controller still has a frame to send (p. 23).
fn can_transmit(job_context: JobContext, job: &Job) -> Outcome {
    let (id, length) = (identifier(job, 0)?, job.argument(2, 0..=8)? as usize);
    let data = job.data.get(..length).ok_or(Refusal::Arguments)?;
    let node = &mut job_context.firmware.node;
    let is_taken = node.to_send() == 0 && job_context.controller.to_send() == 0;
    if is_taken {
        node.send(id, data);
    }
    let mut answer = Answer::default();
    answer.results[0] = u32::from(is_taken);
    Ok(answer)
}

/// Runs `CAN_RECEIVE`. Returns DLC, RTR, AVAILABLE, OVERFLOW and DATA (p. 33-34).
fn can_receive(job_context: JobContext, job: &Job) -> Outcome {
    let (id, is_to_clear) = (identifier(job, 2)?, job.argument(1, 0..=1)? != 0);
    let node = &mut job_context.firmware.node;
    if job.argument(0, 0..=1)? != 0 {
        node.register_identifier(id);
    }
    let found = node.fetch(id, is_to_clear).ok_or(Refusal::State)?;
    let mut answer = Answer { data: found.data, ..Answer::default() };
    answer.results[0] = answer.data.len() as u32;
    (answer.results[2], answer.results[3]) = (found.available.into(), found.has_overflown.into());
    Ok(answer)
}

/// Runs `CAN_ERRORHANDLER`. Returns ERRORCOUNT, and starts the return of a BUS-off controller (p. 36).
fn can_errorhandler(job_context: JobContext, job: &Job) -> Outcome {
    let is_reset = job.argument(0, 0..=1)? != 0;
    let mut answer = Answer::default();
    answer.results[0] = job_context.firmware.can_errors.handle(job_context.controller, is_reset).into();
    Ok(answer)
}
