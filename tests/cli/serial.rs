//! Serial lines of the built program: external programs over TCP and over a pseudo-terminal, and Wireshark.

use crate::common::{Emulator, finish, is_there};
use serde_json::Value;
use std::fs::OpenOptions;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;

/// Maximum time for an answer, even on a slow machine.
const WATCHDOG: Duration = Duration::from_secs(60);

const PLANT: &str = r#"
[[plc]]
name = "line"
serial = "rs485"
[[bus]]
name = "rs485"
kind = "serial"
wires = 4
baud_rate = 38400
doors = ["serial-tcp:127.0.0.1:0", "serial-pty"]
"#;

fn start(args: &[&str]) -> Emulator {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), PLANT).unwrap();
    let emulator = Emulator::start(&[&[file.path().to_str().unwrap()], args].concat());
    emulator.poke(&[
        "serial.u_BAUD_RATE=38400",
        "serial.us_DATA_BITS=8",
        "serial.b_PARITY=2",
        "serial.us_STOP_BITS=1",
        "serial.us_WIRES=4",
        "serial.b_RESISTORS=2",
        "serial.w_CONTROL=1",
    ]);
    emulator.run("wait", &["serial.w_STATUS==1"]).ok();
    emulator
}

/// Returns the rest of the name of the door with this kind.
fn door(emulator: &Emulator, kind: &str) -> String {
    let buses: Value = serde_json::from_str(emulator.run("bus", &["list", "--format", "json"]).ok()).unwrap();
    let doors = buses[0]["doors"].as_array().unwrap().iter().filter_map(Value::as_str);
    doors.filter_map(|door| door.strip_prefix(kind)).next().unwrap().to_owned()
}

/// Sends two characters and takes two characters.
fn exchange(emulator: &Emulator, guest: &mut (impl Read + Write), round: u8) {
    let (head, sent) = (2 * u16::from(round), [0x10, round]);
    let words = [
        format!("serial.a_TX[{head}]={}", sent[0]),
        format!("serial.a_TX[{}]={}", head + 1, sent[1]),
        format!("serial.u_TX_HEAD={}", head + 2),
    ];
    emulator.poke(&words.each_ref().map(String::as_str));
    let mut heard = [0; 2];
    guest.read_exact(&mut heard).unwrap();
    assert_eq!(heard, sent);
    guest.write_all(&[0x02, 0xA0 + round]).unwrap();
    emulator.run("wait", &[&format!("serial.u_RX_HEAD=={}", head + 2)]).ok();
    let read = emulator.peek(&[&format!("serial.a_RX[{head}]"), &format!("serial.a_RX[{}]", head + 1)]);
    assert_eq!(read, format!("16#0002 16#00A{round}"));
}

#[test]
fn programs_exchange_octets_over_tcp_and_a_pseudo_terminal() {
    let emulator = start(&[]);
    let port: u16 = door(&emulator, "serial-tcp:127.0.0.1:").parse().unwrap();
    let mut over_tcp = TcpStream::connect(("127.0.0.1", port)).unwrap();
    over_tcp.set_read_timeout(Some(WATCHDOG)).unwrap();
    over_tcp.write_all(&[0x55]).unwrap();
    // The first octet shows that the guest takes part. The other rounds follow it in the rings.
    emulator.run("wait", &["serial.u_RX_HEAD==1"]).ok();
    emulator.poke(&["serial.u_RX_TAIL=1", "serial.a_TX[0]=16#42", "serial.u_TX_HEAD=1"]);
    let mut heard = [0];
    over_tcp.read_exact(&mut heard).unwrap();
    assert_eq!(heard, [0x42]);
    drop((over_tcp, emulator));

    let emulator = start(&[]);
    let path = door(&emulator, "serial-pty:");
    let mut over_pty = OpenOptions::new().read(true).write(true).open(path).unwrap();
    for round in 0..3 {
        exchange(&emulator, &mut over_pty, round);
    }
    let listed = emulator.run("bus", &["list"]);
    assert!(listed.ok().contains("rs485"), "{}", listed.out);
    emulator.run("check", &[]).ok();
}

#[test]
fn a_drive_on_a_line_has_its_name_in_the_list_of_buses() {
    let plant = tempfile::NamedTempFile::new().unwrap();
    let drive = "[[bus.drive]]\nname = 'pump'\naddress = 3\n";
    std::fs::write(plant.path(), format!("{PLANT}\n{drive}")).unwrap();
    let emulator = Emulator::start(&[plant.path().to_str().unwrap(), "--clock", "stepped"]);
    let buses: Value = serde_json::from_str(emulator.run("bus", &["list", "--format", "json"]).ok()).unwrap();
    let stations = buses[0]["stations"].as_array().unwrap().iter();
    let drive: Vec<_> = stations.filter(|it| it["state"] == "drive").collect();
    assert_eq!((&drive[0]["name"], &drive[0]["address"]), (&"pump".into(), &3.into()));
}

#[test]
fn a_stepped_clock_takes_the_octets_of_a_guest_at_the_next_step() {
    let emulator = start(&["--clock", "stepped"]);
    let port: u16 = door(&emulator, "serial-tcp:127.0.0.1:").parse().unwrap();
    let mut guest = TcpStream::connect(("127.0.0.1", port)).unwrap();
    guest.write_all(&[0x41]).unwrap();
    let mut arrived = String::new();
    let begin = std::time::Instant::now();
    while arrived != "16#0041" && begin.elapsed() < WATCHDOG {
        emulator.step(&["1ms"]);
        arrived = emulator.peek(&["serial.a_RX[0]"]);
    }
    assert_eq!(arrived, "16#0041");
    let refused = emulator.run("bus", &["open", "rs485", "slcan-pty"]);
    assert!(
        refused.err.contains("a serial bus has no door slcan-pty; open one of kind serial-tcp or serial-pty"),
        "{}",
        refused.err
    );
}

#[test]
fn wireshark_shows_the_octets_of_a_serial_line_with_their_direction() {
    if !is_there("tshark") {
        return;
    }
    let emulator = start(&["--clock", "stepped"]);
    let words: Vec<_> = (0..6).map(|at| format!("serial.a_TX[{at}]={}", 0x31 + at)).collect();
    emulator.poke(&words.iter().map(String::as_str).collect::<Vec<_>>());
    // A break, and a character that a fault garbles.
    emulator.poke(&["serial.a_TX[6]=16#0100", "serial.a_TX[7]=16#0055", "serial.u_TX_HEAD=8"]);
    emulator.run("fault", &["add", "garble_character", "bus=rs485", "octet=16#55"]).ok();
    emulator.step(&["10ms"]);
    let file = tempfile::NamedTempFile::new().unwrap();
    let mut trace = emulator.command("trace", &["--format", "pcapng"]);
    assert!(trace.stdout(std::fs::File::create(&file).unwrap()).status().unwrap().success());
    let mut tshark = std::process::Command::new("tshark");
    tshark.arg("-r").arg(file.path()).args(["-T", "fields"]);
    for field in ["frame.interface_name", "rtacser.eventtype", "data.data"] {
        tshark.args(["-e", field]);
    }
    let output = finish(&mut tshark);
    assert_eq!(output.code, Some(0), "{}", output.err);
    // The file has no packets for the break and the garbled character.
    assert_eq!(output.out, "rs485\t0x01\t313233343536\n");
    // The log can be read, without the octets.
    let compared = emulator.run("bus", &["compare", file.path().to_str().unwrap(), "--allow-empty"]);
    assert!(compared.err.contains("link type 250"), "{} {}", compared.out, compared.err);
}
