//! The visible state of a bus: identity, ports, stations, and the load of its wire.

use crate::can::{self, BitRate, ErrorCounters};
use crate::devices::Interval;
use crate::journal::{Event, Origin};

/// A station of a bus with known stations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StationState {
    /// The port or the guest of the station.
    pub origin: Origin,
    /// Address of the station, if it has one and it is known.
    pub address: Option<u8>,
    /// Activity of the station in one word; `None` if the state of its error counters describes the station.
    pub does: Option<&'static str>,
    /// Error counters of the station; 0 on buses that do not count errors.
    pub errors: ErrorCounters,
}

/// A station with another rate than its bus, which therefore does not take part.
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
    /// A participant from the section of the bus in the plant file, by its name.
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

    /// Returns the stations that have power. The list is empty if the bus has no list of stations.
    fn stations(&self) -> Vec<StationState> {
        Vec::new()
    }

    /// Stations that are set to another rate and therefore do not take part.
    fn strangers(&self) -> Vec<RateMismatch> {
        Vec::new()
    }

    /// Returns the interval that repeats on the bus; `None` while no interval repeats.
    fn interval(&self) -> Option<Interval> {
        None
    }

    /// Participants that faults can concern, bit n for number n.
    fn participants(&self) -> u32 {
        0
    }

    /// Returns the time for which a journal event of this bus, a frame, has kept the wire busy, in nanoseconds.
    fn busy_ns(&self, event: &Event) -> u64 {
        let rate = BitRate::new(self.bit_s());
        let taken = event.frame().zip(rate).map(|(carried, rate)| can::wire::airtime(&carried.frame, rate));
        taken.map_or(0, |airtime| airtime.occupation_ns)
    }
}
