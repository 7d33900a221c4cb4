//! Orders of a block to the operating system, in the job block (`docs/devices/cs0015/overview.md`).

use crate::devices::cs0015::registers::values::{job_control, job_error};
use crate::devices::cs0015::registers::{CS0015_JOBS, JOBS};
use crate::memory::MemoryError;
use crate::plc::{Base, BlockContext, Ram, Wire};
use core::ops::DerefMut;
use core::time::Duration;

/// The job block, through which programs give orders to the operating system.
pub struct Jobs(Base<CS0015_JOBS>);

impl Jobs {
    /// Returns the job block of a CS0015 with this RAM.
    ///
    /// # Errors
    /// The RAM is too small for a job block: it belongs to another device.
    pub fn of(ram: &Ram) -> Result<Self, MemoryError> {
        Ok(Jobs(ram.at(JOBS)?))
    }

    /// Takes a place for an order: a free place, or otherwise the place with the oldest answer that no block
    /// has fetched (D-434).
    fn take_place(&self) -> Option<usize> {
        let controls = || self.0.a_CONTROL.iter().enumerate();
        let take = |place: usize, from: u8| {
            self.0.a_CONTROL[place].compare_exchange(from, job_control::TAKEN).ok().map(|_| place)
        };
        if let Some(place) = controls().find_map(|(place, _)| take(place, job_control::FREE)) {
            return Some(place);
        }
        let now = self.0.d_ORDERS.load();
        let answered = controls().filter(|(_, control)| control.load() == job_control::DONE);
        let oldest = answered.max_by_key(|(place, _)| now.wrapping_sub(self.0.a_ORDER[*place].load()));
        oldest.and_then(|(place, _)| take(place, job_control::DONE))
    }
}

impl Wire for Jobs {
    type CallView = Self;

    fn connect(place: &BlockContext<'_>) -> Result<Self, MemoryError> {
        Jobs::of(place.ram)
    }

    fn lend(&mut self) -> impl DerefMut<Target = Self> {
        self
    }
}

/// The answer to an order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Answer {
    /// True if the order was refused because of its arguments or because of the state of the device.
    pub is_refused: bool,
    /// Results as in `a_RESULT`.
    pub results: [u32; 8],
    /// The used bytes of `a_DATA`.
    pub data: Vec<u8>,
}

/// Progress of an order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Progress {
    /// No order was given.
    Nothing,
    /// The order has not been answered yet.
    UnderWay,
    /// The order has been answered; returned once.
    Answered(Answer),
}

/// The order of a block.
#[derive(Clone, Debug, Default)]
pub struct Order(Option<(usize, u32)>);

impl Order {
    /// Runs one call of a block. Returns the answer to the previous order, if there is an answer. Enters a new order if
    /// `enable` is true. A block has at most one order at a time.
    pub fn call(
        &mut self,
        jobs: &Jobs,
        enable: bool,
        function: u16,
        arguments: &[u32],
        data: &[u8],
    ) -> Option<Answer> {
        let answer = match self.look(jobs) {
            Progress::Answered(answer) => Some(answer),
            Progress::Nothing | Progress::UnderWay => None,
        };
        if enable && self.0.is_none() {
            self.give(jobs, function, arguments, data);
        }
        answer
    }

    /// Gives an order; returns `false` if no place is free.
    pub fn give(&mut self, jobs: &Jobs, function: u16, arguments: &[u32], data: &[u8]) -> bool {
        let Some(place) = jobs.take_place() else { return false };
        let jobs = &jobs.0;
        jobs.a_FUNCTION[place].store(function);
        let arguments = arguments.iter().copied().chain(core::iter::repeat(0));
        jobs.a_ARGUMENT[place].iter().zip(arguments).for_each(|(cell, value)| cell.store(value));
        jobs.a_DATA[place].iter().zip(data).for_each(|(cell, byte)| cell.store(*byte));
        jobs.a_LENGTH[place].store(data.len().min(jobs.a_DATA[place].len()) as u16);
        let number = jobs.d_ORDERS.update(|orders| orders.wrapping_add(1)).wrapping_add(1);
        jobs.a_ORDER[place].store(number);
        jobs.a_CONTROL[place].store(job_control::ORDER);
        self.0 = Some((place, number));
        true
    }

    /// Returns the progress. If a power-on has deleted the order, it counts as not given.
    pub fn look(&mut self, jobs: &Jobs) -> Progress {
        let Some((place, number)) = self.0 else { return Progress::Nothing };
        let jobs = &jobs.0;
        let control = jobs.a_CONTROL[place].load();
        let is_own = jobs.a_ORDER[place].load() == number;
        if is_own && control == job_control::ORDER {
            return Progress::UnderWay;
        }
        self.0 = None;
        if !is_own || control != job_control::DONE {
            return Progress::Nothing;
        }
        let mut answer =
            Answer { is_refused: jobs.a_ERROR[place].load() != job_error::NONE, ..Answer::default() };
        answer.results.iter_mut().zip(&jobs.a_RESULT[place]).for_each(|(to, cell)| *to = cell.load());
        let length = usize::from(jobs.a_LENGTH[place].load());
        answer.data.extend(jobs.a_DATA[place].iter().take(length).map(|cell| cell.load()));
        jobs.a_CONTROL[place].store(job_control::FREE);
        Progress::Answered(answer)
    }

    /// Withdraws an order without an answer, or discards its answer.
    pub fn withdraw(&mut self, jobs: &Jobs) {
        if self.look(jobs) == Progress::UnderWay
            && let Some((place, _)) = self.0.take()
        {
            // If the answer has already come, it is discarded, too.
            jobs.0.a_CONTROL[place].store(job_control::FREE);
        }
    }
}

/// Converts a TIME to ms for the job block.
pub(super) fn ms(time: Duration) -> u32 {
    u32::try_from(time.as_millis()).unwrap_or(u32::MAX)
}

/// Returns the data of an answer as an array. Missing bytes are 0.
pub(super) fn array<const N: usize>(data: &[u8]) -> [u8; N] {
    let mut array = [0; N];
    array.iter_mut().zip(data).for_each(|(to, byte)| *to = *byte);
    array
}
