//! The master: a cycle over the slaves.

use super::layout::{Layout, LayoutError, PkwWidth};
use super::pkw::{Pkw, Request, Task};
use super::receiver::Receiver;
use super::telegram::{Address, Telegram, TelegramError};
use super::timing::Timing;
use crate::serial::Character;
use std::collections::VecDeque;

/// Number of exchanges without a valid answer after which a slave is lost.
const LOST_AFTER: u8 = 3;

/// Number of exchanges after which the master gives up a request that the slave does not answer.
const REQUEST_EXCHANGES: u8 = 100;

/// Number of events that a master keeps.
const MOST_EVENTS: usize = 256;

/// A slave in the cycle of the master.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Station {
    /// Address of the slave, 0 to 31.
    pub address: u8,
    /// Layout of the net data.
    pub layout: Layout,
}

/// Reason for which an exchange with a slave failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, thiserror::Error)]
pub enum StationFault {
    /// No telegram came.
    #[error("no answer within the response delay of 20 ms")]
    Silent,
    /// The answer is no telegram.
    #[error("the answer is damaged: {0}")]
    Damaged(TelegramError),
    /// The answer has another address.
    #[error("a telegram with ADR 16#{0:02X} came instead of the answer")]
    Address(u8),
    /// The net data of the answer have a wrong length.
    #[error("the answer has {0} characters of net data, which the layout does not permit")]
    Length(usize),
    /// The mirror telegram was changed.
    #[error("the slave returned other net data than those of the mirror telegram")]
    Mirror,
}

/// Reason for which a call of the master is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MasterError {
    /// The address is too large.
    #[error("the address of a slave is 0 to 31, not {0}")]
    Address(u8),
    /// Two slaves have the same address.
    #[error("two slaves have the address {0}")]
    Twice(u8),
    /// There is no slave with this address.
    #[error("the master has no slave with the address {0}")]
    NoStation(u8),
    /// The number of words does not match the layout.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// The slave has no parameter channel.
    #[error("slave {0} has no parameter channel")]
    NoParameters(u8),
    /// The master still sends an earlier request to this slave.
    #[error("slave {0} has not answered the last request yet")]
    Busy(u8),
    /// The request has the code 0, or a code above 15.
    #[error("{0} is no request; the codes of requests are 1 to 15")]
    NoRequest(u8),
    /// The number of the parameter is too large.
    #[error("the number of a parameter is 0 to 31999, not {0}")]
    Number(u16),
    /// The net data are too long.
    #[error(transparent)]
    Telegram(#[from] TelegramError),
}

/// What happened at the master.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum MasterEvent {
    /// A slave has answered a request.
    Answered {
        /// Address of the slave.
        address: u8,
        /// The answer.
        reply: Pkw,
    },
    /// A slave has answered, but 100 of its answers did not contain the answer to the request; or it did not answer.
    Unanswered {
        /// Address of the slave.
        address: u8,
        /// The request.
        request: Request,
    },
    /// A slave has reported a change of a parameter without a request.
    Reported {
        /// Address of the slave.
        address: u8,
        /// The parameter and its value.
        report: Pkw,
    },
    /// An exchange failed.
    Failed {
        /// Address of the slave.
        address: u8,
        /// Reason.
        fault: StationFault,
    },
    /// Three exchanges in a row failed.
    Lost(u8),
    /// A lost slave answers again.
    Returned(u8),
    /// A slave has returned the mirror telegram unchanged.
    Mirrored(u8),
    /// The exchange of a mirror telegram with a slave failed; the event before has the reason.
    NotMirrored(u8),
}

#[derive(Clone, Debug)]
struct Seat {
    station: Station,
    setpoints: Vec<u16>,
    actual: Vec<u16>,
    request: Option<(Request, u8)>,
    failures: u8,
    has_answered: bool,
}

/// A telegram outside the cycle.
#[derive(Clone, Debug)]
enum Extra {
    Broadcast(Telegram),
    Mirror(Telegram),
}

#[derive(Clone, Debug)]
enum Phase {
    /// The next telegram may begin at `until`. Characters of an earlier telegram move this time, up to `latest`.
    Pause { until: u64, latest: u64 },
    /// `STX` of the answer must be complete before `begin`. `mirror` is the telegram that the slave must return.
    Waiting { address: u8, begin: u64, mirror: Option<Telegram> },
}

/// A master as a state machine.
#[derive(Clone, Debug)]
pub struct Master {
    timing: Timing,
    response_delay: u64,
    tolerance: u64,
    seats: Vec<Seat>,
    next: usize,
    phase: Phase,
    receiver: Receiver,
    extra: VecDeque<Extra>,
    events: VecDeque<MasterEvent>,
}

impl Master {
    /// Returns a master of these slaves. Setpoints are 0.
    ///
    /// # Errors
    /// An address is above 31, or occurs twice.
    pub fn new(timing: Timing, stations: impl IntoIterator<Item = Station>) -> Result<Self, MasterError> {
        let mut seats: Vec<Seat> = Vec::new();
        for station in stations {
            let address = station.address;
            if address > 31 {
                return Err(MasterError::Address(address));
            }
            if seats.iter().any(|seat| seat.station.address == address) {
                return Err(MasterError::Twice(address));
            }
            let words = vec![0; station.layout.pzd()];
            seats.push(Seat {
                station,
                setpoints: words.clone(),
                actual: words,
                request: None,
                failures: 0,
                has_answered: false,
            });
        }
        Ok(Master {
            timing,
            response_delay: Timing::RESPONSE_DELAY,
            tolerance: 0,
            seats,
            next: 0,
            phase: Phase::Pause { until: 0, latest: 0 },
            receiver: Receiver::new(timing),
            extra: VecDeque::new(),
            events: VecDeque::new(),
        })
    }

    /// Sets the longest time from the end of a request to the begin of the answer, in microseconds. Without this call it
    /// is [`Timing::RESPONSE_DELAY`].
    pub const fn set_response_delay(&mut self, delay: u64) {
        self.response_delay = delay;
    }

    /// Sets a time in microseconds by which answers may begin and end later. A user that calls the master only at
    /// intervals passes the interval.
    pub fn set_tolerance(&mut self, tolerance: u64) {
        self.tolerance = tolerance;
        self.receiver.set_tolerance(tolerance);
    }

    fn seat(&self, address: u8) -> Result<&Seat, MasterError> {
        self.seats.iter().find(|seat| seat.station.address == address).ok_or(MasterError::NoStation(address))
    }

    fn seat_mut(&mut self, address: u8) -> Result<&mut Seat, MasterError> {
        self.seats
            .iter_mut()
            .find(|seat| seat.station.address == address)
            .ok_or(MasterError::NoStation(address))
    }

    /// Sets the process data for a slave.
    ///
    /// # Errors
    /// There is no such slave, or the number of words is not that of its layout.
    pub fn set_setpoints(&mut self, address: u8, setpoints: &[u16]) -> Result<(), MasterError> {
        let seat = self.seat_mut(address)?;
        let expected = seat.setpoints.len();
        if setpoints.len() != expected {
            return Err(LayoutError::Words { found: setpoints.len(), expected }.into());
        }
        seat.setpoints.copy_from_slice(setpoints);
        Ok(())
    }

    /// Returns the process data from a slave.
    ///
    /// # Errors
    /// There is no such slave.
    pub fn actual(&self, address: u8) -> Result<&[u16], MasterError> {
        Ok(&self.seat(address)?.actual)
    }

    /// True if the last three exchanges with a slave did not fail.
    ///
    /// # Errors
    /// There is no such slave.
    pub fn is_present(&self, address: u8) -> Result<bool, MasterError> {
        Ok(self.seat(address)?.failures < LOST_AFTER)
    }

    /// True if a slave has answered, and the last three exchanges with it did not fail.
    ///
    /// # Errors
    /// There is no such slave.
    pub fn has_answered(&self, address: u8) -> Result<bool, MasterError> {
        Ok(self.seat(address)?.has_answered && self.is_present(address)?)
    }

    /// Sends a request to a slave in each cycle until the slave answers it. The result is [`MasterEvent::Answered`] or
    /// [`MasterEvent::Unanswered`].
    ///
    /// # Errors
    /// There is no such slave, it has no parameter channel, the request is not valid or does not fit into the channel,
    /// or an earlier request has no answer yet.
    pub fn request(&mut self, address: u8, request: Request) -> Result<(), MasterError> {
        let seat = self.seat_mut(address)?;
        let layout = seat.station.layout;
        if layout.pkw() == PkwWidth::None {
            return Err(MasterError::NoParameters(address));
        }
        if seat.request.is_some() {
            return Err(MasterError::Busy(address));
        }
        if !(1..=15).contains(&request.code) {
            return Err(MasterError::NoRequest(request.code));
        }
        if request.number >= 32_000 {
            return Err(MasterError::Number(request.number));
        }
        layout.data(&request, &seat.setpoints)?;
        seat.request = Some((request, REQUEST_EXCHANGES));
        Ok(())
    }

    /// Sends a telegram to all slaves, once, before the next slave of the cycle. The slaves must have this layout.
    ///
    /// # Errors
    /// The request or the process data do not match the layout.
    pub fn broadcast(
        &mut self,
        layout: Layout,
        request: &Request,
        setpoints: &[u16],
    ) -> Result<(), MasterError> {
        let telegram = Telegram { address: Address::BROADCAST, data: layout.data(request, setpoints)? };
        self.extra.push_back(Extra::Broadcast(telegram));
        Ok(())
    }

    /// Sends a mirror telegram to a slave, once, before the next slave of the cycle. The result is
    /// [`MasterEvent::Mirrored`] or [`MasterEvent::NotMirrored`].
    ///
    /// # Errors
    /// There is no such slave, or the data are longer than 252 characters.
    pub fn mirror(&mut self, address: u8, data: &[u8]) -> Result<(), MasterError> {
        self.seat(address)?;
        let telegram = Telegram { address: Address::of_station(address).mirror(), data: data.to_vec() };
        telegram.characters()?;
        self.extra.push_back(Extra::Mirror(telegram));
        Ok(())
    }

    /// True if a broadcast or a mirror telegram has not been sent yet.
    #[must_use]
    pub fn has_waiting(&self) -> bool {
        !self.extra.is_empty()
    }

    /// Takes the oldest event. A master keeps the 256 newest.
    pub fn next_event(&mut self) -> Option<MasterEvent> {
        self.events.pop_front()
    }

    fn report(&mut self, event: MasterEvent) {
        if self.events.len() == MOST_EVENTS {
            self.events.pop_front();
        }
        self.events.push_back(event);
    }

    /// Returns the time of the next action of [`poll`](Self::poll) if no further character comes, in microseconds;
    /// `None` if there is none.
    #[must_use]
    pub fn due(&self) -> Option<u64> {
        match self.phase {
            Phase::Pause { .. } if self.seats.is_empty() && self.extra.is_empty() => None,
            Phase::Pause { until, .. } => Some(until),
            Phase::Waiting { begin, .. } => Some(self.receiver.deadline().map_or(begin, |end| end + 1)),
        }
    }

    /// Advances to `now`, in microseconds. Returns the characters of a telegram, which the master sends without a pause.
    pub fn poll(&mut self, now: u64) -> Vec<u8> {
        if let Phase::Waiting { address, begin, .. } = self.phase {
            let fault = match self.receiver.deadline() {
                Some(end) if now > end => StationFault::Damaged(TelegramError::Late),
                None if now >= begin => StationFault::Silent,
                _ => return Vec::new(),
            };
            self.receiver.drop_telegram();
            self.failed(now, address, fault);
        }
        match self.phase {
            Phase::Pause { until, .. } if until <= now => self.send(now),
            _ => Vec::new(),
        }
    }

    /// Sends the next telegram.
    fn send(&mut self, now: u64) -> Vec<u8> {
        self.receiver.drop_telegram();
        let (telegram, is_mirror) = match self.extra.pop_front() {
            Some(Extra::Broadcast(telegram)) => {
                let characters = telegram.characters().unwrap_or_default();
                let end = now + self.timing.characters(characters.len() as u64);
                self.pause(end);
                return characters;
            }
            Some(Extra::Mirror(telegram)) => (telegram, true),
            None => match self.cyclic() {
                Some(telegram) => (telegram, false),
                None => return Vec::new(),
            },
        };
        let characters = telegram.characters().unwrap_or_default();
        let end = now + self.timing.characters(characters.len() as u64);
        let begin = end + self.response_delay + self.timing.characters(1) + self.tolerance;
        let address = telegram.address.station();
        self.phase = Phase::Waiting { address, begin, mirror: is_mirror.then_some(telegram) };
        characters
    }

    /// Returns the telegram for the next slave of the cycle.
    fn cyclic(&mut self) -> Option<Telegram> {
        let count = self.seats.len();
        let seat = self.seats.get(self.next % count.max(1))?;
        self.next = (self.next + 1) % count;
        let pkw = seat.request.as_ref().map_or(Pkw::NONE, |(request, _)| request.clone());
        // The request was checked against the layout when the user passed it.
        let data = seat.station.layout.data(&pkw, &seat.setpoints).unwrap_or_default();
        Some(Telegram { address: Address::of_station(seat.station.address), data })
    }

    /// Passes a character of the line to the master. `at` is the time of its last bit, in microseconds.
    pub fn received(&mut self, at: u64, character: Character) {
        let result = self.receiver.received(at, character);
        let (address, mirror) = match &mut self.phase {
            Phase::Waiting { address, mirror, .. } => (*address, mirror.clone()),
            Phase::Pause { until, latest } => {
                *until = (*until).max(at + self.timing.start_delay()).min((*latest).max(*until));
                return;
            }
        };
        match (result, mirror) {
            (None, _) => {}
            (Some(Err(error)), _) => self.failed(at, address, StationFault::Damaged(error)),
            (Some(Ok(telegram)), Some(sent)) if telegram == sent => {
                self.present(address);
                self.report(MasterEvent::Mirrored(address));
                self.pause(at);
            }
            (Some(Ok(telegram)), Some(sent)) if telegram.address == sent.address => {
                self.failed(at, address, StationFault::Mirror);
            }
            (Some(Ok(telegram)), None) if telegram.address == Address::of_station(address) => {
                self.answered(at, address, &telegram);
            }
            (Some(Ok(telegram)), _) => self.failed(at, address, StationFault::Address(telegram.address.0)),
        }
    }

    fn answered(&mut self, at: u64, address: u8, telegram: &Telegram) {
        let Ok(seat) = self.seat_mut(address) else { return };
        let Ok((reply, actual)) = seat.station.layout.parse(&telegram.data) else {
            return self.failed(at, address, StationFault::Length(telegram.data.len()));
        };
        seat.actual = actual;
        self.pause(at);
        self.present(address);
        let Ok(seat) = self.seat_mut(address) else { return };
        if seat.request.as_ref().is_some_and(|(request, _)| reply.answers(request)) {
            seat.request = None;
            self.report(MasterEvent::Answered { address, reply });
        } else {
            let is_report = reply.is_report || (9..=12).contains(&reply.code);
            if is_report && reply.code != Task::None as u8 {
                self.report(MasterEvent::Reported { address, report: reply });
            }
            self.count_request(address);
        }
    }

    /// The slave has answered.
    fn present(&mut self, address: u8) {
        let Ok(seat) = self.seat_mut(address) else { return };
        let was_lost = seat.failures >= LOST_AFTER;
        (seat.failures, seat.has_answered) = (0, true);
        if was_lost {
            self.report(MasterEvent::Returned(address));
        }
    }

    /// Begins the start delay before the next telegram.
    fn pause(&mut self, at: u64) {
        let (until, latest) = (at + self.timing.start_delay(), at + self.timing.residual(super::MAX_DATA));
        self.phase = Phase::Pause { until, latest };
    }

    fn failed(&mut self, at: u64, address: u8, fault: StationFault) {
        let is_mirror = matches!(self.phase, Phase::Waiting { mirror: Some(_), .. });
        self.pause(at);
        self.report(MasterEvent::Failed { address, fault });
        if is_mirror {
            self.report(MasterEvent::NotMirrored(address));
        }
        self.count_request(address);
        let Ok(seat) = self.seat_mut(address) else { return };
        seat.failures = seat.failures.saturating_add(1);
        if seat.failures == LOST_AFTER {
            self.report(MasterEvent::Lost(address));
        }
    }

    /// Counts an exchange without an answer to the request.
    fn count_request(&mut self, address: u8) {
        let Ok(seat) = self.seat_mut(address) else { return };
        let Some((_, left)) = &mut seat.request else { return };
        *left -= 1;
        if *left == 0
            && let Some((request, _)) = seat.request.take()
        {
            self.report(MasterEvent::Unanswered { address, request });
        }
    }
}
