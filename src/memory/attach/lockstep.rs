//! Tasks in lockstep: the emulated time waits while such a task runs. One run, from the event until the task is done,
//! is a turn.
//!
//! The clock does not run during a turn. A task that models its run time first reads its inputs, then calls
//! [`LockstepTask::run_for`] with the run time, and only then stores its outputs. So the outputs enter the RAM at
//! exactly that emulated time, before or after a deadline.

use super::{Attached, LIVENESS};
use crate::memory::header::{SEAT_ORDERS, SEAT_WAITS, SEATS, Seat, SeatState};
use crate::memory::process::ProcessId;
use crate::memory::{Header, MemoryError, View, bell};
use core::num::NonZeroU32;
use std::time::{Duration, Instant};

/// A task that takes part in lockstep. Dropping the value ends its part.
#[derive(Debug)]
pub struct LockstepTask<'a> {
    attached: &'a Attached,
    header: View<Header>,
    seat: View<Seat>,
    event: usize,
    /// Number of turns that the task has had.
    turns: u32,
    in_turn: bool,
}

impl Attached {
    /// Joins lockstep with the task that event `event` starts. From now on the emulated time stops at each of these
    /// events until the task is done. This needs a stepped clock. The function block `INTR_SET` enables the event.
    ///
    /// If a turn takes more real time than `patience` (in whole milliseconds; zero: no limit), the emulator continues
    /// without the task. `timeout` limits the wait for the emulator's consent.
    ///
    /// # Errors
    /// The image is attached read-only, no seat is free, the clock is not stepped, the event does not exist, or an
    /// error of [`Attached::check`].
    pub fn join_lockstep(
        &self,
        event: usize,
        patience: Duration,
        timeout: Duration,
    ) -> Result<LockstepTask<'_>, MemoryError> {
        self.join(event, 0, patience, timeout)
    }

    /// Does the same as [`Attached::join_lockstep`]. The task also gets a turn when the board orders a start or stop of
    /// the program, and after a reset.
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
        // From here on, dropping the task frees the seat.
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

    /// Ends the turns of `tasks`. If `wait_us` is given, the first task gets its next turn after this emulated time at
    /// the latest. Then waits until a task has its next turn or `condition` is true. The function calls `condition`
    /// again whenever the firmware has changed registers. `false`: neither happened within `timeout` of real time.
    #[cfg_attr(not(feature = "plc"), expect(dead_code, reason = "for the runner of tasks"))]
    pub(crate) fn wait_turns(
        &self,
        tasks: &mut [LockstepTask<'_>],
        wait_us: Option<u32>,
        timeout: Duration,
        mut condition: impl FnMut() -> bool,
    ) -> Result<bool, MemoryError> {
        if let Some((first, us)) = tasks.first_mut().zip(wait_us) {
            first.end_turn(SEAT_WAITS | us.min(SEAT_WAITS - 1));
        }
        tasks.iter_mut().for_each(|task| task.end_turn(0));
        let (start, answer) = (Instant::now(), &self.header()?.answer);
        loop {
            let mut bells = vec![(answer, answer.rings())];
            bells.extend(tasks.iter().map(|task| (&task.seat.turn, task.turns)));
            if condition() {
                return Ok(true);
            }
            self.check_header()?;
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
    /// Ends the present turn, if there is one, and waits for the next event. Returns the emulated time of that event in
    /// microseconds. If the event occurred during the last turn, the function returns immediately. `timeout` is real
    /// time.
    ///
    /// # Errors
    /// Returns the errors of [`Attached::check`], [`MemoryError::Timeout`], or [`MemoryError::LockstepLost`] if the
    /// emulator has continued without this task.
    pub fn next_event(&mut self, timeout: Duration) -> Result<u64, MemoryError> {
        self.end_turn(0);
        self.await_turn(timeout)
    }

    /// Advances the clock by `us` microseconds as run time of this task; if tasks of a higher level of the same PLC
    /// interrupt this task, the clock advances by more. Returns the emulated time afterwards. Call it within a turn.
    ///
    /// # Errors
    /// Returns the errors of [`LockstepTask::next_event`].
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

    /// Begins the turn that the emulator has announced. Returns the emulated time of the turn.
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
