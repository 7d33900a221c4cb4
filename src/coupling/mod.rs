//! Couples a plant with other simulators, such as models of motors, machines or other controllers. The plant and the
//! simulators exchange values and frames.
//!
//! Exchanges happen at regular intervals of emulated time. An exchange has two steps. First the plant takes the values
//! that the other simulators have published, in the same way as requests of a client. Then the plant publishes its own
//! values. Neither side advances further than the next exchange (decision D-576). [`Simulators`] transports the values
//! and frames.

mod config;
mod conversion;
mod error;
mod input;
mod lookup;
#[cfg(test)]
mod tests;

pub use config::{BusEntry, CouplingConfig, ValueEntry};
pub use error::CouplingError;
pub use lookup::{Endpoint, Interface, Publication, Subscription};

use crate::awake_time::AwakeTime;
use crate::fmi::{Quantity, Shafts, Value};
use crate::journal::{Source, candump};
use crate::plant::Plant;
use crate::request::Host;
use core::time::Duration;
use input::Refusals;

/// The values and frames that the plant publishes at an exchange.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlantOutput {
    /// Changed values, by their index in [`Interface::publications`].
    pub values: Vec<(usize, Value)>,
    /// Frames on the buses since the last exchange, as lines of a log, by their index in [`Interface::endpoints`].
    pub frames: Vec<(usize, String)>,
    /// Emulated time of the next exchange, in microseconds since the start.
    pub next_us: u64,
}

/// The values and frames that the other simulators publish at an exchange.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SimulatorOutput {
    /// Values published since the last exchange, by their index in [`Interface::subscriptions`].
    pub values: Vec<(usize, f64)>,
    /// Frames as text, by their index in [`Interface::endpoints`].
    pub frames: Vec<(usize, Vec<u8>)>,
    /// True if all other simulators have disconnected.
    pub have_gone: bool,
}

/// Connection to the other simulators. An implementation also wakes the emulator when input has arrived.
pub trait Simulators: Send {
    /// Publishes the values and frames of the plant. The other simulators can then advance to the next exchange.
    fn give(&mut self, given: PlantOutput);

    /// Returns the input for the current exchange, if it has arrived; does not wait. The first exchange is at the
    /// start, before the first [`Simulators::give`].
    ///
    /// # Errors
    /// The connection has failed. The text gives the reason.
    fn take(&mut self) -> Result<Option<SimulatorOutput>, String>;

    /// Describes which part of the connection is missing; `None` if the connection is complete.
    fn missing(&self) -> Option<String> {
        None
    }

    /// Closes the connection to the other simulators.
    fn leave(&mut self);
}

/// Result of [`Coupling::take`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Progress {
    /// The time for an exchange has not come.
    Nothing,
    /// The time for an exchange has come, but the other simulators have not yet reached it.
    Waits,
    /// The exchange has taken place. The list has the motors with a new speed: the number of the drive, and the speed
    /// in the unit of the plant. `None` means that the motor turns as the drive demands.
    Exchanged(Vec<(usize, Option<i32>)>),
    /// The other simulators have ended normally.
    HaveGone,
}

/// A plant coupled with other simulators.
pub struct Coupling {
    interface: Interface,
    published: Vec<(Quantity, Option<Value>)>,
    refused_values: Vec<Refusals>,
    refused_frames: Vec<Refusals>,
    shafts: Shafts,
    /// Last speed that the plant received for each drive.
    turned: Vec<Option<i32>>,
    period_us: u64,
    start_us: u64,
    /// Emulated time of the next exchange.
    due_us: u64,
    /// Number of the first journal record with frames that are not yet sent.
    next_record: u64,
    limit: Duration,
    /// Real time since the other simulators are awaited, if they are awaited now.
    waiting: Option<AwakeTime>,
    simulators: Option<Box<dyn Simulators>>,
}

impl Coupling {
    /// Looks up the names of the exchange file in the plant. `limit` is the maximum real time that the other simulators
    /// may take for an exchange.
    ///
    /// # Errors
    /// The plant does not have a value or bus of the file, or the value or bus cannot be exchanged in this
    /// way.
    pub fn new(config: &CouplingConfig, plant: &Plant, limit: Duration) -> Result<Self, CouplingError> {
        let interface = Interface::of(config, plant)?;
        let start_us = plant.now();
        Ok(Coupling {
            published: interface.publications.iter().map(|it| (it.quantity, None)).collect(),
            refused_values: interface.subscriptions.iter().map(|_| Refusals::default()).collect(),
            refused_frames: interface.endpoints.iter().map(|_| Refusals::default()).collect(),
            shafts: Shafts::of(plant),
            turned: vec![None; plant.drives().len()],
            period_us: config.period_us,
            start_us,
            due_us: start_us,
            next_record: plant.journal().end(),
            limit,
            waiting: None,
            interface,
            simulators: None,
        })
    }

    /// Returns the values and buses that are exchanged.
    pub fn interface(&self) -> &Interface {
        &self.interface
    }

    /// Emulated time from one exchange to the next, in microseconds.
    pub fn period_us(&self) -> u64 {
        self.period_us
    }

    /// Returns all published values. They are for the first exchange, before the clock starts.
    pub fn first(&mut self, plant: &Plant) -> PlantOutput {
        PlantOutput { next_us: 0, ..self.collect(plant) }
    }

    /// Sets the connection to the other simulators.
    pub fn connect(&mut self, simulators: Box<dyn Simulators>) {
        self.simulators = Some(simulators);
    }

    /// True if `now` is the time of an exchange. No other input may then enter the plant before the exchange.
    pub fn is_due(&self, now: u64) -> bool {
        now >= self.due_us
    }

    /// If it is time for an exchange, passes the input of the other simulators to the plant.
    ///
    /// # Errors
    /// The connection to the other simulators has failed, or they do not reach the exchange within the limit.
    pub fn take(&mut self, host: &mut dyn Host) -> Result<Progress, CouplingError> {
        let is_due = self.is_due(host.plant().now());
        let Some(simulators) = self.simulators.as_mut().filter(|_| is_due) else {
            return Ok(Progress::Nothing);
        };
        let Some(taken) = simulators.take().map_err(CouplingError::Broken)? else {
            let (at_us, limit) = (self.due_us - self.start_us, self.limit);
            if self.waiting.get_or_insert_with(AwakeTime::start).elapsed() < limit {
                return Ok(Progress::Waits);
            }
            let silent = CouplingError::Silent { at_us, limit };
            return Err(simulators.missing().map_or(silent, CouplingError::Broken));
        };
        self.waiting = None;
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
        Ok(Progress::Exchanged(changed.map(|(drive, (now, _))| (drive, *now)).collect()))
    }

    /// Publishes the values of the plant. Must be called after [`Progress::Exchanged`]. The next exchange is one period
    /// later.
    pub fn give(&mut self, plant: &Plant) {
        self.due_us = self.due_us.saturating_add(self.period_us);
        let given = self.collect(plant);
        if let Some(simulators) = &mut self.simulators {
            simulators.give(given);
        }
    }

    /// Closes the connection to the other simulators.
    pub fn leave(&mut self) {
        if let Some(mut simulators) = self.simulators.take() {
            simulators.leave();
        }
        let all = self.refused_values.iter().chain(&self.refused_frames);
        let refused: u64 = all.map(|it| it.0).sum();
        if refused > 0 {
            tracing::warn!("{refused} of the values and frames of other simulators were refused");
        }
    }

    fn collect(&mut self, plant: &Plant) -> PlantOutput {
        let mut given = PlantOutput { next_us: self.due_us - self.start_us, ..PlantOutput::default() };
        for (place, (quantity, last)) in self.published.iter_mut().enumerate() {
            let value = self.shafts.value(plant, *quantity);
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
                    let frame = candump::FrameText(&carried.frame);
                    let line = format!("({seconds:010}.{us:06}) {} {frame}", endpoint.bus_name);
                    given.frames.push((place, line));
                }
            }
        }
        self.next_record = journal.end();
        given
    }
}
