//! Connections between the ports of devices and the buses, and the signals between both.

use super::Plant;
use crate::devices::{
    BUS_KINDS, BuildError, Bus, Context, Device, DevicePorts, FrontAction, Plug, SyncOrigin, SyncSignal,
};
use crate::identity::{BusIndex, DeviceIndex, PortNumber};
use crate::journal::{Origin, Source};
use crate::snapshot_fields;
use std::collections::HashMap;
use std::sync::Arc;

/// A port of a device, connected to a bus.
#[derive(Clone, Copy, Debug)]
pub(super) struct Port {
    /// Number of the port in the device's layout.
    pub(super) number: PortNumber,
    /// Index of the bus.
    pub(super) bus: BusIndex,
    /// Place of the port on the bus.
    pub(super) place: usize,
    takes_part: bool,
}

/// Device and port that are connected to a place of a bus.
#[derive(Clone, Copy, Debug)]
pub(super) struct PluggedPort {
    /// Index of the device.
    pub(super) device: DeviceIndex,
    /// Index of the port in the device.
    pub(super) port: usize,
}

/// A port with events that the device of the port handles ([`DevicePorts::exchanges_with_ports`]).
///
/// [`DevicePorts::exchanges_with_ports`]: crate::devices::DevicePorts::exchanges_with_ports
#[derive(Clone, Copy, Debug)]
struct LinkedPort {
    device: DeviceIndex,
    port: Port,
}

snapshot_fields!(Port { values: takes_part; built: number, bus, place });
snapshot_fields!(Ports { parts: of_device; built: ways, seats, linked });

/// The ports of all devices.
#[derive(Default)]
pub(super) struct Ports {
    of_device: Vec<Vec<Port>>,
    /// For each bus, the ports on other buses to which a device can pass on the SYNC signal of this bus. Each
    /// entry consists of the device, the index of the other port in the device, and the index of the device's
    /// port on this bus.
    ways: Vec<Vec<(DeviceIndex, usize, usize)>>,
    /// For each bus, the port at each of its places.
    seats: Arc<Vec<Vec<PluggedPort>>>,
    /// Ports with events that their devices handle.
    linked: Arc<Vec<LinkedPort>>,
}

impl Ports {
    /// Connects the ports of the next device to their buses. `named` has the index of each bus in the plant file by its
    /// name. Placeholders for ports without a bus follow these buses: one for each kind, then one for each port that
    /// runs alone.
    pub(super) fn plug_in(
        &mut self,
        device: &mut dyn Device,
        plugs: Vec<Plug>,
        buses: &mut Vec<Box<dyn Bus>>,
        named: &HashMap<String, usize>,
    ) -> Result<(), BuildError> {
        let mut ports = Vec::with_capacity(plugs.len());
        let seats = Arc::make_mut(&mut self.seats);
        seats.resize(buses.len(), Vec::new());
        for Plug { number, family, bus, socket } in plugs {
            let kind =
                BUS_KINDS.iter().position(|kind| kind.name == family).ok_or(BuildError::OtherFamily)?;
            let index = match bus.as_ref().and_then(|name| named.get(name)) {
                Some(index) => *index,
                None if (BUS_KINDS[kind].runs_alone)(&*socket) => {
                    buses.push((BUS_KINDS[kind].unplugged)());
                    buses.len() - 1
                }
                None => named.len() + kind,
            };
            seats.resize(buses.len(), Vec::new());
            let place = buses[index].attach(socket)?;
            if let Some(ports) = device.ports() {
                ports.plugged_in(number, buses[index].bit_s());
            }
            seats[index]
                .push(PluggedPort { device: DeviceIndex::at(self.of_device.len()), port: ports.len() });
            let port = Port { number, bus: BusIndex::at(index), place, takes_part: false };
            if device.ports().is_some_and(|ports| ports.exchanges_with_ports()) {
                let device = DeviceIndex::at(self.of_device.len());
                Arc::make_mut(&mut self.linked).push(LinkedPort { device, port });
            }
            ports.push(port);
        }
        self.ways.resize(buses.len(), Vec::new());
        let find = |number: PortNumber| ports.iter().position(|port| port.number == number);
        for &(from, to) in device.ports().map_or(&[][..], |ports| ports.sync_ways()) {
            if let (Some(from), Some(to)) = (find(from), find(to)) {
                self.ways[ports[from].bus.index()].push((DeviceIndex::at(self.of_device.len()), to, from));
            }
        }
        self.of_device.push(ports);
        Ok(())
    }

    /// Returns device and number of each port on a bus.
    pub(super) fn at(&self, bus: BusIndex) -> impl Iterator<Item = Origin> {
        let of_device = move |(plc, ports): (DeviceIndex, &Vec<Port>)| {
            let at = ports.iter().filter(move |port| port.bus == bus);
            at.map(move |port| Origin { plc, node: port.number }).collect::<Vec<_>>()
        };
        DeviceIndex::enumerate(&self.of_device).flat_map(of_device)
    }

    /// Returns, for each bus, the port at each of its places. The places are in the order in which the ports
    /// were connected.
    pub(super) fn seats(&self) -> Arc<Vec<Vec<PluggedPort>>> {
        Arc::clone(&self.seats)
    }

    /// True if a device handles the events of its port at this bus.
    pub(super) fn is_linked(&self, bus: BusIndex) -> bool {
        self.linked.iter().any(|linked| linked.port.bus == bus)
    }

    /// Returns the port with this number.
    pub(super) fn find(&self, device: DeviceIndex, number: PortNumber) -> Option<&Port> {
        self.of_device.get(device.index())?.iter().find(|port| port.number == number)
    }

    /// Returns the ports of each device, in the order in which they were plugged in.
    pub(super) fn of_devices(&self) -> impl Iterator<Item = &[Port]> {
        self.of_device.iter().map(Vec::as_slice)
    }
}

impl Plant {
    /// Returns the ports that are connected to bus number `bus`.
    pub fn ports_at(&self, bus: BusIndex) -> Vec<Origin> {
        self.ports.at(bus).collect()
    }

    /// Starts device `index`, then its ports.
    pub(super) fn start(&mut self, index: DeviceIndex) {
        let Plant { now, devices, buses, ports, journal, .. } = self;
        let (Some(device), Some(ports)) =
            (devices.get_mut(index.index()), ports.of_device.get(index.index()))
        else {
            return;
        };
        let origin = Origin::of_device(index);
        let now = *now;
        device.start(&mut Context { now, journal, origin, base: 0 });
        for port in ports {
            let mut of_device = device.ports();
            let address = of_device.as_ref().map_or(0, |ports| ports.address(port.number));
            if !buses[port.bus.index()].power_on(port.place, address, now, journal)
                && let Some(of_device) = &mut of_device
            {
                of_device.address_taken(&mut Context { now, journal, origin, base: 0 }, port.number);
            }
        }
        self.pass_signals();
    }

    /// Stops device `index`, then lets its ports leave their buses.
    fn stop(&mut self, index: DeviceIndex) {
        let Plant { now, devices, buses, ports, journal, .. } = self;
        let (Some(device), Some(ports)) =
            (devices.get_mut(index.index()), ports.of_device.get_mut(index.index()))
        else {
            return;
        };
        let origin = Origin::of_device(index);
        device.stop(&mut Context { now: *now, journal, origin, base: 0 });
        for port in ports {
            buses[port.bus.index()].power_off(port.place, *now, journal);
            port.takes_part = false;
            if let Some(ports) = device.ports() {
                ports.port_joined(port.number, false);
            }
        }
        self.pass_signals();
    }

    /// Carries out the action that results from polling the front panel of device `index`.
    pub(super) fn follow(&mut self, look: FrontAction, index: DeviceIndex) {
        self.is_rescheduled |= !matches!(look, FrontAction::Nothing | FrontAction::Answered);
        match look {
            FrontAction::Nothing | FrontAction::Answered => {}
            FrontAction::Held => self.stop(index),
            FrontAction::Off => {
                if self.devices[index.index()].is_up() {
                    self.stop(index);
                }
                self.devices[index.index()].supply_failed();
            }
            FrontAction::Up => self.start(index),
        }
    }

    /// Lets the ports handle the orders that their devices have given at this moment. A device without power
    /// gives no orders.
    pub(super) fn pass_orders(&mut self) {
        if self.ports.linked.is_empty() {
            return;
        }
        for &LinkedPort { device, port } in &*Arc::clone(&self.ports.linked) {
            let has_orders = |ports: &mut dyn DevicePorts| ports.has_orders(port.number);
            if self.devices[device.index()].ports().is_some_and(has_orders) {
                let bus = &mut self.buses[port.bus.index()];
                bus.processor_cycle(port.place, self.now, &mut self.journal);
                self.schedule.set(port.bus.index(), bus.next_time());
            }
        }
    }

    /// Polls the control registers of all ports of device `index`, as their firmware does.
    pub(super) fn ports_look(&mut self, index: DeviceIndex) {
        let mut of_device = self.devices[index.index()].ports();
        for port in &mut self.ports.of_device[index.index()] {
            let bus = &mut self.buses[port.bus.index()];
            let takes_part = bus.processor_cycle(port.place, self.now, &mut self.journal);
            self.schedule.set(port.bus.index(), bus.next_time());
            let has_changed = core::mem::replace(&mut port.takes_part, takes_part) != takes_part;
            let Some(of_device) = &mut of_device else { continue };
            if has_changed {
                of_device.port_joined(port.number, takes_part);
            }
            of_device.port_looked(port.number, bus.last_frame(port.place), self.now);
        }
    }

    /// Passes a SYNC edge of bus `from` on to the buses with masters that use it as their SYNC signal
    /// (decision D-12).
    pub(super) fn forward_sync(&mut self, from: BusIndex, signal: SyncSignal) {
        for &(device, port, _) in &self.ports.ways[from.index()] {
            let port = self.ports.of_device[device.index()][port];
            let bus = &mut self.buses[port.bus.index()];
            if let Some(sync) = bus.sync_mut()
                && sync.takes_sync(port.place)
            {
                sync.forwarded_edge(port.place, self.now, signal, &mut self.journal);
                self.schedule.set(port.bus.index(), bus.next_time());
            }
        }
    }

    /// Returns the emulated time of the next SYNC edge on the bus at port `port` of device `device`; `None`
    /// while there is no SYNC signal.
    pub fn next_sync(&self, device: DeviceIndex, port: PortNumber) -> Option<u64> {
        let mut bus = self.ports.find(device, port)?.bus;
        // The loop follows a forwarded signal to the master that generates it. The number of buses limits the
        // number of steps.
        for _ in 0..self.buses.len() {
            if let Some(time) = self.buses.get(bus.index())?.sync()?.next_sync() {
                return Some(time);
            }
            bus = self.sync_comes_from(bus)?.bus;
        }
        None
    }

    /// If the master of bus `bus` passes on a SYNC signal at present, returns the port that receives this
    /// signal.
    fn sync_comes_from(&self, bus: BusIndex) -> Option<Port> {
        let sync = self.buses.get(bus.index())?.sync()?;
        let takes_it = |&&(device, to, _): &&(DeviceIndex, usize, usize)| {
            let port = self.ports.of_device[device.index()][to];
            port.bus == bus && sync.takes_sync(port.place)
        };
        let &(device, _, from) = self.ports.ways.iter().flatten().find(takes_it)?;
        Some(self.ports.of_device[device.index()][from])
    }

    /// Describes why there is no SYNC signal at port `port` of device `device`, for the case that [`Plant::next_sync`]
    /// returns `None`.
    pub fn why_no_sync(&self, device: DeviceIndex, port: PortNumber) -> String {
        let names = self.names();
        let Some(mut at) = self.ports.find(device, port).copied() else {
            return "the port is not there".to_owned();
        };
        let origin = |at: Port| Origin { plc: self.device_of(at), node: at.number };
        let name = |it: Origin| names.source(Source::Node(it));
        let mut way = String::new();
        for _ in 0..=self.buses.len() {
            let bus = &self.buses[at.bus.index()];
            let is_plugged = at.bus.index() < self.named_buses;
            let here = if is_plugged { format!("bus '{}'", bus.name()) } else { name(origin(at)) };
            let master = |port| {
                if is_plugged { format!("the master of {here}, {},", name(port)) } else { name(port) }
            };
            let Some(sync) = bus.sync() else { return format!("{way}{here} has no SYNC signal") };
            return match sync.sync_origin() {
                SyncOrigin::NoMaster if !is_plugged => format!("{way}{here} is at no bus"),
                SyncOrigin::NoMaster => format!("{way}{here} has no master"),
                SyncOrigin::Idle { port, .. } if !self.is_up(port) => {
                    format!("{way}{} has no power or is held in RESET", master(port))
                }
                SyncOrigin::Idle { port, register, state } => format!(
                    "{way}{} has not started: {register} is 16#{state:04X}; initialize it first",
                    master(port)
                ),
                SyncOrigin::Own(port) => {
                    format!("{way}{} makes a SYNC signal, which does not get here", name(port))
                }
                SyncOrigin::Forwarded { port, setting } => match self.sync_comes_from(at.bus) {
                    Some(from) => {
                        way = format!("{} passes on the SYNC signal at {}: ", name(port), name(origin(from)));
                        at = from;
                        continue;
                    }
                    None => format!(
                        "{way}{} is to pass a SYNC signal on ({setting}), and no other port passes one to it",
                        name(port)
                    ),
                },
            };
        }
        format!("{way}the signal goes round in a circle")
    }

    fn is_up(&self, port: Origin) -> bool {
        self.devices.get(port.plc.index()).is_some_and(|device| device.is_up())
    }

    fn device_of(&self, port: Port) -> DeviceIndex {
        let is_it = |other: &Port| (other.bus, other.place) == (port.bus, port.place);
        let device = self.ports.of_device.iter().position(|ports| ports.iter().any(is_it));
        device.map(DeviceIndex::at).unwrap_or_default()
    }
}
