//! The door to a PROFIBUS of the built program: external masters over TCP.

use crate::common::{Emulator, eventually, python};
use serde_json::Value;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::Duration;

/// Maximum time for an answer, even on a slow machine.
const WATCHDOG: Duration = Duration::from_secs(60);

const PLANT: &str = r#"
[[device]]
kind = "can-dp2"
name = "gw"
profibus = "dp"
switches = 5
[[bus]]
name = "dp"
kind = "profibus"
kbit_s = 500
doors = ["profibus-tcp:127.0.0.1:0"]
"#;

/// A request of station 2 for a diagnosis of the gateway, marked as repeated.
const SLAVE_DIAG: [u8; 11] = [0x68, 5, 5, 0x68, 0x85, 0x82, 0x6D, 0x3C, 0x3E, 0xEE, 0x16];

struct Guest(TcpStream);

/// Returns the port of the first door.
fn port(emulator: &Emulator) -> u16 {
    let buses = buses(emulator);
    let door = buses[0]["doors"][0].as_str().unwrap();
    door.strip_prefix("profibus-tcp:127.0.0.1:").unwrap().parse().unwrap()
}

impl Guest {
    fn come(emulator: &Emulator) -> Self {
        let stream = TcpStream::connect(("127.0.0.1", port(emulator))).unwrap();
        stream.set_read_timeout(Some(WATCHDOG)).unwrap();
        Guest(stream)
    }

    fn send(&mut self, octets: &[u8]) {
        self.send_at(0, octets);
    }

    fn send_at(&mut self, begin: u64, octets: &[u8]) {
        let mut bytes = u16::try_from(octets.len()).unwrap().to_le_bytes().to_vec();
        bytes.extend(begin.to_le_bytes());
        bytes.extend_from_slice(octets);
        self.0.write_all(&bytes).unwrap();
    }

    /// Reads the bit time and the octets of the next telegram.
    fn hear(&mut self) -> (u64, Vec<u8>) {
        let (mut length, mut begin) = ([0; 2], [0; 8]);
        self.0.read_exact(&mut length).unwrap();
        self.0.read_exact(&mut begin).unwrap();
        let mut octets = vec![0; usize::from(u16::from_le_bytes(length))];
        self.0.read_exact(&mut octets).unwrap();
        (u64::from_le_bytes(begin), octets)
    }
}

fn buses(emulator: &Emulator) -> Value {
    serde_json::from_str(emulator.run("bus", &["list", "--format", "json"]).ok()).unwrap()
}

fn start() -> Emulator {
    start_with(PLANT, &[])
}

fn start_with(plant: &str, args: &[&str]) -> Emulator {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), plant).unwrap();
    Emulator::start(&[&[file.path().to_str().unwrap()], args].concat())
}

/// Starts a program that requests a seat, and waits until it has requested the seat.
fn seat(emulator: &Emulator, program: &mut Command) -> Child {
    let child = program.arg(port(emulator).to_string()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let child = child.unwrap();
    assert!(eventually(|| buses(emulator)[0]["guests"][0]["seat"] == true), "{}", buses(emulator));
    child
}

/// Runs the program of the page for users word for word.
#[test]
fn the_program_of_the_documentation_runs_as_printed() {
    let Some(mut python) = python(&[]) else { return };
    let page = include_str!("../../docs/devices/can-dp2/overview.md");
    let (_, program) = page.split_once("```python\n").unwrap();
    let (program, following) = program.split_once("```\n").unwrap();
    let (_, printed) = following.split_once("it prints `").unwrap();
    let (printed, _) = printed.split_once('`').unwrap();
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), program).unwrap();
    let emulator = start_with(PLANT, &["--clock", "stepped"]);
    let child = seat(&emulator, python.arg(file.path()));
    emulator.step(&["100ms"]);
    let outcome = child.wait_with_output().unwrap();
    let error = String::from_utf8_lossy(&outcome.stderr);
    assert_eq!(String::from_utf8_lossy(&outcome.stdout).trim_end(), printed, "{error}");
}

/// pyprofibus, the gateway, and a CANopen controller on the gateway's other bus. The controller's registers have the
/// master's values.
#[test]
fn pyprofibus_reaches_a_controller_through_the_gateway() {
    let Some(mut python) = python(&["pyprofibus"]) else { return };
    let plant = include_str!("../../tools/plants/can-dp2-door.toml");
    let emulator = start_with(plant, &["--clock", "stepped"]);
    // The step gives the controller time to receive the start frame.
    emulator.step(&["1s"]);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/check_profibus.py");
    let child = seat(&emulator, python.arg(script));
    let (output, error) = exchange(&emulator, child, || drop(emulator.step(&["50ms"])));
    assert_eq!(output, "pyprofibus exchanges data\n", "{error}");
}

/// Answers the outputs of pyprofibus as the controller does, until the process ends; `advance` is called before each
/// poll. Returns both outputs of the process.
fn exchange(emulator: &Emulator, mut child: Child, advance: impl Fn()) -> (String, String) {
    let mut is_answered = false;
    let ended = eventually(|| {
        advance();
        if !is_answered && emulator.peek(&["panel:%MW2000"]) == "16#1234" {
            emulator.poke(&["panel:%MW2032=16#ABCD"]);
            is_answered = true;
        }
        child.try_wait().unwrap().is_some()
    });
    if !ended {
        child.kill().unwrap();
    }
    let outcome = child.wait_with_output().unwrap();
    let [output, error] =
        [outcome.stdout, outcome.stderr].map(|it| String::from_utf8_lossy(&it).into_owned());
    let trace = || emulator.run("trace", &["--bus", "dp"]).out;
    assert!(ended && is_answered, "{output}{error}{}", trace());
    (output, error)
}

/// Returns the path of the pseudo-terminal at the first bus.
fn terminal(emulator: &Emulator) -> String {
    let buses = buses(emulator);
    let doors = buses[0]["doors"].as_array().unwrap().iter().filter_map(Value::as_str);
    doors.filter_map(|door| door.strip_prefix("profibus-pty:")).next().unwrap().to_owned()
}

/// pyprofibus on a serial line in real time, with the phy that it makes for `type=serial`.
#[test]
fn pyprofibus_runs_unchanged_on_a_serial_line() {
    let Some(mut python) = python(&["pyprofibus", "serial"]) else { return };
    let plant = include_str!("../../tools/plants/can-dp2-door.toml");
    let emulator = start_with(&plant.replace("profibus-tcp:127.0.0.1:0", "profibus-pty"), &[]);
    emulator.run("wait", &["--within", "60s", "panel:flags.CAN_OPEN==1"]).ok();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/check_profibus.py");
    let child = python
        .args([script.to_str().unwrap(), &terminal(&emulator)])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let (output, error) = exchange(&emulator, child, || {});
    // pyprofibus warns of rates that serial ports seldom have.
    assert_eq!(output.lines().last(), Some("pyprofibus exchanges data"), "{output}{error}");
}

/// A program on a serial line acts as two slaves. A master at another door sends requests to both.
#[test]
fn several_slaves_at_one_serial_line() {
    let emulator = start();
    emulator.run("bus", &["open", "dp", "profibus-pty"]).ok();
    let path = terminal(&emulator);
    let mut line = std::fs::OpenOptions::new().read(true).write(true).open(path).unwrap();
    let slaves = std::thread::spawn(move || {
        let mut octets = [0; 6];
        for station in [7, 8] {
            // The octets arrive one at a time, without a gap between telegrams.
            line.read_exact(&mut octets).unwrap();
            assert_eq!(octets[..4], [0x10, station, 2, 0x49]);
            line.write_all(&[0x10, 2]).unwrap();
            line.write_all(&[station, 0, station + 2, 0x16]).unwrap();
        }
        line
    });
    let mut master = Guest::come(&emulator);
    for station in [7_u8, 8] {
        master.send(&[0x10, station, 2, 0x49, 0x49 + 2 + station, 0x16]);
        assert_eq!(master.hear().1, [0x10, 2, station, 0, station + 2, 0x16]);
    }
    let mut line = slaves.join().unwrap();
    // Octets that are no telegram are sent unchanged, and every receiver sees them as garbled.
    line.write_all(&[0x55, 0x16]).unwrap();
    assert_eq!(master.hear().1, [0x55, 0x16]);
}

#[test]
fn foreign_masters_ask_a_slave_and_hear_each_other() {
    let emulator = start();
    assert!(emulator.ready.contains(", door profibus-tcp:127.0.0.1:"), "{}", emulator.ready);
    let (mut master, mut other) = (Guest::come(&emulator), Guest::come(&emulator));
    assert!(eventually(|| buses(&emulator)[0]["guests"].as_array().unwrap().len() == 2));
    // The slave detects the bit rate from the first telegram.
    master.send(&[0xDC, 2, 2]);
    let (token_at, token) = other.hear();
    assert_eq!(token, [0xDC, 2, 2]);
    master.send(&SLAVE_DIAG);
    let (asked_at, asked) = other.hear();
    assert_eq!(asked, SLAVE_DIAG);
    assert!(asked_at >= token_at + 33 + 33, "{token_at} {asked_at}");
    let (answered_at, answer) = master.hear();
    assert_eq!(answer, [0x68, 11, 11, 0x68, 0x82, 0x85, 8, 62, 60, 2, 5, 0, 0xFF, 4, 0xA4, 0x37, 0x16]);
    assert_eq!(answered_at, asked_at + 11 * 11 + 11);
    assert_eq!(other.hear(), (answered_at, answer));
    let trace = emulator.run("trace", &["--bus", "dp"]).out;
    assert!(trace.contains("guest1 takes part") && trace.contains("from guest1"), "{trace}");
}

#[test]
fn a_length_that_no_telegram_has_closes_the_door_for_this_guest() {
    let emulator = start();
    emulator.breaks(&["guest-telegram"]);
    let (mut other, mut confused) = (Guest::come(&emulator), Guest::come(&emulator));
    confused.0.write_all(&[0xFF, 0xFF, 0, 0, 0, 0, 0, 0, 0, 0]).unwrap();
    assert_eq!(confused.0.read(&mut [0; 1]).unwrap(), 0, "it was sent away");
    let findings = || emulator.run("check", &[]).out;
    assert!(eventually(|| findings().contains("guest-telegram")), "{}", findings());
    // Other guests stay connected.
    other.send(&[0xDC, 2, 2]);
    other.send(&SLAVE_DIAG);
    assert_eq!(other.hear().1.len(), 17);
}

/// The emulator refuses this time. Without the refusal the guest would wait without a timeout and without an
/// explanation.
#[test]
fn a_distant_bit_time_is_refused_with_a_message() {
    let emulator = start();
    emulator.breaks(&["guest-time"]);
    let (mut other, mut guest) = (Guest::come(&emulator), Guest::come(&emulator));
    guest.send_at(1 << 62, &[0xDC, 2, 2]);
    guest.send(&[0xDC, 3, 3]);
    assert_eq!(other.hear().1, [0xDC, 3, 3], "what follows is not kept back");
    let findings = emulator.run("check", &[]).out;
    assert!(findings.contains("guest-time"), "{findings}");
    assert_eq!(buses(&emulator)[0]["guests"][1]["refused"], 1);
}

/// Decision D-678.
#[test]
fn a_request_without_a_pause_is_found() {
    let emulator = start_with(PLANT, &["--clock", "stepped"]);
    emulator.breaks(&["guest-early"]);
    let mut guest = Guest::come(&emulator);
    guest.send_at(1_000, &[0xDC, 2, 2]);
    guest.send_at(1_000 + 33 + 11, &SLAVE_DIAG);
    assert!(eventually(|| {
        emulator.step(&["10ms"]);
        emulator.run("check", &[]).out.contains("guest-early")
    }));
}

/// Addresses and states of all stations, as a table and as JSON.
#[test]
fn the_list_of_buses_has_the_stations_of_a_segment() {
    let emulator = start();
    let mut master = Guest::come(&emulator);
    master.send(&[0xDC, 2, 2]);
    master.send(&SLAVE_DIAG);
    master.hear();
    let list = emulator.run("bus", &["list"]).ok().to_owned();
    for station in ["gw:dp (5, wait_prm)", "gw:mst (1, master)", "guest1 (2, guest)"] {
        assert!(list.contains(station), "{list}");
    }
    let stations = buses(&emulator)[0]["stations"].clone();
    let slave = serde_json::json!({
        "name": "gw:dp", "address": 5, "state": "wait_prm", "transmit_errors": 0, "receive_errors": 0
    });
    assert!(stations.as_array().unwrap().contains(&slave), "{stations}");
}

/// Each gateway has address 3 as delivered (CAN-DP/2 p. 9). The check of the plant warns about it, and the emulator
/// reports it.
#[test]
fn two_gateways_with_one_address_are_named() {
    let twice =
        PLANT.replace("switches = 5", "") + "[[device]]\nkind = 'can-dp2'\nname = 'gw2'\nprofibus = 'dp'\n";
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), &twice).unwrap();
    let judged = crate::common::run(&["run", "--check", file.path().to_str().unwrap()]);
    let warning = "warning: 'gw:dp' and 'gw2:dp' have the same address 3 on bus 'dp'";
    assert!(judged.ok().contains(warning), "{}", judged.out);
    let emulator = start_with(&twice, &[]);
    emulator.breaks(&["dp-address"]);
    let findings = || emulator.run("check", &[]).out;
    assert!(eventually(|| findings().matches("dp-address").count() >= 2), "{}", findings());
}

/// The bus needs 50 s for these octets.
#[test]
fn a_guest_that_leaves_with_scheduled_telegrams_frees_its_place() {
    let emulator = start();
    let mut later = 1u16.to_le_bytes().to_vec();
    later.extend(25_000_000_u64.to_le_bytes());
    later.push(0xE5);
    let address = ("127.0.0.1", port(&emulator));
    for _ in 0..200 {
        // While the door is full, it rejects a guest that sends data.
        let _ = TcpStream::connect(address).unwrap().write_all(&later.repeat(100));
    }
    assert!(eventually(|| {
        let _guest = Guest::come(&emulator);
        buses(&emulator)[0]["guests"].as_array().unwrap().len() == 1
    }));
}

#[test]
fn a_bus_accepts_only_doors_of_its_kind() {
    let emulator = start();
    let refused = emulator.run("bus", &["open", "dp", "slcan-tcp:127.0.0.1:0"]).err;
    assert!(
        refused.contains(
            "a profibus bus has no door slcan-tcp:127.0.0.1:0; open one of kind profibus-tcp or profibus-pty"
        ),
        "{refused}"
    );
    let opened = emulator.run("bus", &["open", "dp", "profibus-tcp:127.0.0.1:0"]);
    let door = opened.ok().trim().to_owned();
    assert_eq!(buses(&emulator)[0]["doors"].as_array().unwrap().len(), 2);
    emulator.run("bus", &["close", "dp", &door]).ok();
    assert_eq!(buses(&emulator)[0]["doors"].as_array().unwrap().len(), 1);
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), PLANT.replace("profibus-tcp:127.0.0.1:0", "slcan-pty")).unwrap();
    let refused = crate::common::run(&["run", file.path().to_str().unwrap()]).err;
    assert!(
        refused.contains("line 11")
            && refused.contains("no door slcan-pty; open one of kind profibus-tcp or profibus-pty"),
        "{refused}"
    );
}
