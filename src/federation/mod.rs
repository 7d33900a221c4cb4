//! One plant over several hosts: federates, each of which runs all of it, and what enters it on one host enters it on all.
//!
//! A plant does the same whenever the same enters it at the same emulated times. So what federates tell each other is not what
//! happens on its buses, but what enters: operations of clients, stores of programs, and until when they have nothing more to
//! say. At a moment they have turns, one after the other in the order of their numbers; then time passes everywhere until the
//! earliest of the times that they want, or until an event at which one of them wants to have a turn (decision D-570). With each
//! turn goes a hash of the journal: those that have not gone the same way notice it.
//!
//! How messages travel is not told here: that is an [`Exchange`].

mod alone;
mod error;
mod exchange;
mod message;

pub use alone::Alone;
pub use error::FederationError;
pub use exchange::Exchange;

use crate::memory::header::SeatState;
use crate::plant::{Outside, Plant, SnapshotError};
use crate::request::{Code, Execution, Host, Op, Refused};
use core::time::Duration;
use message::{Hello, Input, Message, Turn};
use std::collections::VecDeque;
use std::time::Instant;

/// Most federates there can be.
pub const MOST: u8 = 64;
/// How often a federate says that it waits for somebody in its turn.
const ALIVE: Duration = Duration::from_secs(1);

/// Which federate this is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// Its number, from 0.
    pub own: u8,
    /// How many there are.
    pub count: u8,
    /// It never lets time pass by itself.
    pub follows: bool,
    /// How long another one may not be heard of.
    pub limit: Duration,
    /// Emulated time from one exchange with other simulators to the next, if it has any; federate 0 only (decision D-578).
    pub exchange_us: Option<u64>,
}

/// What has come of a look at the messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum News {
    /// There were none.
    Nothing,
    /// The plant, or whose turn it is, is not what it was.
    Moved,
    /// This federate ended in good order.
    Left(u8),
}

/// This federate among the others.
pub struct Federation {
    part: Part,
    exchange: Box<dyn Exchange>,
    /// Who is there, until all are.
    hellos: Vec<Option<Hello>>,
    is_complete: bool,
    /// Whose turn it is.
    turn: u8,
    /// Earliest of the times that those want who have had their turns.
    want: u64,
    /// Of each federate the turns of which it has told, but it is somebody else's: messages of several may come in any order.
    pending: Vec<VecDeque<Turn>>,
    /// What has entered here and was not told yet.
    inputs: Vec<Input>,
    outside: Outside,
    /// Of each federate the events of each device at which it wants to have a turn.
    watched: Vec<Vec<u16>>,
    /// Emulated time at which it has joined.
    start: u64,
    /// Where somebody here wants to go.
    asked: Option<u64>,
    /// He is there.
    arrived: Option<u64>,
    heard: Instant,
    spoken: Instant,
}

impl Federation {
    /// Joins, with a plant in which nothing has happened yet.
    ///
    /// # Errors
    /// The others cannot be told.
    pub fn join(part: Part, plant: &Plant, mut exchange: Box<dyn Exchange>) -> Result<Self, FederationError> {
        let hello = Hello {
            version: env!("CARGO_PKG_VERSION").to_owned(),
            count: part.count,
            follows: part.follows && part.exchange_us.is_none(),
            exchange_us: part.exchange_us,
            plant: plant.likeness(),
        };
        let message = Message::Hello(hello.clone());
        exchange.send(&message.to_bytes()).map_err(FederationError::Exchange)?;
        let mut hellos = vec![None; part.count.into()];
        hellos[usize::from(part.own)] = Some(hello);
        Ok(Federation {
            part,
            exchange,
            hellos,
            is_complete: part.count == 1,
            turn: 0,
            want: u64::MAX,
            pending: (0..part.count).map(|_| VecDeque::new()).collect(),
            inputs: Vec::new(),
            outside: Outside::of(plant),
            watched: vec![vec![0; plant.devices().len()]; part.count.into()],
            start: plant.now(),
            asked: None,
            arrived: None,
            heard: Instant::now(),
            spoken: Instant::now(),
        })
    }

    /// Whether this federate has its turn: only then may anything enter the plant here.
    pub fn is_own_turn(&self) -> bool {
        self.is_complete && self.turn == self.part.own
    }

    /// For whom the time waits, for people; `None` if it is this federate.
    pub fn waits_for(&self) -> Option<String> {
        match (self.is_complete, self.is_own_turn()) {
            (false, _) => Some(format!("federate {}, which has not been heard of yet", self.missing())),
            (true, false) => Some(format!("federate {}, whose turn it is", self.turn)),
            (true, true) => None,
        }
    }

    /// Who is not there yet.
    fn missing(&self) -> String {
        let missing = (0..self.part.count).zip(&self.hellos).filter(|(_, hello)| hello.is_none());
        missing.map(|(who, _)| who.to_string()).collect::<Vec<_>>().join(", ")
    }

    /// Whether it never lets time pass by itself.
    pub fn follows(&self) -> bool {
        self.part.follows
    }

    /// An operation is about to be executed here.
    ///
    /// # Errors
    /// It is one that several hosts cannot do together.
    pub fn permit(&mut self, plant: &Plant, op: &Op) -> Result<(), Refused> {
        match op {
            Op::Restore { .. } | Op::BackTo { .. } | Op::Back { .. } | Op::BackUntil { .. } => {
                let text = "the other federates cannot go back with the plant; going back needs an instance of its own";
                return Err(Refused::new(Code::NOT_ALONE, text));
            }
            Op::DoorOpen { .. } => {
                let text = "a federate has no doors: their guests would be on one host only";
                return Err(Refused::new(Code::NO_DOORS, text));
            }
            _ if op.acts() => {
                self.gather(plant);
                self.inputs.push(Input::of(op));
            }
            _ => {}
        }
        Ok(())
    }

    /// In this federate's turn: the boards answer what programs here have asked them by the header page; tells whether there was
    /// anything.
    pub fn look_at_boards(&mut self, plant: &mut Plant) -> bool {
        if !plant.has_untold() {
            return false;
        }
        self.gather(plant);
        self.inputs.push(Input::Boards);
        plant.look_at_boards()
    }

    /// The plant has noted what became of a task in lockstep.
    pub fn note_task(&mut self, plc: usize, event: usize, state: SeatState) {
        self.inputs.push(Input::Task(plc as u16, event as u16, state.code()));
    }

    /// A motor turns now as a model here says.
    pub fn note_shaft(&mut self, drive: usize, speed: Option<i32>) {
        self.inputs.push(Input::Shaft(drive as u16, speed));
    }

    /// When the next exchange with other simulators is behind this emulated time, at whichever federate: then registers may change.
    /// `u64::MAX` if there is none.
    pub fn next_exchange(&self, now: u64) -> u64 {
        let Some(period) = self.hellos.iter().flatten().find_map(|hello| hello.exchange_us) else {
            return u64::MAX;
        };
        let periods = (now - self.start) / period.max(1) + 1;
        periods.saturating_mul(period).saturating_add(self.start)
    }

    /// Whether time has passed up to `target`, for whoever asked for it by [`Federation::end_turn`].
    pub fn has_come_to(&mut self, target: u64) -> bool {
        self.arrived.take_if(|at| *at >= target).is_some()
    }

    /// Ends this federate's turn: until `want` it has nothing more to say. `target`: somebody here wants to go there. `watched`: at
    /// which events of each device it wants to have a turn before, bit n for event n.
    ///
    /// # Errors
    /// [`FederationError`].
    pub fn end_turn(
        &mut self,
        plant: &mut Plant,
        target: Option<u64>,
        want: u64,
        watched: Vec<u16>,
    ) -> Result<(), FederationError> {
        self.gather(plant);
        self.asked = target;
        let inputs = core::mem::take(&mut self.inputs);
        let (now, hash) = (plant.now(), plant.journal().hash());
        self.say(&Message::Turn(Turn { now, inputs, hash, want, watched: watched.clone() }))?;
        self.heard = Instant::now();
        self.turn_over(plant, want, watched);
        Ok(())
    }

    /// Takes in what the others have said since, if it is not this federate's turn, and lets time pass when all have had theirs.
    ///
    /// # Errors
    /// [`FederationError`].
    pub fn look(&mut self, host: &mut dyn Host) -> Result<News, FederationError> {
        let mut news = News::Nothing;
        while !self.is_own_turn() {
            let Some((from, bytes)) = self.exchange.receive().map_err(FederationError::Exchange)? else {
                self.is_in_time()?;
                return Ok(news);
            };
            self.heard = Instant::now();
            match Message::of_bytes(&bytes).ok_or(FederationError::Nonsense { who: from })? {
                Message::Bye(None) => return Ok(News::Left(from)),
                Message::Bye(Some(reason)) => return Err(FederationError::Failed { who: from, reason }),
                Message::Hello(hello) if !self.is_complete => self.welcome(host.plant(), from, hello)?,
                Message::Alive => {}
                Message::Turn(turn) => match self.pending.get_mut(usize::from(from)) {
                    Some(pending) => pending.push_back(turn),
                    None => return Err(FederationError::Nonsense { who: from }),
                },
                Message::Hello(_) => return Err(FederationError::Nonsense { who: from }),
            }
            news = News::Moved;
            while self.is_complete
                && let Some(turn) = self.pending[usize::from(self.turn)].pop_front()
            {
                self.take_in(host, turn)?;
            }
        }
        if self.spoken.elapsed() >= ALIVE {
            self.say(&Message::Alive)?;
        }
        Ok(news)
    }

    /// Tells the others that it ends, and why if it has failed.
    pub fn leave(mut self, error: Option<&FederationError>) {
        self.exchange.leave(&Message::Bye(error.map(ToString::to_string)).to_bytes());
    }

    fn say(&mut self, message: &Message) -> Result<(), FederationError> {
        self.spoken = Instant::now();
        self.exchange.send(&message.to_bytes()).map_err(FederationError::Exchange)
    }

    fn is_in_time(&self) -> Result<(), FederationError> {
        let Part { limit, .. } = self.part;
        if self.heard.elapsed() < limit {
            return Ok(());
        }
        let who = if self.is_complete { self.turn.to_string() } else { self.missing() };
        Err(FederationError::Silent { who, limit })
    }

    fn welcome(&mut self, plant: &Plant, who: u8, hello: Hello) -> Result<(), FederationError> {
        let Part { count, .. } = self.part;
        if hello.version != env!("CARGO_PKG_VERSION") {
            return Err(FederationError::OtherVersion { who, theirs: hello.version });
        }
        if hello.count != count {
            return Err(FederationError::OtherCount { who, theirs: hello.count, ours: count });
        }
        let own = usize::from(self.part.own);
        let Some(Some(ours)) = self.hellos.get(own) else { return Err(FederationError::Nonsense { who }) };
        let is_like = plant.is_like(&ours.plant, &hello.plant);
        is_like.map_err(|why| FederationError::OtherPlant { who, why: in_words(why) })?;
        match self.hellos.get_mut(usize::from(who)) {
            Some(place @ None) => *place = Some(hello),
            _ => return Err(FederationError::Nonsense { who }),
        }
        self.is_complete = self.hellos.iter().all(Option::is_some);
        if self.is_complete && self.hellos.iter().flatten().all(|hello| hello.follows) {
            return Err(FederationError::NobodyLeads);
        }
        Ok(())
    }

    /// In this federate's turn: what programs have stored since the last look belongs to it.
    fn gather(&mut self, plant: &Plant) {
        // A program that asks a board has stored before what belongs to it, so that is looked for behind it and told ahead of it.
        let asked = plant.tell_boards();
        self.gather_registers(plant);
        self.inputs.extend(asked.into_iter().map(Input::Stored));
    }

    /// What programs have stored into registers meanwhile belongs to the turn to come.
    fn gather_registers(&mut self, plant: &Plant) {
        self.inputs.extend(self.outside.stored(plant).into_iter().map(Input::Stored));
    }

    /// What enters elsewhere enters here.
    fn take_in(&mut self, host: &mut dyn Host, turn: Turn) -> Result<(), FederationError> {
        let who = self.turn;
        self.gather_registers(host.plant());
        for input in turn.inputs {
            match input {
                Input::Op(bytes) => {
                    let op = Input::op(&bytes).filter(Op::acts).ok_or(FederationError::Nonsense { who })?;
                    // What is refused there is refused here.
                    let _ = Execution::default().run(host, &op);
                }
                Input::Boards => {
                    host.plant_mut().look_at_boards();
                }
                Input::Stored(stored) => host.plant().store_as_outside(&stored),
                Input::Task(plc, event, state) => {
                    let state = SeatState::from_code(state).ok_or(FederationError::Nonsense { who })?;
                    host.plant_mut().note_lockstep(plc.into(), event.into(), state);
                }
                Input::Shaft(drive, speed) => {
                    host.plant_mut().turn_shaft(drive.into(), speed);
                }
            }
        }
        self.outside.renew(host.plant());
        let plant = host.plant_mut();
        if (turn.now, turn.hash) != (plant.now(), plant.journal().hash()) {
            return Err(FederationError::Apart { who, at_us: plant.now() });
        }
        self.turn_over(plant, turn.want, turn.watched);
        Ok(())
    }

    /// The turn of federate `self.turn` has ended. After the last one's, time passes.
    fn turn_over(&mut self, plant: &mut Plant, want: u64, watched: Vec<u16>) {
        self.want = self.want.min(want);
        self.watched[usize::from(self.turn)] = watched;
        self.turn += 1;
        if self.turn < self.part.count {
            return;
        }
        let until = core::mem::replace(&mut self.want, u64::MAX);
        for device in 0..plant.devices().len() {
            let of_all = self.watched.iter().filter_map(|watched| watched.get(device));
            plant.watch(device, of_all.fold(0, |all, events| all | events));
        }
        let has_stopped = plant.advance_until(until);
        self.outside.renew(plant);
        self.arrived = self.asked.take().filter(|at| !has_stopped && *at <= plant.now());
        self.turn = 0;
    }
}

/// In what a plant differs, without what is to be done about a snapshot.
fn in_words(why: SnapshotError) -> String {
    match why {
        SnapshotError::OtherSettings { what } => format!("its plant file sets {what} otherwise"),
        SnapshotError::OtherPlant { theirs, ours } => format!("it has {theirs}, here there are {ours}"),
        SnapshotError::OtherDevice { plc, theirs, ours } => {
            format!("PLC '{plc}' is another device in it, {theirs}, here {ours}")
        }
        other => other.to_string(),
    }
}
