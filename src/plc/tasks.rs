//! A small runner of a PLC program's tasks: start tasks, cyclic task, event tasks.
//!
//! There are two ways to run the tasks. [`Tasks::scan`] runs the tasks that are due at the present emulated time and
//! returns; a test calls it between two calls of `advance_to` of a plant in the same process. [`Tasks::run`] is for an
//! attached image: it runs the due tasks whenever the emulated clock has advanced.
//!
//! The switch of the board controls the program. The program starts at RUN and stops at STOP. After a reset
//! the program starts warm if its project is a boot project; any other project is lost at a reset. Tasks do
//! not interrupt each other. If several tasks are due, event tasks run first, in the order in which they were
//! given to [`Tasks::load`].

use super::Ram;
use crate::memory::header::{Power, ProgramState, Project, RunSwitch, Start};
use crate::memory::{Attached, ClockMode, MemoryError};
use core::fmt;
use core::time::Duration;
use thiserror::Error;

/// A PLC program with its tasks.
pub trait Program {
    /// An error that ends the program.
    type Error;

    /// Called at the beginning of a start. Variables get their initial values; retained variables only at a cold start
    /// (manual p. 38). Function blocks are variables.
    fn initialize(&mut self, start: Start);

    /// Runs the start task after a cold start. Called in every processor cycle until it returns [`Progress::Done`].
    ///
    /// # Errors
    /// The program ends with an error.
    fn cold_start(&mut self) -> Result<Progress, Self::Error>;

    /// Runs the start task after a warm start: retained variables keep their values. The default calls
    /// [`Program::cold_start`].
    ///
    /// # Errors
    /// The program ends with an error.
    fn warm_start(&mut self) -> Result<Progress, Self::Error> {
        self.cold_start()
    }

    /// Runs the cyclic task. [`Progress::Done`] ends the program.
    ///
    /// # Errors
    /// The program ends with an error.
    fn cyclic(&mut self) -> Result<Progress, Self::Error>;

    /// Runs the task of an event. `missed` is the number of earlier events of this number for which the task
    /// did not run.
    ///
    /// # Errors
    /// The program ends with an error.
    fn event(&mut self, number: usize, missed: u32) -> Result<(), Self::Error> {
        let _ = (number, missed);
        Ok(())
    }
}

/// Result of a call of a task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// The task has more to do: the runner must call it once more.
    Again,
    /// The task has ended.
    Done,
}

impl Progress {
    /// Returns `Done` if `done` is true.
    pub fn done_if(done: bool) -> Self {
        if done { Progress::Done } else { Progress::Again }
    }
}

/// The reason why a program has ended.
#[derive(Debug, Error)]
pub enum RunError<E: fmt::Display + fmt::Debug> {
    /// The emulator has ended, or no task became due within the given time.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// The program has ended with an error.
    #[error("{0}")]
    Program(E),
}

/// The present phase of the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// The board has not requested a start yet, or has requested a stop.
    Stopped,
    Starting(Start),
    Cyclic,
}

/// The tasks of a program.
pub struct Tasks<P: Program> {
    ram: Ram,
    program: P,
    period_us: u64,
    /// Event numbers, each with the count of events at the last poll.
    events: Vec<(usize, u32)>,
    phase: Phase,
    /// True if the variables of the program have been initialized.
    is_initialized: bool,
    /// Number of starts and stops that the board has requested before this poll.
    orders: u32,
    /// Number of power-ons and resets of the board before this poll.
    restarts: u32,
    /// Time at which the start task or the cyclic task is due.
    next_us: u64,
}

impl<P: Program> Tasks<P> {
    /// Loads a program with a cyclic task every `period` of emulated time and a task for each of the event
    /// numbers, which the program enables with `INTR_SET`.
    pub fn load(ram: &Ram, program: P, period: Duration, events: &[usize]) -> Self {
        let header = ram.header();
        let mut orders = header.program.start.rings();
        match ProgramState::from_code(header.program.state.load()) {
            Some(ProgramState::None) if header.project.load() == Project::None.code() => {}
            // A project is loaded, and this is its program. If the board has requested a start before the
            // program attached, this start is still pending.
            Some(ProgramState::Stopped) => {
                let kind = Start::from_code(header.program.start_kind.load());
                if matches!(kind, Some(Start::Cold | Start::Warm | Start::Hot)) {
                    orders = orders.wrapping_sub(1);
                }
            }
            // The previous program did not end normally, or has ended so recently that the board has not
            // noticed. The board then takes this program for the previous one and requests no start. So this
            // program requests a start itself.
            _ => header.program.start_request.store(Start::Cold.code()),
        }
        header.program.state.store(ProgramState::Stopped.code());
        header.submit_request();
        Tasks {
            ram: ram.clone(),
            program,
            period_us: u64::try_from(period.as_micros()).unwrap_or(u64::MAX).max(1),
            events: events.iter().map(|&number| (number, 0)).collect(),
            phase: Phase::Stopped,
            is_initialized: false,
            orders,
            restarts: header.program.restarts.load(),
            next_us: 0,
        }
    }

    /// Returns the program that the tasks belong to.
    pub fn program(&self) -> &P {
        &self.program
    }

    /// Returns the time at which the start task or the cyclic task is due, in microseconds of emulated time; `None`
    /// while the program is stopped.
    pub fn next_us(&self) -> Option<u64> {
        (self.phase != Phase::Stopped).then_some(self.next_us)
    }

    /// Runs all tasks that are due now. Returns [`Progress::Done`] if the program has ended.
    ///
    /// # Errors
    /// The program has ended with an error.
    pub fn scan(&mut self) -> Result<Progress, P::Error> {
        self.obey();
        let now = self.ram.now_us();
        match self.phase {
            Phase::Stopped => {}
            Phase::Starting(kind) if now >= self.next_us => {
                let progress = match kind {
                    Start::Cold => self.program.cold_start()?,
                    _ => self.program.warm_start()?,
                };
                self.next_us = now + u64::from(self.ram.header().processor_cycle_us.load()).max(1);
                if progress == Progress::Done {
                    self.go_cyclic(now);
                }
            }
            Phase::Starting(_) => {}
            Phase::Cyclic => {
                self.run_events()?;
                if now >= self.next_us {
                    // The next time remains a multiple of the period after the start: the task skips the
                    // periods that it has missed.
                    self.next_us += self.period_us * ((now - self.next_us) / self.period_us + 1);
                    self.ram.header().program_cycles.increment();
                    return self.program.cyclic();
                }
            }
        }
        Ok(Progress::Again)
    }

    /// Runs the program until it ends. `patience` is the longest real time without a due task.
    ///
    /// In stepped mode the emulated time waits for the event tasks (lockstep). The task of an event runs at
    /// the emulated time of the event, and takes no emulated time. A start or stop that the board requests
    /// takes effect at the emulated time of the request. If the program has event tasks, the emulated time
    /// also waits for its start tasks. It does not wait for the cyclic task.
    ///
    /// # Errors
    /// The program has ended with an error, the emulator has ended, or no task was due within `patience`.
    pub fn run(&mut self, attached: &Attached, patience: Duration) -> Result<(), RunError<P::Error>>
    where
        P::Error: fmt::Display + fmt::Debug,
    {
        let stepped = self.ram.header().clock_mode.load() == ClockMode::Stepped.code();
        let mut seats = Vec::new();
        for (event, _) in self.events.iter().filter(|_| stepped) {
            // The task of the first seat also gets a turn for each start or stop that the board requests.
            seats.push(match seats.is_empty() {
                true => attached.join_with_orders(*event, patience, patience)?,
                false => attached.join_lockstep(*event, patience, patience)?,
            });
        }
        let obeys_in_turns = !seats.is_empty();
        loop {
            if self.scan().map_err(RunError::Program)? == Progress::Done {
                return Ok(());
            }
            attached.ring()?;
            let wait_us = self.start_task_due_in();
            if !attached.wait_turns(&mut seats, wait_us, patience, || self.is_due(obeys_in_turns))? {
                let what = "a task to fall due".to_owned();
                return Err(MemoryError::Timeout { what, timeout: patience }.into());
            }
        }
    }

    /// Returns the time until the next call of the start task, in microseconds; `None` if no start task runs.
    fn start_task_due_in(&self) -> Option<u32> {
        let is_starting = matches!(self.phase, Phase::Starting(_));
        is_starting.then(|| u32::try_from(self.next_us.saturating_sub(self.ram.now_us())).unwrap_or(u32::MAX))
    }

    /// True if a task must run now. With `obeys_in_turns`, the emulator gives the program a turn for a start
    /// or stop of the board and for the next call of the start task. This function then need not poll for
    /// them.
    fn is_due(&self, obeys_in_turns: bool) -> bool {
        let header = self.ram.header();
        let has_turns = obeys_in_turns && matches!(self.phase, Phase::Starting(_));
        !obeys_in_turns && header.program.start.rings() != self.orders
            || !has_turns && self.next_us().is_some_and(|time| self.ram.now_us() >= time)
            || self.phase == Phase::Cyclic
                && self.events.iter().any(|&(event, seen)| count(&self.ram, event) != seen)
    }

    /// Carries out the starts and stops that the board requests.
    fn obey(&mut self) {
        let header = self.ram.header();
        // A reset may have begun and ended since the last poll. The number of resets shows it.
        let restarts = header.program.restarts.load();
        if core::mem::replace(&mut self.restarts, restarts) != restarts && self.phase != Phase::Stopped {
            self.enter(Phase::Stopped, ProgramState::Stopped);
        }
        let header = self.ram.header();
        let orders = header.program.start.rings();
        if core::mem::replace(&mut self.orders, orders) != orders {
            let now = self.ram.now_us();
            let kind = match Start::from_code(header.program.start_kind.load()) {
                // A program that was never started has nothing to continue.
                Some(Start::Hot) if !self.is_initialized => Some(Start::Warm),
                kind => kind,
            };
            match kind {
                Some(kind @ (Start::Cold | Start::Warm)) => {
                    self.is_initialized = true;
                    self.program.initialize(kind);
                    header.program_cycles.store(0);
                    self.next_us = now;
                    self.enter(Phase::Starting(kind), ProgramState::Initializing);
                }
                Some(Start::Hot) => self.go_cyclic(now),
                _ => self.enter(Phase::Stopped, ProgramState::Stopped),
            }
        }
        // RESET and a missing supply stop all tasks without a request of the board.
        let header = self.ram.header();
        let may_run = header.board.switch.load() == RunSwitch::Run.code()
            && header.program.power.load() == Power::On.code();
        if !may_run && self.phase != Phase::Stopped {
            self.enter(Phase::Stopped, ProgramState::Stopped);
        }
    }

    fn enter(&mut self, phase: Phase, state: ProgramState) {
        self.phase = phase;
        // 0 means that the project was deleted. The state stays 0 until a project is loaded.
        self.ram
            .header()
            .program
            .state
            .update(|now| if now == ProgramState::None.code() { now } else { state.code() });
        self.ram.header().submit_request();
    }

    fn go_cyclic(&mut self, now: u64) {
        self.next_us = now;
        let ram = &self.ram;
        self.events.iter_mut().for_each(|(event, seen)| *seen = count(ram, *event));
        self.enter(Phase::Cyclic, ProgramState::Cyclic);
    }

    fn run_events(&mut self) -> Result<(), P::Error> {
        for (event, seen) in &mut self.events {
            let count = count(&self.ram, *event);
            let new = count.wrapping_sub(core::mem::replace(seen, count));
            if let Some(missed) = new.checked_sub(1) {
                self.program.event(*event, missed)?;
            }
        }
        Ok(())
    }
}

/// Returns the number of events.
fn count(ram: &Ram, event: usize) -> u32 {
    ram.header().events.get(event).map_or(0, |slot| slot.bell.rings())
}

impl<P: Program> Drop for Tasks<P> {
    /// Reports that no program is loaded any more.
    fn drop(&mut self) {
        self.ram.header().program.state.store(ProgramState::None.code());
        self.ram.header().submit_request();
        // The board must see this state before the next program is loaded, even while the clock is stopped.
        self.ram.header().doorbell.ring();
    }
}
