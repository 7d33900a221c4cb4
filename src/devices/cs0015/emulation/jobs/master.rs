//! Functions of a CANopen master (p. 52-70). Their RESULT is the error code of the manual.

use crate::devices::can_bus::Controller;
use crate::devices::canopen::nmt::{Command, State};
use crate::devices::canopen::sdo::EntryAddress;
use crate::devices::cs0015::emulation::canopen::nmt::{Nmt, Restart};
use crate::devices::cs0015::emulation::canopen::node::Node;
use crate::devices::cs0015::emulation::jobs::{Answer, Job, JobContext, Outcome, Refusal};
use crate::devices::cs0015::registers::values::job;

/// Values of RESULT. `OK`: done. `NOT_SENT`: not sent, or not successful. Then follow the values for
/// parameters out of their ranges, and for a device that is not a master.
const OK: u32 = 0;
const NOT_SENT: u32 = 1;
const PARAMETERS: u32 = 2;
const NO_MASTER: u32 = 255;
/// RESULT of SDOs for a finished transfer. An aborted transfer does not count as finished.
const FINISHED: u32 = 1;
/// Number of bytes in DATA of an SDO (bytes 0 to 255).
const MOST: u32 = 256;

pub(crate) fn carry_out(job_context: JobContext, job: &Job) -> Outcome {
    match job.function {
        job::NMM_SET_NMT_MASTER => set_nmt_master(job_context),
        job::NMM_ADD_NODE => Ok(result(add_node(job_context, job))),
        job::NMM_START_GUARDING => {
            Ok(result(guarding(job_context, job, |nmt, number, now| nmt.network.start(number, now))))
        }
        job::NMM_STOP_GUARDING => {
            Ok(result(guarding(job_context, job, |nmt, number, _| nmt.network.stop(number))))
        }
        job::NMM_NODE_GUARDING => Ok(result(node_guarding(job_context, job))),
        job::NMM_SET_PREOPERATIONAL => Ok(result(command(job_context, job, Command::EnterPreOperational))),
        job::NMM_SET_OPERATIONAL => Ok(result(command(job_context, job, Command::Start))),
        job::NMM_SET_PREPARED => Ok(result(command(job_context, job, Command::Stop))),
        job::NMM_GET_NODE_STATE => Ok(results(&node_state(job_context, job))),
        job::NMM_RESET_NODE => Ok(result(command(job_context, job, Command::ResetNode))),
        // The block of manual p. 65 has an output STATE. The state of a node is unknown after a reset.
        job::NMM_RESET_COMM => Ok(results(&[0, command(job_context, job, Command::ResetCommunication)])),
        job::PDO_INI_SEND_SYNC_OBJ => ini_send_sync(job_context),
        job::PDO_SEND_SYNC_OBJ => Ok(result(u32::from(send_sync(job_context)))),
        job::EMC_GET_EMERGENCY => emergency(job_context),
        job::SDO_READ | job::SDO_WRITE => sdo(job_context, job),
        _ => Err(Refusal::Function),
    }
}

pub(crate) fn results(results: &[u32]) -> Answer {
    let mut answer = Answer::default();
    answer.results.iter_mut().zip(results).for_each(|(to, result)| *to = *result);
    answer
}

pub(crate) fn result(result: u32) -> Answer {
    results(&[result])
}

/// NODE: 0 for all.
fn node_number(job: &Job) -> Option<u8> {
    job.argument(0, 0..=127).ok().map(|number| number as u8)
}

/// If the device is a master, returns the master and related objects.
pub(crate) fn master<'a>(
    job_context: &'a mut JobContext,
) -> Option<(&'a mut Nmt, &'a mut Node, &'a Controller)> {
    Some((job_context.firmware.nmt.as_mut()?, &mut job_context.firmware.node, &*job_context.controller))
}

/// Runs `NMM_SET_NMT_MASTER`. The flag `CAN_OPEN` takes effect at once here, because a program may set it and
/// call the block in its first cycle (p. 52).
fn set_nmt_master(job_context: JobContext) -> Outcome {
    job_context.firmware.open(job_context.now);
    if job_context.firmware.node.state() == State::Initialising {
        return Err(Refusal::State);
    }
    job_context.firmware.make_master();
    Ok(Answer::default())
}

fn add_node(mut job_context: JobContext, job: &Job) -> u32 {
    let number = job.argument(0, 1..=127).map(|number| number as u8);
    let (guard_ms, life) = (job.argument(1, 0..=65_535), job.argument(2, 0..=255));
    let (Ok(number), Ok(guard_ms), Ok(life)) = (number, guard_ms, life) else { return PARAMETERS };
    let Some((nmt, node, _)) = master(&mut job_context) else { return NOT_SENT };
    if number == node.number() {
        return PARAMETERS;
    }
    nmt.network.add(number, u64::from(guard_ms) * 1000, life as u8);
    OK
}

fn guarding(mut job_context: JobContext, job: &Job, does: impl FnOnce(&mut Nmt, u8, u64) -> bool) -> u32 {
    let (now, number) = (job_context.now, node_number(job));
    let (Some((nmt, node, _)), Some(number)) = (master(&mut job_context), number) else { return PARAMETERS };
    let is_known = does(nmt, number, now);
    nmt.show(node);
    if is_known { OK } else { PARAMETERS }
}

/// Requests the states that are due. The program must call the function repeatedly (D-440).
fn node_guarding(mut job_context: JobContext, job: &Job) -> u32 {
    let (now, restart) = (job_context.now, job.argument(0, 0..=1));
    let (Some((nmt, node, _)), Ok(restart)) = (master(&mut job_context), restart) else { return NO_MASTER };
    nmt.restart = if restart == 0 { Restart::Never } else { Restart::Missing };
    nmt.guard(node, now);
    nmt.network.next_missing().map_or(OK, u32::from)
}

pub(crate) fn has_room(node: &Node, controller: &Controller) -> bool {
    node.to_send() + controller.to_send() < Controller::ROOM
}

/// Sends a command to a node or to all nodes, or executes it for the master itself (D-439).
fn command(mut job_context: JobContext, job: &Job, command: Command) -> u32 {
    let now = job_context.now;
    let Some((nmt, node, controller)) = master(&mut job_context) else { return NO_MASTER };
    let own = match command {
        Command::Start => Some(State::Operational),
        Command::EnterPreOperational => Some(State::PreOperational),
        Command::Stop | Command::ResetNode | Command::ResetCommunication => None,
    };
    let is_right = |number: &u8| match *number {
        0 => true,
        number if number == node.number() => own.is_some(),
        number => nmt.network.has(number),
    };
    let Some(number) = node_number(job).filter(is_right) else { return PARAMETERS };
    let is_own = number == node.number();
    if !is_own {
        if !has_room(node, controller) {
            return NOT_SENT;
        }
        nmt.command(node, command, number);
    }
    if let Some(own) = own.filter(|_| is_own || number == 0) {
        node.set_state(own, now);
    }
    OK
}

/// Returns STATE and RESULT. For all nodes, STATE is the state that they have in common.
fn node_state(mut job_context: JobContext, job: &Job) -> [u32; 2] {
    let Some((nmt, node, _)) = master(&mut job_context) else { return [0, NO_MASTER] };
    let known = |number: u8| {
        let state = if number == node.number() { Some(node.state()) } else { nmt.network.state(number) };
        state.map_or(0, State::code)
    };
    match node_number(job) {
        Some(0) => {
            let mut states = nmt.network.numbers().map(known);
            let first = states.next().unwrap_or(0);
            [if states.all(|state| state == first) { first.into() } else { 0 }, OK]
        }
        Some(number) if number == node.number() || nmt.network.has(number) => [known(number).into(), OK],
        _ => [0, PARAMETERS],
    }
}

fn ini_send_sync(mut job_context: JobContext) -> Outcome {
    let (nmt, ..) = master(&mut job_context).ok_or(Refusal::State)?;
    nmt.has_sync = true;
    Ok(Answer::default())
}

fn send_sync(mut job_context: JobContext) -> bool {
    let now = job_context.now;
    let Some((nmt, node, controller)) = master(&mut job_context) else { return false };
    let can_send = nmt.has_sync && has_room(node, controller);
    can_send && node.send_sync(now)
}

fn emergency(mut job_context: JobContext) -> Outcome {
    let (nmt, ..) = master(&mut job_context).ok_or(Refusal::State)?;
    let Some(emergency) = nmt.emergencies.pop_front() else { return Ok(Answer::default()) };
    let numbers = [1, emergency.node.into(), emergency.code.into(), emergency.register.into()];
    Ok(Answer { data: emergency.data.to_vec(), ..results(&numbers) })
}

/// Returns RESULT and the abort code, and after a read also DATA. The order is checked again until it is
/// finished.
fn sdo(mut job_context: JobContext, job: &Job) -> Outcome {
    let (now, place) = (job_context.now, job_context.place);
    let (nmt, node, _) = master(&mut job_context).ok_or(Refusal::State)?;
    if let Some(finished) = nmt.finished(place) {
        return Ok(match finished {
            Ok(data) => Answer { data, ..result(FINISHED) },
            Err(code) => results(&[0, code]),
        });
    }
    if !nmt.sdo.is_of(place) {
        let number = job.argument(0, 1..=127)? as u8;
        let at = EntryAddress {
            index: job.argument(1, 0..=0xFFFF)? as u16,
            sub: job.argument(2, 0..=0xFF)? as u8,
        };
        let length = job.argument(3, 0..=MOST)? as usize;
        if !nmt.network.has(number) {
            return Err(Refusal::State);
        }
        if !nmt.sdo.is_free() {
            return Err(Refusal::Later);
        }
        let request = if job.function == job::SDO_READ {
            nmt.sdo.read(place, number, at, MOST as usize, now)
        } else {
            let data = job.data.get(..length).ok_or(Refusal::Arguments)?;
            nmt.sdo.write(place, number, at, data, now)
        };
        node.send_sdo(number, request);
    }
    Err(Refusal::Later)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can::{Frame, Payload};
    use crate::devices::cs0015::emulation::canopen::communication::Factory;
    use crate::devices::cs0015::emulation::canopen::node::BootUp;
    use crate::devices::cs0015::emulation::ram::Registers;
    use crate::devices::cs0015::registers::DEVICE;
    use crate::memory::Segment;

    /// Frames that the node has queued, but not given to the controller, need room in the controller, too.
    #[test]
    fn there_is_room_for_as_many_frames_as_the_controller_takes() {
        let registers = Registers::new(&Segment::of(&DEVICE)).unwrap();
        let node = Node::new(registers, Factory { node: 1, kbit_s: 125 }, BootUp::None);
        let mut controller = Controller::default();
        for _ in 0..Controller::ROOM {
            assert!(has_room(&node, &controller));
            controller.send(Frame::standard(0x80, Payload::EMPTY)).unwrap();
        }
        assert!(!has_room(&node, &controller));
    }
}
