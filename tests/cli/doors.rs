//! Doors of a running emulator: external programs at its buses, over sockets and terminals.

mod turns;

use crate::common::{Emulator, eventually, finish, python};
use rustix::net;
use serde_json::Value;
use std::fs::File;
use std::io::{ErrorKind, Read, Write};
use std::net::{Ipv4Addr, SocketAddrV4, TcpStream};
use std::path::Path;
use std::time::Duration;

/// Maximum time for an answer, even on a slow machine.
const WATCHDOG: Duration = Duration::from_secs(60);

/// A CAN bus, and a PLC that is not connected to it.
const OPEN: &str = r#"
[[plc]]
name = "line"
[[bus]]
name = "open"
kind = "can"
kbit_s = 125
doors = ["slcan-tcp:127.0.0.1:0"]
"#;

/// A master of three drives, and a door to their bus.
const DRIVES: &str = r#"
[[plc]]
name = "line"
node2 = "drives"
[[bus]]
name = "drives"
doors = ["slcan-tcp:127.0.0.1:0"]
[[bus.drive]]
name = "one"
slave_number = 1
[[bus.drive]]
name = "two"
slave_number = 2
[[bus.drive]]
name = "three"
slave_number = 3
"#;

fn start(plant: &str, args: &[&str]) -> Emulator {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), plant).unwrap();
    Emulator::start(&[&[file.path().to_str().unwrap()], args].concat())
}

fn buses(emulator: &Emulator) -> Value {
    serde_json::from_str(emulator.run("bus", &["list", "--format", "json"]).ok()).unwrap()
}

/// Returns the port of the first door.
fn port(emulator: &Emulator) -> u16 {
    port_of(emulator, 0)
}

/// Returns the port of the first door of a bus.
fn port_of(emulator: &Emulator, bus: usize) -> u16 {
    let buses = buses(emulator);
    let door = buses[bus]["doors"][0].as_str().unwrap();
    door.strip_prefix("slcan-tcp:127.0.0.1:").unwrap().parse().unwrap()
}

/// A client program that speaks SLCAN.
struct Guest<S>(S);

impl Guest<TcpStream> {
    fn come(port: u16) -> Self {
        Self::on(TcpStream::connect(("127.0.0.1", port)).unwrap())
    }

    fn on(stream: TcpStream) -> Self {
        stream.set_read_timeout(Some(WATCHDOG)).unwrap();
        Guest(stream)
    }

    /// Returns a guest that takes part in the bus traffic.
    fn open(port: u16) -> Self {
        Self::come(port).opened()
    }

    fn opened(mut self) -> Self {
        assert_eq!(self.ask("O"), "\r");
        self
    }

    /// Like [`open`](Self::open), but few unread bytes fill the connection.
    fn open_with_small_buffer(port: u16) -> Self {
        let socket = net::socket(net::AddressFamily::INET, net::SocketType::STREAM, None).unwrap();
        net::sockopt::set_socket_recv_buffer_size(&socket, 4096).unwrap();
        net::connect(&socket, &SocketAddrV4::new(Ipv4Addr::LOCALHOST, port)).unwrap();
        Self::on(socket.into()).opened()
    }
}

impl<S: Read + Write> Guest<S> {
    fn send(&mut self, text: &str) {
        self.0.write_all(text.as_bytes()).unwrap();
    }

    /// Reads the next answer: a line with its CR, or a BEL.
    fn hear(&mut self) -> String {
        let mut line = String::new();
        loop {
            let mut byte = [0];
            self.0.read_exact(&mut byte).unwrap();
            line.push(char::from(byte[0]));
            if matches!(byte[0], b'\r' | 7) {
                return line;
            }
        }
    }

    fn ask(&mut self, line: &str) -> String {
        self.send(&format!("{line}\r"));
        self.hear()
    }
}

#[test]
fn guests_hear_each_other_but_not_themselves() {
    let emulator = start(OPEN, &[]);
    assert!(emulator.ready.contains(", door slcan-tcp:127.0.0.1:"), "{}", emulator.ready);
    let port = port(&emulator);
    let (mut one, mut other) = (Guest::open(port), Guest::open(port));
    for line in ["t1232AABB", "r7201", "T1FFF00010", "R000000018", "t00080102030405060708"] {
        let yes = if line.starts_with(|c: char| c.is_lowercase()) { "z\r" } else { "Z\r" };
        assert_eq!(one.ask(line), yes);
        assert_eq!(other.hear(), format!("{line}\r"));
    }
    // A door does not send a frame back to its sender. If it did, this echo would arrive before the frame of the other
    // guest.
    assert_eq!(other.ask("t5551FF"), "z\r");
    assert_eq!(one.hear(), "t5551FF\r");
    let log = emulator.run("trace", &["--format", "candump"]);
    let frames: Vec<_> = log.ok().lines().map(|line| line.rsplit(' ').next().unwrap()).collect();
    assert_eq!(frames, ["123#AABB", "720#R1", "1FFF0001#", "00000001#R8", "000#0102030405060708", "555#FF"]);
    let text = emulator.run("trace", &["--bus", "open"]).out;
    assert!(text.contains("guest1 takes part\n") && text.contains("16#123 AA BB from guest1"), "{text}");
    let buses = buses(&emulator);
    assert_eq!((buses[0]["bus"].as_str(), buses[0]["kind"].as_str()), (Some("open"), Some("can")));
    assert_eq!((&buses[0]["kbit_s"], buses[0]["guests"].as_array().unwrap().len()), (&Value::from(125), 2));
}

#[test]
fn frames_of_a_guest_that_leaves_at_once_are_sent() {
    let emulator = start(OPEN, &[]);
    let port = port(&emulator);
    let mut listener = Guest::open(port);
    {
        let mut hasty = Guest::come(port);
        hasty.send("S4\rO\rt1230\rt1240\rt1250\rC\r");
    }
    assert_eq!([listener.hear(), listener.hear(), listener.hear()], ["t1230\r", "t1240\r", "t1250\r"]);
    assert!(eventually(|| buses(&emulator)[0]["guests"].as_array().unwrap().len() == 1));
}

#[test]
fn bad_lines_are_answered_by_the_bell_and_the_next_one_counts() {
    let emulator = start(OPEN, &[]);
    let mut guest = Guest::come(port(&emulator));
    assert_eq!(guest.ask("t1230"), "\x07", "it does not take part");
    for line in ["bad", "t12", "t1239", "T123", "t8000", &"t".repeat(5000)] {
        assert_eq!(guest.ask(line), "\x07", "{line}");
    }
    guest.send("\r\r\r");
    assert_eq!(
        (guest.ask("V"), guest.ask("L"), guest.ask("t1230")),
        ("V0101\r".into(), "\r".into(), "\x07".into())
    );
}

#[test]
fn a_guest_with_another_bit_rate_receives_nothing_and_is_reported() {
    let emulator = start(OPEN, &[]);
    emulator.breaks(&["guest-bit-rate"]);
    let port = port(&emulator);
    let mut unready = Guest::come(port);
    assert_eq!((unready.ask("S6"), unready.ask("O")), ("\r".into(), "\r".into()));
    assert!(eventually(|| emulator.run("check", &[]).out.contains("guest-bit-rate  open:guest1")));
    let mut right = Guest::come(port);
    assert_eq!((right.ask("S4"), right.ask("O")), ("\r".into(), "\r".into()));
    let mut other = Guest::open(port);
    assert_eq!(unready.ask("t1110"), "z\r");
    assert!(eventually(|| buses(&emulator)[0]["guests"][0]["refused"] == 1));
    assert_eq!(right.ask("t1230"), "z\r");
    assert_eq!(other.hear(), "t1230\r", "and nothing before it");
    // The guest receives frames as soon as it sets the right bit rate. Earlier frames are lost for it.
    assert_eq!(
        (unready.ask("C"), unready.ask("S4"), unready.ask("O")),
        ("\r".into(), "\r".into(), "\r".into())
    );
    assert_eq!(right.ask("t1240"), "z\r");
    assert_eq!(unready.hear(), "t1240\r");
}

#[test]
fn a_bit_rate_without_a_code_accepts_any_code() {
    let emulator = start(&OPEN.replace("125", "33.3"), &[]);
    let port = port(&emulator);
    let (mut one, mut other) = (Guest::come(port), Guest::open(port));
    assert_eq!((one.ask("S8"), one.ask("O"), one.ask("t1230")), ("\r".into(), "\r".into(), "z\r".into()));
    assert_eq!(other.hear(), "t1230\r");
    assert_eq!(buses(&emulator)[0]["kbit_s"], 33.3);
}

#[test]
fn with_the_stepped_clock_frames_enter_at_the_next_step() {
    let emulator = start(OPEN, &["--clock", "stepped"]);
    let port = port(&emulator);
    let (mut one, mut other) = (Guest::open(port), Guest::open(port));
    emulator.step(&["1ms"]);
    assert_eq!(one.ask("t1230"), "z\r");
    let log = emulator.run("trace", &["--format", "jsonl", "--bus", "open"]);
    assert!(!log.ok().contains("can_frame") && log.out.contains("takes_part_stepped"), "{}", log.out);
    emulator.step(&["10ms"]);
    assert_eq!(other.hear(), "t1230\r");
    let log = emulator.run("trace", &["--format", "candump"]);
    // The frame begins with the step, and has 44 bits and a stuff bit at 125 kbit/s.
    assert_eq!(log.ok(), "(0000000000.001360) open 123#\n");
}

/// The controller of a guest has fewer places than its door. The frames that have waited since the beginning of a step
/// follow when places become free, and not at the next step.
#[test]
fn many_frames_of_a_guest_enter_alike_for_any_division_into_steps() {
    let trace = |steps: &[&str]| {
        let emulator = start(OPEN, &["--clock", "stepped"]);
        let port = port(&emulator);
        let (mut one, _other) = (Guest::open(port), Guest::open(port));
        emulator.step(&["1ms"]);
        for number in 0..200 {
            assert_eq!(one.ask("t1230"), "z\r", "{number}");
        }
        assert_eq!(one.ask("C"), "\r");
        steps.iter().for_each(|step| drop(emulator.step(&[step])));
        emulator.run("trace", &["--format", "jsonl", "--bus", "open"]).ok().to_owned()
    };
    let at_once = trace(&["1s"]);
    assert_eq!(at_once.matches("can_frame").count(), 200);
    // 200 frames of 45 bits with 3 bits between them at 125 kbit/s.
    assert!(at_once.contains("\"time_us\":77776"), "{at_once}");
    assert_eq!(trace(&[&["7ms"; 20][..], &["860ms"]].concat()), at_once);
}

#[test]
fn guests_receive_frames_of_a_cansync_bus_and_their_frames_are_reported() {
    let emulator = start(DRIVES, &["--clock", "stepped"]);
    let port = port(&emulator);
    let (mut one, mut other) = (Guest::open(port), Guest::open(port));
    emulator.set_up(&[]);
    emulator.run("wait", &["node2.a_STAT_SL[1]==1", "--within", "100ms"]).ok();
    let first = other.hear();
    assert!(first.starts_with('t'), "{first}");
    let log = emulator.run("trace", &["--format", "candump"]).out;
    let frame = log.lines().next().unwrap().rsplit(' ').next().unwrap().replace('#', "");
    assert_eq!(format!("{}{}", &first[1..4], &first[5..first.len() - 1]), frame);
    one.send("t7FF2BEEF\rT000000010\r");
    while one.hear() != "Z\r" {}
    emulator.step(&["4ms"]);
    while other.hear() != "t7FF2BEEF\r" {}
    let log = emulator.run("trace", &["--format", "jsonl", "--kind", "foreign_frame"]);
    let record: Value = serde_json::from_str(log.ok().lines().next().unwrap()).unwrap();
    assert_eq!((&record["id"], &record["data"], &record["guest"]), (&2047.into(), &"BEEF".into(), &1.into()));
    let findings = emulator.run("check", &["--format", "json"]);
    assert!(
        findings.ok().contains("foreign-frame") && findings.out.contains("drives:guest1"),
        "{}",
        findings.out
    );
    assert_eq!(buses(&emulator)[0]["guests"][0]["refused"], 1, "there are no 29 bits in CANsync");
}

#[test]
fn a_guest_that_does_not_read_delays_no_other_and_its_losses_are_counted() {
    let emulator = start(DRIVES, &["--clock", "stepped"]);
    let mut slow = Guest::open_with_small_buffer(port(&emulator));
    emulator.set_up(&[]);
    emulator.run("wait", &["node2.a_STAT_SL[3]==1", "--within", "100ms"]).ok();
    let dropped = || buses(&emulator)[0]["guests"][0]["dropped"].as_u64().unwrap();
    assert_eq!(dropped(), 0);
    let frames = || emulator.run("trace", &["--format", "candump"]).out.lines().count();
    assert!(frames() > 0);
    assert!(
        eventually(|| {
            emulator.step(&["200ms"]);
            dropped() > 0
        }),
        "nothing was dropped"
    );
    assert!(emulator.run("bus", &["list"]).ok().contains(" dropped)"));
    // The emulator still reads from the slow guest and answers it.
    slow.send("F\r");
    assert!(eventually(|| slow.hear() == "F08\r"));
}

/// Decision D-350.
#[test]
fn a_guest_alone_on_its_bus_is_error_passive_until_another_joins() {
    let emulator = start(OPEN, &["--clock", "stepped"]);
    let port = port(&emulator);
    let mut one = Guest::open(port);
    assert_eq!(one.ask("t1230"), "z\r");
    emulator.step(&["1s"]);
    let station = || buses(&emulator)[0]["stations"][0].clone();
    let passive = serde_json::json!({
        "name": "guest1", "address": null, "state": "error_passive", "transmit_errors": 128, "receive_errors": 0
    });
    assert_eq!(station(), passive);
    assert!(emulator.run("bus", &["list"]).ok().contains("guest1 (error_passive, 128+0)"));
    assert_eq!(one.ask("F"), "F24\r");
    let mut other = Guest::open(port);
    emulator.step(&["100ms"]);
    assert_eq!(other.hear(), "t1230\r");
    assert_eq!(
        (station()["state"].as_str(), station()["transmit_errors"].as_u64()),
        (Some("error_warning"), Some(127))
    );
    assert_eq!(one.ask("F"), "F04\r");
    let log = emulator.run("trace", &[]);
    let expected = "16#123 from guest1 is not acknowledged";
    assert!(
        log.ok().matches(expected).count() == 1 && log.out.contains("guest1 is error-passive, 128 transmit"),
        "{}",
        log.out
    );
}

#[test]
fn doors_open_and_close_while_the_plant_runs() {
    let emulator = start(&OPEN.replace("doors", "# doors"), &[]);
    assert_eq!(
        emulator.run("bus", &["list"]).ok(),
        "BUS   KIND  KBIT S  DOORS  GUESTS  STATIONS  OTHER RATES\nopen  can   125     -      -       -         -\n"
    );
    let door = emulator.run("bus", &["open", "open", "slcan-tcp:127.0.0.1:0"]).ok().trim_end().to_owned();
    let port = port(&emulator);
    assert_eq!(door, format!("slcan-tcp:127.0.0.1:{port}"));
    let mut guest = Guest::open(port);
    let taken = emulator.run("bus", &["open", "open", &door]);
    assert!(taken.fails(3).contains(&door), "{}", taken.err);
    let unknown = emulator.run("bus", &["close", "open", "slcan-pty:/dev/pts/4000000"]);
    assert!(
        unknown.fails(2).contains("bus 'open' has no door slcan-pty:/dev/pts/4000000"),
        "{}",
        unknown.err
    );
    assert!(
        emulator
            .run("bus", &["open", "shut", "slcan-pty"])
            .fails(2)
            .contains("no bus 'shut'; its buses are: open")
    );
    let public = emulator.run("bus", &["open", "open", "slcan-tcp:0.0.0.0:0"]);
    assert!(public.fails(2).contains("slcan-tcp-anybody"), "{}", public.err);
    assert_eq!(emulator.run("bus", &["close", "open", &door]).ok(), "");
    assert_eq!(guest.0.read(&mut [0]).unwrap(), 0, "it had to leave");
    assert!(TcpStream::connect(("127.0.0.1", port)).is_err());
    assert_eq!(buses(&emulator)[0]["doors"].as_array().unwrap().len(), 0);
}

/// A client can connect to a door any number of times; the log does not grow with each attempt.
#[test]
fn repeated_rejections_of_guests_are_logged_once() {
    let mut emulator = start(OPEN, &[]);
    let port = port(&emulator);
    let _guests: Vec<_> = (0..commram::door::MAX_GUESTS).map(|_| Guest::open(port)).collect();
    for _ in 0..100 {
        assert_eq!(Guest::come(port).0.read(&mut [0]).unwrap_or(0), 0, "there is no room");
    }
    emulator.run("stop", &[]).ok();
    emulator.wait();
    let complaints = emulator.complaints();
    assert_eq!(
        complaints.matches("a guest was sent away: an instance has places for 64 guests").count(),
        1,
        "{complaints}"
    );
}

#[test]
fn a_plant_file_with_a_public_door_needs_explicit_permission() {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), OPEN.replace("127.0.0.1", "0.0.0.0")).unwrap();
    let refused = crate::common::run(&["run", file.path().to_str().unwrap()]);
    let text = refused.fails(2);
    assert!(text.contains("line 8") && text.contains("slcan-tcp-anybody"), "{text}");
}

#[test]
fn a_terminal_is_a_door_too() {
    let emulator = start(&OPEN.replace("slcan-tcp:127.0.0.1:0", "slcan-tcp:127.0.0.1:0\", \"slcan-pty"), &[]);
    let buses = buses(&emulator);
    let path = buses[0]["doors"][1].as_str().unwrap().strip_prefix("slcan-pty:").unwrap().to_owned();
    let terminal = File::options().read(true).write(true).open(&path).unwrap();
    let (mut one, mut other) = (Guest(terminal), Guest::open(port(&emulator)));
    assert_eq!(
        (one.ask("V"), one.ask("O"), one.ask("t1231AB")),
        ("V0101\r".into(), "\r".into(), "z\r".into())
    );
    assert_eq!(other.hear(), "t1231AB\r");
    assert_eq!(other.ask("t3210"), "z\r");
    assert_eq!(one.hear(), "t3210\r");
}

#[test]
fn python_can_and_canopen_connect_to_a_door() {
    let Some(mut command) = python(&["can", "canopen", "serial"]) else { return };
    let emulator = start(OPEN, &[]);
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/check_can.py");
    let outcome = finish(command.arg(script).args([&port(&emulator).to_string(), "125000"]));
    assert_eq!(
        (outcome.code, outcome.out.as_str()),
        (Some(0), "python-can and canopen agree\n"),
        "{}",
        outcome.err
    );
}

#[test]
fn a_scenario_on_the_instance_sends_frames_and_hears_guests() {
    let emulator = start(OPEN, &["--clock", "stepped"]);
    let mut guest = Guest::open(port(&emulator));
    assert_eq!(guest.ask("t1A02BEEF"), "z\r");
    let scripts = tempfile::tempdir().unwrap();
    let run = |script: &str| {
        let path = scripts.path().join("one.rhai");
        std::fs::write(&path, script).unwrap();
        crate::common::run(&["test", path.to_str().unwrap(), "--attach", &emulator.name])
    };
    let outcome = run("expect_frame(\"open\", 0x1A0, \"BE ??\", \"10ms\");\n\
        send_frame(\"open\", 0x220, \"34 12 78 56\");\n\
        rtr(\"open\", 0x720);\n\
        send_frame(\"open\", 0x18FF1234, \"01\", extended);\n\
        step(\"10ms\");");
    assert_eq!(outcome.code, Some(0), "{}{}", outcome.out, outcome.err);
    assert_eq!([guest.hear(), guest.hear(), guest.hear()], ["t220434127856\r", "r7200\r", "T18FF1234101\r"]);
    for (script, complaint) in [
        ("send_frame(\"open\", 0x800, \"\");", "11 bits"),
        ("send_frame(\"open\", 0x20000000, \"\", extended);", "29 bits"),
        ("send_frame(\"open\", 1, \"??\");", "data to be sent"),
        ("send_frame(\"shut\", 1, \"\");", "shut"),
    ] {
        let outcome = run(script);
        assert!(outcome.code == Some(2) && outcome.out.contains(complaint), "{}{}", outcome.out, outcome.err);
    }
}

#[test]
fn a_log_is_played_and_compared() {
    let log = "(1436509052.000000) can0 123#AA\n(1436509052.002000) can0 1FFF0001#R8\n(1436509052.010000) can0 124#\n";
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("can0.log");
    let path = path.to_str().unwrap();
    let write = |text: &str| std::fs::write(path, text).unwrap();
    write(log);
    for clock in [&["--clock", "stepped"][..], &[]] {
        let emulator = start(OPEN, clock);
        let mut guest = Guest::open(port(&emulator));
        let played = emulator.run("bus", &["play", path]);
        let is_reported = match clock.is_empty() {
            true => {
                played.ok().starts_with("3 frames in 10 ms of the log; sent within ")
                    && played.out.contains(" late\n")
            }
            false => played.ok() == "3 frames in 10 ms\n",
        };
        assert!(is_reported, "{}", played.out);
        // The last frame of the log has ended on the bus when `bus play` ends.
        assert_eq!([guest.hear(), guest.hear(), guest.hear()], ["t1231AA\r", "R1FFF00018\r", "t1240\r"]);
        // In real time the machine's load decides when a frame is sent.
        let tolerance = if clock.is_empty() { "1h" } else { "1ms" };
        let compare =
            |tolerance| emulator.run("bus", &["compare", path, "--tolerance", tolerance, "--bus", "open"]);
        assert_eq!(compare(tolerance).ok(), "3 frames, no difference\n");
        if !clock.is_empty() {
            // The times of a log are the ends of its frames, which have different lengths.
            assert_eq!(compare("0s").ok(), "3 frames, no difference\n");
        }
        let pcapng = directory.path().join("open.pcapng");
        let mut trace = emulator.command("trace", &["--format", "pcapng"]);
        assert!(trace.stdout(File::create(&pcapng).unwrap()).status().unwrap().success());
        let pcapng = pcapng.to_str().unwrap();
        assert_eq!(
            emulator.run("bus", &["compare", pcapng, "--tolerance", "0s"]).ok(),
            "3 frames, no difference\n"
        );
        let again = start(OPEN, &["--clock", "stepped"]);
        let mut hears = Guest::open(self::port(&again));
        assert!(again.run("bus", &["play", pcapng]).ok().starts_with("3 frames in "));
        assert_eq!([hears.hear(), hears.hear(), hears.hear()], ["t1231AA\r", "R1FFF00018\r", "t1240\r"]);
        write(&log.replace("123#AA", "123#AB"));
        let other = compare(tolerance);
        let kinds: Vec<_> = other.out.lines().map(|line| line.split(' ').next().unwrap()).collect();
        assert_eq!((other.code, kinds), (Some(1), vec!["missing", "extra"]), "{}", other.out);
        write(log);
    }
}

/// Writes a log into a temporary directory, and returns the directory and the path of the log.
fn log_file(text: &str) -> (tempfile::TempDir, String) {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("recorded.log");
    std::fs::write(&path, text).unwrap();
    let path = path.to_str().unwrap().to_owned();
    (directory, path)
}

#[test]
fn entries_that_are_no_frames_of_the_bus_are_skipped_with_their_line() {
    let log = "# by a logger\r\n(1.000000) can0 123#AA R\r\n(1.1) can0 20000080#0000000000000000 R\r\n\
               (1.2) can0 124##1AABB\r\n(1.3) can0 125#R2 T\r\n(1.4) can0 12";
    let (_directory, path) = log_file(log);
    let emulator = start(OPEN, &["--clock", "stepped"]);
    let mut guest = Guest::open(port(&emulator));
    let played = emulator.run("bus", &["play", &path]);
    assert_eq!((played.code, played.out.as_str()), (Some(0), "2 frames in 300 ms\n"), "{}", played.err);
    for note in [
        "line 3: skipped: an error message",
        "line 4: skipped: a frame of CAN FD",
        "line 6: skipped: the last line",
    ] {
        assert!(played.err.contains(note), "{note}: {}", played.err);
    }
    assert_eq!([guest.hear(), guest.hear()], ["t1231AA\r", "r1252\r"]);
    let compared = emulator.run("bus", &["compare", &path]);
    assert_eq!(
        (compared.code, compared.out.as_str()),
        (Some(0), "2 frames, no difference\n"),
        "{}",
        compared.err
    );
}

#[test]
fn a_log_without_a_frame_for_the_bus_is_an_error() {
    let emulator = start(OPEN, &["--clock", "stepped"]);
    let _guest = Guest::open(port(&emulator));
    for (log, options) in [
        ("", &[][..]),
        ("(1.0) can0 123##0AA\n", &[]),
        ("(1.0) can0 123#AA\n", &["--interface", "can1"]),
        ("(1.0) can0 123#AA\n", &["--direction", "tx"]),
    ] {
        let (_directory, path) = log_file(log);
        for (command, right) in
            [("play", "it has no frame to play"), ("compare", "it has no frame to compare")]
        {
            let run =
                |more: &[&str]| emulator.run("bus", &[&[command, path.as_str()], options, more].concat());
            let refused = run(&[]);
            assert!(refused.fails(2).contains(right), "{log}: {}", refused.err);
            let accepted = run(&["--allow-empty"]);
            assert!(
                accepted.code == Some(0) && accepted.out.starts_with("0 frames"),
                "{log}: {}",
                accepted.err
            );
        }
    }
    // With several buses, an interface is the bus of its name.
    let two = start(
        &format!("{OPEN}\n[[bus]]\nname = 'other'\nkind = 'can'\nkbit_s = 125\n"),
        &["--clock", "stepped"],
    );
    let _guest = Guest::open(port(&two));
    let (_directory, path) = log_file("(1.0) can0 123#AA\n(1.1) open 124#AA\n");
    let played = two.run("bus", &["play", &path]);
    assert_eq!((played.code, played.out.as_str()), (Some(0), "1 frame in 0 us\n"), "{}", played.err);
    assert!(
        played.err.contains("1 frame of interface 'can0' passed over: no bus has this name"),
        "{}",
        played.err
    );
    let (_directory, path) = log_file("(1.0) can0 123#AA\n");
    assert!(two.run("bus", &["play", &path]).fails(2).contains("it has no frame to play"));
}

/// A recording of frames that follow one another without a gap, and of a long frame after a short one.
#[test]
fn an_own_recording_gives_the_same_journal() {
    let log = "(1.000000) can0 7FF#0000000000000000\n(1.000001) can0 001#\n(1.000002) can0 1FFFFFFF#FFFFFFFFFFFFFFFF\n\
               (1.000003) can0 002#\n(1.100000) can0 003#\n(1.101300) can0 004#0000000000000000\n";
    let (directory, path) = log_file(log);
    let recording = |path: &str| {
        let emulator = start(OPEN, &["--clock", "stepped"]);
        let _guest = Guest::open(port(&emulator));
        emulator.run("bus", &["play", path]).ok();
        emulator.run("trace", &["--format", "candump"]).ok().to_owned()
    };
    let first = recording(&path);
    let own = directory.path().join("own.log");
    std::fs::write(&own, &first).unwrap();
    assert_eq!(recording(own.to_str().unwrap()), first);
}

/// The log has more frames than the rate of the bus allows in its time.
#[test]
fn a_log_with_more_frames_than_the_bus_can_carry_is_played_completely() {
    let frames: String =
        (0..300).map(|number| format!("(1.000000) can0 {:03X}#1122334455667788\n", number)).collect();
    let (_directory, path) = log_file(&frames);
    let emulator = start(OPEN, &["--clock", "stepped"]);
    let mut guest = Guest::open(port(&emulator));
    assert_eq!(emulator.run("bus", &["play", &path]).ok(), "300 frames in 0 us\n");
    assert_eq!(
        emulator.run("bus", &["compare", &path, "--tolerance", "1min"]).ok(),
        "300 frames, no difference\n"
    );
    assert!((0..300).all(|number| guest.hear() == format!("t{number:03X}81122334455667788\r")));
}

/// The log has more frames than the 65,536 that the journal keeps. It has a long gap, at whose begin frames still wait.
#[test]
fn a_log_with_more_frames_than_the_journal_keeps_is_played_completely() {
    let mut frames = "(1.000000) can0 123#\n".repeat(70_000);
    frames += "(3600.000000) can0 123#\n";
    let (_directory, path) = log_file(&frames);
    let emulator = start(&OPEN.replace("125", "1000"), &["--clock", "stepped"]);
    let _hearer = Guest::open(port(&emulator));
    let played = emulator.run("bus", &["play", &path]);
    assert_eq!(played.ok(), "70001 frames in 3599 s\n");
}

/// At 10 kbit/s, ten frames of another guest and then the 64 frames of a controller take more than a second.
#[test]
fn a_log_is_played_as_long_as_its_frames_leave() {
    let data = "3C".repeat(8);
    let (_directory, path) = log_file(&format!("(1.0) can0 00000001#{data}\n").repeat(64));
    let emulator = start(&OPEN.replace("125", "10"), &["--clock", "stepped"]);
    let mut other = Guest::open(port(&emulator));
    let _hearer = Guest::open(port(&emulator));
    (0..10).for_each(|_| assert_eq!(other.ask(&format!("T000000008{data}")), "Z\r"));
    assert_eq!(emulator.run("bus", &["play", &path]).ok(), "64 frames in 0 us\n");
    let now = emulator.step(&["0us"]);
    assert!(now.starts_with("1.1"), "{now}");
}

/// Without another station no frame is acknowledged.
#[test]
fn frames_that_no_station_acknowledges_are_reported() {
    let (_directory, path) = log_file("(1.0) can0 123#AA\n");
    let emulator = start(OPEN, &["--clock", "stepped"]);
    let played = emulator.run("bus", &["play", &path]);
    assert!(played.fails(1).contains("1 frame not sent, and none left within 1 s"), "{}", played.err);
}

#[test]
fn a_selection_of_a_log_is_played() {
    let log = "(1.0) can0 1A0#01 R\n(1.1) can0 220#02 T\n(1.2) can1 5A0#03 R\n(1.3) can0 720#04 R\n(1.4) can0 18FF1234#05 R\n";
    let (_directory, path) = log_file(log);
    for (options, wanted) in [
        (&["--without-node", "32"][..], &["t220102\r", "T18FF1234105\r"][..]),
        (&["--id", "180:780", "--id", "220"], &["t1A0101\r", "t220102\r"]),
        (&["--id", "!1A0", "--direction", "rx", "--interface", "can0"], &["t720104\r", "T18FF1234105\r"]),
        (&["--interface", "can1"], &["t5A0103\r"]),
    ] {
        let emulator = start(OPEN, &["--clock", "stepped"]);
        let mut guest = Guest::open(port(&emulator));
        let played = emulator.run("bus", &[&["play", path.as_str()], options].concat());
        assert_eq!(played.code, Some(0), "{}", played.err);
        assert!(played.out.starts_with(&format!("{} frame", wanted.len())), "{}", played.out);
        assert!(played.err.contains(&format!("{} frames not selected", 5 - wanted.len())), "{}", played.err);
        assert!(wanted.iter().all(|frame| guest.hear() == *frame), "{options:?}");
    }
    let emulator = start(OPEN, &[]);
    let refused = emulator.run("bus", &["play", &path, "--id", "900"]);
    assert!(refused.fails(2).contains("an identifier up to 7FF"), "{}", refused.err);
}

#[test]
fn times_that_cannot_be_played_are_reported_with_their_line() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("can0.log");
    let path = path.to_str().unwrap();
    let write = |times: &[&str]| {
        let lines: String = times.iter().map(|time| format!("({time}) can0 123#AA\n")).collect();
        std::fs::write(path, format!("\n{lines}")).unwrap();
    };
    for clock in [&["--clock", "stepped"][..], &[]] {
        let emulator = start(OPEN, clock);
        let _guest = Guest::open(port(&emulator));
        write(&["1436509052.000000", "1436509052.001000", "2436509052.000000"]);
        let refused = emulator.run("bus", &["play", path]);
        let gap = "line 4: its frame comes 999999999.999000 s after the preceding frame";
        assert!(
            refused.fails(2).contains(gap)
                && refused.err.contains("the longest gap in a log is 86400.000000 s"),
            "{}",
            refused.err
        );
        write(&["0000000005.000000", "0000000005.002000", "0000000004.000000", "0000000005.001000"]);
        let played = emulator.run("bus", &["play", path]);
        assert_eq!(played.code, Some(0), "{}", played.err);
        assert!(played.out.starts_with("4 frames in 2 ms"), "{}", played.out);
        let note = "line 4: its time is before the time of an earlier frame, as in 1 later line; they are sent at once";
        assert!(played.err.contains(note), "{}", played.err);
        // The largest time that a log can have, with more frames than a controller can store.
        write(&["18446744073709.551615"; 200]);
        let played = emulator.run("bus", &["play", path]);
        assert_eq!(played.code, Some(0), "{}", played.err);
        assert!(played.out.starts_with("200 frames in "), "{}", played.out);
        write(&["18446744073709.551616"]);
        let refused = emulator.run("bus", &["play", path]);
        assert!(refused.fails(2).contains("line 2"), "{}", refused.err);
    }
}

/// The begin of two recordings by SavvyCAN: after some fifty frames, the time falls back to the start of the logger's
/// clock.
const RESTARTED: &str = "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n\
    97637502,0000010C,false,Rx,0,2,04,00\n97655775,0000010D,false,Rx,1,1,01\n\
    62087,0000010E,false,Rx,0,1,02\n62387,0000010F,false,Rx,1,1,03\n\
    72087,00000110,false,Rx,0,1,04\n162087,00000111,false,Rx,1,1,05\n";

#[test]
fn a_log_whose_clock_starts_again_keeps_its_intervals() {
    let directory = tempfile::tempdir().unwrap();
    let path = |name: &str| directory.path().join(name).to_str().unwrap().to_owned();
    std::fs::write(path("savvy.csv"), RESTARTED).unwrap();
    let row = |line: &str| {
        let cells: Vec<_> = line.split(',').collect();
        let (time, data) = (cells[0].parse::<u64>().unwrap(), cells[6..].concat());
        format!(
            "({:010}.{:06}) can{} {}#{data}\n",
            time / 1_000_000,
            time % 1_000_000,
            cells[4],
            &cells[1][5..]
        )
    };
    let candump: String = RESTARTED.lines().skip(1).map(row).collect();
    std::fs::write(path("candump.log"), candump).unwrap();
    for (log, first) in [("savvy.csv", 4), ("candump.log", 3)] {
        let log = path(log);
        let note = format!(
            "line {first}: the clock of the log started again: 0.062087 s follows 97.655775 s; the intervals after \
             this line are kept"
        );
        for clock in ["stepped", "realtime"] {
            for (selection, frames, length) in
                [(&[][..], 6, "138273 us"), (&["--interface", "can1"], 3, "120 ms")]
            {
                let emulator = start(OPEN, &["--clock", clock]);
                let mut guest = Guest::open(port(&emulator));
                let played = emulator.run("bus", &[&["play", log.as_str()], selection].concat());
                assert_eq!(played.code, Some(0), "{}", played.err);
                let result = format!("{frames} frames in {length}");
                assert!(played.out.starts_with(&result), "{result}: {}", played.out);
                assert!(played.err.contains(&note), "{}", played.err);
                assert!((0..frames).all(|_| guest.hear().starts_with("t1")));
                // In real time the machine's load decides when a frame is sent.
                let tolerance = if clock == "stepped" { "1ms" } else { "1h" };
                let compare = ["compare", log.as_str(), "--tolerance", tolerance];
                let compared = emulator.run("bus", &[&compare, selection].concat());
                let result = format!("{frames} frames, no difference\n");
                assert_eq!((compared.code, compared.out), (Some(0), result), "{}", compared.err);
                assert!(compared.err.contains(&note), "{}", compared.err);
            }
        }
    }
}

/// The content or the extension of a file shows its format.
#[test]
fn a_log_in_a_format_of_other_programs_names_its_converter() {
    let directory = tempfile::tempdir().unwrap();
    let emulator = start(OPEN, &["--clock", "stepped"]);
    for (name, content, converts) in [
        (
            "a.asc",
            &b"date Sam Sep 30 10:06:13 2017\nbase hex  timestamps absolute\n 0.5 1 123 Rx d 1 AA\n"[..],
            &["`asc2log -I FILE.asc -O FILE.log`", "`can_logconvert FILE.asc FILE.log`"][..],
        ),
        ("b.trc", b";$FILEVERSION=1.1\n;\n 1) 0.5 Rx 0123 1 AA\n", &["`can_logconvert FILE.trc FILE.log`"]),
        ("c.blf", b"LOGG\x90\0\0\0\xFF\xFF", &["`can_logconvert FILE.blf FILE.log`"]),
    ] {
        let path = directory.path().join(name);
        std::fs::write(&path, content).unwrap();
        for command in ["play", "compare"] {
            let refused = emulator.run("bus", &[command, path.to_str().unwrap()]);
            let err = refused.fails(2);
            for convert in converts {
                let stem = path.with_extension("");
                assert!(err.contains(&convert.replace("FILE", stem.to_str().unwrap())), "{convert}: {err}");
            }
        }
    }
}

/// Loggers write the frames of several interfaces out of order by some milliseconds.
#[test]
fn frames_out_of_order_are_played_and_compared_at_the_time_of_the_frame_before() {
    let (_directory, path) =
        log_file("(1.000) can0 101#\n(1.012) can0 102#\n(1.004) can0 103#\n(1.030) can0 104#\n");
    let emulator = start(OPEN, &["--clock", "stepped"]);
    let _guest = Guest::open(port(&emulator));
    let played = emulator.run("bus", &["play", &path]);
    assert_eq!(played.out, "4 frames in 30 ms\n", "{}", played.err);
    let note = "line 3: its time is before the time of an earlier frame; it is sent at once";
    assert!(played.err.contains(note), "{}", played.err);
    assert_eq!(emulator.run("bus", &["compare", &path]).ok(), "4 frames, no difference\n");
}

/// Each of two buses has its frames in order.
#[test]
fn frames_of_two_buses_are_played_in_the_order_of_their_times() {
    let two = format!(
        "{OPEN}\n[[bus]]\nname = 'other'\nkind = 'can'\nkbit_s = 125\ndoors = ['slcan-tcp:127.0.0.1:0']\n"
    );
    let (_directory, path) = log_file(
        "(1.000) open 101#\n(1.050) open 102#\n(1.010) other 103#\n(1.060) other 104#\n(1.100) open 105#\n",
    );
    let emulator = start(&two, &["--clock", "stepped"]);
    let _guests = [Guest::open(port(&emulator)), Guest::open(port_of(&emulator, 1))];
    let played = emulator.run("bus", &["play", &path]);
    assert_eq!((played.out.as_str(), played.err.as_str()), ("5 frames in 100 ms\n", ""));
    assert_eq!(emulator.run("bus", &["compare", &path]).ok(), "5 frames, no difference\n");
}

/// Two clients play logs at the same time, each to its bus. The frames keep the times of their log, except for the reported
/// delay, and each command ends after its last frame.
#[test]
fn logs_that_are_played_at_once_keep_their_times_or_report_the_delay() {
    let two = format!(
        "{OPEN}\n[[bus]]\nname = 'other'\nkind = 'can'\nkbit_s = 125\ndoors = ['slcan-tcp:127.0.0.1:0']\n"
    );
    let emulator = start(&two, &["--clock", "stepped"]);
    let _guests = [Guest::open(port(&emulator)), Guest::open(port_of(&emulator, 1))];
    let logs = ["open", "other"].map(|bus| {
        let line = |index: u32| format!("({}.{}00) {bus} {:03X}#\n", index / 10, index % 10, index + 1);
        log_file(&(0..30).map(line).collect::<String>())
    });
    let mut plays = logs.each_ref().map(|(_, path)| emulator.command("bus", &["play", path]));
    let played = std::thread::scope(|scope| {
        let plays = plays.each_mut().map(|play| scope.spawn(|| finish(play)));
        plays.map(|play| play.join().unwrap())
    });
    for outcome in &played {
        assert!(outcome.ok().starts_with("30 frames in 2900 ms"), "{outcome:?}");
    }
    for (bus, outcome) in ["open", "other"].into_iter().zip(&played) {
        assert_times(&emulator, bus, outcome, 30);
    }
}

/// Asserts that `count` frames, one every 100 ms, were not later than `play` reports. A command that gets no processor time
/// is late, but its delays do not add up.
fn assert_times(emulator: &Emulator, bus: &str, played: &crate::common::Outcome, count: usize) {
    let all = emulator.run("trace", &["--format", "candump"]).out;
    let frames = all.lines().filter(|line| line.contains(&format!(") {bus} ")));
    let times: Vec<f64> = frames.map(|line| line[1..18].parse().unwrap()).collect();
    assert_eq!(times.len(), count, "{all}");
    let late = played.out.split_once("up to ").map_or("0 us", |(_, late)| late);
    let (number, unit) = late.split_once(' ').unwrap();
    let us = [("us", 1.0), ("ms", 1e3), ("s", 1e6)].into_iter().find(|it| unit.starts_with(it.0)).unwrap().1;
    let late = number.parse::<f64>().unwrap() * us / 1e6;
    let delays = times.iter().enumerate().map(|(index, time)| time - times[0] - index as f64 / 10.0);
    assert!(delays.fold(0.0, f64::max) < late + 0.001, "{late} {times:?}");
}

/// Another client advances the clock past the times of some frames.
#[test]
fn a_log_that_is_played_beside_steps_keeps_its_times_or_reports_the_delay() {
    let emulator = start(OPEN, &["--clock", "stepped"]);
    let _guest = Guest::open(port(&emulator));
    let line = |index: u32| format!("({}.{}00) open {index:03X}#\n", index / 10, index % 10);
    let (_directory, path) = log_file(&(0..300).map(line).collect::<String>());
    let mut play = emulator.command("bus", &["play", &path]);
    let played = std::thread::scope(|scope| {
        let play = scope.spawn(|| finish(&mut play));
        while !play.is_finished() {
            emulator.step(&["130ms"]);
        }
        play.join().unwrap()
    });
    assert!(played.ok().starts_with("300 frames in 29900 ms of the log; "), "{played:?}");
    assert_times(&emulator, "open", &played, 300);
}

/// `trace` writes `bus0` into a log of candump for a bus with a name that is too long for an interface.
#[test]
fn buses_with_long_names_are_compared() {
    let plant = OPEN.replace("\"open\"", "\"a_very_long_name_of_a_bus\"");
    let two = format!("{plant}\n[[bus]]\nname = 'another_long_name_of_a_bus'\nkind = 'can'\nkbit_s = 125\n");
    let emulator = start(&two, &["--clock", "stepped"]);
    let _guest = Guest::open(port(&emulator));
    let (_directory, path) = log_file("(1.000) bus0 101#\n(1.050) bus0 102#\n");
    assert_eq!(emulator.run("bus", &["play", &path]).ok(), "2 frames in 50 ms\n");
    let (_directory, path) = log_file(emulator.run("trace", &["--format", "candump"]).ok());
    assert_eq!(emulator.run("bus", &["compare", &path]).ok(), "2 frames, no difference\n");
}

#[test]
fn many_interfaces_without_a_bus_have_one_note() {
    let two = format!("{OPEN}\n[[bus]]\nname = 'other'\nkind = 'can'\nkbit_s = 125\n");
    let emulator = start(&two, &["--clock", "stepped"]);
    let lines: String = (0..1_000).map(|index| format!("({index}.0) i{index} 101#\n")).collect();
    let (_directory, path) = log_file(&lines);
    let refused = emulator.run("bus", &["compare", &path]);
    let notes = refused.fails(2);
    assert!(
        notes.contains("980 frames of 980 more interfaces passed over: no bus has their names"),
        "{notes}"
    );
    assert_eq!(notes.matches("passed over").count(), 21);
}

/// If the terminal's path is not available, the terminal is not created, at the start or later.
#[test]
fn a_door_without_a_place_for_its_guest_does_not_open() {
    let emulator = start(OPEN, &["--clock", "stepped"]);
    let port = port(&emulator);
    let mut guests: Vec<_> = (0..64).map(|_| Guest::open(port)).collect();
    let refused = emulator.run("bus", &["open", "open", "slcan-pty"]);
    assert!(refused.fails(1).contains("an instance has places for 64 guests"), "{}", refused.err);
    let taken = emulator.run("bus", &["open", "open", &format!("slcan-tcp:127.0.0.1:{port}")]);
    assert!(taken.fails(3).contains("Address already in use"), "{}", taken.err);
    emulator.run("bus", &["open", "open", "slcan-pty:/dev/pts/1"]).fails(2);
    assert_eq!(buses(&emulator)[0]["doors"].as_array().unwrap().len(), 1);
    guests.pop();
    assert!(eventually(|| emulator.run("bus", &["open", "open", "slcan-pty"]).code == Some(0)));
    assert_eq!(buses(&emulator)[0]["doors"].as_array().unwrap().len(), 2);
    let doors = "doors = [".to_owned() + &"\"slcan-pty\", ".repeat(65);
    let many = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(many.path(), OPEN.replace("doors = [", &doors)).unwrap();
    let started =
        crate::common::run(&["run", many.path().to_str().unwrap(), "-i", &crate::common::unique_name()]);
    assert!(started.fails(1).contains("an instance has places for 64 guests"), "{}", started.err);
}

/// Returns whether a new guest gets an answer.
fn is_answered(port: u16, line: &str) -> bool {
    let mut guest = Guest::come(port);
    let _ = guest.0.write_all(line.as_bytes());
    guest.0.read(&mut [0]).is_ok_and(|count| count > 0)
}

/// The clock is stepped, and does not advance between the connections.
#[test]
fn departed_or_silent_guests_take_no_place() {
    let emulator = start(OPEN, &["--clock", "stepped"]);
    let port = port(&emulator);
    let guests = || buses(&emulator)[0]["guests"].as_array().unwrap().len();
    // When there are too many connections that send no data, the emulator closes the oldest of them for a new one.
    let mut silent: Vec<_> = (0..100).map(|_| Guest::come(port)).collect();
    let mut speaker = Guest::open(port);
    assert_eq!(silent[0].0.read(&mut [0]).unwrap(), 0, "the oldest was sent away");
    assert!(buses(&emulator)[0]["sent_away"].as_u64().unwrap() >= 37);
    let mut hearer = silent.pop().unwrap();
    assert_eq!(hearer.ask("O"), "\r", "a younger one is there");
    drop(silent);
    // More guests take part and leave than an instance can have at the same time.
    for _ in 0..250 {
        assert!(eventually(|| is_answered(port, "O\r")));
    }
    assert!(eventually(|| guests() == 2));
    assert_eq!(speaker.ask("t1230"), "z\r");
    emulator.step(&["5ms"]);
    assert_eq!(hearer.hear(), "t1230\r");
}

/// Guests send many frames and disconnect. The bus would need minutes for these frames, so they must not block the
/// places of new guests.
#[test]
fn departed_guests_take_no_place_while_the_bus_is_slow() {
    let emulator = start(OPEN, &[]);
    let port = port(&emulator);
    let _hearer = Guest::open(port);
    let frames = "t1238AABBCCDDEEFF0011\r".repeat(500);
    for _ in 0..250 {
        let mut guest = Guest::come(port);
        guest.send("O\r");
        // The emulator may close the connection before it has read all frames, so the write may fail.
        let _ = guest.0.write_all(frames.as_bytes());
        let _ = guest.0.shutdown(std::net::Shutdown::Write);
        let _ = guest.0.read_to_end(&mut Vec::new());
    }
    assert_eq!(buses(&emulator)[0]["guests"].as_array().unwrap().len(), 1);
    let sent_away = || buses(&emulator)[0]["sent_away"].as_u64().unwrap();
    let before = sent_away();
    let mut guests: Vec<_> = (0..63).map(|_| Guest::come(port)).collect();
    for guest in &mut guests {
        assert_eq!(guest.ask("O"), "\r");
    }
    assert_eq!(sent_away(), before);
}

/// Returns the numbers of the emulator's open file descriptors.
fn used_descriptors(emulator: &Emulator) -> Vec<u64> {
    let numbers = || -> Vec<u64> {
        let all = std::fs::read_dir(format!("/proc/{}/fd", emulator.pid())).unwrap();
        all.map(|entry| entry.unwrap().file_name().to_str().unwrap().parse().unwrap()).collect()
    };
    // The descriptors of a client that has just disconnected are closed a little later.
    let mut used = Vec::new();
    assert!(eventually(|| std::mem::replace(&mut used, numbers()) == numbers()));
    used
}

/// Limits the numbers of an emulator's file descriptors. Returns whether that succeeded.
fn limit_descriptors(emulator: &Emulator, limit: u64) -> bool {
    let limits = rustix::process::Rlimit { current: Some(limit), maximum: Some(limit) };
    let pid = rustix::process::Pid::from_raw(emulator.pid() as i32);
    rustix::process::prlimit(pid, rustix::process::Resource::Nofile, limits).is_ok()
}

#[test]
fn guests_leave_descriptors_to_the_channel_and_enter_when_some_are_free() {
    let emulator = start(OPEN, &[]);
    let port = port(&emulator);
    let used = used_descriptors(&emulator);
    let limit = (0..).filter(|number| !used.contains(number)).nth(32 + 16).unwrap();
    assert!(limit_descriptors(&emulator, limit));
    let mut guests: Vec<_> = (0..30).map(|_| Guest::come(port)).collect();
    let is_in = |guest: &mut Guest<TcpStream>| {
        let _ = guest.0.write_all(b"V\r");
        guest.0.read(&mut [0]).is_ok_and(|count| count > 0)
    };
    let inside = guests.iter_mut().filter_map(|guest| is_in(guest).then_some(())).count();
    assert!((10..30).contains(&inside), "{inside}");
    assert_eq!(buses(&emulator)[0]["sent_away"].as_u64(), Some(30 - inside as u64));
    for _ in 0..5 {
        emulator.peek(&["node2.w_CPU_CONTROL"]);
    }
    // The process has almost no free descriptor, not even for a guest that it rejects. The guest gets its answer when
    // one is free.
    let highest = used_descriptors(&emulator).into_iter().filter(|number| *number < limit).max().unwrap();
    assert!(limit_descriptors(&emulator, highest + 1));
    let mut waiting = Guest::come(port);
    waiting.send("V\r");
    drop(guests);
    let answer = waiting.0.read(&mut [0]).map_err(|error| error.kind());
    assert!(matches!(answer, Ok(_) | Err(ErrorKind::ConnectionReset)), "an answer, or the end: {answer:?}");
    // Only root may raise the hard limit of a process again.
    if limit_descriptors(&emulator, 1024) {
        assert!(eventually(|| is_answered(port, "V\r")));
    }
}
