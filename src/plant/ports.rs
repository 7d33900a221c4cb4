//! Which port of which device is where, and what passes between the two.

use super::Plant;
use crate::devices::{BuildError, Context, Device, Look, MEDIA, Medium, Plug, SyncSignal};
use crate::journal::Origin;
use crate::state;
use std::sync::Arc;

/// A port of a device, plugged in.
#[derive(Clone, Copy, Debug)]
pub(super) struct Port {
    /// Its number in the device's layout.
    pub(super) number: u8,
    /// Index of its medium.
    pub(super) medium: usize,
    /// Its place there.
    pub(super) place: usize,
    takes_part: bool,
}

/// Whose port is plugged in somewhere.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seat {
    /// Index of the device.
    pub(super) device: usize,
    /// Index of the port there.
    pub(super) port: usize,
}

state!(Port { values: takes_part; built: number, medium, place });
state!(Ports { parts: of_device; built: ways, seats });

/// The ports of all devices.
#[derive(Default)]
pub(super) struct Ports {
    of_device: Vec<Vec<Port>>,
    /// For each medium the ports that can take its SYNC signal over: their device and their index there.
    ways: Vec<Vec<(usize, usize)>>,
    /// For each medium who is at which of its places.
    seats: Arc<Vec<Vec<Seat>>>,
}

impl Ports {
    /// Plugs the ports of the next device in; behind the `named` media come those for ports without a medium, one for
    /// each kind.
    pub(super) fn plug_in(
        &mut self,
        device: &dyn Device,
        plugs: Vec<Plug>,
        media: &mut [Box<dyn Medium>],
        named: usize,
    ) -> Result<(), BuildError> {
        let mut ports = Vec::with_capacity(plugs.len());
        let seats = Arc::make_mut(&mut self.seats);
        seats.resize(media.len(), Vec::new());
        for Plug { number, family, medium, socket } in plugs {
            let at = |name: &String| media[..named].iter().position(|medium| medium.name() == name);
            let nowhere = MEDIA.iter().position(|kind| kind.name == family).ok_or(BuildError::OtherFamily)?;
            let medium = medium.as_ref().and_then(at).unwrap_or(named + nowhere);
            let place = media[medium].attach(socket)?;
            seats[medium].push(Seat { device: self.of_device.len(), port: ports.len() });
            ports.push(Port { number, medium, place, takes_part: false });
        }
        self.ways.resize(media.len(), Vec::new());
        let find = |number: u8| ports.iter().position(|port| port.number == number);
        for &(from, to) in device.sync_ways() {
            if let (Some(from), Some(to)) = (find(from), find(to))
                && ports[from].medium < named
            {
                self.ways[ports[from].medium].push((self.of_device.len(), to));
            }
        }
        self.of_device.push(ports);
        Ok(())
    }

    /// Device and number of each port at a medium.
    pub(super) fn at(&self, medium: usize) -> impl Iterator<Item = Origin> {
        let of_device = move |(plc, ports): (usize, &Vec<Port>)| {
            let at = ports.iter().filter(move |port| port.medium == medium);
            at.map(move |port| Origin { plc: plc as u16, node: port.number }).collect::<Vec<_>>()
        };
        self.of_device.iter().enumerate().flat_map(of_device)
    }

    /// Who is at the places of each medium; a place is given to each port that is plugged in, one after the other.
    pub(super) fn seats(&self) -> Arc<Vec<Vec<Seat>>> {
        Arc::clone(&self.seats)
    }

    /// The port with this number.
    pub(super) fn find(&self, device: usize, number: u8) -> Option<&Port> {
        self.of_device.get(device)?.iter().find(|port| port.number == number)
    }

    /// The ports of each device, in the order in which they were plugged in.
    pub(super) fn of_devices(&self) -> impl Iterator<Item = &[Port]> {
        self.of_device.iter().map(Vec::as_slice)
    }
}

impl Plant {
    /// The ports that are plugged in at bus number `bus`.
    pub fn ports_at(&self, bus: usize) -> Vec<Origin> {
        self.ports.at(bus).collect()
    }

    /// Device `index` starts, and its ports after it.
    pub(super) fn start(&mut self, index: usize) {
        let Plant { now, devices, media, ports, journal, .. } = self;
        let (Some(device), Some(ports)) = (devices.get_mut(index), ports.of_device.get(index)) else {
            return;
        };
        let origin = Origin { plc: index as u16, node: 0 };
        let now = *now;
        device.start(&mut Context { now, journal, origin, base: 0 });
        for port in ports {
            let address = device.address(port.number);
            if !media[port.medium].power_on(port.place, address, now, journal) {
                device.address_taken(&mut Context { now, journal, origin, base: 0 }, port.number);
            }
        }
    }

    /// Device `index` stops, and its ports after it leave their media.
    fn stop(&mut self, index: usize) {
        let Plant { now, devices, media, ports, journal, .. } = self;
        let (Some(device), Some(ports)) = (devices.get_mut(index), ports.of_device.get_mut(index)) else {
            return;
        };
        let origin = Origin { plc: index as u16, node: 0 };
        device.stop(&mut Context { now: *now, journal, origin, base: 0 });
        for port in ports {
            media[port.medium].power_off(port.place, *now, journal);
            port.takes_part = false;
            device.port_joined(port.number, false);
        }
    }

    /// What a look at the front of device `index` asks of the rest.
    pub(super) fn follow(&mut self, look: Look, index: usize) {
        self.is_rescheduled |= !matches!(look, Look::Nothing | Look::Answered);
        match look {
            Look::Nothing | Look::Answered => {}
            Look::Held => self.stop(index),
            Look::Off => {
                if self.devices[index].is_up() {
                    self.stop(index);
                }
                self.devices[index].supply_failed();
            }
            Look::Up => self.start(index),
        }
    }

    /// The firmware of all ports of device `index` looks at its control registers.
    pub(super) fn ports_look(&mut self, index: usize) {
        for port in &mut self.ports.of_device[index] {
            let medium = &mut self.media[port.medium];
            let takes_part = medium.processor_cycle(port.place, self.now, &mut self.journal);
            if port.medium < self.named_media {
                self.schedule.set(port.medium, medium.next_time());
            }
            if takes_part != port.takes_part {
                port.takes_part = takes_part;
                self.devices[index].port_joined(port.number, takes_part);
            }
        }
    }

    /// Passes a SYNC edge on to the media whose masters take it over from medium `from` (decision D-12).
    pub(super) fn forward_sync(&mut self, from: usize, signal: SyncSignal) {
        for &(device, port) in &self.ports.ways[from] {
            let port = self.ports.of_device[device][port];
            let medium = &mut self.media[port.medium];
            if medium.takes_sync(port.place) {
                medium.forwarded_edge(port.place, self.now, signal, &mut self.journal);
                if port.medium < self.named_media {
                    self.schedule.set(port.medium, medium.next_time());
                }
            }
        }
    }

    /// Emulated time of the next SYNC edge on the medium at port `port` of device `device`; `None` while there is no SYNC
    /// signal.
    pub fn next_sync(&self, device: usize, port: u8) -> Option<u64> {
        let mut medium = self.ports.find(device, port)?.medium;
        // Follow a forwarded signal to the master that makes it; the number of media bounds the way.
        for _ in 0..self.media.len() {
            if let Some(time) = self.media.get(medium)?.next_sync() {
                return Some(time);
            }
            medium = self.ports.ways.iter().position(|ways| {
                ways.iter().any(|&(device, port)| {
                    let port = self.ports.of_device[device][port];
                    port.medium == medium && self.media[medium].takes_sync(port.place)
                })
            })?;
        }
        None
    }
}
