//! Functions of a CANopen slave (p. 45-51).

use crate::devices::canopen::pdo::Transmission;
use crate::devices::cs0015::emulation::canopen::communication::{PDOS, PdoConfig, PdoDirection};
use crate::devices::cs0015::emulation::canopen::node::GuardingConfig;
use crate::devices::cs0015::emulation::jobs::{Answer, Job, JobContext, OutOfRange, Outcome, Refusal};
use crate::devices::cs0015::registers::values::job;

pub(crate) fn carry_out(job_context: JobContext, job: &Job) -> Outcome {
    match job.function {
        job::NMS_SET_NODEID => nms_set_nodeid(job_context, job),
        job::NMS_GUARDING_CONFIG => nms_guarding_config(job_context, job),
        job::PDO_TX_CONFIG => pdo_config(job_context, job, PdoDirection::Transmit),
        job::PDO_RX_CONFIG => pdo_config(job_context, job, PdoDirection::Receive),
        job::PDO_TX_REFRESH => pdo_tx_refresh(job_context, job),
        _ => Err(Refusal::Function),
    }
}

/// Returns a time argument in ms.
fn ms(job: &Job, argument: usize) -> Result<u16, OutOfRange> {
    job.argument(argument, 0..=u32::from(u16::MAX)).map(|ms| ms as u16)
}

/// Returns the number of a PDO, counted from 0.
fn pdo(job: &Job) -> Result<usize, OutOfRange> {
    job.argument(0, 1..=PDOS as u32).map(|pdo| pdo as usize - 1)
}

fn nms_set_nodeid(job_context: JobContext, job: &Job) -> Outcome {
    let number = job.argument(0, 1..=30)? as u8;
    job_context.firmware.node.set_number(number, job_context.now);
    Ok(Answer::default())
}

fn nms_guarding_config(job_context: JobContext, job: &Job) -> Outcome {
    let life = job.argument(1, 0..=255)? as u8;
    let config = GuardingConfig { guard_ms: ms(job, 0)?, life, cycle_ms: ms(job, 2)? };
    job_context.firmware.node.set_guarding(&config, job_context.now);
    Ok(Answer::default())
}

/// Configures a PDO and resets the communication. This reset ends the role of master (p. 48).
fn pdo_config(job_context: JobContext, job: &Job, way: PdoDirection) -> Outcome {
    let (pdo, id) = (pdo(job)?, job.argument(1, 0..=0x7FF)? as u16);
    let code = job.argument(2, 0..=255)? as u8;
    let kind = Transmission::from_code(code).filter(|_| code != 254).ok_or(OutOfRange)?;
    let inhibit_us = match way {
        PdoDirection::Transmit => u64::from(ms(job, 3)?) * 1000,
        PdoDirection::Receive => 0,
    };
    let firmware = job_context.firmware;
    let id = Some(id).filter(|id| *id != 0 && !firmware.node.is_predefined(way, pdo, *id));
    firmware.node.ask_pdo(way, pdo, PdoConfig { id, kind, inhibit_us });
    firmware.reset_communication(job_context.now);
    Ok(Answer::default())
}

fn pdo_tx_refresh(job_context: JobContext, job: &Job) -> Outcome {
    job_context.firmware.node.refresh_pdo(pdo(job)?);
    Ok(Answer::default())
}
