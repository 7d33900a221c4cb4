//! A slave: a drive with process data and parameters.

use super::MasterError;
use super::layout::{Layout, LayoutError, PkwWidth};
use super::parameters::{ParameterAccess, Parameters};
use super::pkw::{Pkw, Refusal, ReplyCode, Task};
use super::receiver::Receiver;
use super::telegram::{Address, Telegram, TelegramError};
use super::timing::Timing;
use crate::serial::Character;
#[cfg(feature = "emulator")]
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Number of events that a slave keeps.
const MOST_EVENTS: usize = 64;

/// What happened at a slave.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "emulator", derive(Serialize, Deserialize))]
pub enum SlaveEvent {
    /// New setpoints have come.
    Setpoints,
    /// The master requested a parameter. The second value is the code of the answer, 0 to 15.
    Requested(Pkw, u8),
    /// Characters on the line were no telegram.
    Damaged(TelegramError),
    /// The net data of a telegram for this slave have this number of characters, which the layout does not permit.
    WrongLength(usize),
}

/// A telegram that the slave will send.
#[derive(Clone, Debug)]
#[cfg_attr(feature = "emulator", derive(Serialize, Deserialize))]
enum Pending {
    Mirror(Telegram),
    Answer(Pkw),
}

/// A slave as a state machine, with the parameters `P`.
#[derive(Clone, Debug)]
pub struct Slave<P = Parameters> {
    address: u8,
    timing: Timing,
    layout: Layout,
    parameters: P,
    response_delay: u64,
    receiver: Receiver,
    setpoints: Vec<u16>,
    actual: Vec<u16>,
    pending: Option<(u64, Pending)>,
    last_telegram: Option<u64>,
    events: VecDeque<SlaveEvent>,
}

#[cfg(feature = "emulator")]
crate::snapshot_fields!(where [P: crate::snapshot_fields::SnapshotFields] Slave<P> {
    values: receiver, setpoints, actual, pending, last_telegram, events;
    parts: parameters;
    built: address, timing, layout, response_delay
});

impl<P: ParameterAccess> Slave<P> {
    /// Returns a slave with an address, 0 to 31. Its process data are 0.
    ///
    /// # Errors
    /// The address is above 31.
    pub fn new(address: u8, timing: Timing, layout: Layout, parameters: P) -> Result<Self, MasterError> {
        if address > 31 {
            return Err(MasterError::Address(address));
        }
        Ok(Slave {
            address,
            timing,
            layout,
            parameters,
            response_delay: timing.start_delay(),
            receiver: Receiver::new(timing),
            setpoints: vec![0; layout.pzd()],
            actual: vec![0; layout.pzd()],
            pending: None,
            last_telegram: None,
            events: VecDeque::new(),
        })
    }

    /// Sets the time from the end of a request to the begin of the answer, in microseconds. It is at least the start
    /// delay. A master reports a slave that needs more than [`Timing::RESPONSE_DELAY`].
    pub fn set_response_delay(&mut self, delay: u64) {
        self.response_delay = delay.max(self.timing.start_delay());
    }

    /// Returns the address.
    #[must_use]
    pub const fn address(&self) -> u8 {
        self.address
    }

    /// Returns the process data from the master.
    #[must_use]
    pub fn setpoints(&self) -> &[u16] {
        &self.setpoints
    }

    /// Sets the process data for the master.
    ///
    /// # Errors
    /// The number of words is not that of the layout.
    pub fn set_actual(&mut self, actual: &[u16]) -> Result<(), LayoutError> {
        if actual.len() != self.layout.pzd() {
            return Err(LayoutError::Words { found: actual.len(), expected: self.layout.pzd() });
        }
        actual.clone_into(&mut self.actual);
        Ok(())
    }

    /// Returns the parameters.
    #[must_use]
    pub const fn parameters(&self) -> &P {
        &self.parameters
    }

    /// Returns the parameters, to change them from the side of the drive.
    pub const fn parameters_mut(&mut self) -> &mut P {
        &mut self.parameters
    }

    /// Returns the time of the last telegram for this slave, in microseconds. A drive that monitors its telegrams
    /// compares it with the present time.
    #[must_use]
    pub const fn last_telegram(&self) -> Option<u64> {
        self.last_telegram
    }

    /// Takes the oldest event. A slave keeps the 64 newest.
    pub fn next_event(&mut self) -> Option<SlaveEvent> {
        self.events.pop_front()
    }

    fn report(&mut self, event: SlaveEvent) {
        if self.events.len() == MOST_EVENTS {
            self.events.pop_front();
        }
        self.events.push_back(event);
    }

    /// Returns the time of the answer, in microseconds.
    #[must_use]
    pub fn due(&self) -> Option<u64> {
        self.pending.as_ref().map(|(time, _)| *time)
    }

    /// Returns the characters of the answer if its time has come at `now`. The slave sends them without a pause.
    pub fn poll(&mut self, now: u64) -> Vec<u8> {
        let Some((_, pending)) = self.pending.take_if(|(time, _)| *time <= now) else { return Vec::new() };
        let telegram = match pending {
            Pending::Mirror(telegram) => telegram,
            Pending::Answer(pkw) => {
                let data = self.layout.data(&pkw, &self.actual).or_else(|_| {
                    // The values do not fit into the channel.
                    self.layout
                        .data(&pkw.answer(ReplyCode::Refused, vec![Refusal::Type as u16]), &self.actual)
                });
                Telegram { address: Address::of_station(self.address), data: data.unwrap_or_default() }
            }
        };
        telegram.characters().unwrap_or_default()
    }

    /// Passes a character of the line to the slave. `at` is the time of its last bit, in microseconds.
    pub fn received(&mut self, at: u64, character: Character) {
        match self.receiver.received(at, character) {
            Some(Ok(telegram)) => self.take(at, telegram),
            Some(Err(error)) => self.report(SlaveEvent::Damaged(error)),
            None => {}
        }
    }

    fn take(&mut self, at: u64, telegram: Telegram) {
        let address = telegram.address;
        let is_mine = address.is_broadcast() || address.station() == self.address;
        if !is_mine || address.is_special() {
            return;
        }
        let answer_at = at + self.response_delay;
        if address.is_mirror() {
            if !address.is_broadcast() {
                self.last_telegram = Some(at);
                self.pending = Some((answer_at, Pending::Mirror(telegram)));
            }
            return;
        }
        let Ok((request, setpoints)) = self.layout.parse(&telegram.data) else {
            return self.report(SlaveEvent::WrongLength(telegram.data.len()));
        };
        self.last_telegram = Some(at);
        if !setpoints.is_empty() {
            self.setpoints = setpoints;
            self.report(SlaveEvent::Setpoints);
        }
        let mut answer = Pkw::NONE;
        if request.code != Task::None as u8 {
            answer = self.parameters.execute(&request, self.layout.pkw() == PkwWidth::Variable);
            self.report(SlaveEvent::Requested(request, answer.code));
        }
        if !address.is_broadcast() {
            self.pending = Some((answer_at, Pending::Answer(answer)));
        }
    }
}
