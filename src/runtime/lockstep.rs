//! Tasks of PLC processes in lockstep: the emulated time waits for them.
//!
//! When the event of a task has occurred, the clock stops and the task gets a turn. At the end of the turn, the task
//! may state a run time in emulated time. Then the clock continues, and the task gets another turn when this time is
//! over.
//!
//! Tasks of one PLC share its processor. A task of a higher level interrupts a task of a lower level. The run of the
//! interrupted task ends later by the duration of the interruption. Of tasks of the same level, one runs after the
//! other (manual 5.00005.03a p. 43-44, 73). The emulator gives up a task that dies, leaves or takes too long.

use crate::awake_time::AwakeTime;
use crate::identity::DeviceIndex;
use crate::memory::header::{SEAT_ORDERS, SEAT_WAITS, Seat, SeatState};
use crate::memory::{Header, View, bell};
use crate::plant::{Advance, Plant};
use std::time::Duration;

/// Interval at which the emulator checks that a task in its turn still runs.
const LIVENESS: Duration = Duration::from_millis(20);

/// A task with a seat.
struct Task {
    plc: DeviceIndex,
    seat: View<Seat>,
    event: usize,
    level: u8,
    /// Number of events that the task has seen.
    seen: u32,
    /// Number of starts and stops of the board that the task has seen; `None` if the task does not obey them.
    orders: Option<u32>,
    /// End of the task's present run, in microseconds of emulated time.
    until: Option<u64>,
    /// Time in microseconds of the task's next turn, if no event occurs before it.
    wakes: Option<u64>,
}

impl Task {
    fn has_seat(&self) -> bool {
        self.seat.state.load() == SeatState::Seated.code()
    }

    fn gone(&self) -> bool {
        !self.has_seat() || !self.seat.owner_is_running()
    }
}

/// A turn in progress.
struct Turn {
    /// Index of the task.
    index: usize,
    /// Number of turns that the task had ended before this turn.
    done: u32,
    /// Real time since the start of the turn.
    time: AwakeTime,
}

/// Result of a check of a turn.
enum TurnCheck {
    /// The turn has ended, and the task has stated its run time.
    Ended,
    /// The turn is not over, and another client has rung the doorbell.
    Continues,
    /// The task has died, has given up its seat, or has exceeded its patience.
    Lost,
}

/// All tasks in lockstep.
pub(super) struct Lockstep {
    /// The turn for which the clock waits.
    turn: Option<Turn>,
    headers: Vec<View<Header>>,
    /// Last seen number of requests of each PLC.
    requests: Vec<u32>,
    tasks: Vec<Task>,
    /// True if the clock is stepped, so that tasks may take part.
    stepped: bool,
}

/// Observer of actions of tasks that change the plant. A federation passes them to the other hosts.
pub(crate) trait Witness {
    /// Lets the boards answer pending requests; returns whether there were any.
    fn boards(&mut self, plant: &mut Plant) -> bool;

    /// Called after the plant has recorded a new state of a task.
    fn task(&mut self, plc: DeviceIndex, event: usize, state: SeatState);
}

/// A witness for a plant without federation.
pub(crate) struct NoWitness;

impl Witness for NoWitness {
    fn boards(&mut self, plant: &mut Plant) -> bool {
        plant.look_at_boards()
    }

    fn task(&mut self, _: DeviceIndex, _: usize, _: SeatState) {}
}

/// Returns the total number of orders, power-ons and resets of a board. A change means that a task has something to
/// obey.
fn orders_of(header: &Header) -> u32 {
    header.program.start.rings().wrapping_add(header.program.restarts.load())
}

fn note(plant: &mut Plant, witness: &mut dyn Witness, plc: DeviceIndex, event: usize, state: SeatState) {
    plant.note_lockstep(plc, event, state);
    witness.task(plc, event, state);
}

impl Lockstep {
    pub(crate) fn new(headers: Vec<View<Header>>, stepped: bool) -> Self {
        let requests = vec![0; headers.len()];
        Lockstep { turn: None, headers, requests, tasks: Vec::new(), stepped }
    }

    /// Gives seats to tasks that request one, and removes tasks that have given up their seats. Returns true if there
    /// were such tasks.
    pub(crate) fn look(&mut self, plant: &mut Plant, witness: &mut dyn Witness) -> bool {
        // During a turn, tasks neither join nor leave.
        if self.turn.is_some() {
            return false;
        }
        let mut changed = false;
        for plc in DeviceIndex::first(self.headers.len()) {
            let requests = self.headers[plc.index()].board_requests.load();
            if requests != self.requests[plc.index()] {
                self.requests[plc.index()] = requests;
                changed |= self.look_at(plc, plant, witness);
            }
        }
        changed
    }

    fn look_at(&mut self, plc: DeviceIndex, plant: &mut Plant, witness: &mut dyn Witness) -> bool {
        let before = self.tasks.len();
        self.tasks.retain(|task| {
            let stays = task.plc != plc || task.has_seat();
            if !stays {
                note(plant, witness, task.plc, task.event, SeatState::Free);
            }
            stays
        });
        let mut changed = self.tasks.len() != before;
        for place in 0..self.headers[plc.index()].lockstep.len() {
            let seat = self.headers[plc.index()].project(|header| &header.lockstep[place]);
            match SeatState::from_code(seat.state.load()) {
                Some(SeatState::Asking) => self.seat(plc, seat, plant, witness),
                Some(SeatState::Refused | SeatState::Lost) if seat.free_if_dead() => {}
                _ => continue,
            }
            changed = true;
        }
        self.watch(plc, plant);
        changed
    }

    fn seat(&mut self, plc: DeviceIndex, seat: View<Seat>, plant: &mut Plant, witness: &mut dyn Witness) {
        let mut found = None;
        let answer = seat.decide(|event| {
            let number = (event & !SEAT_ORDERS) as usize;
            // The number of events is read before the task learns that it has the seat, so no event from then on is
            // missed.
            let seen = self.headers[plc.index()].events.get(number).map(|slot| slot.bell.rings());
            found = plant.event_level(plc, number).zip(seen).filter(|_| self.stepped);
            found.is_some()
        });
        // The task has given up its seat before the answer.
        let Some((asked, _)) = answer else { return };
        let event = (asked & !SEAT_ORDERS) as usize;
        // The board may have ordered a start before the task joined. So a task that obeys orders gets its first turn
        // immediately.
        let orders =
            (asked & SEAT_ORDERS != 0).then(|| orders_of(&self.headers[plc.index()]).wrapping_sub(1));
        let Some((level, seen)) = found else {
            note(plant, witness, plc, event, SeatState::Refused);
            return;
        };
        note(plant, witness, plc, event, SeatState::Seated);
        self.tasks.push(Task { plc, seat, event, level, seen, orders, until: None, wakes: None });
    }

    /// Makes the plant stop at the events for which tasks of a PLC wait.
    fn watch(&self, plc: DeviceIndex, plant: &mut Plant) {
        plant.watch(plc, self.watched_of(plc));
    }

    fn watched_of(&self, plc: DeviceIndex) -> u16 {
        let tasks = self.tasks.iter().filter(|task| task.plc == plc);
        tasks.fold(0, |events, task| events | 1 << task.event)
    }

    /// Advances the clock to `target`, and gives each task its turns. Returns early if `stop` is true, if a client
    /// rings during the turn of a task, or if `should_pause` is true and scripts of devices take long. The caller must
    /// then call again with the same target.
    pub(crate) fn advance(
        &mut self,
        plant: &mut Plant,
        target: u64,
        stop: impl Fn() -> bool,
        should_pause: &dyn Fn() -> bool,
    ) {
        let witness = &mut NoWitness;
        self.look(plant, witness);
        loop {
            if !self.give_turns(plant, &stop, witness) {
                return;
            }
            let until = self.next_turn().min(target);
            match plant.advance_in_slices(until, should_pause) {
                Advance::Paused => return,
                Advance::Arrived if until == target => {
                    self.give_turns(plant, &stop, witness);
                    return;
                }
                Advance::Arrived | Advance::Watched => {}
            }
        }
    }

    /// Gives turns to all tasks that are ready now. Returns false if stopped or if a turn is still in progress.
    pub(crate) fn take_turns(
        &mut self,
        plant: &mut Plant,
        stop: impl Fn() -> bool,
        witness: &mut dyn Witness,
    ) -> bool {
        self.look(plant, witness);
        self.give_turns(plant, &stop, witness)
    }

    /// True if tasks must get turns although the clock does not advance: a turn is in progress, or a board has ordered
    /// a start or stop.
    pub(crate) fn has_turns(&self) -> bool {
        self.turn.is_some() || self.tasks.iter().any(|task| task.until.is_none() && self.has_orders(task))
    }

    /// For each PLC, the events for which tasks wait: bit n for event n.
    #[cfg(feature = "channel")]
    pub(crate) fn watched(&self) -> Vec<u16> {
        DeviceIndex::first(self.headers.len()).map(|plc| self.watched_of(plc)).collect()
    }

    /// True if the clock waits for a task.
    pub(crate) fn is_in_turn(&self) -> bool {
        self.turn.is_some()
    }

    /// Description of the task for which the clock waits.
    pub(crate) fn waits_for(&self, plant: &Plant) -> Option<String> {
        let task = self.tasks.get(self.turn.as_ref()?.index)?;
        let (plc, process) = (plant.devices().get(task.plc.index())?.name(), task.seat.owner.load());
        Some(format!("the task of event {} of PLC '{plc}' (process {process})", task.event))
    }

    /// Description of a task that takes part in lockstep; `None` if there is none.
    pub(crate) fn present(&self, plant: &Plant) -> Option<String> {
        // Tasks that have given up their seats stay in the list until the clock advances.
        let task = self.tasks.iter().find(|task| !task.gone())?;
        let (plc, process) = (plant.devices().get(task.plc.index())?.name(), task.seat.owner.load());
        Some(format!(
            "the task of event {} of PLC '{plc}' (process {process}), which takes part in lockstep,",
            task.event
        ))
    }

    /// Returns the time of the next turn of the tasks that run or wait; `u64::MAX` if there is none.
    pub(crate) fn next_turn(&self) -> u64 {
        let held_up = |task: &Task| task.wakes.filter(|_| !self.is_held_up(task));
        self.tasks.iter().filter_map(|task| task.until.or_else(|| held_up(task))).fold(u64::MAX, u64::min)
    }

    /// Gives turns to all tasks that are ready now. Returns false if stopped or if a turn is still in progress.
    fn give_turns(&mut self, plant: &mut Plant, stop: &impl Fn() -> bool, witness: &mut dyn Witness) -> bool {
        loop {
            if let Some(mut turn) = self.turn.take() {
                match self.await_end(&mut turn, plant, witness) {
                    TurnCheck::Ended => self.claim(turn.index, plant),
                    TurnCheck::Lost => self.give_up(turn.index, plant, witness),
                    TurnCheck::Continues => {
                        self.turn = Some(turn);
                        return false;
                    }
                }
                self.look(plant, witness);
            }
            match self.due(plant.now()) {
                Some(_) if stop() => return false,
                Some(index) => self.give_turn(index, plant),
                None => return true,
            }
        }
    }

    /// Returns the task that must run now: the one with the highest level.
    fn due(&self, now: u64) -> Option<usize> {
        let ready = |task: &Task| match task.until {
            Some(until) => until <= now,
            None => {
                let has_waited = task.wakes.is_some_and(|time| time <= now);
                (has_waited || self.has_event(task) || self.has_orders(task)) && !self.is_held_up(task)
            }
        };
        let tasks = self.tasks.iter().enumerate().filter(|(_, task)| ready(task));
        // If several tasks have the same level, the first of them has the turn.
        tasks.rev().max_by_key(|(_, task)| task.level).map(|(index, _)| index)
    }

    fn has_event(&self, task: &Task) -> bool {
        self.rings(task) != task.seen
    }

    fn has_orders(&self, task: &Task) -> bool {
        task.orders.is_some_and(|seen| seen != orders_of(&self.headers[task.plc.index()]))
    }

    fn rings(&self, task: &Task) -> u32 {
        self.headers[task.plc.index()].events[task.event].bell.rings()
    }

    /// True if a task of the same or a higher level of the same PLC is running.
    fn is_held_up(&self, task: &Task) -> bool {
        self.tasks
            .iter()
            .any(|other| other.plc == task.plc && other.until.is_some() && other.level >= task.level)
    }

    fn give_turn(&mut self, index: usize, plant: &Plant) {
        let (now, rings) = (plant.now(), self.rings(&self.tasks[index]));
        let orders = orders_of(&self.headers[self.tasks[index].plc.index()]);
        let task = &mut self.tasks[index];
        task.wakes = None;
        if task.until.take().is_none() {
            task.seen = rings;
            task.orders = task.orders.map(|_| orders);
        }
        self.turn = Some(Turn { index, done: task.seat.done.rings(), time: AwakeTime::start() });
        task.seat.time_us.store(now);
        task.seat.turn.ring();
    }

    /// Ends the turn of a task, which then counts as running for the emulated time that it has stated.
    fn claim(&mut self, index: usize, plant: &Plant) {
        let task = &mut self.tasks[index];
        let stated = task.seat.run_us.load();
        let run_us = u64::from(stated & !SEAT_WAITS);
        if stated & SEAT_WAITS != 0 {
            task.wakes = Some(plant.now() + run_us.max(1));
            return;
        }
        if run_us == 0 {
            return;
        }
        task.until = Some(plant.now() + run_us);
        // This run interrupts running tasks of lower levels, so their ends move by its duration.
        let (plc, level) = (task.plc, task.level);
        for other in self.tasks.iter_mut().filter(|other| other.plc == plc && other.level < level) {
            other.until = other.until.map(|until| until + run_us);
        }
    }

    /// Waits for the end of a turn, or until another client rings. During the wait the boards answer requests of the
    /// task.
    fn await_end(&self, turn: &mut Turn, plant: &mut Plant, witness: &mut dyn Witness) -> TurnCheck {
        let task = &self.tasks[turn.index];
        let (header, seat) = (&self.headers[task.plc.index()], &task.seat);
        let patience = match seat.patience_ms.load() {
            0 => Duration::MAX,
            ms => Duration::from_millis(ms.into()),
        };
        let rings = header.doorbell.rings();
        if witness.boards(plant) {
            header.answer.ring();
        }
        if seat.done.rings() != turn.done {
            return TurnCheck::Ended;
        }
        let slice = LIVENESS.min(patience.saturating_sub(turn.time.elapsed()));
        let rung = bell::wait_any(&[(&seat.done, turn.done), (&header.doorbell, rings)], Some(slice));
        match rung {
            Some(0) => TurnCheck::Ended,
            _ if !task.has_seat() => TurnCheck::Lost,
            None if task.gone() || turn.time.elapsed() >= patience => TurnCheck::Lost,
            _ => TurnCheck::Continues,
        }
    }

    fn give_up(&mut self, index: usize, plant: &mut Plant, witness: &mut dyn Witness) {
        let task = self.tasks.remove(index);
        let state = if task.seat.lose() { SeatState::Lost } else { SeatState::Free };
        note(plant, witness, task.plc, task.event, state);
        if state == SeatState::Lost {
            tracing::warn!("the task of event {} was given up: it died or took too long", task.event);
            task.seat.turn.ring();
            // A dead process cannot leave by itself.
            task.seat.free_if_dead();
        }
        self.watch(task.plc, plant);
    }
}
