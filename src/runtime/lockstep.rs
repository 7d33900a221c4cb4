//! Lockstep: tasks of PLC processes that the emulated time waits for.
//!
//! When the event of a task has occurred, the plant stops and the task gets a turn. At its end it claims run time: it
//! gets another turn when that is over, and the time goes on. Tasks of one PLC share its processor: a task of a
//! higher level interrupts one of a lower level, which then needs as much longer; tasks of the same level wait for
//! each other (manual 5.00005.03a p. 43-44, 73). Who dies, leaves or takes too long is given up.

use crate::memory::header::{SEAT_ORDERS, Seat, SeatState};
use crate::memory::{Header, View, bell};
use crate::plant::Plant;
use std::time::{Duration, Instant};

/// How often the emulator looks whether a task in its turn still lives.
const LIVENESS: Duration = Duration::from_millis(20);

/// A task that takes part.
struct Task {
    plc: usize,
    seat: View<Seat>,
    event: usize,
    level: u8,
    /// Events seen by it.
    seen: u32,
    /// Orders of the board seen by it; none if it does not obey any.
    orders: Option<u32>,
    /// It runs, until this emulated time.
    until: Option<u64>,
}

impl Task {
    fn has_seat(&self) -> bool {
        self.seat.state.load() == SeatState::Seated.code()
    }

    fn gone(&self) -> bool {
        !self.has_seat() || !self.seat.owner_is_running()
    }
}

/// A turn that has not ended yet.
struct Turn {
    /// Whose it is.
    index: usize,
    /// Turns that the task had ended before.
    done: u32,
    since: Instant,
}

/// How a look at a turn came out.
enum Look {
    /// It has ended, and the task claims run time.
    Ended,
    /// It goes on, and somebody else wants something.
    GoesOn,
    /// The task is gone, or has taken too long.
    Lost,
}

/// All tasks that take part.
pub(super) struct Lockstep {
    /// The turn that the time waits for.
    turn: Option<Turn>,
    headers: Vec<View<Header>>,
    /// Requests of each PLC as last seen.
    requests: Vec<u32>,
    tasks: Vec<Task>,
    /// Whether tasks may take part.
    stepped: bool,
}

/// Who is told what tasks do to a plant at other times than those of events.
pub(crate) trait Witness {
    /// The boards are to answer what they are asked, if anything; tells whether there was anything.
    fn boards(&mut self, plant: &mut Plant) -> bool;

    /// The plant has noted what became of a task.
    fn task(&mut self, plc: usize, event: usize, state: SeatState);
}

/// Nobody but the plant.
pub(crate) struct NoWitness;

impl Witness for NoWitness {
    fn boards(&mut self, plant: &mut Plant) -> bool {
        plant.look_at_boards()
    }

    fn task(&mut self, _: usize, _: usize, _: SeatState) {}
}

/// Orders, power-ons and resets of a board, counted.
fn orders_of(header: &Header) -> u32 {
    header.program.start.rings().wrapping_add(header.program.restarts.load())
}

fn note(plant: &mut Plant, witness: &mut dyn Witness, plc: usize, event: usize, state: SeatState) {
    plant.note_lockstep(plc, event, state);
    witness.task(plc, event, state);
}

impl Lockstep {
    pub(crate) fn new(headers: Vec<View<Header>>, stepped: bool) -> Self {
        let requests = vec![0; headers.len()];
        Lockstep { turn: None, headers, requests, tasks: Vec::new(), stepped }
    }

    /// Seats those that ask for it and forgets those that have left; tells whether there was anything.
    pub(crate) fn look(&mut self, plant: &mut Plant, witness: &mut dyn Witness) -> bool {
        // Who comes or leaves during a turn does so behind it.
        if self.turn.is_some() {
            return false;
        }
        let mut changed = false;
        for plc in 0..self.headers.len() {
            let requests = self.headers[plc].board_requests.load();
            if requests != self.requests[plc] {
                self.requests[plc] = requests;
                changed |= self.look_at(plc, plant, witness);
            }
        }
        changed
    }

    fn look_at(&mut self, plc: usize, plant: &mut Plant, witness: &mut dyn Witness) -> bool {
        let before = self.tasks.len();
        self.tasks.retain(|task| {
            let stays = task.plc != plc || task.has_seat();
            if !stays {
                note(plant, witness, task.plc, task.event, SeatState::Free);
            }
            stays
        });
        let mut changed = self.tasks.len() != before;
        for place in 0..self.headers[plc].lockstep.len() {
            let seat = self.headers[plc].project(|header| &header.lockstep[place]);
            match SeatState::from_code(seat.state.load()) {
                Some(SeatState::Asking) => self.seat(plc, seat, plant, witness),
                Some(SeatState::Refused | SeatState::Lost) if seat.bury() => {}
                _ => continue,
            }
            changed = true;
        }
        self.watch(plc, plant);
        changed
    }

    fn seat(&mut self, plc: usize, seat: View<Seat>, plant: &mut Plant, witness: &mut dyn Witness) {
        let mut found = None;
        let answer = seat.decide(|event| {
            let number = (event & !SEAT_ORDERS) as usize;
            // Read before it is told that it has its seat: no event behind that is missed.
            let seen = self.headers[plc].events.get(number).map(|slot| slot.bell.rings());
            found = plant.event_level(plc, number).zip(seen).filter(|_| self.stepped);
            found.is_some()
        });
        // Who has left is asked for by nobody.
        let Some((asked, _)) = answer else { return };
        let event = (asked & !SEAT_ORDERS) as usize;
        // An order may have been given before the task came, so its first turn comes at once.
        let orders = (asked & SEAT_ORDERS != 0).then(|| orders_of(&self.headers[plc]).wrapping_sub(1));
        let Some((level, seen)) = found else {
            note(plant, witness, plc, event, SeatState::Refused);
            return;
        };
        note(plant, witness, plc, event, SeatState::Seated);
        self.tasks.push(Task { plc, seat, event, level, seen, orders, until: None });
    }

    /// The plant stops at the events that tasks of a PLC wait for.
    fn watch(&self, plc: usize, plant: &mut Plant) {
        plant.watch(plc, self.watched_of(plc));
    }

    fn watched_of(&self, plc: usize) -> u16 {
        let tasks = self.tasks.iter().filter(|task| task.plc == plc);
        tasks.fold(0, |events, task| events | 1 << task.event)
    }

    /// Lets emulated time pass until `target`, with a turn for each task whenever it is due. Returns early if `stop`
    /// says so, and while a task has its turn and somebody rings: then it is to be called again with the same target.
    pub(crate) fn advance(&mut self, plant: &mut Plant, target: u64, stop: impl Fn() -> bool) {
        let witness = &mut NoWitness;
        self.look(plant, witness);
        loop {
            if !self.give_turns(plant, &stop, witness) {
                return;
            }
            let until = self.next_turn().min(target);
            let stopped = plant.advance_until(until);
            if !stopped && until == target {
                self.give_turns(plant, &stop, witness);
                return;
            }
        }
    }

    /// Turns for all tasks that are due now, and nothing else. `false`: told to stop, or a turn goes on.
    pub(crate) fn take_turns(
        &mut self,
        plant: &mut Plant,
        stop: impl Fn() -> bool,
        witness: &mut dyn Witness,
    ) -> bool {
        self.look(plant, witness);
        self.give_turns(plant, &stop, witness)
    }

    /// Whether the time is to wait for a task although it does not pass: an order of a board waits, or its turn goes on.
    pub(crate) fn has_turns(&self) -> bool {
        self.turn.is_some() || self.tasks.iter().any(|task| task.until.is_none() && self.has_orders(task))
    }

    /// Of each PLC the events that tasks wait for, bit n for event n.
    #[cfg(feature = "channel")]
    pub(crate) fn watched(&self) -> Vec<u16> {
        (0..self.headers.len()).map(|plc| self.watched_of(plc)).collect()
    }

    /// Whether the time waits for a task.
    pub(crate) fn is_in_turn(&self) -> bool {
        self.turn.is_some()
    }

    /// For whom the time waits, for people.
    pub(crate) fn waits_for(&self, plant: &Plant) -> Option<String> {
        let task = self.tasks.get(self.turn.as_ref()?.index)?;
        let (plc, process) = (plant.devices().get(task.plc)?.name(), task.seat.owner.load());
        Some(format!("the task of event {} of PLC '{plc}' (process {process})", task.event))
    }

    /// A task that takes part, for people.
    pub(crate) fn present(&self, plant: &Plant) -> Option<String> {
        // Those that have gone are forgotten only when time passes.
        let task = self.tasks.iter().find(|task| !task.gone())?;
        let (plc, process) = (plant.devices().get(task.plc)?.name(), task.seat.owner.load());
        Some(format!(
            "the task of event {} of PLC '{plc}' (process {process}), which takes part in lockstep,",
            task.event
        ))
    }

    /// When the first of the tasks that run has its next turn; `u64::MAX` if none runs.
    pub(crate) fn next_turn(&self) -> u64 {
        self.tasks.iter().filter_map(|task| task.until).fold(u64::MAX, u64::min)
    }

    /// Turns for all tasks that are due now. `false`: told to stop, or a turn goes on.
    fn give_turns(&mut self, plant: &mut Plant, stop: &impl Fn() -> bool, witness: &mut dyn Witness) -> bool {
        loop {
            if let Some(turn) = self.turn.take() {
                match self.await_end(&turn, plant, witness) {
                    Look::Ended => self.claim(turn.index, plant),
                    Look::Lost => self.give_up(turn.index, plant, witness),
                    Look::GoesOn => {
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

    /// The task that is to run now: the highest level first.
    fn due(&self, now: u64) -> Option<usize> {
        let ready = |task: &Task| match task.until {
            Some(until) => until <= now,
            None => (self.has_event(task) || self.has_orders(task)) && !self.is_held_up(task),
        };
        let tasks = self.tasks.iter().enumerate().filter(|(_, task)| ready(task));
        // Of equals the first one.
        tasks.rev().max_by_key(|(_, task)| task.level).map(|(index, _)| index)
    }

    fn has_event(&self, task: &Task) -> bool {
        self.rings(task) != task.seen
    }

    fn has_orders(&self, task: &Task) -> bool {
        task.orders.is_some_and(|seen| seen != orders_of(&self.headers[task.plc]))
    }

    fn rings(&self, task: &Task) -> u32 {
        self.headers[task.plc].events[task.event].bell.rings()
    }

    /// Whether a task of the same or a higher level of the same PLC is running.
    fn is_held_up(&self, task: &Task) -> bool {
        self.tasks
            .iter()
            .any(|other| other.plc == task.plc && other.until.is_some() && other.level >= task.level)
    }

    fn give_turn(&mut self, index: usize, plant: &Plant) {
        let (now, rings) = (plant.now(), self.rings(&self.tasks[index]));
        let orders = orders_of(&self.headers[self.tasks[index].plc]);
        let task = &mut self.tasks[index];
        if task.until.take().is_none() {
            task.seen = rings;
            task.orders = task.orders.map(|_| orders);
        }
        self.turn = Some(Turn { index, done: task.seat.done.rings(), since: Instant::now() });
        task.seat.time_us.store(now);
        task.seat.turn.ring();
    }

    /// The turn has ended; its task runs on for as long as it claims.
    fn claim(&mut self, index: usize, plant: &Plant) {
        let task = &mut self.tasks[index];
        let run_us = u64::from(task.seat.run_us.load());
        if run_us == 0 {
            return;
        }
        task.until = Some(plant.now() + run_us);
        // It takes the processor from those below it.
        let (plc, level) = (task.plc, task.level);
        for other in self.tasks.iter_mut().filter(|other| other.plc == plc && other.level < level) {
            other.until = other.until.map(|until| until + run_us);
        }
    }

    /// Waits for the end of a turn, but not while somebody else rings. Meanwhile the boards answer, so that the task can ask
    /// them.
    fn await_end(&self, turn: &Turn, plant: &mut Plant, witness: &mut dyn Witness) -> Look {
        let task = &self.tasks[turn.index];
        let (header, seat) = (&self.headers[task.plc], &task.seat);
        let patience = match seat.patience_ms.load() {
            0 => Duration::MAX,
            ms => Duration::from_millis(ms.into()),
        };
        let rings = header.doorbell.rings();
        if witness.boards(plant) {
            header.answer.ring();
        }
        if seat.done.rings() != turn.done {
            return Look::Ended;
        }
        let slice = LIVENESS.min(patience.saturating_sub(turn.since.elapsed()));
        let rung = bell::wait_any(&[(&seat.done, turn.done), (&header.doorbell, rings)], Some(slice));
        match rung {
            Some(0) => Look::Ended,
            _ if !task.has_seat() => Look::Lost,
            None if task.gone() || turn.since.elapsed() >= patience => Look::Lost,
            _ => Look::GoesOn,
        }
    }

    fn give_up(&mut self, index: usize, plant: &mut Plant, witness: &mut dyn Witness) {
        let task = self.tasks.remove(index);
        let state = if task.seat.lose() { SeatState::Lost } else { SeatState::Free };
        note(plant, witness, task.plc, task.event, state);
        if state == SeatState::Lost {
            tracing::warn!("the task of event {} was given up: it died or took too long", task.event);
            task.seat.turn.ring();
            // Who has died does not leave.
            task.seat.bury();
        }
        self.watch(task.plc, plant);
    }
}
