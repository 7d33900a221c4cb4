//! The visible state of a bus: identity, ports, stations, and the load of its wire.

use crate::can::{self, BitRate, ErrorCounters};
use crate::devices::Interval;
use crate::journal::{Event, Origin};

/// A station on a bus that knows its stations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StationState {
    /// The port or the guest of the station.
    pub origin: Origin,
    /// Address of the station, if it has one and it is known.
    pub address: Option<u8>,
    /// Activity of the station in one word. `None` if the state of its error counters is the only description
    /// of its activity.
    pub does: Option<&'static str>,
    /// Error counters of the station; 0 on buses that do not count errors.
    pub errors: ErrorCounters,
}

/// A station with another rate than its bus. Such a station does not take part in the bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RateMismatch {
    /// Identity of the station.
    pub participant: ParticipantId,
    /// Rate of the station, in bit/s.
    pub bit_s: u32,
}

/// Participant of a bus.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ParticipantId {
    /// A port of a device.
    Port(Origin),
    /// A participant that the section of the bus in the plant file declares. The field is its name.
    Own(String),
}

/// The visible state of a bus. Reading it changes nothing.
pub trait BusView {
    /// Returns the name of the bus in the plant.
    fn name(&self) -> &str;

    /// Kind of the bus, one of [`BUS_KINDS`](crate::devices::BUS_KINDS).
    fn family(&self) -> &'static str;

    /// Present bit rate of the bus, in bit/s.
    fn bit_s(&self) -> u32;

    /// Returns the attached ports, in the order of attachment.
    fn ports(&self) -> Vec<Origin>;

    /// Returns the stations that have power. The result is empty if the bus does not know its stations.
    fn stations(&self) -> Vec<StationState> {
        Vec::new()
    }

    /// Returns the stations that are set to another rate. They do not take part in the bus.
    fn strangers(&self) -> Vec<RateMismatch> {
        Vec::new()
    }

    /// Returns the interval that repeats on the bus; `None` while there is no such interval.
    fn interval(&self) -> Option<Interval> {
        None
    }

    /// Returns the participants that faults can affect: bit n for number n.
    fn participants(&self) -> u32 {
        0
    }

    /// Returns the time in nanoseconds for which an event of this bus has kept the wire busy. Only frames
    /// keep it busy.
    fn busy_ns(&self, event: &Event) -> u64 {
        let rate = BitRate::new(self.bit_s());
        let taken = event.frame().zip(rate).map(|(carried, rate)| can::wire::airtime(&carried.frame, rate));
        taken.map_or(0, |airtime| airtime.occupation_ns)
    }
}
