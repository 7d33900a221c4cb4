//! Modules on a bus with a test master.

use super::config::Cr201xConfig;
use crate::can::{Frame, Payload};
use crate::devices::canopen::records::NodeState;
use crate::devices::cr201x::registers::{
    CHANNELS, CR201X_CHANNELS, DEVICE, FRONT_INPUTS, FRONT_OPEN, FRONT_OUTPUTS, FRONT_STATE,
};
use crate::devices::samples::master::{Wires, bus_with, cycle};
use crate::devices::{Bus, DeviceConfig};
use crate::fault::Faults;
use crate::identity::DeviceIndex;
use crate::journal::Journal;
use crate::memory::{Header, Segment, View};
use embedded_can::StandardId;
use proptest::prelude::*;
use std::sync::{Arc, Mutex};
use toml::de::ValueDeserializer;

const MS: u64 = 1000;
const NODE: u8 = 3;

struct Bench {
    bus: Box<dyn Bus>,
    registers: View<CR201X_CHANNELS>,
    header: View<Header>,
    wires: Arc<Mutex<Wires>>,
    journal: Journal,
    faults: Faults,
    now: u64,
}

fn read(keys: &str) -> Result<Arc<dyn DeviceConfig>, toml::de::Error> {
    Cr201xConfig::read(ValueDeserializer::parse(&format!("{{ name = 'io', {keys} }}"))?)
}

impl Bench {
    /// Returns a module that has just been powered on. In the plant file it has these keys in addition to
    /// name and Node-ID.
    fn new(keys: &str) -> Self {
        let segment = Segment::of(&DEVICE);
        let config = read(&format!("node_id = {NODE}, {keys}")).unwrap();
        let (_, plugs) = config.build(DeviceIndex(0), segment.clone()).unwrap();
        let (bus, wires) = bus_with(plugs);
        let (registers, header) = (segment.view(CHANNELS).unwrap(), segment.header().unwrap());
        let (journal, faults) = (Journal::default(), Faults::default());
        let mut bench = Bench { bus, registers, header, wires, journal, faults, now: 0 };
        bench.bus.power_on(1, 0, 0, &mut bench.journal);
        bench.bus.power_on(0, 0, 0, &mut bench.journal);
        bench.run(5 * MS);
        bench
    }

    fn run(&mut self, us: u64) {
        let end = self.now + us;
        while self.now < end {
            let until = (self.now + 500).min(end);
            cycle(&mut *self.bus, self.now, until, &mut self.journal, &mut self.faults);
            self.now = until;
        }
    }

    /// Sends a frame and returns the frames heard within 5 ms.
    fn exchange(&mut self, id: u16, data: &[u8]) -> Vec<(u16, Vec<u8>)> {
        self.wires.lock().unwrap().to_send.push(Frame::standard(id, Payload::new(data).unwrap()));
        self.run(5 * MS);
        self.heard()
    }

    fn heard(&mut self) -> Vec<(u16, Vec<u8>)> {
        let heard = self.wires.lock().unwrap().take_heard();
        heard.into_iter().map(|(_, id, data)| (id, data)).collect()
    }

    /// Writes a byte by SDO; returns the abort code, or 0.
    fn write(&mut self, index: u16, sub: u8, value: u8) -> u32 {
        let [low, high] = index.to_le_bytes();
        let heard = self.exchange(0x600 + u16::from(NODE), &[0x2F, low, high, sub, value, 0, 0, 0]);
        let [(0x583, answer)] = &heard[..] else { panic!("{heard:?}") };
        if answer[0] == 0x60 { 0 } else { u32::from_le_bytes(answer[4..].try_into().unwrap()) }
    }

    fn front(&mut self, word: usize, value: u32) {
        self.header.front[word].store(value);
        self.run(5 * MS);
    }

    /// Returns a front panel word as an observer of the module sees it.
    fn sees(&self, word: usize) -> u32 {
        self.header.front[word].load()
    }
}

#[test]
fn each_mistake_in_a_plant_file_is_named() {
    for (keys, expected) in [
        ("node_id = 1, module = 'cr2012'", "module of 'io' is 'cr2012'; it is cr2010 or cr2011"),
        ("node_id = 0, module = 'cr2010'", "node_id of 'io' is 0; it must be 1 to 127"),
        ("module = 'cr2010'", "missing field `node_id`"),
        ("node_id = 1, module = 'cr2011', channels = [0]", "channels of 'io': 1 values; a CR2011 has 4"),
        ("node_id = 1, module = 'cr2011', channels = [0, 0, 0, 3]", "number 4 is 3; it is 0, 2, 4, 5"),
        ("node_id = 1, module = 'cr2010', pwm_hz = 19", "pwm_hz of 'io' is 19; it must be 20 to 200"),
        ("node_id = 1, module = 'cr2010', nodes = 1", "unknown field `nodes`"),
    ] {
        let message = read(keys).unwrap_err().to_string();
        assert!(message.contains(expected), "{keys}\n{message}");
    }
}

/// Manual p. 38: digital inputs are sent when they change. Analog inputs are sent, and all outputs take
/// effect, with SYNC.
#[test]
fn a_cr2010_exchanges_inputs_and_outputs() {
    let mut bench = Bench::new("module = 'cr2010', channels = [1, 2, 1, 3, 0, 4, 0, 0]");
    assert_eq!(bench.heard(), [(0x703, vec![0])], "it has started");
    bench.front(FRONT_INPUTS, 0b0101_0001);
    assert_eq!(bench.heard(), []);
    assert_eq!(bench.exchange(0, &[1, NODE]), [(0x183, vec![0b0000_0001])], "connectors 5 and 7 are off");
    bench.front(FRONT_INPUTS, 0b0000_0101);
    assert_eq!(bench.heard(), [(0x183, vec![0b0000_0101])]);
    bench.front(crate::devices::cr201x::registers::FRONT_ANALOG_4, 0x1234);
    assert_eq!(bench.heard(), []);
    assert_eq!(bench.exchange(0x080, &[]), [(0x283, vec![0, 0, 0x34, 0x12, 0, 0, 0, 0])]);
    bench.exchange(0x203, &[0xFF]);
    bench.exchange(0x303, &[1, 0, 2, 0, 3, 1, 4, 0]);
    assert_eq!(bench.sees(FRONT_OUTPUTS), 0, "they wait for SYNC");
    bench.exchange(0x080, &[]);
    assert_eq!(bench.sees(FRONT_OUTPUTS), 0b0010_0010);
    let outputs: Vec<_> = bench.registers.a_OUTPUT.iter().map(|cell| cell.load()).collect();
    assert_eq!(outputs, [0, 1, 0, 0, 0, 0x103, 0, 0]);
    for (index, sub, low, high) in
        [(0x6000, 1, 0b101, 0), (0x6200, 1, 0xFF, 0), (0x6401, 2, 0x34, 0x12), (0x6411, 3, 3, 1)]
    {
        let [index_low, index_high] = u16::to_le_bytes(index);
        let answer = bench.exchange(0x603, &[0x40, index_low, index_high, sub, 0, 0, 0, 0]);
        assert_eq!(answer[0].1[4..6], [low, high], "{index:04X}");
    }
    let inputs: Vec<_> = bench.registers.a_INPUT.iter().map(|cell| cell.load()).collect();
    assert_eq!(inputs, [1, 0, 1, 0x1234, 0, 0, 0, 0]);
    bench.exchange(0, &[2, NODE]);
    assert_eq!((bench.sees(FRONT_OUTPUTS), bench.sees(FRONT_STATE)), (0, 4));
    let states = bench.journal.records().filter_map(|record| record.event.get().map(|it: NodeState| it.to));
    assert_eq!(states.collect::<Vec<_>>(), [127, 5, 4]);
}

/// Manual p. 82-85.
#[test]
fn a_cr2011_reports_the_current_of_its_pairs_and_open_lines() {
    let mut bench = Bench::new("module = 'cr2011', channels = [5, 4, 2, 0]");
    bench.exchange(0, &[1, 0]);
    bench.heard();
    bench.exchange(0x203, &[0b0001_0000]);
    bench.exchange(0x303, &[0x0C, 0xFE, 100, 0, 0, 0, 0, 0]);
    bench.exchange(0x080, &[]);
    let outputs: Vec<_> = bench.registers.a_OUTPUT.iter().map(|cell| cell.load()).collect();
    assert_eq!(outputs, [0, 500, 100, 0, 1, 0, 0, 0]);
    assert_eq!(bench.exchange(0x080, &[]), [(0x283, vec![0xF4, 1, 0, 0, 0, 0, 0, 0])]);
    let inputs: Vec<_> = bench.registers.a_INPUT.iter().map(|cell| cell.load()).collect();
    assert_eq!(inputs, [0, 500, 0, 0, 0, 0, 0, 0], "of a pair, at its second connector");
    bench.front(FRONT_OPEN, 0b0000_0011);
    assert_eq!(bench.heard(), [(0x083, vec![0x00, 0x21, 0x02, 0b10, 0, 0, 0, 0])]);
    assert_eq!(bench.exchange(0x080, &[]), [(0x283, vec![0; 8])]);
    bench.front(FRONT_OPEN, 0);
    assert_eq!(bench.heard(), [(0x083, vec![0; 8])]);
}

/// Manual p. 79, 83: a value that is written in Operational takes effect only after Pre-Operational.
#[test]
fn a_configuration_takes_effect_in_pre_operational() {
    let mut bench = Bench::new("module = 'cr2011'");
    bench.heard();
    assert_eq!(bench.write(0x2000, 1, 5), 0);
    assert_eq!(bench.write(0x2000, 1, 3), 0x0609_0030);
    assert_eq!(bench.write(0x2000, 5, 2), 0x0609_0030, "there are four pairs");
    assert_eq!(bench.write(0x2000, 0, 2), 0x0601_0002);
    assert_eq!(bench.write(0x2001, 0, 201), 0x0609_0030);
    assert_eq!(bench.write(0x2001, 0, 200), 0);
    assert_eq!(bench.write(0x2002, 0, 1), 0x0602_0000);
    assert_eq!(bench.registers.a_CHANNEL[0].load(), 5);
    bench.exchange(0, &[1, 0]);
    bench.heard();
    assert_eq!(bench.write(0x2000, 1, 4), 0);
    assert_eq!(bench.registers.a_CHANNEL[0].load(), 5);
    let read = bench.exchange(0x603, &[0x40, 0x00, 0x20, 1, 0, 0, 0, 0]);
    assert_eq!(read[0].1[..5], [0x4F, 0x00, 0x20, 1, 4]);
    bench.exchange(0, &[128, 0]);
    assert_eq!(bench.registers.a_CHANNEL[0].load(), 4);
    // The module keeps the configuration without supply.
    bench.bus.power_off(0, bench.now, &mut bench.journal);
    bench.run(MS);
    assert_eq!(bench.sees(FRONT_STATE), 0);
    bench.bus.power_on(0, 0, bench.now, &mut bench.journal);
    bench.run(5 * MS);
    assert_eq!((bench.registers.a_CHANNEL[0].load(), bench.registers.b_PWM_FRQ.load()), (4, 200));
}

#[test]
fn a_module_answers_guarding_and_reports_missing_guarding() {
    let mut bench = Bench::new("module = 'cr2010'");
    bench.heard();
    assert_eq!(bench.exchange(0x603, &[0x2B, 0x0C, 0x10, 0, 100, 0, 0, 0]).len(), 1);
    assert_eq!(bench.write(0x100D, 0, 2), 0);
    let ask = |bench: &mut Bench| {
        let frame = Frame::remote(StandardId::new(0x703).unwrap(), 1).unwrap();
        bench.wires.lock().unwrap().to_send.push(frame);
        bench.run(5 * MS);
        bench.heard()
    };
    assert_eq!(ask(&mut bench), [(0x703, vec![127])]);
    assert_eq!(ask(&mut bench), [(0x703, vec![255])]);
    bench.run(250 * MS);
    assert_eq!(bench.heard(), [(0x083, vec![0x00, 0x81, 0x10, 0, 0, 0, 0, 0])]);
    let name = bench.exchange(0x603, &[0x40, 0x08, 0x10, 0, 0, 0, 0, 0]);
    assert_eq!(name[0].1[..5], [0x41, 0x08, 0x10, 0, 6]);
    assert_eq!(ask(&mut bench), [(0x703, vec![127]), (0x083, vec![0; 8])]);
    assert_eq!(bench.exchange(0, &[129, NODE]), [(0x703, vec![0])]);
}

/// Random identifiers. Many of them have a meaning for the module.
fn identifier() -> impl Strategy<Value = u16> {
    prop_oneof![Just(0), Just(0x80), Just(0x603), Just(0x203), Just(0x303), 0..0x800_u16]
}

/// Random data. Many of them have a meaning: network management, SDOs, random bytes.
fn data() -> impl Strategy<Value = Vec<u8>> {
    let management = (proptest::sample::select(&[1_u8, 2, 128, 129, 130][..]), 0..5_u8);
    let sdo = (any::<u8>(), 0..DEVICE.objects.len(), any::<[u8; 4]>()).prop_map(|(command, at, value)| {
        let object = &DEVICE.objects[at];
        let [low, high] = object.index.to_le_bytes();
        [&[command, low, high, object.sub][..], &value].concat()
    });
    prop_oneof![
        management.prop_map(|(command, node)| vec![command, node]),
        sdo,
        proptest::collection::vec(any::<u8>(), 0..=8)
    ]
}

proptest! {
    #![proptest_config(crate::property_tests())]

    /// Each request gets one answer while there is an SDO server, and no frame stops the module.
    #[test]
    fn random_frames_never_stop_the_node(
        frames in proptest::collection::vec((identifier(), data()), 0..25),
        is_cr2010: bool,
    ) {
        let mut bench = Bench::new(if is_cr2010 { "module = 'cr2010'" } else { "module = 'cr2011'" });
        for (id, data) in frames {
            let is_request = id == 0x603 && data.len() == 8 && data[0] >> 5 != 4;
            let is_served = is_request && bench.sees(FRONT_STATE) != 4;
            let answers = bench.exchange(id, &data).into_iter().filter(|(id, _)| *id == 0x583).count();
            prop_assert_eq!(answers, usize::from(is_served));
        }
        prop_assert!([4, 5, 127].contains(&bench.sees(FRONT_STATE)));
    }
}
