//! A plant and other simulators that give each other values and frames: models of motors, of machines, of other controllers.
//!
//! Every so often in emulated time there is an exchange. What the others have published enters the plant as a client's request
//! would, then they are given what stands in the plant; no time passes for them beyond the next exchange, nor for the plant
//! (decision D-576). How it travels is not told here: that is [`Simulators`].

mod config;
mod error;
mod fitting;
mod lookup;
mod taking;
#[cfg(test)]
mod tests;

pub use config::{CouplingConfig, Named, NamedBus};
pub use error::CouplingError;
pub use lookup::{Endpoint, Interface, Publication, Subscription};

use crate::fmi::{Shafts, Value, What};
use crate::journal::{Source, candump};
use crate::plant::Plant;
use crate::request::Host;
use core::time::Duration;
use std::time::Instant;
use taking::Refusals;

/// What the plant gives at an exchange.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Given {
    /// Values that are others than before, by their place in [`Interface::publications`].
    pub values: Vec<(usize, Value)>,
    /// Frames that have been on buses since, as lines of a log, by their place in [`Interface::endpoints`].
    pub frames: Vec<(usize, String)>,
    /// When the next exchange is, in microseconds since the start.
    pub next_us: u64,
}

/// What the others give at an exchange.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Taken {
    /// Values that were published since, by their place in [`Interface::subscriptions`].
    pub values: Vec<(usize, f64)>,
    /// Frames as text, by their place in [`Interface::endpoints`].
    pub frames: Vec<(usize, Vec<u8>)>,
    /// There is nobody any more.
    pub have_gone: bool,
}

/// The way to the other simulators. Whoever provides one says how it wakes the emulator when there is something to take.
pub trait Simulators: Send {
    /// Gives them something, and lets time pass for them until the next exchange.
    fn give(&mut self, given: Given);

    /// What they give for the exchange that is due; does not wait. The first one is at the start, before anything was given.
    ///
    /// # Errors
    /// The way is broken: why.
    fn take(&mut self) -> Result<Option<Taken>, String>;

    /// The way ends.
    fn leave(&mut self);
}

/// What came of a look at the others.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Progress {
    /// No exchange is due.
    Nothing,
    /// One is due, and they have not come there.
    Waits,
    /// They have given something; these motors turn with another speed now: number of the drive, and speed as the plant counts
    /// it, `None`: as the drive demands.
    Taken(Vec<(usize, Option<i32>)>),
    /// They have ended in good order.
    HaveGone,
}

/// A plant among other simulators.
pub struct Coupling {
    interface: Interface,
    published: Vec<(What, Option<Value>)>,
    refused_values: Vec<Refusals>,
    refused_frames: Vec<Refusals>,
    shafts: Shafts,
    /// Of each drive what the plant was told.
    turned: Vec<Option<i32>>,
    period_us: u64,
    start_us: u64,
    /// When the next exchange is, in emulated time.
    due_us: u64,
    /// First record of the journal of whose frames nobody was told.
    next_record: u64,
    limit: Duration,
    waits_since: Option<Instant>,
    simulators: Option<Box<dyn Simulators>>,
}

impl Coupling {
    /// Looks up what the file names. `limit`: how long the others may take for an exchange, in real time.
    ///
    /// # Errors
    /// The plant has no such values, or they cannot be exchanged so.
    pub fn new(config: &CouplingConfig, plant: &Plant, limit: Duration) -> Result<Self, CouplingError> {
        let interface = Interface::of(config, plant)?;
        let start_us = plant.now();
        Ok(Coupling {
            published: interface.publications.iter().map(|it| (it.what, None)).collect(),
            refused_values: interface.subscriptions.iter().map(|_| Refusals::default()).collect(),
            refused_frames: interface.endpoints.iter().map(|_| Refusals::default()).collect(),
            shafts: Shafts::of(plant),
            turned: vec![None; plant.drives().len()],
            period_us: config.period_us,
            start_us,
            due_us: start_us,
            next_record: plant.journal().end(),
            limit,
            waits_since: None,
            interface,
            simulators: None,
        })
    }

    /// What is exchanged.
    pub fn interface(&self) -> &Interface {
        &self.interface
    }

    /// Emulated time from one exchange to the next, in microseconds.
    pub fn period_us(&self) -> u64 {
        self.period_us
    }

    /// What the plant gives before its time begins to pass, all of it.
    pub fn first(&mut self, plant: &Plant) -> Given {
        Given { next_us: 0, ..self.collect(plant) }
    }

    /// This is the way to the others.
    pub fn connect(&mut self, simulators: Box<dyn Simulators>) {
        self.simulators = Some(simulators);
    }

    /// Whether an exchange is due at this emulated time: then nothing else enters the plant before it.
    pub fn is_due(&self, now: u64) -> bool {
        now >= self.due_us
    }

    /// If an exchange is due: lets into the plant what the others give.
    ///
    /// # Errors
    /// The others are not there any more.
    pub fn take(&mut self, host: &mut dyn Host) -> Result<Progress, CouplingError> {
        let is_due = self.is_due(host.plant().now());
        let Some(simulators) = self.simulators.as_mut().filter(|_| is_due) else {
            return Ok(Progress::Nothing);
        };
        let Some(taken) = simulators.take().map_err(CouplingError::Broken)? else {
            let (at_us, limit) = (self.due_us - self.start_us, self.limit);
            let since = *self.waits_since.get_or_insert_with(Instant::now);
            return if since.elapsed() < limit {
                Ok(Progress::Waits)
            } else {
                Err(CouplingError::Silent { at_us, limit })
            };
        };
        self.waits_since = None;
        if taken.have_gone {
            return Ok(Progress::HaveGone);
        }
        for (place, value) in taken.values {
            self.take_value(host, place, value);
        }
        for (place, text) in taken.frames {
            self.take_frame(host, place, &text);
        }
        let mut now = vec![None; self.turned.len()];
        self.shafts.turned().for_each(|(drive, speed)| now[drive] = Some(speed));
        let before = core::mem::replace(&mut self.turned, now);
        let pairs = self.turned.iter().zip(before).enumerate();
        let changed = pairs.filter(|(_, (now, before))| *now != before);
        Ok(Progress::Taken(changed.map(|(drive, (now, _))| (drive, *now)).collect()))
    }

    /// Behind [`Progress::Taken`]: gives the others what stands in the plant; the next exchange is a period later.
    pub fn give(&mut self, plant: &Plant) {
        self.due_us = self.due_us.saturating_add(self.period_us);
        let given = self.collect(plant);
        if let Some(simulators) = &mut self.simulators {
            simulators.give(given);
        }
    }

    /// Ends the way to the others.
    pub fn leave(&mut self) {
        if let Some(mut simulators) = self.simulators.take() {
            simulators.leave();
        }
        let all = self.refused_values.iter().chain(&self.refused_frames);
        let refused: u64 = all.map(|it| it.0).sum();
        if refused > 0 {
            tracing::warn!("{refused} of the values and frames of other simulators were not taken");
        }
    }

    fn collect(&mut self, plant: &Plant) -> Given {
        let mut given = Given { next_us: self.due_us - self.start_us, ..Given::default() };
        for (place, (what, last)) in self.published.iter_mut().enumerate() {
            let value = self.shafts.value(plant, *what);
            if last.replace(value) != Some(value) {
                given.values.push((place, value));
            }
        }
        let (endpoints, journal) = (&self.interface.endpoints, plant.journal());
        if !endpoints.is_empty() {
            for record in journal.read(self.next_record) {
                let (Some(carried), Source::Bus(bus)) = (record.event.frame(), record.event.source()) else {
                    continue;
                };
                let heard = endpoints.iter().enumerate().filter(|(_, it)| it.bus == bus && !it.to.is_empty());
                for (place, endpoint) in heard {
                    let (seconds, us) = (record.time_us / 1_000_000, record.time_us % 1_000_000);
                    let frame = candump::Shown(&carried.frame);
                    let line = format!("({seconds:010}.{us:06}) {} {frame}", endpoint.bus_name);
                    given.frames.push((place, line));
                }
            }
        }
        self.next_record = journal.end();
        given
    }
}
