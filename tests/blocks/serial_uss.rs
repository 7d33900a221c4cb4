//! `SERIAL_USS`: the program of PLC `line` drives the slaves of a serial line. They are drives of the plant, or a slave in the
//! program of PLC `partner`.

use crate::rig::{add_fault, drive_parameter, plant_of};
use commram::devices::omega_drive_line_2::blocks::{Base, Ram, SERIAL_USS, USS_BMARRAY};
use commram::devices::omega_drive_line_2::registers::values::{serial_control, serial_parity};
use commram::devices::omega_drive_line_2::registers::{SERIAL, SERIAL_BMSTRUCT};
use commram::plant::Plant;
use commram::serial::Character;
use commram::serial::uss::{
    Address, Layout, Parameter, ParameterType, Parameters, Pkw, PkwWidth, Slave, Telegram, Timing,
};

const LINE: &str = "\
[[plc]]
name = 'line'
serial = 'rs485'
[[plc]]
name = 'partner'
serial = 'rs485'
[[bus]]
name = 'rs485'
kind = 'serial'
wires = 2
baud_rate = 19200
";

const DRIVES: &str = "\
[[bus.drive]]
name = 'pump'
address = 3
pzd_words = 3
parameters = [{ number = 2010, format = 'word', initial = 7, max = 100 }]
[[bus.drive]]
name = 'fan'
address = 31
pzd_words = 3
response_delay_us = 15000
";

fn port(plant: &Plant, device: usize) -> Base<SERIAL_BMSTRUCT> {
    let base = Ram::of(plant.devices()[device].segment()).unwrap().at::<SERIAL_BMSTRUCT>(SERIAL).unwrap();
    base.u_BAUD_RATE.store(19_200);
    base.us_DATA_BITS.store(8);
    base.b_PARITY.store(serial_parity::EVEN);
    base.us_STOP_BITS.store(1);
    base.us_WIRES.store(2);
    base.w_CONTROL.store(serial_control::ON);
    base
}

/// Takes the characters that the port has received.
fn take(port: &Base<SERIAL_BMSTRUCT>) -> Vec<u8> {
    let (mut tail, head) = (port.u_RX_TAIL.load(), port.u_RX_HEAD.load());
    let mut octets = Vec::new();
    while tail != head {
        octets.push((port.a_RX[usize::from(tail % 256)].load() & 0xFF) as u8);
        tail = tail.wrapping_add(1);
    }
    port.u_RX_TAIL.store(tail);
    octets
}

fn put(port: &Base<SERIAL_BMSTRUCT>, octets: &[u8]) {
    let mut head = port.u_TX_HEAD.load();
    for octet in octets {
        port.a_TX[usize::from(head % 256)].store(u16::from(*octet));
        head = head.wrapping_add(1);
    }
    port.u_TX_HEAD.store(head);
}

/// What the program of PLC `partner` does.
enum Partner {
    None,
    Slave(Slave),
    /// Collects a request, and answers each with this telegram.
    Answers(Vec<u8>, Telegram),
}

struct Bench {
    plant: Plant,
    base: Base<SERIAL_BMSTRUCT>,
    block: SERIAL_USS,
    setpoints: Box<USS_BMARRAY>,
    actual: Box<USS_BMARRAY>,
    values: Box<USS_BMARRAY>,
    reply: Box<USS_BMARRAY>,
    /// Interval of the event task in microseconds.
    interval: u64,
    partner: Partner,
    at_partner: Base<SERIAL_BMSTRUCT>,
}

impl Bench {
    fn new(drives: &str, slaves: u32, layout: (u8, u8)) -> Self {
        let mut plant = plant_of(&format!("{LINE}{drives}"));
        let (base, at_partner) = (port(&plant, 0), port(&plant, 1));
        plant.advance_to(1_000);
        let (us_PKW, us_PZD) = layout;
        let block = SERIAL_USS { x_EN: true, d_SLAVES: slaves, us_PKW, us_PZD, ..Default::default() };
        let words = || Box::new([0; 512]);
        let (setpoints, actual) = (words(), words());
        let (values, reply) = (words(), words());
        let partner = Partner::None;
        Bench { plant, base, block, setpoints, actual, values, reply, interval: 1_000, partner, at_partner }
    }

    /// Runs the event task, and the partner every 250 us.
    fn run(&mut self, us: u64) {
        let end = self.plant.now() + us;
        while self.plant.now() < end {
            for _ in 0..self.interval / 250 {
                let now = self.plant.now() + 250;
                self.plant.advance_to(now);
                self.run_partner(now);
            }
            self.block.call(&self.base, &self.setpoints, &mut self.actual, &self.values, &mut self.reply);
        }
    }

    fn run_partner(&mut self, now: u64) {
        let octets = take(&self.at_partner);
        match &mut self.partner {
            Partner::None => {}
            Partner::Slave(slave) => {
                octets.iter().for_each(|octet| slave.received(now, Character::Byte(*octet)));
                put(&self.at_partner, &slave.poll(now));
            }
            Partner::Answers(heard, telegram) => {
                heard.extend(octets);
                if heard.len() > 1 && heard.len() == usize::from(heard[1]) + 2 {
                    heard.clear();
                    put(&self.at_partner, &telegram.characters().unwrap());
                }
            }
        }
    }

    /// Sends a command with a rising edge, and waits for its end.
    fn command(&mut self, input: impl Fn(&mut SERIAL_USS) -> &mut bool) {
        *input(&mut self.block) = true;
        self.run(self.interval);
        *input(&mut self.block) = false;
        self.run(self.interval);
        for _ in 0..1_000 {
            if !self.block.x_BUSY {
                return;
            }
            self.run(10_000);
        }
        panic!("{:?}", self.block);
    }

    /// Sends a parameter request. Returns code and words of the answer.
    fn ask(&mut self, address: u8, task: u8, number: u16, index: u8, values: &[u16]) -> (u8, Vec<u16>) {
        (self.block.us_ADDRESS, self.block.b_TASK) = (address, task);
        (self.block.u_NUMBER, self.block.us_INDEX) = (number, index);
        self.values[..values.len()].copy_from_slice(values);
        self.block.u_VALUES = values.len() as u16;
        self.command(|block| &mut block.x_REQUEST);
        (self.block.b_REPLY, self.reply[..usize::from(self.block.u_REPLY)].to_vec())
    }

    fn set(&mut self, address: usize, words: &[u16]) {
        self.setpoints[16 * address..][..words.len()].copy_from_slice(words);
    }

    fn parameter(&self, drive: usize, number: u16) -> i64 {
        drive_parameter(&self.plant, drive, number)
    }

    fn fault(&mut self, kind: &str, words: &[&str]) {
        add_fault(&mut self.plant, kind, words);
    }
}

const PUMP: u32 = 1 << 3;
const FAN: u32 = 1 << 31;

/// Also with an event task that is slower than a telegram, and slower than the silence between two telegrams.
#[test]
fn drives_follow_their_setpoints() {
    for interval in [500, 1_000, 5_000, 20_000] {
        let mut bench = Bench::new(DRIVES, PUMP | FAN, (4, 3));
        bench.interval = interval;
        for word in [0x0006, 0x0007, 0x000F] {
            bench.set(3, &[word, 0x0001, 0x2345]);
            bench.set(31, &[word, 0xFFFF, 0xFFFE]);
            bench.run(300_000);
        }
        assert_eq!(bench.block.d_PRESENT, PUMP | FAN, "{interval}");
        let speeds = [0, 1].map(|drive| bench.plant.drive(drive).unwrap().state.speed_actual);
        assert_eq!(speeds, [0x12345, -2], "{interval}");
        let shown = |address: usize| bench.actual[16 * address + 1..][..2].to_vec();
        assert_eq!([shown(3), shown(31)], [[0x0001, 0x2345], [0xFFFF, 0xFFFE]]);
        assert_eq!((bench.actual[48] & 0x006F, bench.block.u_FAULTS), (0x0027, 0), "{interval}");
        assert_eq!(bench.ask(3, 2, 2010, 0, &[55]), (1, vec![0, 55]));
        assert_eq!((bench.block.d_REPLY, bench.parameter(0, 2010)), (55, 55));
    }
}

/// Each code of a request and its answer, with a channel of four words.
#[test]
fn all_requests_get_their_answers() {
    let table = || {
        let limited = Parameter::new(1, ParameterType::Unsigned16, 5.0).within(0.0, 100.0);
        let double = Parameter::new(2, ParameterType::Integer32, -2.0);
        let words = Parameter::array(31_999, ParameterType::Unsigned16, &[1.0, 2.0]);
        let doubles = Parameter::array(2_000, ParameterType::Unsigned32, &[65_536.0, 7.0]);
        Parameters::new([limited, double, words, doubles]).unwrap()
    };
    let timing = Timing::new(19_200);
    let layout = Layout::new(PkwWidth::Four, 2).unwrap();
    let mut bench = Bench::new("", 1 << 17, (4, 2));
    bench.partner = Partner::Slave(Slave::new(17, timing, layout, table()).unwrap());
    for (task, number, index, values, code, reply) in [
        (1, 1, 0, &[][..], 1, [0, 5]),
        (1, 2, 0, &[], 2, [0xFFFF, 0xFFFE]),
        (2, 1, 0, &[9], 1, [0, 9]),
        (2, 1, 0, &[101], 7, [0, 2]),
        (3, 2, 0, &[1, 2], 2, [1, 2]),
        (4, 1, 8, &[], 3, [0, 100]),
        (4, 31_999, 1, &[], 3, [0, 0x4006]),
        (5, 1, 8, &[50], 7, [0, 7]),
        (6, 31_999, 1, &[], 4, [0, 2]),
        (6, 2_000, 0, &[], 5, [1, 0]),
        (7, 31_999, 1, &[8], 4, [0, 8]),
        (8, 2_000, 1, &[3, 4], 5, [3, 4]),
        (9, 2_000, 0, &[], 6, [0, 2]),
        (10, 1, 0, &[], 7, [0, 18]),
        (11, 2_000, 1, &[5, 6], 5, [5, 6]),
        (12, 31_999, 0, &[4], 4, [0, 4]),
        (13, 2, 0, &[0, 1], 2, [0, 1]),
        (14, 1, 0, &[6], 1, [0, 6]),
        (15, 1, 0, &[], 7, [0, 15]),
        (1, 3, 0, &[], 7, [0, 0]),
    ] {
        let answer = bench.ask(17, task, number, index, values);
        assert_eq!(answer, (code, reply.to_vec()), "request {task} for {number}");
        assert!(bench.block.x_DONE && bench.block.b_ERR == 0, "{:?}", bench.block);
    }
    if let Partner::Slave(slave) = &mut bench.partner {
        slave.parameters_mut().lock(true);
    }
    assert_eq!(bench.ask(17, 2, 1, 0, &[1]).0, 8, "no right to change parameters");
    // A variable channel has room for all elements of an array.
    let layout = Layout::new(PkwWidth::Variable, 2).unwrap();
    let mut bench = Bench::new("", 1 << 17, (127, 2));
    bench.partner = Partner::Slave(Slave::new(17, timing, layout, table()).unwrap());
    assert_eq!(bench.ask(17, 6, 2_000, 255, &[]), (5, vec![1, 0, 0, 7]));
    assert_eq!(bench.ask(17, 1, 1, 0, &[]), (1, vec![5]));
    let layout = Layout::new(PkwWidth::Three, 2).unwrap();
    let mut bench = Bench::new("", 1 << 17, (3, 2));
    bench.partner = Partner::Slave(Slave::new(17, timing, layout, table()).unwrap());
    assert_eq!(bench.ask(17, 2, 1, 0, &[77]), (1, vec![77]));
}

/// Changes that a slave reports without a request, and a text.
#[test]
fn reports_and_texts() {
    let layout = Layout::new(PkwWidth::Four, 1).unwrap();
    let answer =
        |pkw: &Pkw| Telegram { address: Address::of_station(2), data: layout.data(pkw, &[7]).unwrap() };
    for (code, is_report) in [(9, false), (10, false), (11, false), (12, false), (1, true)] {
        let report = Pkw { code, number: 4001, index: 5, is_report, values: vec![1, 2] };
        let mut bench = Bench::new("", 1 << 2, (4, 1));
        bench.partner = Partner::Answers(Vec::new(), answer(&report));
        bench.run(100_000);
        let block = &bench.block;
        assert!(block.u_REPORTS > 0 && block.u_FAULTS == 0, "{block:?}");
        assert_eq!((block.b_REPORT, block.us_REPORT, block.u_REPORT), (code, 2, 4001));
        assert_eq!((block.us_REPORT_INDEX, block.d_REPORT, bench.actual[32]), (5, 0x1_0002, 7));
        // A report is not the answer to a request, which is given up after 100 exchanges.
        assert_eq!(bench.ask(2, 1, 4001, 5, &[]), (0, vec![]));
        assert_eq!((bench.block.b_ERR, bench.block.x_DONE), (5, false));
    }
    let text = Pkw { code: 15, number: 1, index: 0, is_report: false, values: vec![0x4142, 0x4344] };
    let mut bench = Bench::new("", 1 << 2, (4, 1));
    bench.partner = Partner::Answers(Vec::new(), answer(&text));
    assert_eq!(bench.ask(2, 15, 1, 0, &[]), (15, vec![0x4142, 0x4344]));
}

#[test]
fn broadcasts_and_mirror_telegrams() {
    let mut bench = Bench::new(DRIVES, PUMP | FAN, (4, 3));
    bench.run(200_000);
    // The setpoints of a broadcast are those of the row of `us_ADDRESS`.
    bench.set(9, &[0x0006, 0, 0]);
    (bench.block.us_ADDRESS, bench.block.b_TASK, bench.block.u_NUMBER) = (9, 3, 306);
    (bench.values[0], bench.values[1], bench.block.u_VALUES) = (1, 2, 2);
    bench.command(|block| &mut block.x_BROADCAST);
    assert_eq!((bench.block.x_DONE, bench.block.b_ERR), (true, 0));
    bench.run(200_000);
    assert_eq!([bench.parameter(0, 306), bench.parameter(1, 306)], [0x1_0002; 2]);
    bench.block.us_ADDRESS = 31;
    bench.set(31, &[0x1234, 0x5678, 0x9ABC]);
    bench.command(|block| &mut block.x_MIRROR);
    assert_eq!((bench.block.x_DONE, bench.block.b_ERR, bench.block.u_FAULTS), (true, 0, 0));
}

#[test]
fn errors_of_commands_have_numbers() {
    let mut bench = Bench::new(DRIVES, PUMP, (4, 3));
    bench.run(100_000);
    for (address, task, number, values, error) in [
        (31, 1, 1, &[][..], 1),
        (200, 1, 1, &[], 1),
        (3, 0, 1, &[], 3),
        (3, 16, 1, &[], 3),
        (3, 1, 32_000, &[], 3),
        (3, 3, 1, &[1, 2, 3], 4),
    ] {
        bench.ask(address, task, number, 0, values);
        assert_eq!((bench.block.b_ERR, bench.block.x_DONE, bench.block.x_BUSY), (error, false, false));
    }
    bench.block.us_ADDRESS = 31;
    bench.command(|block| &mut block.x_MIRROR);
    assert_eq!(bench.block.b_ERR, 1);
    bench.block.us_PZD = 17;
    bench.run(1_000);
    assert_eq!((bench.block.b_ERR, bench.block.d_PRESENT), (6, 0));
    let mut bench = Bench::new("", PUMP, (0, 3));
    bench.ask(3, 1, 1, 0, &[]);
    assert_eq!(bench.block.b_ERR, 2);
}

/// Faults of the line: the drive is lost after three exchanges, and its request is given up.
#[test]
fn faults_of_exchanges_have_numbers() {
    let mut bench = Bench::new(DRIVES, PUMP | FAN, (4, 3));
    bench.run(300_000);
    bench.fault("silent_drive", &["address=3"]);
    bench.run(500_000);
    assert_eq!((bench.block.d_PRESENT, bench.block.b_FAULT, bench.block.us_FAULT), (FAN, 1, 3));
    bench.ask(3, 1, 300, 0, &[]);
    assert_eq!((bench.block.b_ERR, bench.block.x_DONE), (5, false));
    bench.block.us_ADDRESS = 3;
    bench.command(|block| &mut block.x_MIRROR);
    assert_eq!(bench.block.b_ERR, 5);
    assert_eq!(bench.block.d_PRESENT, FAN);

    let mut bench = Bench::new(DRIVES, FAN, (4, 3));
    bench.run(100_000);
    bench.fault("garble_character", &["sender=partner", "count=1"]);
    bench.run(200_000);
    assert_eq!(
        (bench.block.b_FAULT, bench.block.us_FAULT, bench.block.u_FAULTS),
        (1, 31, 1),
        "a damaged STX"
    );
    // A drive with another layout, and a longer delay than the block permits.
    let mut bench = Bench::new(DRIVES, PUMP, (4, 2));
    bench.run(100_000);
    assert_eq!((bench.block.b_FAULT, bench.block.d_PRESENT), (1, 0), "the drive ignores the length");
    let mut bench = Bench::new(DRIVES, FAN, (4, 3));
    bench.block.us_DELAY = 5;
    bench.run(200_000);
    assert_eq!((bench.block.b_FAULT, bench.block.d_PRESENT), (1, 0));
    for (telegram, fault) in [
        (Telegram { address: Address::of_station(4), data: vec![0; 14] }, 3),
        (Telegram { address: Address::of_station(3), data: vec![0; 13] }, 4),
    ] {
        let mut bench = Bench::new("", PUMP, (4, 3));
        bench.partner = Partner::Answers(Vec::new(), telegram);
        bench.run(100_000);
        assert_eq!((bench.block.b_FAULT, bench.block.d_PRESENT), (fault, 0));
    }
    // A partner that returns a changed mirror telegram.
    let mut bench = Bench::new("", PUMP, (4, 3));
    let changed = Telegram { address: Address::of_station(3).mirror(), data: vec![1; 14] };
    bench.partner = Partner::Answers(Vec::new(), changed);
    bench.block.us_ADDRESS = 3;
    bench.command(|block| &mut block.x_MIRROR);
    assert_eq!((bench.block.b_FAULT, bench.block.b_ERR), (5, 5));
}

/// FALSE at `x_EN` clears the outputs. Other slaves begin a new exchange.
#[test]
fn the_exchange_begins_anew() {
    let mut bench = Bench::new(DRIVES, PUMP, (4, 3));
    bench.run(100_000);
    assert_eq!(bench.block.d_PRESENT, PUMP);
    bench.block.d_SLAVES = FAN;
    bench.run(1_000);
    assert_eq!(bench.block.d_PRESENT, 0);
    bench.run(200_000);
    assert_eq!(bench.block.d_PRESENT, FAN);
    bench.block.x_EN = false;
    bench.run(1_000);
    assert_eq!((bench.block.d_PRESENT, bench.block.u_FAULTS), (0, 0));
    bench.block.x_EN = true;
    bench.run(200_000);
    assert_eq!(bench.block.d_PRESENT, FAN);
}
