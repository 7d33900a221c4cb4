//! How a block asks the operating system: an order in the job block (`docs/devices/cs0015/overview.md`).

use crate::devices::cs0015::registers::values::{job_control, job_error};
use crate::devices::cs0015::registers::{CS0015_JOBS, JOBS};
use crate::memory::MemoryError;
use crate::plc::{Base, Place, Ram, Wire};
use core::ops::DerefMut;
use core::time::Duration;

/// The job block.
pub struct Jobs(Base<CS0015_JOBS>);

impl Jobs {
    /// The job block of a CS0015 with this RAM.
    ///
    /// # Errors
    /// The RAM is too small for it: it is another device's.
    pub fn of(ram: &Ram) -> Result<Self, MemoryError> {
        Ok(Jobs(ram.at(JOBS)?))
    }

    /// A place for an order: a free one, else the one whose answer nobody has fetched for the longest time (D-434).
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
    type Lent = Self;

    fn connect(place: &Place<'_>) -> Result<Self, MemoryError> {
        Jobs::of(place.ram)
    }

    fn lend(&mut self) -> impl DerefMut<Target = Self> {
        self
    }
}

/// What an order has brought.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Answer {
    /// It was refused, because of its arguments or the state of the device.
    pub is_refused: bool,
    /// As `a_RESULT` has them.
    pub results: [u32; 8],
    /// The bytes of `a_DATA` that it has.
    pub data: Vec<u8>,
}

/// How an order stands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Progress {
    /// There is none.
    Nothing,
    /// It has not been answered yet.
    UnderWay,
    /// It has been answered, which is told once.
    Answered(Answer),
}

/// The order of a block.
#[derive(Clone, Debug, Default)]
pub struct Order(Option<(usize, u32)>);

impl Order {
    /// A call of a block that gives an order in each call with `enable`: the answer to the order before, if it has come, and a new
    /// order. While one is under way there is no other.
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

    /// Gives an order; `false`: there is no place for it.
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

    /// How it stands. A power-on has dropped it, and nobody is told.
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

    /// Takes an order back that is under way, or throws its answer away.
    pub fn withdraw(&mut self, jobs: &Jobs) {
        if self.look(jobs) == Progress::UnderWay
            && let Some((place, _)) = self.0.take()
        {
            // It may have been answered meanwhile, which is the same.
            jobs.0.a_CONTROL[place].store(job_control::FREE);
        }
    }
}

/// A TIME as the job block has it, in ms.
pub(super) fn ms(time: Duration) -> u32 {
    u32::try_from(time.as_millis()).unwrap_or(u32::MAX)
}

/// Data of an answer as an array, 0 behind them.
pub(super) fn array<const N: usize>(data: &[u8]) -> [u8; N] {
    let mut array = [0; N];
    array.iter_mut().zip(data).for_each(|(to, byte)| *to = *byte);
    array
}
