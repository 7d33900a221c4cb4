//! A task that the emulated time waits for.
//!
//! The clock stands still during a turn. A task that takes its run time seriously looks at its inputs, lets the time
//! that it claims pass with [`LockstepTask::run_for`], and only then stores its outputs: they are in the RAM at
//! exactly that emulated time, be it before or after a deadline.

use super::{Attached, LIVENESS};
use crate::memory::header::{SEAT_ORDERS, SEATS, Seat, SeatState};
use crate::memory::process::ProcessId;
use crate::memory::{Header, MemoryError, View, bell};
use core::num::NonZeroU32;
use std::time::{Duration, Instant};

/// A task in lockstep. Dropping it leaves.
#[derive(Debug)]
pub struct LockstepTask<'a> {
    attached: &'a Attached,
    header: View<Header>,
    seat: View<Seat>,
    event: usize,
    /// Turns so far.
    turns: u32,
    in_turn: bool,
}

impl Attached {
    /// Takes part in lockstep with the task of event `event`: from now on the emulated time stands still whenever
    /// the event has occurred, until the task is done. Stepped mode only. `INTR_SET` enables the event.
    ///
    /// A turn that really takes longer than `patience` (in whole milliseconds; zero: no limit) makes the emulator go
    /// on without the task. `timeout` is how long to wait for the emulator's consent.
    ///
    /// # Errors
    /// Attached read-only, no seat is free, the clock is not stepped, no such event, or as [`Attached::check`].
    pub fn join_lockstep(
        &self,
        event: usize,
        patience: Duration,
        timeout: Duration,
    ) -> Result<LockstepTask<'_>, MemoryError> {
        self.join(event, 0, patience, timeout)
    }

    /// As [`Attached::join_lockstep`], with a turn for each order of the board, too.
    #[cfg_attr(not(feature = "plc"), expect(dead_code, reason = "for the runner of tasks"))]
    pub(crate) fn join_with_orders(
        &self,
        event: usize,
        patience: Duration,
        timeout: Duration,
    ) -> Result<LockstepTask<'_>, MemoryError> {
        self.join(event, SEAT_ORDERS, patience, timeout)
    }

    fn join(
        &self,
        event: usize,
        flags: u32,
        patience: Duration,
        timeout: Duration,
    ) -> Result<LockstepTask<'_>, MemoryError> {
        let header = self.header()?.clone();
        let own = ProcessId::own();
        let free = |seat: &Seat| seat.owner.compare_exchange(0, own.pid).is_ok();
        let Some(place) = header.lockstep.iter().position(free) else {
            return Err(MemoryError::NoSeat { seats: SEATS });
        };
        let seat = header.project(|header| &header.lockstep[place]);
        // From here on the seat is given back by dropping the task.
        let turns = seat.turn.rings();
        let task = LockstepTask { attached: self, header, seat, event, turns, in_turn: false };
        task.seat.owner_start.store(own.start);
        task.seat.event.store(u32::try_from(event).map_or(u32::MAX, |event| event | flags));
        task.seat.patience_ms.store(u32::try_from(patience.as_millis()).unwrap_or(u32::MAX));
        task.seat.state.store(SeatState::Asking.code());
        task.header.submit_request();
        let state = || SeatState::from_code(task.seat.state.load());
        let answer = self.wait_until("the answer to joining lockstep", timeout, |_| {
            state().filter(|state| !matches!(state, SeatState::Asking | SeatState::Deciding))
        })?;
        match answer {
            SeatState::Seated => Ok(task),
            _ => Err(MemoryError::LockstepRefused { event }),
        }
    }

    /// Ends the turns of `tasks`, then waits until one of them has its next turn or `condition` holds. The condition is
    /// asked again whenever the firmware has changed registers. `false`: neither, within `timeout` of real time.
    #[cfg_attr(not(feature = "plc"), expect(dead_code, reason = "for the runner of tasks"))]
    pub(crate) fn wait_turns(
        &self,
        tasks: &mut [LockstepTask<'_>],
        timeout: Duration,
        mut condition: impl FnMut() -> bool,
    ) -> Result<bool, MemoryError> {
        tasks.iter_mut().for_each(|task| task.end_turn(0));
        let (start, answer) = (Instant::now(), &self.header()?.answer);
        loop {
            let mut bells = vec![(answer, answer.rings())];
            bells.extend(tasks.iter().map(|task| (&task.seat.turn, task.turns)));
            if condition() {
                return Ok(true);
            }
            self.check_generation(&self.header_snapshot())?;
            let left = timeout.saturating_sub(start.elapsed());
            match bell::wait_any(&bells, Some(left.min(LIVENESS))) {
                Some(0) => {}
                Some(rung) => {
                    tasks[rung - 1].begin_turn()?;
                    return Ok(true);
                }
                None => {
                    self.check()?;
                    if left.is_zero() {
                        return Ok(false);
                    }
                }
            }
        }
    }
}

impl LockstepTask<'_> {
    /// Ends the present turn, if there is one, and waits for the next event; returns its emulated time in
    /// microseconds. An event that came during the last run is there at once. `timeout` is real time.
    ///
    /// # Errors
    /// As [`Attached::check`], [`MemoryError::Timeout`], or [`MemoryError::LockstepLost`] if the emulator has gone on
    /// without this task.
    pub fn next_event(&mut self, timeout: Duration) -> Result<u64, MemoryError> {
        self.end_turn(0);
        self.await_turn(timeout)
    }

    /// Lets `us` microseconds of emulated time pass as run time of this task, longer if tasks of a higher level of
    /// the same PLC interrupt it; returns the emulated time then. To be called within a turn.
    ///
    /// # Errors
    /// As [`LockstepTask::next_event`].
    pub fn run_for(&mut self, us: NonZeroU32, timeout: Duration) -> Result<u64, MemoryError> {
        self.end_turn(us.get());
        self.await_turn(timeout)
    }

    fn end_turn(&mut self, run_us: u32) {
        if core::mem::take(&mut self.in_turn) {
            self.seat.run_us.store(run_us);
            self.seat.done.ring();
        }
    }

    fn await_turn(&mut self, timeout: Duration) -> Result<u64, MemoryError> {
        let seat = &self.seat;
        let turns = self.turns;
        let turn = self.attached.wait_on(Some(&seat.turn), timeout, || {
            let now = seat.turn.rings();
            (now != turns).then_some(now)
        })?;
        if turn.is_none() {
            return Err(MemoryError::Timeout { what: format!("a turn on event {}", self.event), timeout });
        }
        self.begin_turn()
    }

    /// The turn that has been rung for; returns its emulated time.
    fn begin_turn(&mut self) -> Result<u64, MemoryError> {
        let seat = &self.seat;
        self.turns = seat.turn.rings();
        if SeatState::from_code(seat.state.load()) != Some(SeatState::Seated) {
            return Err(MemoryError::LockstepLost { event: self.event });
        }
        self.in_turn = true;
        Ok(seat.time_us.load())
    }
}

impl Drop for LockstepTask<'_> {
    fn drop(&mut self) {
        self.seat.state.store(SeatState::Free.code());
        self.seat.owner.store(0);
        self.header.submit_request();
    }
}
