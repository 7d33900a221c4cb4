//! Drives on a serial line: slaves of the protocol USS. The program of a PLC is the master, through the port of the PLC.

use crate::rig::{add_fault, drive_parameter, plant_of};
use commram::devices::omega_drive_line_2::registers::values::{serial_control, serial_parity};
use commram::devices::omega_drive_line_2::registers::{SERIAL, SERIAL_BMSTRUCT};
use commram::devices::{ParameterRefusal, catalogue};
use commram::journal::Format;
use commram::journal::text::Text;
use commram::memory::View;
use commram::plant::{Plant, PlantConfig};
use commram::serial::Character;
use commram::serial::uss::{
    Layout, Master, MasterEvent, PkwWidth, Refusal, ReplyCode, Request, Station, StationFault, Timing,
};

const PLANT: &str = "\
[[plc]]
name = 'line'
serial = 'rs485'
[[bus]]
name = 'rs485'
kind = 'serial'
wires = 2
baud_rate = 38400
[[bus.drive]]
name = 'pump'
address = 3
pzd_words = 3
parameters = [
    { number = 400, format = 'word', initial = 7, min = -5, max = 100, settle_us = 50000 },
    { number = 401, format = 'doubleword', initial = 70000, read_only = true },
    { number = 402, format = 'doubleword', max = 100000 },
]
telegram_monitoring = { time_us = 200000, reaction = 'quick_stop' }
[[bus.drive]]
name = 'fan'
address = 12
pzd_words = 3
enable = 'at_power_on'
response_delay_us = 5000
";

/// A plant, and a program with a master of USS.
struct Bench {
    plant: Plant,
    port: View<SERIAL_BMSTRUCT>,
    master: Master,
}

impl Bench {
    fn new() -> Self {
        Bench::of(PLANT, Layout::new(PkwWidth::Four, 3).unwrap(), &[3, 12])
    }

    fn of(text: &str, layout: Layout, addresses: &[u8]) -> Self {
        let mut plant = plant_of(text);
        let port: View<SERIAL_BMSTRUCT> = plant.devices()[0].segment().view(SERIAL).unwrap();
        port.u_BAUD_RATE.store(38_400);
        port.us_DATA_BITS.store(8);
        port.b_PARITY.store(serial_parity::EVEN);
        port.us_STOP_BITS.store(1);
        port.us_WIRES.store(2);
        port.w_CONTROL.store(serial_control::ON);
        plant.advance_to(1_000);
        let stations = addresses.iter().map(|address| Station { address: *address, layout });
        let master = Master::new(Timing::new(38_400), stations).unwrap();
        Bench { plant, port, master }
    }

    /// Runs a cycle of the program every 250 us.
    fn run(&mut self, us: u64) {
        let end = self.plant.now() + us;
        while self.plant.now() < end {
            let now = self.plant.now() + 250;
            self.plant.advance_to(now);
            let (mut tail, head) = (self.port.u_RX_TAIL.load(), self.port.u_RX_HEAD.load());
            while tail != head {
                let octet = (self.port.a_RX[usize::from(tail % 256)].load() & 0xFF) as u8;
                self.master.received(now, Character::Byte(octet));
                tail = tail.wrapping_add(1);
            }
            self.port.u_RX_TAIL.store(tail);
            let mut head = self.port.u_TX_HEAD.load();
            for octet in self.master.poll(now) {
                self.port.a_TX[usize::from(head % 256)].store(octet.into());
                head = head.wrapping_add(1);
            }
            self.port.u_TX_HEAD.store(head);
        }
    }

    /// Returns code and values of the answer to a request.
    fn ask(&mut self, address: u8, request: Request) -> (u8, Vec<u16>) {
        self.master.request(address, request).unwrap();
        for _ in 0..100 {
            self.run(10_000);
            if let Some(event) = self.master.next_event() {
                let MasterEvent::Answered { address: from, reply } = event else { panic!("{event:?}") };
                assert_eq!(from, address);
                return (reply.code, reply.values);
            }
        }
        panic!("no answer");
    }

    fn state(&self, drive: usize) -> String {
        self.plant.drive(drive).unwrap().state.state
    }

    fn parameter(&self, drive: usize, number: u16) -> i64 {
        drive_parameter(&self.plant, drive, number)
    }

    fn fault(&mut self, kind: &str, words: &[&str]) {
        add_fault(&mut self.plant, kind, words);
    }

    fn events(&mut self) -> Vec<MasterEvent> {
        core::iter::from_fn(|| self.master.next_event()).collect()
    }
}

fn refused(refusal: Refusal) -> (u8, Vec<u16>) {
    (ReplyCode::Refused as u8, vec![0, refusal as u16])
}

#[test]
fn process_data_move_the_drive_and_show_its_state() {
    let mut bench = Bench::new();
    assert_eq!(bench.state(0), "switch_on_disabled");
    for word in [0x0006, 0x0007, 0x000F] {
        bench.master.set_setpoints(3, &[word, 0x0001, 0x2345]).unwrap();
        bench.run(60_000);
    }
    assert_eq!((bench.state(0).as_str(), bench.parameter(0, 300)), ("operation_enabled", 0x12345));
    let shown = bench.master.actual(3).unwrap().to_vec();
    assert_eq!((shown[0] & 0x006F, &shown[1..]), (0x0027, &[0x0001, 0x2345][..]));
    let details = bench.plant.drive(0).unwrap();
    assert_eq!((details.state.number, details.state.speed_actual), (Some(3), 0x12345));
    assert!(bench.plant.shaft(0).unwrap().is_fed);
    assert_eq!(bench.events(), []);
    // The other drive follows its own setpoints, with a longer response delay.
    for word in [0x0006, 0x000F] {
        bench.master.set_setpoints(12, &[word, 0xFFFF, 0xFFFE]).unwrap();
        bench.run(60_000);
    }
    assert_eq!(bench.plant.drive(1).unwrap().state.speed_actual, -2);
    assert_eq!(bench.master.actual(12).unwrap()[1..], [0xFFFF, 0xFFFE]);
}

/// With two words of process data, the second word is the upper word of the speed.
#[test]
fn two_words_carry_the_upper_word_of_the_speed() {
    let text = PLANT.replace("pzd_words = 3", "ppo = 3");
    let mut bench = Bench::of(&text, Layout::ppo(3).unwrap(), &[12]);
    bench.master.set_setpoints(12, &[0x000F, 0x0005]).unwrap();
    bench.run(60_000);
    assert_eq!(bench.parameter(1, 300), 0x0005_0000);
    assert_eq!(bench.master.actual(12).unwrap()[1], 0x0005);
}

#[test]
fn the_parameter_channel_reaches_the_parameters() {
    let mut bench = Bench::new();
    assert_eq!(bench.ask(3, Request::read(400)), (ReplyCode::Word as u8, vec![0, 7]));
    assert_eq!(bench.ask(3, Request::write_word(400, 0xFFFB)), (ReplyCode::Word as u8, vec![0, 0xFFFB]));
    assert_eq!(bench.parameter(0, 400), -5);
    assert_eq!(bench.ask(3, Request::read(400)), refused(Refusal::State), "in recalculation");
    bench.run(60_000);
    assert_eq!(bench.ask(3, Request::write_word(400, 101)), refused(Refusal::Limit));
    assert_eq!(bench.ask(3, Request::write_double(400, 1)), refused(Refusal::Type));
    assert_eq!(bench.ask(3, Request::read(401)), (ReplyCode::Double as u8, vec![1, 0x1170]));
    assert_eq!(bench.ask(3, Request::write_double(401, 1)), refused(Refusal::ReadOnly));
    let stored = Request::write_double(402, 99_999).stored();
    assert_eq!(bench.ask(3, stored), (ReplyCode::Double as u8, vec![1, 0x869F]));
    assert_eq!(bench.parameter(0, 402), 99_999);
    assert_eq!(bench.ask(3, Request::read(999)), refused(Refusal::Number));
    assert_eq!(bench.ask(3, Request::read_element(402, 1)), refused(Refusal::NoArray));
    let limit = |element| Request::read_description(400, element);
    assert_eq!(bench.ask(3, limit(7)), (ReplyCode::Description as u8, vec![0, 0xFFFB]));
    assert_eq!(bench.ask(3, limit(8)), (ReplyCode::Description as u8, vec![0, 100]));
    // A control word by the parameter channel acts like one of the process data, until the next process data.
    assert_eq!(bench.ask(12, Request::read(120)), (ReplyCode::Word as u8, vec![0, 0]));
    // By hand, as at the drive itself.
    assert_eq!(bench.plant.set_parameter(0, 402, 5), Some(Ok(())));
    let refusal = ParameterRefusal::Range { min: 0, max: 100_000 };
    assert_eq!(bench.plant.set_parameter(0, 402, 100_001), Some(Err(refusal)));
    assert_eq!(bench.ask(3, Request::read(402)), (ReplyCode::Double as u8, vec![0, 5]));
}

#[test]
fn broadcasts_and_mirror_telegrams() {
    let mut bench = Bench::new();
    bench.run(60_000);
    let layout = Layout::new(PkwWidth::Four, 3).unwrap();
    // The setpoints of the cycle follow the broadcast, so the broadcast changes a parameter.
    bench.plant.set_parameter(1, 306, 0).unwrap().unwrap();
    let request = Request::write_double(306, 1_000);
    bench.master.broadcast(layout, &request, &[0x0006, 0, 0]).unwrap();
    bench.master.mirror(3, b"any data, of any length").unwrap();
    bench.run(60_000);
    assert_eq!([bench.parameter(0, 306), bench.parameter(1, 306)], [1_000; 2]);
    assert_eq!(bench.events(), [MasterEvent::Mirrored(3)]);
}

/// The fault concerns one drive by its address. The drive notices that no telegrams come only if the master is silent.
#[test]
fn a_silent_drive_is_lost_and_returns() {
    let mut bench = Bench::new();
    bench.run(60_000);
    bench.fault("silent_drive", &["address=3", "duration=1s"]);
    bench.run(500_000);
    assert_eq!([3, 12].map(|address| bench.master.is_present(address).unwrap()), [false, true]);
    let events = bench.events();
    let silent = MasterEvent::Failed { address: 3, fault: StationFault::Silent };
    assert!(events.contains(&silent) && events.contains(&MasterEvent::Lost(3)), "{events:?}");
    bench.run(700_000);
    assert!(bench.master.is_present(3).unwrap());
    assert!(bench.events().contains(&MasterEvent::Returned(3)));
}

/// The monitoring of the drive reacts when the process data are missing.
#[test]
fn a_drive_without_telegrams_trips() {
    let mut bench = Bench::new();
    for word in [0x0006, 0x000F] {
        bench.master.set_setpoints(3, &[word, 0, 0]).unwrap();
        bench.run(60_000);
    }
    assert_eq!(bench.state(0), "operation_enabled");
    bench.fault("silent_participant", &["sender=port"]);
    bench.run(150_000);
    assert_eq!(bench.state(0), "operation_enabled");
    bench.run(100_000);
    assert_eq!((bench.state(0).as_str(), bench.plant.drive(0).unwrap().state.fault), ("fault", 503));
}

/// A snapshot within an answer: the restored plant continues with the same characters.
#[test]
fn snapshots_contain_the_drives() {
    let mut bench = Bench::new();
    for word in [0x0006, 0x000F] {
        bench.master.set_setpoints(3, &[word, 1, 0]).unwrap();
        bench.run(60_000);
    }
    for _ in 0..40 {
        bench.run(750);
        let snapshot = bench.plant.snapshot();
        let mut other = plant_of(PLANT);
        other.restore(&snapshot).unwrap();
        assert!(other.snapshot() == snapshot);
        assert_eq!(other.drive(0), bench.plant.drive(0));
        let end = bench.plant.now() + 30_000;
        bench.plant.advance_to(end);
        other.advance_to(end);
        assert!(other.snapshot() == bench.plant.snapshot());
        bench.plant.go_back(&snapshot).unwrap();
        assert!(bench.plant.snapshot() == snapshot);
    }
}

#[test]
fn the_journal_names_the_drive() {
    let mut bench = Bench::new();
    bench.run(60_000);
    bench.plant.set_parameter(0, 402, 5).unwrap().unwrap();
    let mut text = Text::new(bench.plant.names(), catalogue());
    let lines: Vec<String> = bench
        .plant
        .journal()
        .records()
        .map(|record| {
            let mut line = String::new();
            text.record(&record, &mut line);
            line
        })
        .collect();
    let has = |wanted: &str| lines.iter().any(|line| line.contains(wanted));
    assert!(has("18 octets 02 10 03") && has("from drive3") && has("from drive12"), "{lines:?}");
    assert!(has("drive 3: P402 set to 5 by hand"), "{lines:?}");
}

#[test]
fn wrong_settings_name_the_drive_and_the_key() {
    let error = |from: &str, to: &str| {
        let text = PLANT.replacen(from, to, 1);
        assert_ne!(text, PLANT);
        PlantConfig::parse("plant.toml", &text).err().unwrap().to_string()
    };
    for (from, to, right) in [
        ("address = 3", "address = 32", "address of 'pump' is 32; it must be 0 to 31"),
        ("address = 3", "address = 12", "pump"),
        ("name = 'fan'", "name = 'pump'", "'pump'"),
        ("pzd_words = 3", "pzd_words = 17", "17 words of process data; there may be 0 to 16"),
        ("pzd_words = 3", "pkw_words = 5", "pkw_words of 'pump' is 5; it must be 0, 3, 4 or 127"),
        ("pzd_words = 3", "ppo = 6", "there is no PPO type 6; the types are 1 to 5"),
        ("pzd_words = 3", "ppo = 1\npzd_words = 3", "leave pkw_words and pzd_words out"),
        ("pzd_words = 3", "setpoints = [121]", "setpoints has parameter 121, which cannot be written"),
        (
            "pzd_words = 3",
            "actual_values = [999]",
            "actual_values has parameter 999, which the drive does not",
        ),
        ("baud_rate = 38400", "parity = 'odd'", "USS needs characters with 8 data bits, even parity"),
        ("number = 401", "number = 121", "the drive has this parameter itself"),
        ("pzd_words = 3", "slave_number = 3", "unknown field `slave_number`"),
    ] {
        let error = error(from, to);
        assert!(error.contains(right), "{to}: {error}");
    }
}
