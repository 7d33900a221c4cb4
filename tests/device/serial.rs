//! Serial lines: characters between RS485 ports and guests, their times, errors and faults.

use crate::rig::{add_fault, plant_of};
use commram::devices::omega_drive_line_2::registers::values::{
    serial_control, serial_parity, serial_received, serial_resistors, serial_status, serial_transmitted,
};
use commram::devices::omega_drive_line_2::registers::{SERIAL, SERIAL_BMSTRUCT};
use commram::devices::{Power, catalogue};
use commram::identity::{BusIndex, DeviceIndex};
use commram::journal::Format;
use commram::journal::text::Text;
use commram::memory::View;
use commram::plant::Plant;

/// The only bus of the plants.
const LINE: BusIndex = BusIndex(0);

/// Returns a plant with PLCs `a`, `b` ... on a line.
fn plant(plcs: usize, line: &str) -> Plant {
    let mut text = String::new();
    for name in ["a", "b", "c"].iter().take(plcs) {
        text += &format!("[[plc]]\nname = '{name}'\nserial = 'rs485'\n");
    }
    plant_of(&format!("{text}[[bus]]\nname = 'rs485'\nkind = 'serial'\n{line}\n"))
}

/// The port of a PLC, as its program uses it.
struct Port(View<SERIAL_BMSTRUCT>);

impl Port {
    fn of(plant: &Plant, device: usize) -> Self {
        Port(plant.devices()[device].segment().view(SERIAL).unwrap())
    }

    /// Writes 8 data bits, even parity and one stop bit, and switches the port on.
    fn switch_on(&self, baud_rate: u16, wires: u8, resistors: u8) {
        self.0.u_BAUD_RATE.store(baud_rate);
        self.0.us_DATA_BITS.store(8);
        self.0.b_PARITY.store(serial_parity::EVEN);
        self.0.us_STOP_BITS.store(1);
        self.0.us_WIRES.store(wires);
        self.0.b_RESISTORS.store(resistors);
        self.0.w_CONTROL.store(serial_control::ON);
    }

    fn send(&self, characters: &[u16]) {
        let mut head = self.0.u_TX_HEAD.load();
        for character in characters {
            self.0.a_TX[usize::from(head % 256)].store(*character);
            head = head.wrapping_add(1);
        }
        self.0.u_TX_HEAD.store(head);
    }

    /// Takes the characters that have arrived.
    fn receive(&self) -> Vec<u16> {
        let (mut tail, head) = (self.0.u_RX_TAIL.load(), self.0.u_RX_HEAD.load());
        let mut characters = Vec::new();
        while tail != head {
            characters.push(self.0.a_RX[usize::from(tail % 256)].load());
            tail = tail.wrapping_add(1);
        }
        self.0.u_RX_TAIL.store(tail);
        characters
    }

    fn status(&self) -> u16 {
        self.0.w_STATUS.load()
    }
}

/// Returns a plant with two PLCs, whose ports are ready.
fn ready(wires: u8) -> (Plant, Port, Port) {
    let mut plant = plant(2, &format!("wires = {wires}\nterminators = 0"));
    let (a, b) = (Port::of(&plant, 0), Port::of(&plant, 1));
    plant.advance_to(1_000);
    let resistors = serial_resistors::PULL | serial_resistors::TERMINATION;
    a.switch_on(9600, wires, resistors);
    b.switch_on(9600, wires, resistors);
    plant.advance_to(2_000);
    assert_eq!([a.status(), b.status()], [serial_status::READY; 2]);
    (plant, a, b)
}

/// Returns the rules of the findings.
fn findings(plant: &Plant) -> Vec<&'static str> {
    plant.journal().findings().iter().map(|entry| entry.last.rule.id()).collect()
}

/// Returns the lines of the journal with one of these texts.
fn lines(plant: &Plant, wanted: &[&str]) -> Vec<String> {
    let mut text = Text::new(plant.names(), catalogue());
    let line = |record| {
        let mut line = String::new();
        text.record(&record, &mut line);
        line.trim().to_owned()
    };
    let lines = plant.journal().records().map(line);
    lines.filter(|line| wanted.iter().any(|wanted| line.contains(wanted))).collect()
}

/// A character at 9600 baud has 11 bits and takes 1145.8 us.
#[test]
fn characters_arrive_at_the_end_of_their_bits() {
    let (mut plant, a, b) = ready(4);
    a.send(&[0x02, 0x10, 0xFF]);
    let mut arrived = Vec::new();
    for us in 2_001..=8_000 {
        plant.advance_to(us);
        arrived.extend(b.receive().into_iter().map(|character| (us, character)));
    }
    // The firmware polls at 2500 us. The line counts in ticks of 1/38400 s, and tick 96 begins at 2500 us.
    assert_eq!(arrived, [(3_646, 0x02), (4_792, 0x10), (5_938, 0xFF)]);
    assert_eq!((a.0.u_TX_TAIL.load(), a.status()), (3, serial_status::READY));
    assert_eq!(lines(&plant, &[" octet"]), ["0.005938 s  rs485    3 octets 02 10 FF from a:serial"]);
    assert_eq!(findings(&plant), [""; 0]);
}

#[test]
fn four_wires_carry_both_directions_at_once() {
    let (mut plant, a, b) = ready(4);
    a.send(&[0x11, 0x12]);
    b.send(&[0x21]);
    plant.advance_to(10_000);
    assert_eq!((a.receive(), b.receive()), (vec![0x21], vec![0x11, 0x12]));
    assert_eq!(findings(&plant), [""; 0]);
}

/// 5.00005.03a p. 26: on two wires only one participant may send at a time.
#[test]
fn two_participants_on_two_wires_destroy_each_others_characters() {
    let mut plant = plant(3, "wires = 2\nterminators = 2\npull_resistors = true");
    let ports: Vec<_> = (0..3).map(|device| Port::of(&plant, device)).collect();
    ports.iter().for_each(|port| port.switch_on(9600, 2, 0));
    plant.advance_to(2_000);
    ports[0].send(&[0x41]);
    plant.advance_to(5_000);
    let received: Vec<_> = ports.iter().map(Port::receive).collect();
    assert_eq!(received, [vec![], vec![0x41], vec![0x41]], "nobody hears itself");
    assert_eq!(findings(&plant), [""; 0]);
    ports[0].send(&[0x42]);
    ports[1].send(&[0x43]);
    plant.advance_to(10_000);
    let received: Vec<_> = ports.iter().map(Port::receive).collect();
    let framing = serial_received::FRAMING;
    assert_eq!(received, [vec![], vec![], vec![framing, framing]]);
    assert_eq!(findings(&plant), ["serial-collision"; 2], "one for each PLC");
    let errors = lines(&plant, &["destroyed by a collision"]);
    assert!(errors.len() == 2 && errors[0].contains("destroyed by a collision from a:serial"), "{errors:?}");
}

/// A port that is set to four wires never releases the only pair.
#[test]
fn a_port_for_four_wires_blocks_a_line_with_two() {
    let mut plant = plant(3, "wires = 2\nterminators = 2\npull_resistors = true");
    let ports: Vec<_> = (0..3).map(|device| Port::of(&plant, device)).collect();
    ports.iter().zip([2, 4, 2]).for_each(|(port, wires)| port.switch_on(9600, wires, 0));
    plant.advance_to(2_000);
    ports[0].send(&[0x41]);
    plant.advance_to(5_000);
    assert_eq!(ports[2].receive(), [serial_received::FRAMING]);
    ports[1].send(&[0x42]);
    plant.advance_to(10_000);
    assert_eq!(ports[2].receive(), [0x42]);
    assert_eq!(findings(&plant), ["serial-collision", "serial-wires"]);
}

#[test]
fn guests_send_and_receive_octets_with_the_settings_of_the_line() {
    let mut plant = plant(2, "wires = 4");
    let (a, b) = (Port::of(&plant, 0), Port::of(&plant, 1));
    a.switch_on(9600, 4, serial_resistors::TERMINATION);
    b.switch_on(9600, 4, 0);
    plant.advance_to(2_000);
    let text: Vec<u8> = (0..100).collect();
    plant.send_telegram(LINE, text.clone()).unwrap();
    plant.advance_to(200_000);
    assert_eq!(a.receive(), text.iter().copied().map(u16::from).collect::<Vec<_>>());
    assert_eq!(b.receive(), [0; 0], "only the first port hears the others");
    let [line] = &lines(&plant, &[" octet"])[..] else { panic!("one record for all octets") };
    assert!(line.contains("100 octets 00 01 02 03 04 05") && line.contains(" 63 from guest0"), "{line}");
    assert_eq!(findings(&plant), [""; 0]);
}

#[test]
fn settings_that_the_port_does_not_have_are_refused() {
    let mut plant = plant(1, "wires = 4");
    let port = Port::of(&plant, 0);
    let mut now = 1_000;
    let mut try_settings = |change: fn(&SERIAL_BMSTRUCT)| {
        port.0.w_CONTROL.store(0);
        plant.advance_to(now);
        port.switch_on(9600, 4, 0);
        change(&port.0);
        plant.advance_to(now + 1_000);
        now += 2_000;
        port.status()
    };
    assert_eq!(try_settings(|_| {}), serial_status::READY);
    assert_eq!(try_settings(|port| port.u_BAUD_RATE.store(9601)), serial_status::REFUSED);
    assert_eq!(try_settings(|port| port.us_DATA_BITS.store(9)), serial_status::REFUSED);
    assert_eq!(try_settings(|port| port.b_PARITY.store(3)), serial_status::REFUSED);
    assert_eq!(try_settings(|port| port.us_STOP_BITS.store(0)), serial_status::REFUSED);
    assert_eq!(try_settings(|port| port.us_WIRES.store(3)), serial_status::REFUSED);
    assert_eq!(try_settings(|port| port.u_BAUD_RATE.store(38_400)), serial_status::READY);
    assert_eq!(findings(&plant), ["serial-settings"]);
    let news = lines(&plant, &[" ready: ", " off", "refuses"]);
    assert!(
        news[0].ends_with("ready: 9600 baud, 8 data bits, parity even, 1 stop bit, 4 wires, resistors 16#00")
    );
    assert!(news[1].ends_with("off") && news[2].contains("refuses the settings: 9601 baud"), "{news:?}");
}

/// A port with another format than the line receives errors, and is not understood.
#[test]
fn other_settings_than_those_of_the_line_give_errors() {
    for (change, error, rules) in [
        (
            (|port: &SERIAL_BMSTRUCT| port.b_PARITY.store(serial_parity::ODD)) as fn(&SERIAL_BMSTRUCT),
            serial_received::PARITY | 0x41,
            ["serial-format"],
        ),
        (|port| port.u_BAUD_RATE.store(19_200), serial_received::FRAMING, ["serial-format"]),
        (|port| port.us_STOP_BITS.store(2), 0x41, ["serial-format"]),
    ] {
        let mut plant = plant(1, "wires = 4");
        let port = Port::of(&plant, 0);
        port.switch_on(9600, 4, serial_resistors::TERMINATION);
        change(&port.0);
        plant.advance_to(2_000);
        port.send(&[0x55]);
        plant.send_telegram(LINE, vec![0x41]).unwrap();
        plant.advance_to(10_000);
        assert_eq!((port.receive(), findings(&plant)), (vec![error], rules.to_vec()));
    }
}

/// 5.00005.03a p. 25-26: two terminating resistors, and a potential on a line that no participant drives.
#[test]
fn wrong_resistors_are_found_when_a_port_begins_to_send() {
    let (pull, termination) = (serial_resistors::PULL, serial_resistors::TERMINATION);
    for (line, wires, resistors, rules) in [
        ("wires = 2", 2, pull | termination, &[][..]),
        ("wires = 2", 2, pull, &["serial-termination"]),
        ("wires = 2\nterminators = 2", 2, pull | termination, &["serial-termination"]),
        ("wires = 2", 2, termination, &["serial-pull"]),
        ("wires = 2\npull_resistors = true", 2, termination, &[]),
        ("wires = 4", 4, termination, &[]),
        ("wires = 4", 4, 0, &["serial-termination"]),
    ] {
        let mut plant = plant(1, line);
        let port = Port::of(&plant, 0);
        port.switch_on(9600, wires, resistors);
        plant.advance_to(2_000);
        assert_eq!(findings(&plant), [""; 0], "{line}");
        port.send(&[1, 2, 3]);
        plant.advance_to(20_000);
        assert_eq!(findings(&plant), rules, "{line}, {resistors}");
        assert!(plant.journal().findings().iter().all(|entry| entry.count == 1), "{line}");
    }
}

#[test]
fn characters_without_room_are_lost_and_the_next_one_reports_the_loss() {
    let (mut plant, a, b) = ready(4);
    let all: Vec<u16> = (0..256).collect();
    a.send(&all);
    plant.advance_to(400_000);
    a.send(&[1, 2]);
    plant.advance_to(500_000);
    assert_eq!(b.status(), serial_status::READY | serial_status::OVERRUN);
    assert_eq!(lines(&plant, &["a_RX is full"]).len(), 2);
    assert_eq!(b.receive(), all);
    a.send(&[7, 8]);
    plant.advance_to(600_000);
    assert_eq!(b.receive(), [7 | serial_received::OVERRUN, 8]);
}

#[test]
fn a_ring_with_too_many_characters_is_discarded() {
    let (mut plant, a, b) = ready(4);
    a.0.u_TX_HEAD.store(257);
    plant.advance_to(10_000);
    assert_eq!((findings(&plant), a.0.u_TX_TAIL.load(), b.receive()), (vec!["serial-ring"], 257, vec![]));
    a.send(&[5]);
    plant.advance_to(20_000);
    assert_eq!(b.receive(), [5]);
}

#[test]
fn a_count_of_characters_that_have_not_arrived_is_found() {
    let (mut plant, a, b) = ready(4);
    b.0.u_RX_TAIL.store(1);
    a.send(&[5]);
    plant.advance_to(10_000);
    assert_eq!(
        (findings(&plant), b.status()),
        (vec!["serial-ring"], serial_status::READY | serial_status::OVERRUN)
    );
    b.0.u_RX_TAIL.store(0);
    a.send(&[6]);
    plant.advance_to(20_000);
    assert_eq!(b.receive(), [6 | serial_received::OVERRUN]);
}

#[test]
fn a_port_makes_and_receives_breaks() {
    let (mut plant, a, b) = ready(4);
    a.send(&[0x41, serial_transmitted::BREAK, 0x42]);
    plant.advance_to(10_000);
    assert_eq!(b.receive(), [0x41, serial_received::BREAK, 0x42]);
    let lines = lines(&plant, &[" octet", " break from"]);
    assert!(lines.len() == 3 && lines[1].ends_with("break from a:serial"), "{lines:?}");
}

/// The counters pass 65535 without a loss.
#[test]
fn counters_begin_again_after_65535() {
    let (mut plant, a, b) = ready(4);
    let mut now = plant.now();
    for round in 0..330_u32 {
        let part: Vec<u16> = (0..200).map(|index| (round * 200 + index) as u16 & 0xFF).collect();
        a.send(&part);
        now += 250_000;
        plant.advance_to(now);
        assert_eq!(b.receive(), part, "{round}");
    }
    assert_eq!(a.0.u_TX_TAIL.load(), (330_u32 * 200) as u16);
}

#[test]
fn a_device_without_power_is_silent_and_loses_its_settings() {
    let (mut plant, a, b) = ready(4);
    a.send(&[1, 2, 3]);
    plant.advance_to(4_000);
    plant.set_power(DeviceIndex(0), Power::Off);
    plant.advance_to(20_000);
    assert_eq!(b.receive(), [1, serial_received::FRAMING], "the second character is cut off");
    assert_eq!((a.status(), a.0.u_TX_TAIL.load(), a.0.u_BAUD_RATE.load()), (0, 0, 0));
    plant.set_power(DeviceIndex(0), Power::On);
    plant.advance_to(30_000);
    b.send(&[4]);
    plant.advance_to(40_000);
    assert_eq!(a.receive(), [0; 0], "the port is off");
}

/// Without a line the program finds a port that works, but no partner.
#[test]
fn a_port_without_a_line_takes_its_characters_at_once() {
    let mut plant = plant_of("[[plc]]\nname = 'a'\n[[plc]]\nname = 'b'\n");
    let (a, b) = (Port::of(&plant, 0), Port::of(&plant, 1));
    a.switch_on(9600, 4, 0);
    b.switch_on(9600, 4, 0);
    plant.advance_to(2_000);
    a.send(&[1, 2, 3]);
    plant.advance_to(3_000);
    assert_eq!((a.0.u_TX_TAIL.load(), a.status(), b.receive()), (3, serial_status::READY, vec![]));
    assert_eq!(findings(&plant), [""; 0]);
}

/// The owner of a counter is the port.
#[test]
fn a_program_that_writes_the_counters_of_the_port_is_found() {
    let (mut plant, a, b) = ready(4);
    a.0.u_RX_HEAD.store(100);
    plant.advance_to(3_000);
    assert_eq!(findings(&plant), ["owner"]);
    b.send(&[0x33]);
    plant.advance_to(10_000);
    assert_eq!((a.0.u_RX_HEAD.load(), a.0.a_RX[0].load()), (1, 0x33), "the port has its own counter");
}

/// Runs both directions with one fault, and returns the characters that `b` and `a` receive.
fn disturbed(kind: &str, words: &[&str]) -> (Plant, [Vec<u16>; 2]) {
    let (mut plant, a, b) = ready(4);
    add_fault(&mut plant, kind, words);
    plant.advance_to(2_400);
    a.send(&[0x41, 0x42, 0x42]);
    b.send(&[0x51]);
    plant.send_telegram(LINE, vec![0x60]).unwrap();
    plant.advance_to(60_000);
    let received = [b.receive(), a.receive()];
    (plant, received)
}

#[test]
fn faults_disturb_characters() {
    let parity = serial_received::PARITY;
    let collided = [serial_received::FRAMING; 2];
    for (kind, words, of_a, of_others) in [
        ("lose_character", &["octet=16#42", "count=1"][..], &[0x41, 0x42][..], &collided[..]),
        ("lose_character", &["sender=partner", "duration_us=50000"], &[0x41, 0x42, 0x42], &[0x51]),
        ("garble_character", &["octet=16#41", "count=1"], &[0x40 | parity, 0x42, 0x42], &collided),
        (
            "delay_character",
            &["octet=16#51", "delay_us=20000", "count=1"],
            &[0x41, 0x42, 0x42],
            &[0x60, 0x51],
        ),
        ("silent_participant", &["sender=port", "duration_us=50000"], &[], &[0x60]),
    ] {
        let (plant, [to_b, to_a]) = disturbed(kind, words);
        assert_eq!((&to_b[..], &to_a[..]), (of_a, of_others), "{kind} {words:?}");
        assert_eq!(plant.faults().count(), 0, "{kind} is over");
    }
}

#[test]
fn a_break_on_the_line_reaches_all_participants() {
    let (plant, [to_b, to_a]) = disturbed("line_break", &["length_us=20000", "at_us=30000"]);
    let of_break = [serial_received::BREAK];
    assert_eq!((&to_b[3..], &to_a[2..]), (&of_break[..], &of_break[..]));
    assert_eq!(plant.faults().count(), 0);
}

/// A snapshot in the middle of characters, with a waiting guest and an acting fault, continues like the plant.
#[test]
fn a_restored_line_continues_like_the_original() {
    let (mut plant, a, b) = ready(4);
    add_fault(&mut plant, "garble_character", &["octet=16#03", "count=1"]);
    a.send(&[1, 2, 3, 4]);
    plant.send_telegram(LINE, vec![5, 6, 7]).unwrap();
    plant.advance_to(4_000);
    let snapshot = plant.snapshot();
    let mut other = self::plant(2, "wires = 4\nterminators = 0");
    assert_eq!(other.restore(&snapshot), Ok(()));
    assert!(other.snapshot() == snapshot);
    for plant in [&mut plant, &mut other] {
        plant.advance_to(20_000);
    }
    assert_eq!(plant.journal().hash(), other.journal().hash());
    assert!(plant.snapshot() == other.snapshot());
    let received = [a.receive(), b.receive()];
    assert_eq!(received, [vec![5, 6, 7], vec![1, 2, 2 | serial_received::PARITY, 4]]);
    assert_eq!([Port::of(&other, 0).receive(), Port::of(&other, 1).receive()], received);
    assert_eq!(plant.go_back(&snapshot), Ok(()));
    plant.advance_to(20_000);
    assert_eq!(plant.journal().hash(), other.journal().hash());
}
