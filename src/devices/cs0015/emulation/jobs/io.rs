//! Functions for I/O modules (p. 71-85).

use super::master::{has_room, master, result, results};
use crate::devices::canopen::nmt::{Command, State};
use crate::devices::cr201x::Model;
use crate::devices::cs0015::emulation::canopen::io_slaves::{ModuleOutputs, NODES, Slave, Transfer};
use crate::devices::cs0015::emulation::canopen::nmt::Restart;
use crate::devices::cs0015::emulation::jobs::{Answer, Job, JobContext, OutOfRange, Outcome, Refusal};
use crate::devices::cs0015::registers::values::{bool, job};

/// Duration of the network's boot-up, in us (p. 73: more than 2 s).
const BOOT_UP_US: u64 = 2_000_000;
/// Values of CFG_RESULT (p. 77). `DONE`: read or written. `NOT_YET`: not yet read or written.
const DONE: u32 = 1;
const NOT_YET: u32 = 2;
/// Identifiers of a module's receive PDOs (D-451).
const DIGITAL_OUTPUTS: u16 = 0x200;
const ANALOG_OUTPUTS: u16 = 0x300;

pub(crate) fn carry_out(job_context: JobContext, job: &Job) -> Outcome {
    match job.function {
        job::COP_MSTR_BOOTUP => boot_up(job_context, job),
        job::COP_MSTR_MAIN => main(job_context, job),
        job::SLAVE_CR2010_CONFIG => configure(job_context, job, Model::Cr2010),
        job::SLAVE_CR2010_WORK => work(job_context, job, Model::Cr2010),
        job::SLAVE_CR2011_CONFIG => configure(job_context, job, Model::Cr2011),
        job::SLAVE_CR2011_WORK => work(job_context, job, Model::Cr2011),
        _ => Err(Refusal::Function),
    }
}

fn number_of_nodes(job: &Job) -> Result<u8, OutOfRange> {
    Ok(job.argument(0, 1..=127)? as u8)
}

/// Makes the device the master of nodes 1 to NO_NODE. The order finishes 2 s later (p. 73, D-449).
fn boot_up(job_context: JobContext, job: &Job) -> Outcome {
    let count = number_of_nodes(job)?;
    let (guard_ms, life) = (job.argument(1, 0..=65_535)?, job.argument(2, 0..=255)? as u8);
    let JobContext { firmware, place, now, .. } = job_context;
    if let (Some(nmt), node) = (&mut firmware.nmt, &mut firmware.node)
        && let Some((_, until)) = nmt.io.boot_up.filter(|(of, _)| *of == place)
    {
        nmt.guard(node, now);
        if now < until {
            return Err(Refusal::Later);
        }
        nmt.io.boot_up = None;
        return Ok(result(1));
    }
    firmware.node.registers.flags.CAN_OPEN.store(bool::TRUE);
    firmware.open(now);
    firmware.make_master();
    let (Some(nmt), node) = (&mut firmware.nmt, &mut firmware.node) else { return Err(Refusal::State) };
    nmt.command(node, Command::EnterPreOperational, 0);
    for number in (1..=count).filter(|number| *number != node.number()) {
        nmt.network.add(number, u64::from(guard_ms) * 1000, life);
    }
    nmt.network.start(0, now);
    nmt.has_sync = true;
    nmt.io.boot_up = Some((place, now + BOOT_UP_US));
    Err(Refusal::Later)
}

/// Sends SYNC objects, requests the states of the nodes, and notes missing nodes (p. 75-76).
fn main(mut job_context: JobContext, job: &Job) -> Outcome {
    number_of_nodes(job)?;
    let sync_us = u64::from(job.argument(1, 0..=65_535)?) * 1000;
    let (is_automatic, is_to_forget) = (job.argument(2, 0..=1)? != 0, job.argument(3, 0..=1)? != 0);
    let now = job_context.now;
    let (nmt, node, controller) = master(&mut job_context).ok_or(Refusal::State)?;
    nmt.restart = if is_automatic { Restart::Missing } else { Restart::Never };
    nmt.guard(node, now);
    nmt.io.note_missing(nmt.network.all_missing().collect());
    if is_to_forget {
        nmt.io.forget_missing();
    }
    if sync_us != 0 && now >= nmt.io.next_sync && has_room(node, controller) {
        // If the call is more than one period late, the schedule starts again at this call.
        let next = nmt.io.next_sync + sync_us;
        nmt.io.next_sync = if next > now { next } else { now + sync_us };
        node.send_sync(now);
    }
    Ok(Answer { data: nmt.io.missing().to_vec(), ..Answer::default() })
}

/// Writes and reads the configuration of a module, entry by entry (p. 77-79, 81-83). The order is checked
/// again until it is finished.
fn configure(mut job_context: JobContext, job: &Job, model: Model) -> Outcome {
    let number = job.argument(0, NODES)? as u8;
    let (is_read, is_write) = (job.argument(2, 0..=1)? != 0, job.argument(3, 0..=1)? != 0);
    let pwm_hz = job.argument(1, 0..=255)? as u8;
    let kinds = job.data.get(..model.values()).ok_or(Refusal::Arguments)?;
    let (now, place) = (job_context.now, job_context.place);
    let (nmt, node, _) = master(&mut job_context).ok_or(Refusal::State)?;
    if !nmt.network.has(number) {
        return Err(Refusal::State);
    }
    if !is_read && !is_write {
        return Ok(Answer::default());
    }
    let finished = nmt.finished(place);
    let configuring = nmt.io.configuring(place, model, is_write.then_some((kinds, pwm_hz)), is_read);
    match finished {
        Some(Ok(data)) => configuring.is_done(&data),
        Some(Err(code)) => {
            nmt.io.withdraw(place);
            return Ok(results(&[NOT_YET, code]));
        }
        None => {}
    }
    let Some(transfer) = configuring.now() else {
        let read = configuring.read().to_vec();
        if is_read {
            nmt.io.has_read(number, model, &read);
        }
        nmt.io.withdraw(place);
        return Ok(Answer { data: read, ..result(DONE) });
    };
    if nmt.sdo.is_free() {
        let request = match transfer {
            Transfer::Write(at, value) => nmt.sdo.write(place, number, at, &[value], now),
            Transfer::Read(at) => nmt.sdo.read(place, number, at, 1, now),
        };
        node.send_sdo(number, request);
    }
    Err(Refusal::Later)
}

/// Exchanges the words of an Operational module (p. 80, 84-85). Unchanged values are not sent again.
fn work(mut job_context: JobContext, job: &Job, model: Model) -> Outcome {
    let (is_init, number) = (job.argument(0, 0..=1)? != 0, job.argument(1, NODES)? as u8);
    let (nmt, node, controller) = master(&mut job_context).ok_or(Refusal::State)?;
    let is_operational = nmt.network.state(number) == Some(State::Operational);
    let of_model = |it: &&mut Slave| it.node == number && it.channels.model == model;
    let Some(slave) = nmt.io.slaves.iter_mut().find(of_model) else { return Ok(result(0)) };
    slave.is_known |= is_init;
    if !is_operational || !slave.is_known {
        slave.sent = ModuleOutputs::default();
        return Ok(result(0));
    }
    let to_send = slave.exchange(&node.registers);
    if to_send.bits != slave.sent.bits || to_send.words != slave.sent.words {
        if !has_room(node, controller) {
            return Ok(result(0));
        }
        if let Some(bits) = to_send.bits.filter(|_| to_send.bits != slave.sent.bits) {
            node.send_to(DIGITAL_OUTPUTS, number, &[bits]);
        }
        if let Some(words) = to_send.words.filter(|_| to_send.words != slave.sent.words) {
            node.send_to(ANALOG_OUTPUTS, number, &words.map(u16::to_le_bytes).concat());
        }
        slave.sent = to_send;
    }
    Ok(result(1))
}
