//! A CAN-DP/2 between a PROFIBUS segment and a CAN bus. Its own master without a stack controls it, and a
//! test station is on the CAN bus.

mod any;
#[cfg(feature = "plc")]
mod blocks;
mod canopen;
mod diagnosis;
mod disturbed;
mod exchange;
mod foreign;
mod guests;
mod paging;
mod ring;
mod rules;
mod states;

use super::config::CanDp2Config;
use super::firmware::ram::Registers;
use crate::can::{Frame, Payload};
use crate::devices::can_bus::{CanBusConfig, CanPort, CanSocket, Controller};
use crate::devices::can_dp2::registers::values::{mst_control, mst_result};
use crate::devices::can_dp2::registers::{
    CAN_DP2_MST, DEVICE, FRONT_ADDRESS, FRONT_LED_C, FRONT_LED_D, FRONT_LED_E, FRONT_SWITCHES, MST,
};
use crate::devices::profibus_bus::ProfibusConfig;
use crate::devices::samples::tables::STATION;
use crate::devices::{Bus, Context, Device, Power, World};
use crate::fault::Faults;
use crate::identity::{BusIndex, DeviceIndex, PortNumber};
use crate::journal::{Journal, Origin};
use crate::memory::{HEADER_SIZE, Segment, View};
use crate::snapshot_fields;
use embedded_can::Frame as _;
use std::sync::{Arc, Mutex};
use toml::de::ValueDeserializer;

/// The processor cycle of the bench, in us.
const CYCLE: u64 = 100;

const MS: u64 = 1000;
const S: u64 = 1_000_000;

/// The frames that the station on CAN has to send, and the frames that it has received with their times.
#[derive(Default)]
struct Wires {
    to_send: Vec<Frame>,
    heard: Vec<(u64, Frame)>,
}

struct Station(Arc<Mutex<Wires>>);

snapshot_fields!(Station { built: 0 });

impl CanPort for Station {
    fn look(&mut self, _: &mut Context, controller: &mut Controller) {
        let mut wires = self.0.lock().unwrap();
        while controller.to_send() < Controller::ROOM && !wires.to_send.is_empty() {
            controller.send(wires.to_send.remove(0)).unwrap();
        }
    }

    fn received(&mut self, ctx: &mut Context, _: &mut Controller, frame: &Frame) {
        self.0.lock().unwrap().heard.push((ctx.now, *frame));
    }
}

/// Octets of a good Set_Prm: watchdog off, 125 kbit/s, wake-up and SYNC times 0, with these flags.
fn prm(flags_1: u8, flags_2: u8) -> Vec<u8> {
    vec![0x80, 0, 0, 11, 0x04, 0xA4, 0, 0, 6, flags_1, 5, flags_2, 0, 0, 0, 0]
}

/// The configuration: an output of 2 bytes with 16#203, and an input of 2 bytes with 16#289.
const CFG: [u8; 10] = [0x83, 1, 2, 3, 0, 0x43, 1, 2, 0x89, 0];

struct Bench {
    /// The buses of the gateway: the PROFIBUS segment, and the CAN bus.
    buses: [Box<dyn Bus>; 2],
    /// Positions of the ports: bus and index.
    places: Vec<(usize, usize)>,
    device: Box<dyn Device>,
    registers: Registers,
    mst: View<CAN_DP2_MST>,
    wires: Arc<Mutex<Wires>>,
    journal: Journal,
    faults: Faults,
    segment: Segment,
    now: u64,
}

impl Bench {
    /// Returns a gateway that has just been powered on. PROFIBUS runs at 500 kbit/s, CAN at 125 kbit/s.
    fn new(switches: u8) -> Self {
        Self::with_segment(switches, "kbit_s = 500")
    }

    /// Like `new`, with other settings of the PROFIBUS segment.
    fn with_segment(switches: u8, settings: &str) -> Self {
        let text = format!("{{ name = 'gw', profibus = 'dp', can = 'open', switches = {switches} }}");
        let config = CanDp2Config::read(ValueDeserializer::parse(&text).unwrap()).unwrap();
        let segment = Segment::of(&DEVICE);
        let (device, plugs) = config.build(DeviceIndex(0), segment.clone()).unwrap();
        let dp = format!("{{ name = 'dp', {settings} }}");
        let dp = ValueDeserializer::parse(&dp).unwrap();
        let can = ValueDeserializer::parse("{ name = 'open', kbit_s = 125 }").unwrap();
        let mut buses = [
            ProfibusConfig::read(dp).unwrap().build(BusIndex(0)).unwrap(),
            CanBusConfig::read(can).unwrap().build(BusIndex(1)).unwrap(),
        ];
        let mut places = Vec::new();
        for plug in plugs {
            let bus = usize::from(plug.family == "can");
            places.push((bus, buses[bus].attach(plug.socket).unwrap()));
        }
        let wires = Arc::new(Mutex::new(Wires::default()));
        let socket = CanSocket {
            origin: Origin { plc: DeviceIndex(1), node: PortNumber(1) },
            segment: Segment::heap(2 * HEADER_SIZE),
            layout: &STATION,
            port: Box::new(Station(wires.clone())),
        };
        let station = buses[1].attach(Box::new(socket)).unwrap();
        let (registers, mst) = (Registers::new(&segment).unwrap(), segment.view(MST).unwrap());
        let journal = Journal::default();
        let faults = Faults::default();
        let mut bench =
            Bench { buses, places, device, registers, mst, wires, journal, faults, segment, now: 0 };
        bench.buses[1].power_on(station, 0, 0, &mut bench.journal);
        bench.places.push((1, station));
        bench.power(Power::On);
        bench
    }

    /// Returns a gateway in data exchange with this configuration and these flags.
    fn exchanging(flags_1: u8, flags_2: u8, cfg: &[u8]) -> Self {
        let mut bench = Bench::new(5);
        bench.commission(flags_1, flags_2, cfg);
        bench
    }

    fn commission(&mut self, flags_1: u8, flags_2: u8, cfg: &[u8]) {
        assert_eq!(self.ask(61, &prm(flags_1, flags_2)).0, mst_result::RECEIPT);
        assert_eq!(self.ask(62, cfg).0, mst_result::RECEIPT);
        assert_eq!(self.diag()[..2], [0, 4], "{:02X?}", self.diag());
    }

    /// Switches the supply of the device.
    fn power(&mut self, power: Power) {
        let origin = Origin::of_device(DeviceIndex(0));
        self.device.set_power(power);
        let ctx = &mut Context { now: self.now, journal: &mut self.journal, origin, base: 0 };
        if power == Power::On {
            self.device.start(ctx)
        } else {
            self.device.stop(ctx)
        }
        for &(bus, place) in self.places.iter().take(3) {
            match power {
                Power::On => {
                    self.buses[bus].power_on(place, 0, self.now, &mut self.journal);
                }
                _ => self.buses[bus].power_off(place, self.now, &mut self.journal),
            }
        }
    }

    /// Advances the clock by `us` microseconds.
    fn run(&mut self, us: u64) {
        let end = self.now + us;
        while self.now < end {
            let next = self.buses.iter().map(|bus| bus.next_time()).min().unwrap().max(self.now);
            let cycle = (self.now / CYCLE + 1) * CYCLE;
            if next > cycle.min(end) {
                self.now = cycle.min(end);
                if self.now == cycle {
                    for &(bus, place) in &self.places {
                        self.buses[bus].processor_cycle(place, self.now, &mut self.journal);
                    }
                    let origin = Origin::of_device(DeviceIndex(0));
                    let ctx = &mut Context { now: self.now, journal: &mut self.journal, origin, base: 0 };
                    self.device.processor_cycle(ctx);
                }
                continue;
            }
            self.now = next;
            let mut edges = Vec::new();
            for bus in self.buses.iter_mut().filter(|bus| bus.next_time() <= next) {
                let (journal, faults) = (&mut self.journal, &mut self.faults);
                bus.event(&mut World { now: next, journal, faults, edges: &mut edges });
            }
        }
    }

    /// Sends a request to the slave; returns result and answer.
    fn ask(&mut self, dsap: u8, data: &[u8]) -> (u8, Vec<u8>) {
        self.mst.mst_dsap.store(dsap);
        self.mst.mst_request_len.store(data.len() as u8);
        super::firmware::ram::fill(&self.mst.mst_request, data);
        self.mst.mst_control.store(mst_control::SEND);
        for _ in 0..1000 {
            self.run(CYCLE);
            if self.mst.mst_control.load() == mst_control::DONE {
                let length = usize::from(self.mst.mst_reply_len.load());
                let reply = self.mst.mst_reply.iter().take(length).map(|cell| cell.load()).collect();
                return (self.mst.mst_result.load(), reply);
            }
        }
        panic!("no end of the request to {dsap}");
    }

    /// Reads the diagnosis of the gateway.
    fn diag(&mut self) -> Vec<u8> {
        let (result, reply) = self.ask(60, &[]);
        assert_eq!(result, mst_result::DATA);
        reply
    }

    /// Exchanges data with these outputs; returns the inputs.
    fn exchange(&mut self, outputs: &[u8]) -> Vec<u8> {
        let (result, inputs) = self.ask(255, outputs);
        assert!(
            [mst_result::DATA, mst_result::DATA_AND_DIAGNOSIS, mst_result::RECEIPT].contains(&result),
            "result {result}"
        );
        inputs
    }

    /// Sends a frame from the station on CAN.
    fn send(&mut self, frame: Frame) {
        self.wires.lock().unwrap().to_send.push(frame);
    }

    /// Returns the frames that the station on CAN has received since the last call: `203: 12 34`, `289: remote 2`.
    fn heard(&mut self) -> Vec<String> {
        self.heard_at().into_iter().map(|(_, frame)| frame).collect()
    }

    /// Like `heard`, with the times.
    fn heard_at(&mut self) -> Vec<(u64, String)> {
        let heard = core::mem::take(&mut self.wires.lock().unwrap().heard);
        let text = |frame: Frame| {
            let id = frame.arbitration().number();
            if frame.is_remote_frame() {
                return format!("{id:X}: remote {}", frame.length());
            }
            let data: String = frame.data().iter().map(|byte| format!(" {byte:02X}")).collect();
            format!("{id:X}:{data}")
        };
        heard.into_iter().map(|(at, frame)| (at, text(frame))).collect()
    }

    fn front(&self, word: usize) -> u32 {
        self.registers.shown(word).load()
    }
}

fn data(id: u16, bytes: &[u8]) -> Frame {
    Frame::standard(id, Payload::new(bytes).unwrap())
}
