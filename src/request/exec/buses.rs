//! Operations on buses and on the doors to them.

use super::Work;
use crate::can::Frame;
use crate::devices;
use crate::devices::{Bus, GuestRefusal, ParticipantId, StationState};
use crate::door::{DoorSpec, Doors};
use crate::identity::BusIndex;
use crate::journal::Source;
use crate::profibus::MAX_OCTETS;
use crate::request::{BusState, Code, FilePart, Host, RateMismatch, Refused, Reply, Station};
use std::io::ErrorKind;

/// Period over which the load of a bus is measured, in emulated microseconds.
const LOAD_US: u64 = 100_000;

impl Work<'_> {
    pub(super) fn buses(&mut self) -> Result<Reply, Refused> {
        let host = &*self.host;
        let doors = |bus| host.doors_seen().map_or_else(Vec::new, |doors| doors.of_bus(bus));
        let names = host.plant().names();
        let drive = |bus: &dyn Bus, address: u8| {
            let drives = bus.drives().map_or_else(Vec::new, |drives| drives.list());
            let found = drives.into_iter().find(|(_, state)| state.number == Some(address));
            found.map(|(name, _)| name.to_owned())
        };
        let station = |bus: &dyn Bus, it: StationState| Station {
            // The plant file names drives; in the journal they have only their numbers.
            name: (it.origin.drive().and_then(|address| drive(bus, address)))
                .unwrap_or_else(|| names.source(Source::Node(it.origin))),
            address: it.address,
            state: it.does.unwrap_or_else(|| it.errors.state().name()).to_owned(),
            transmit_errors: it.errors.transmit(),
            receive_errors: it.errors.receive(),
        };
        let stranger = |it: devices::RateMismatch| {
            let name = match it.participant {
                ParticipantId::Port(origin) => names.source(Source::Node(origin)),
                ParticipantId::Own(name) => name,
            };
            RateMismatch { name, bit_s: it.bit_s }
        };
        let port = |origin| names.source(Source::Node(origin));
        let state = |index: BusIndex, bus: &dyn Bus| BusState {
            name: bus.name().to_owned(),
            kind: bus.family().to_owned(),
            bit_s: bus.bit_s(),
            load_permille: host.plant().bus_load(index, LOAD_US),
            ports: host.plant().ports_at(index).into_iter().map(port).collect(),
            doors: doors(index),
            stations: bus.stations().into_iter().map(|it| station(bus, it)).collect(),
            strangers: bus.strangers().into_iter().map(stranger).collect(),
        };
        let buses = BusIndex::enumerate(host.plant().buses());
        Ok(Reply::Buses(buses.map(|(index, bus)| state(index, &**bus)).collect()))
    }

    pub(super) fn door_open(&mut self, bus: BusIndex, door: DoorSpec) -> Result<Reply, Refused> {
        let host = &mut *self.host;
        known(host, bus)?;
        let family = host.plant().buses().get(bus.index()).map_or("", |bus| bus.family());
        devices::door_fits(family, door).map_err(|text| Refused::new(Code::DOOR, text))?;
        let opened = doors_of(host, bus)?.open(bus, door);
        opened.map(Reply::DoorOpened).map_err(|error| {
            let code = match error.reason.kind() {
                ErrorKind::InvalidInput => Code::DOOR,
                ErrorKind::QuotaExceeded => Code::NOT_NOW,
                _ => Code::NO_RESOURCE,
            };
            Refused::new(code, error)
        })
    }

    pub(super) fn door_close(&mut self, bus: BusIndex, door: Option<DoorSpec>) -> Result<Reply, Refused> {
        let host = &mut *self.host;
        let count = doors_of(host, bus)?.close(bus, door);
        match door {
            Some(door) if count == 0 => {
                let name = host.plant().buses().get(bus.index()).map_or("", |bus| bus.name());
                let text = format_args!("bus '{name}' has no door {door}");
                Err(Refused::new(Code::DOOR, text))
            }
            _ => Ok(Reply::DoorsClosed { count: count as u16 }),
        }
    }

    pub(super) fn bus_send(&mut self, bus: BusIndex, frame: Option<Frame>) -> Result<Reply, Refused> {
        let host = &mut *self.host;
        known(host, bus)?;
        let taken = host.plant_mut().take_part(bus, frame.as_ref());
        taken.map(|()| Reply::Written).map_err(|refusal| refused(host, bus, refusal))
    }

    pub(super) fn telegram_send(
        &mut self,
        bus: BusIndex,
        is_last: bool,
        part: FilePart,
    ) -> Result<Reply, Refused> {
        let host = &mut *self.host;
        known(host, bus)?;
        let octets = &mut self.execution.octets;
        octets.extend_from_slice(part.bytes());
        if octets.len() > MAX_OCTETS || is_last && octets.is_empty() {
            let text =
                format_args!("a telegram has 1 to {MAX_OCTETS} octets, and these are {}", octets.len());
            let refused = Refused::new(Code::FRAME, text);
            octets.clear();
            return Err(refused);
        }
        if is_last {
            let octets = core::mem::take(octets);
            let taken = host.plant_mut().send_telegram(bus, octets);
            taken.map_err(|refusal| refused(host, bus, refusal))?;
        }
        Ok(Reply::Written)
    }
}

/// Returns the error for a frame or telegram that a bus refuses.
fn refused(host: &dyn Host, bus: BusIndex, refusal: GuestRefusal) -> Refused {
    let found = host.plant().buses().get(bus.index());
    let (name, family) = found.map_or(("", ""), |bus| (bus.name(), bus.family()));
    let (code, text) = match refusal {
        GuestRefusal::Full => (
            Code::QUEUE_FULL,
            format!("bus '{name}': as many frames as a controller holds wait to be sent already"),
        ),
        GuestRefusal::TooFarAhead { seconds } => (
            Code::FRAME,
            format!("bus '{name}': the time of the telegram lies {seconds} s ahead; it may be 60 s at most"),
        ),
        GuestRefusal::NotHere => (
            Code::FRAME,
            format!(
                "bus '{name}' does not take this frame: it is a {family} bus, which may not have such frames, or no \
                 master runs it"
            ),
        ),
    };
    Refused::new(code, text)
}

fn known(host: &dyn Host, bus: BusIndex) -> Result<(), Refused> {
    let known = host.plant().buses().len();
    if bus.index() < known {
        return Ok(());
    }
    let text = format_args!("there is no bus number {bus}; the instance has {known}, counted from 0");
    Err(Refused::new(Code::UNKNOWN_BUS, text))
}

fn doors_of(host: &mut dyn Host, bus: BusIndex) -> Result<&mut Doors, Refused> {
    known(host, bus)?;
    let text = "a plant in a scenario's own process has no doors; run it by `commram run`";
    host.doors().ok_or_else(|| Refused::new(Code::NO_DOORS, text))
}
