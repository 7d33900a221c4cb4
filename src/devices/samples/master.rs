//! A station on a CAN bus that the test controls. The port of a device is on the same bus.

use super::tables::STATION;
use crate::can::Frame;
use crate::devices::can_bus::{CanBusConfig, CanPort, CanSocket, Controller};
use crate::devices::{Bus, Context, Plug, World};
use crate::fault::Faults;
use crate::identity::{BusIndex, DeviceIndex, PortNumber};
use crate::journal::{Journal, Origin};
use crate::memory::{HEADER_SIZE, Segment};
use crate::snapshot_fields;
use embedded_can::{Frame as _, Id};
use std::sync::{Arc, Mutex};
use toml::de::ValueDeserializer;

/// The frames that the station has to send, and the frames that it has received with their times.
#[derive(Default)]
pub(crate) struct Wires {
    pub(crate) to_send: Vec<Frame>,
    heard: Vec<(u64, Frame)>,
}

impl Wires {
    /// Returns the frames received since the last call: times, identifiers and data.
    pub(crate) fn take_heard(&mut self) -> Vec<(u64, u16, Vec<u8>)> {
        let fields = |(at, frame): (u64, Frame)| match frame.id() {
            Id::Standard(id) => (at, id.as_raw(), frame.data().to_vec()),
            Id::Extended(_) => panic!("{frame:?}"),
        };
        core::mem::take(&mut self.heard).into_iter().map(fields).collect()
    }
}

struct Master(Arc<Mutex<Wires>>);

snapshot_fields!(Master { built: 0 });

impl CanPort for Master {
    fn look(&mut self, _: &mut Context, controller: &mut Controller) {
        self.0.lock().unwrap().to_send.drain(..).for_each(|frame| controller.send(frame).unwrap());
    }

    fn received(&mut self, ctx: &mut Context, _: &mut Controller, frame: &Frame) {
        self.0.lock().unwrap().heard.push((ctx.now, *frame));
    }
}

/// Returns a bus of 125 kbit/s. The port of a device is at place 0, and the station is at place 1.
pub(crate) fn bus_with(plugs: Vec<Plug>) -> (Box<dyn Bus>, Arc<Mutex<Wires>>) {
    let bus = ValueDeserializer::parse("{ name = 'open', kbit_s = 125 }").unwrap();
    let mut bus = CanBusConfig::read(bus).unwrap().build(BusIndex(0)).unwrap();
    for plug in plugs {
        bus.attach(plug.socket).unwrap();
    }
    let wires = Arc::new(Mutex::new(Wires::default()));
    let socket = CanSocket {
        origin: Origin { plc: DeviceIndex(1), node: PortNumber(1) },
        segment: Segment::heap(2 * HEADER_SIZE),
        layout: &STATION,
        port: Box::new(Master(wires.clone())),
    };
    bus.attach(Box::new(socket)).unwrap();
    (bus, wires)
}

/// Runs a processor cycle of the device and of the station at `now`. Then runs the bus until the next cycle
/// at `until`.
pub(crate) fn cycle(bus: &mut dyn Bus, now: u64, until: u64, journal: &mut Journal, faults: &mut Faults) {
    for place in 0..2 {
        bus.processor_cycle(place, now, journal);
    }
    while bus.next_time() <= until {
        let now = bus.next_time();
        bus.event(&mut World { now, journal, faults, edges: &mut Vec::new() });
    }
}
