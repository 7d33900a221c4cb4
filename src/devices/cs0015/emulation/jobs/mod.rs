//! Jobs: orders of a program to the operating system. A program gives the orders by the functions of the
//! libraries, through the job block (p. 30-119, D-434).

mod can;
mod io;
mod master;
mod peripherals;
mod slave;

use crate::devices::cs0015::emulation::port::Firmware;
use crate::devices::cs0015::emulation::ram::Registers;
use crate::devices::cs0015::emulation::records::JobRefused;
use crate::devices::cs0015::registers::values::{job_control, job_error};

use crate::devices::Context;
use crate::devices::can_bus::Controller;
use serde::{Deserialize, Serialize};

/// Number of places for orders.
const PLACES: usize = 16;
/// Number of arguments and results of each order.
const NUMBERS: usize = 8;

/// An order of a program to the operating system.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Job {
    /// Function, as in `a_FUNCTION`.
    pub function: u16,
    /// Arguments in the order of the manual's inputs, without ENABLE.
    pub arguments: [u32; NUMBERS],
    /// Bytes of the field DATA of the job block.
    pub data: Vec<u8>,
}

/// An argument is out of its range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct OutOfRange;

impl Job {
    /// Returns an argument that must be in `range`.
    pub(crate) fn argument(
        &self,
        number: usize,
        range: core::ops::RangeInclusive<u32>,
    ) -> Result<u32, OutOfRange> {
        let value = self.arguments.get(number).copied().ok_or(OutOfRange)?;
        range.contains(&value).then_some(value).ok_or(OutOfRange)
    }
}

/// Results of a function.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Answer {
    /// Results in the order of the manual's outputs.
    pub results: [u32; NUMBERS],
    /// Bytes of the field DATA of the job block.
    pub data: Vec<u8>,
}

/// Result of an order.
pub(crate) type Outcome = Result<Answer, Refusal>;

/// Reason why an order has no regular answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Refusal {
    /// The function does not exist.
    Function,
    /// Arguments are out of their ranges.
    Arguments,
    /// The device cannot execute the function now: it is not a master, or the node or identifier is unknown.
    State,
    /// The order was started, or waits for another order to finish. The firmware checks the order again
    /// later.
    Later,
}

impl From<OutOfRange> for Refusal {
    fn from(_: OutOfRange) -> Self {
        Refusal::Arguments
    }
}

impl Refusal {
    fn code(self) -> u8 {
        match self {
            Refusal::Function => job_error::FUNCTION,
            Refusal::Arguments => job_error::ARGUMENTS,
            Refusal::State | Refusal::Later => job_error::STATE,
        }
    }
}

/// Context of a function.
pub(crate) struct JobContext<'a> {
    pub firmware: &'a mut Firmware,
    pub controller: &'a mut Controller,
    pub place: usize,
    pub now: u64,
}

/// Orders that have been started. Each entry has the order's place and number.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct StartedOrders(Vec<(usize, u32)>);

impl StartedOrders {
    pub(crate) fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// True if the job block contains orders that were not started yet.
    pub(crate) fn has_new_orders(&self, registers: &Registers) -> bool {
        let is_new = |place: usize| !self.0.iter().any(|(begun, _)| *begun == place);
        (0..PLACES).any(|place| is_order(registers, place) && is_new(place))
    }

    /// Returns the places at which the program has withdrawn or replaced an order.
    fn take_withdrawn(&mut self, registers: &Registers) -> Vec<usize> {
        let number = |place: usize| registers.jobs.a_ORDER[place].load();
        let is_there =
            |(place, order): &(usize, u32)| is_order(registers, *place) && number(*place) == *order;
        let (there, gone): (Vec<_>, Vec<_>) = self.0.iter().copied().partition(is_there);
        self.0 = there;
        gone.into_iter().map(|(place, _)| place).collect()
    }

    fn note(&mut self, place: usize, order: u32, is_under_way: bool) {
        self.0.retain(|(begun, _)| *begun != place);
        if is_under_way {
            self.0.push((place, order));
        }
    }
}

fn is_order(registers: &Registers, place: usize) -> bool {
    registers.jobs.a_CONTROL[place].load() == job_control::ORDER
}

/// Returns the places with orders, in the sequence in which the orders were given.
fn orders(registers: &Registers) -> Vec<usize> {
    let mut places: Vec<usize> = (0..PLACES).filter(|place| is_order(registers, *place)).collect();
    let first = places.first().map_or(0, |place| registers.jobs.a_ORDER[*place].load());
    // Order numbers wrap.
    places.sort_by_key(|place| registers.jobs.a_ORDER[*place].load().wrapping_sub(first) as i32);
    places
}

fn answer(registers: &Registers, place: usize, outcome: &Outcome) {
    let jobs = &registers.jobs;
    let (error, nothing) =
        (outcome.as_ref().err().map_or(job_error::NONE, |it| it.code()), Answer::default());
    let Answer { results, data } = outcome.as_ref().unwrap_or(&nothing);
    jobs.a_RESULT[place].iter().zip(results).for_each(|(cell, result)| cell.store(*result));
    let room = jobs.a_DATA[place].iter().zip(data);
    jobs.a_LENGTH[place].store(room.len() as u16);
    room.for_each(|(cell, byte)| cell.store(*byte));
    jobs.a_ERROR[place].store(error);
    // If the program has withdrawn the order, the exchange fails and the control register does not change.
    let _ = jobs.a_CONTROL[place].compare_exchange(job_control::ORDER, job_control::DONE);
}

/// Carries out the orders of the program. The program must be running.
pub(crate) fn look(firmware: &mut Firmware, ctx: &mut Context, controller: &mut Controller) {
    if !firmware.under_way.is_empty() {
        for place in firmware.under_way.take_withdrawn(&firmware.node.registers) {
            if let Some(nmt) = &mut firmware.nmt {
                nmt.withdraw(&mut firmware.node, place);
            }
        }
    }
    for place in orders(&firmware.node.registers) {
        let jobs = &firmware.node.registers.jobs;
        let (function, order) = (jobs.a_FUNCTION[place].load(), jobs.a_ORDER[place].load());
        let length = usize::from(jobs.a_LENGTH[place].load());
        let data = jobs.a_DATA[place].iter().take(length).map(|cell| cell.load()).collect();
        let mut job = Job { function, data, ..Job::default() };
        job.arguments.iter_mut().zip(&jobs.a_ARGUMENT[place]).for_each(|(to, cell)| *to = cell.load());
        let job_context =
            JobContext { firmware: &mut *firmware, controller: &mut *controller, place, now: ctx.now };
        // The high byte of a function's number identifies the part of the manual that describes the function.
        let outcome = match function >> 8 {
            1 => can::carry_out(job_context, &job),
            2 => slave::carry_out(job_context, &job),
            3 => master::carry_out(job_context, &job),
            4 => io::carry_out(job_context, &job),
            6..=9 => peripherals::carry_out(job_context, &job),
            _ => Err(Refusal::Function),
        };
        let is_under_way = outcome == Err(Refusal::Later);
        firmware.under_way.note(place, order, is_under_way);
        if is_under_way {
            continue;
        }
        if let Err(refusal) = outcome {
            ctx.report(JobRefused { plc: ctx.origin.plc, function, error: refusal.code() });
        }
        answer(&firmware.node.registers, place, &outcome);
    }
}
