//! Runs one plant on several hosts. Each federate runs the whole plant, and input on one host enters the plant on all
//! hosts.
//!
//! A plant is deterministic: the same input at the same emulated time gives the same result. So federates exchange only
//! input (operations of clients and stores of programs), not the traffic of the buses. Each federate also sends the
//! time before which it has no further input. At each moment the federates take turns in the order of their numbers.
//! Then all clocks advance to the earliest time that a federate has sent, or to an event at which a federate needs a
//! turn (decision D-570). Each message about a turn contains a hash of the journal, so that a difference between hosts
//! is detected.
//!
//! An [`Exchange`] transports the messages.

mod error;
mod exchange;
mod message;
mod no_exchange;

pub use error::FederationError;
pub use exchange::Exchange;
pub use no_exchange::NoExchange;

use crate::awake_time::AwakeTime;
use crate::identity::DeviceIndex;
use crate::memory::header::SeatState;
use crate::plant::{Outside, Plant, SnapshotError};
use crate::request::{Code, Execution, Host, Op, Refused};
use core::time::Duration;
use message::{Hello, Input, Message, Turn};
use std::collections::VecDeque;
use std::time::Instant;

/// Largest number of federates.
pub const MOST: u8 = 64;
/// Interval at which a federate sends a sign of life.
const ALIVE: Duration = Duration::from_secs(1);

/// Configuration of this federate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FederateConfig {
    /// Number of this federate, from 0.
    pub own: u8,
    /// Number of all federates, including this one.
    pub count: u8,
    /// True if this federate never advances the clock by itself.
    pub follows: bool,
    /// Longest time without a message of another federate.
    pub limit: Duration,
    /// Emulated time between two exchanges with other simulators, if there are any; federate 0 only (decision D-578).
    pub exchange_us: Option<u64>,
}

/// Result of [`Federation::look`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FederationEvent {
    /// No message has arrived.
    Nothing,
    /// The plant has changed, or another federate has the turn now.
    Moved,
    /// The federate with this number has ended normally.
    Left(u8),
}

/// This process as a member of the federation.
pub struct Federation {
    part: FederateConfig,
    exchange: Box<dyn Exchange>,
    /// The greeting of each federate, until all have arrived.
    hellos: Vec<Option<Hello>>,
    is_complete: bool,
    /// Number of the federate that has the turn.
    turn: u8,
    /// Earliest of the times that the federates have requested in this round of turns.
    want: u64,
    /// For each federate, turns that have arrived too early. Messages of different federates may arrive in any order.
    pending: Vec<VecDeque<Turn>>,
    /// Input on this host that was not sent yet.
    inputs: Vec<Input>,
    outside: Outside,
    /// For each federate and device, the events at which the federate needs a turn.
    watched: Vec<Vec<u16>>,
    /// Emulated time at which this federate joined, in microseconds.
    start: u64,
    /// Emulated time requested by a client of this host, in microseconds.
    asked: Option<u64>,
    /// Target that the clock has reached.
    arrived: Option<u64>,
    /// Real time since this federate joined.
    time: AwakeTime,
    /// For each federate, the reading of `time` at which its last message arrived.
    heard: Vec<Duration>,
    /// Real time at which this federate last sent a message.
    spoken: Instant,
}

impl Federation {
    /// Joins the federation with a plant in its initial state.
    ///
    /// # Errors
    /// The message to the others cannot be sent.
    pub fn join(
        part: FederateConfig,
        plant: &Plant,
        mut exchange: Box<dyn Exchange>,
    ) -> Result<Self, FederationError> {
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
            time: AwakeTime::start(),
            heard: vec![Duration::ZERO; part.count.into()],
            spoken: Instant::now(),
        })
    }

    /// True if this federate has the turn. Input may enter the plant here only then.
    pub fn is_own_turn(&self) -> bool {
        self.is_complete && self.turn == self.part.own
    }

    /// Describes the federate for which the clock waits; `None` if the clock waits for this federate.
    pub fn waits_for(&self) -> Option<String> {
        match (self.is_complete, self.is_own_turn()) {
            (false, _) => Some(format!("federate {}, which has not joined yet", self.missing())),
            (true, false) => Some(format!("federate {}, which has the turn", self.turn)),
            (true, true) => None,
        }
    }

    /// Returns the name of the first federate that has not joined yet.
    fn missing(&self) -> String {
        let missing = (0..self.part.count).zip(&self.hellos).filter(|(_, hello)| hello.is_none());
        missing.map(|(federate, _)| federate.to_string()).collect::<Vec<_>>().join(", ")
    }

    /// True if this federate never advances the clock by itself.
    pub fn follows(&self) -> bool {
        self.part.follows
    }

    /// Checks an operation before it is executed here.
    ///
    /// # Errors
    /// The operation is not possible on several hosts together.
    pub fn permit(&mut self, plant: &Plant, op: &Op) -> Result<(), Refused> {
        match op {
            Op::Restore { .. } | Op::BackTo { .. } | Op::Back { .. } | Op::BackUntil { .. } => {
                let text =
                    "the other federates cannot go back with the plant; going back needs a separate instance";
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

    /// Called in this federate's turn. Lets the boards answer the requests of programs in the header page. Returns true
    /// if there were requests.
    pub fn look_at_boards(&mut self, plant: &mut Plant) -> bool {
        if !plant.has_undelivered_requests() {
            return false;
        }
        self.gather(plant);
        self.inputs.push(Input::Boards);
        plant.look_at_boards()
    }

    /// Records the state of a task in lockstep for the other federates.
    pub fn note_task(&mut self, plc: DeviceIndex, event: usize, state: SeatState) {
        self.inputs.push(Input::Task(plc, event as u16, state.code()));
    }

    /// Records, for the other federates, that a client of this host has set the speed of a motor.
    pub fn note_shaft(&mut self, drive: usize, speed: Option<i32>) {
        self.inputs.push(Input::Shaft(drive as u16, speed));
    }

    /// Returns the time of the next exchange of any federate with other simulators after `now`. Registers may change at
    /// this time. `u64::MAX` if there is no exchange.
    pub fn next_exchange(&self, now: u64) -> u64 {
        let Some(period) = self.hellos.iter().flatten().find_map(|hello| hello.exchange_us) else {
            return u64::MAX;
        };
        let periods = (now - self.start) / period.max(1) + 1;
        periods.saturating_mul(period).saturating_add(self.start)
    }

    /// True if the clock has reached `target`, which [`Federation::end_turn`] requested.
    pub fn has_reached(&mut self, target: u64) -> bool {
        self.arrived.take_if(|at| *at >= target).is_some()
    }

    /// Ends this federate's turn. `want` is the time before which this federate has no further input. `target` is the
    /// time that a client of this host requested to reach. `watched` contains, for each device, the events at which
    /// this federate needs a turn earlier: bit n for event n.
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
        self.broadcast(&Message::Turn(Turn { now, inputs, hash, want, watched: watched.clone() }))?;
        self.turn_over(plant, want, watched);
        Ok(())
    }

    /// Processes messages of the federate that has the turn, and advances the clock when all turns are over. During
    /// this federate's own turn, the call only detects that another federate has ended.
    ///
    /// # Errors
    /// [`FederationError`].
    pub fn look(&mut self, host: &mut dyn Host) -> Result<FederationEvent, FederationError> {
        let mut news = FederationEvent::Nothing;
        self.show_life()?;
        // The loop stops when the clock has advanced and it is this federate's turn. So a client that waits for the
        // reached time gets its answer before later messages are processed.
        while !(news == FederationEvent::Moved && self.is_own_turn()) {
            let Some((from, bytes)) = self.exchange.receive().map_err(FederationError::Exchange)? else {
                self.is_in_time()?;
                return Ok(news);
            };
            if let Some(heard) = self.heard.get_mut(usize::from(from)) {
                *heard = self.time.elapsed();
            }
            match Message::of_bytes(&bytes).ok_or(FederationError::Nonsense { federate: from })? {
                Message::Bye(None) => return Ok(FederationEvent::Left(from)),
                Message::Bye(Some(reason)) => return Err(FederationError::Failed { federate: from, reason }),
                Message::Hello(hello) if !self.is_complete => self.welcome(host.plant(), from, hello)?,
                Message::Alive => {}
                Message::Turn(turn) => match self.pending.get_mut(usize::from(from)) {
                    Some(pending) => pending.push_back(turn),
                    None => return Err(FederationError::Nonsense { federate: from }),
                },
                Message::Hello(_) => return Err(FederationError::Nonsense { federate: from }),
            }
            if !self.is_own_turn() {
                news = FederationEvent::Moved;
            }
            while self.is_complete
                && let Some(turn) = self.pending[usize::from(self.turn)].pop_front()
            {
                self.take_in(host, turn)?;
            }
        }
        Ok(news)
    }

    /// Sends the other federates a sign of life if this federate has sent nothing for a while.
    fn show_life(&mut self) -> Result<(), FederationError> {
        if self.is_complete && self.spoken.elapsed() >= ALIVE {
            self.broadcast(&Message::Alive)
        } else {
            Ok(())
        }
    }

    /// Informs the other federates of the end of this federate, with the reason if it failed.
    pub fn leave(mut self, error: Option<&FederationError>) {
        self.exchange.leave(&Message::Bye(error.map(ToString::to_string)).to_bytes());
    }

    fn broadcast(&mut self, message: &Message) -> Result<(), FederationError> {
        self.spoken = Instant::now();
        self.exchange.send(&message.to_bytes()).map_err(FederationError::Exchange)
    }

    fn is_in_time(&mut self) -> Result<(), FederationError> {
        let FederateConfig { limit, own, .. } = self.part;
        let now = self.time.elapsed();
        let mut others = (0..).zip(&self.heard).filter(|(federate, _)| *federate != own);
        let federate = if self.is_complete {
            let silent = others.find(|(_, heard)| now - **heard >= limit);
            let Some((federate, _)) = silent else { return Ok(()) };
            federate.to_string()
        } else if others.any(|(_, heard)| now - *heard < limit) {
            return Ok(());
        } else {
            self.missing()
        };
        match self.exchange.missing() {
            Some(missing) => Err(FederationError::Exchange(missing)),
            None => Err(FederationError::Silent { federate, limit }),
        }
    }

    fn welcome(&mut self, plant: &Plant, federate: u8, hello: Hello) -> Result<(), FederationError> {
        let FederateConfig { count, .. } = self.part;
        if hello.version != env!("CARGO_PKG_VERSION") {
            return Err(FederationError::OtherVersion { federate, theirs: hello.version });
        }
        if hello.count != count {
            return Err(FederationError::OtherCount { federate, theirs: hello.count, ours: count });
        }
        let own = usize::from(self.part.own);
        let Some(Some(ours)) = self.hellos.get(own) else {
            return Err(FederationError::Nonsense { federate });
        };
        let is_like = plant.is_like(&ours.plant, &hello.plant);
        is_like.map_err(|why| FederationError::OtherPlant { federate, why: describe_difference(why) })?;
        match self.hellos.get_mut(usize::from(federate)) {
            Some(place @ None) => *place = Some(hello),
            _ => return Err(FederationError::Nonsense { federate }),
        }
        self.is_complete = self.hellos.iter().all(Option::is_some);
        if self.is_complete && self.hellos.iter().flatten().all(|hello| hello.follows) {
            return Err(FederationError::NobodyLeads);
        }
        Ok(())
    }

    /// Called in this federate's turn. Collects what programs have stored since the last call.
    fn gather(&mut self, plant: &Plant) {
        // A program first stores registers, then sends a request to a board. If the stores were collected first, the
        // stores before a new request could be missed. So the requests are collected first, but the stores are sent
        // before them.
        let asked = plant.deliver_board_requests();
        self.gather_registers(plant);
        self.inputs.extend(asked.into_iter().map(Input::Stored));
    }

    /// Collects the stores of programs into registers for the next turn.
    fn gather_registers(&mut self, plant: &Plant) {
        self.inputs.extend(self.outside.stored(plant).into_iter().map(Input::Stored));
    }

    /// Applies the input of another federate.
    fn take_in(&mut self, host: &mut dyn Host, turn: Turn) -> Result<(), FederationError> {
        let federate = self.turn;
        self.gather_registers(host.plant());
        for input in turn.inputs {
            match input {
                Input::Op(bytes) => {
                    let op =
                        Input::op(&bytes).filter(Op::acts).ok_or(FederationError::Nonsense { federate })?;
                    // The result is ignored: if the operation is refused here, the federate that sent it has refused
                    // it, too, and has reported the error.
                    let _ = Execution::default().run(host, &op);
                }
                Input::Boards => {
                    host.plant_mut().look_at_boards();
                }
                Input::Stored(stored) => host.plant().store_as_outside(&stored),
                Input::Task(plc, event, state) => {
                    let state = SeatState::from_code(state).ok_or(FederationError::Nonsense { federate })?;
                    host.plant_mut().note_lockstep(plc, event.into(), state);
                }
                Input::Shaft(drive, speed) => {
                    host.plant_mut().turn_shaft(drive.into(), speed);
                }
            }
        }
        self.outside.renew(host.plant());
        let plant = host.plant_mut();
        if (turn.now, turn.hash) != (plant.now(), plant.journal().hash()) {
            return Err(FederationError::Apart { federate, at_us: plant.now() });
        }
        self.turn_over(plant, turn.want, turn.watched);
        Ok(())
    }

    /// Ends the turn of federate `self.turn`. After the turn of the last federate the clock advances.
    fn turn_over(&mut self, plant: &mut Plant, want: u64, watched: Vec<u16>) {
        self.want = self.want.min(want);
        self.watched[usize::from(self.turn)] = watched;
        self.turn += 1;
        if self.turn < self.part.count {
            return;
        }
        let until = core::mem::replace(&mut self.want, u64::MAX);
        for device in DeviceIndex::first(plant.devices().len()) {
            let of_all = self.watched.iter().filter_map(|watched| watched.get(device.index()));
            plant.watch(device, of_all.fold(0, |all, events| all | events));
        }
        let has_stopped = plant.advance_until(until);
        self.outside.renew(plant);
        self.arrived = self.asked.take().filter(|at| !has_stopped && *at <= plant.now());
        self.turn = 0;
    }
}

/// Describes a difference between plants. The message of a snapshot error also names a remedy, which does not apply to
/// federates and is left out.
fn describe_difference(why: SnapshotError) -> String {
    match why {
        SnapshotError::OtherSettings { what } => format!("its plant file has another setting of {what}"),
        SnapshotError::OtherPlant { theirs, ours } => format!("it has {theirs}, here there are {ours}"),
        SnapshotError::OtherDevice { plc, theirs, ours } => {
            format!("PLC '{plc}' is another device in it, {theirs}, here {ours}")
        }
        other => other.to_string(),
    }
}
