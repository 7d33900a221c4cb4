//! `snapshot`, `restore`, `run --from` and `step --back` on running emulators.

use crate::common::{Emulator, Follower, eventually, run};
use commram::devices;
use commram::memory::AttachMode;
use std::ffi::OsStr;
use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;
use tempfile::TempDir;

const STATUS: &str = "node2.w_OPTION_STATUS";

#[test]
fn a_file_brings_the_instance_back_and_starts_another_one() {
    let emulator = Emulator::stepped();
    let directory = TempDir::new().unwrap();
    let file = directory.path().join("waiting.snap");
    let file = file.to_str().unwrap();
    emulator.poke(&["node2.w_CPU_CONTROL=16#0001"]);
    emulator.step(&["5ms"]);
    let outcome = emulator.run("snapshot", &[file]);
    assert!(outcome.ok().starts_with(&format!("{file}: the state at 0.005000 s, ")), "{outcome:?}");
    emulator.set_up(&[]);
    let later = emulator.peek(&[STATUS]);
    assert_eq!(emulator.run("restore", &[file]).ok(), "0.005000 s\n");
    let waiting = emulator.peek(&[STATUS]);
    assert!(waiting != later && waiting.contains("16#0002"), "{waiting}");
    // An instance that starts from the file continues exactly like the instance that has written it.
    let other = Emulator::start(&["--clock", "stepped", "--from", file]);
    assert_eq!(other.peek(&[STATUS]), waiting);
    for emulator in [&emulator, &other] {
        emulator.set_up(&[]);
        emulator.step(&["50ms"]);
    }
    let [one, two] = [&emulator, &other].map(|emulator| emulator.run("trace", &[]));
    assert_eq!((one.code, &one.out, &one.err), (Some(0), &two.out, &two.err));
}

#[test]
fn the_start_is_before_the_pokes_at_the_time_0() {
    let emulator = Emulator::stepped();
    emulator.poke(&["node2.w_CPU_CONTROL=16#0001"]);
    emulator.step(&["5ms"]);
    let value = || emulator.run("peek", &["--raw", "node2.w_CPU_CONTROL"]).ok().to_owned();
    assert_eq!(emulator.run("step", &["--back", "5ms"]).ok(), "0.000000 s\n");
    assert_eq!(value(), "16#0001\n");
    assert_eq!(emulator.run("step", &["--back-to-start"]).ok(), "0.000000 s\n");
    assert_eq!(value(), "16#0000\n");
}

/// Tries all readers of the journal on a restored instance and on an instance that starts from the snapshot, first
/// without later records and then with some.
#[test]
fn readers_take_a_journal_that_continues_from_a_snapshot() {
    let emulator = Emulator::stepped();
    let directory = TempDir::new().unwrap();
    let file = |name: &str| directory.path().join(name).to_str().unwrap().to_owned();
    let (snapshot, log, scenario) = (file("a.snap"), file("a.log"), file("a.rhai"));
    emulator.set_up(&[]);
    emulator.step(&["50ms"]);
    emulator.run("snapshot", &[&snapshot]).ok();
    fs::write(&log, emulator.run("trace", &["--format", "candump"]).ok()).unwrap();
    let verbs = "record(\"node2.w_CPU_CONTROL\"); journal(0); history(\"node2.w_CPU_CONTROL\"); \
                 frames(\"drives\", 0); expect(\"node2.w_OPTION_STATUS\", 0x0043);\n\
                 let lost = \"\"; try { frames(\"drives\", 1) } catch (error) { lost = error.message; }\n\
                 expect_that(lost.contains(\"no longer has all frames\"), lost); frames(\"drives\", now());\n";
    fs::write(&scenario, verbs).unwrap();
    emulator.run("restore", &[&snapshot]).ok();
    let other = Emulator::start(&["--clock", "stepped", "--from", &snapshot]);
    for emulator in [&emulator, &other] {
        for has_records in [false, true] {
            let mut follower = Follower::start(emulator, "trace", &["--follow", "--last", "0"]);
            let begin = "the instance continues from a snapshot; its journal begins with record ";
            assert!(follower.note().contains(begin));
            if has_records {
                emulator.step(&["10ms"]);
                follower.line();
            }
            for format in ["text", "jsonl", "candump", "vcd", "pcapng"] {
                let outcome = emulator.command("trace", &["--format", format]).output().unwrap();
                let err = String::from_utf8(outcome.stderr).unwrap();
                assert_eq!(
                    (outcome.status.code(), err.matches(begin).count()),
                    (Some(0), 1),
                    "{format}: {err}"
                );
                assert_eq!(err.lines().count(), 1, "{format}: {err}");
                assert!(!has_records || outcome.stdout.len() > 100, "{format}");
            }
            let compared = emulator.run("bus", &["compare", &log]);
            assert!(matches!(compared.code, Some(0 | 1)) && compared.err.contains(begin), "{compared:?}");
            let played = run(&["test", &scenario, "--attach", &emulator.name]);
            assert_eq!(played.code, Some(0), "{}{}", played.out, played.err);
            emulator.run("check", &[]).ok();
            emulator.run("status", &[]).ok();
            emulator.run("bus", &["list"]).ok();
        }
    }
}

/// States from before the snapshot decide which of two overlaid structures is live. Node 1 is not initialized, node 2
/// is.
#[test]
fn readers_of_a_continued_journal_name_the_registers_of_the_valid_structure() {
    let directory = TempDir::new().unwrap();
    let file = directory.path().join("a.snap");
    let file = file.to_str().unwrap();
    let emulator = Emulator::stepped();
    emulator.poke(&["node2.w_CPU_CONTROL=16#0001"]);
    emulator.step(&["1ms"]);
    emulator.poke(&["node2.b_BT_1=16#1C", "node2.b_TIME_PATTERN=2", "node2.a_SL_TYP[1]=1"]);
    emulator.poke(&["node2.w_CPU_CONTROL=16#0002"]);
    emulator.step(&["1ms"]);
    emulator.run("snapshot", &[file]).ok();
    let continued = |emulator: &Emulator| {
        emulator.poke(&["node2.a_SL_TYP[1]=4", "node1.a_SL_TYP[1]=5"]);
        emulator.run("force", &["node1.a_SL_TYP[3]=9"]).ok();
        emulator.step(&["5ms"]);
        let trace = |format| {
            let outcome = emulator.run("trace", &["--format", format, "--since", "2ms"]);
            assert_eq!(outcome.code, Some(0), "{outcome:?}");
            let lines: Vec<_> = outcome.out.lines().map(str::to_owned).collect();
            // The heads of waveforms name the registers of all records.
            lines[lines.len().saturating_sub(5)..].join("\n")
        };
        ["text", "jsonl", "csv"].map(trace)
    };
    let expected = continued(&emulator);
    assert!(expected[1].contains("\"register\":\"node1.a_SL_TYP[1]\",\"address\""), "{expected:?}");
    emulator.run("restore", &[file]).ok();
    assert_eq!(continued(&emulator), expected);
    let other = Emulator::start(&["--clock", "stepped", "--from", file]);
    assert_eq!(continued(&other), expected);
}

/// The fault causes a change of the controller's state at the present emulated time. The plant handles this change only
/// when the clock advances. The same holds after a return to that time.
#[test]
fn an_event_that_is_due_at_the_moment_of_a_return_is_handled_later() {
    let directory = TempDir::new().unwrap();
    let plant = directory.path().join("plant.toml");
    let text = "[[device]]\nkind = 'cs0015'\nname = 'panel'\nbus = 'field'\nnode_id = 32\nkbit_s = 125\n\
                [[bus]]\nname = 'field'\nkind = 'can'\nkbit_s = 125\n";
    fs::write(&plant, text).unwrap();
    let emulator = Emulator::start(&[plant.to_str().unwrap(), "--clock", "stepped"]);
    let journal = || emulator.run("trace", &["--format", "jsonl"]).ok().to_owned();
    emulator.step(&["5ms"]);
    emulator.run("fault", &["add", "bus_off", "plc=panel"]).ok();
    let due = journal();
    emulator.step(&["1ms"]);
    let handled = journal();
    assert!(!due.contains("can_state") && handled.contains("can_state"), "{handled}");
    for _ in 0..2 {
        emulator.step(&["--back", "1ms"]);
        assert_eq!(journal(), due);
        emulator.step(&["1ms"]);
        assert_eq!(journal(), handled);
    }
    // The condition becomes true only by the event that is due now, so a return to the condition handles this event.
    assert_eq!(emulator.step(&["--back-to", "flags.CAN_BUS_OFF_ERROR==1"]), "0.005000 s");
    assert_eq!(emulator.peek(&["flags.CAN_BUS_OFF_ERROR"]), "16#01");
    emulator.step(&["1ms"]);
    assert_eq!(journal(), handled);
}

/// The journal never had the records from before the snapshot, so readers must not report them as lost. The test also
/// goes back, with and without later records, and with records between the snapshot and the return.
#[test]
fn going_back_after_a_snapshot_loses_no_records() {
    let emulator = Emulator::stepped();
    let directory = TempDir::new().unwrap();
    let file = directory.path().join("a.snap");
    let path = file.to_str().unwrap();
    emulator.set_up(&[]);
    emulator.run("snapshot", &[path]).ok();
    emulator.run("restore", &[path]).ok();
    let other = Emulator::start(&["--clock", "stepped", "--from", path]);
    for emulator in [&emulator, &other] {
        emulator.run("poke", &["node2.w_CPU_CONTROL=0"]).ok();
        emulator.step(&["5ms"]);
        for back in ["2ms", "1ms", "2ms"] {
            emulator.step(&["--back", back]);
            for format in ["text", "jsonl", "candump"] {
                let outcome = emulator.run("trace", &["--format", format]);
                assert_eq!(outcome.code, Some(0), "{outcome:?}");
                assert!(!outcome.out.contains("lost") && !outcome.err.contains("lost"), "{outcome:?}");
                assert_eq!(outcome.err.matches("its journal begins with record ").count(), 1, "{outcome:?}");
            }
        }
    }
}

#[test]
fn an_invalid_snapshot_or_one_of_another_plant_is_refused_by_name() {
    let emulator = Emulator::stepped();
    let directory = TempDir::new().unwrap();
    let file = directory.path().join("a.snap");
    let path = file.to_str().unwrap();
    emulator.run("snapshot", &[path]).ok();
    let mut bytes = fs::read(&file).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&file, &bytes).unwrap();
    let outcome = emulator.run("restore", &[path]);
    assert!(outcome.fails(2).contains("its checksum is wrong"), "{outcome:?}");
    fs::write(&file, "{}").unwrap();
    assert!(emulator.run("restore", &[path]).fails(2).contains("it is not a snapshot of commram"));
    assert!(run(&["run", "--from", path]).fails(2).contains("it is not a snapshot of commram"));
    let plant = directory.path().join("plant.toml");
    fs::write(&plant, "[[plc]]\nname = 'press'\n").unwrap();
    let other = Emulator::start(&[plant.to_str().unwrap(), "--clock", "stepped"]);
    other.run("snapshot", &[path]).ok();
    let outcome = emulator.run("restore", &[path]);
    assert!(outcome.err.contains("it is of another plant: it has PLCs press and buses none"), "{outcome:?}");
}

#[test]
fn back_by_a_time_and_to_a_condition() {
    let emulator = Emulator::stepped();
    emulator.poke(&["node2.w_CPU_CONTROL=16#0001"]);
    emulator.step(&["5ms"]);
    emulator.poke(&["node2.b_AC=16#10"]);
    emulator.step(&["5ms"]);
    let mut follower = Follower::start(&emulator, "trace", &["--follow"]);
    follower.line();
    assert_eq!(emulator.step(&["--back", "7ms"]), "0.003000 s");
    assert!(!emulator.peek(&["node2.b_AC"]).contains("10"));
    assert!(follower.note().contains("the instance has gone back"));
    emulator.step(&["10ms"]);
    assert_eq!(emulator.step(&["--back-to", "node2.w_OPTION_STATUS==16#0002"]), "0.000500 s");
    // A step back that is not possible has exit code 1 and not 2, because its arguments are right.
    let outcome = emulator.run("step", &["--back", "1s"]);
    assert!(outcome.fails(1).contains("the earliest moment is 0.000000 s, it is 0.0"), "{outcome:?}");
    let outcome = emulator.run("step", &["--back-to", "node2.w_OPTION_STATUS==16#0043"]);
    assert!(outcome.fails(1).contains("did not become true since 0.000000 s"), "{outcome:?}");
}

#[test]
fn a_snapshot_replaces_files_and_nothing_else() {
    use std::os::unix::fs::FileTypeExt;
    let emulator = Emulator::stepped();
    let directory = TempDir::new().unwrap();
    let fifo = directory.path().join("fifo");
    assert!(std::process::Command::new("mkfifo").arg(&fifo).status().unwrap().success());
    let own = directory.path().join("directory");
    fs::create_dir(&own).unwrap();
    for path in [&fifo, &own, Path::new("/dev/null")] {
        let outcome = emulator.run("snapshot", &[path.to_str().unwrap()]);
        assert!(outcome.fails(2).contains("name a regular file"), "{outcome:?}");
    }
    assert!(fs::metadata(&fifo).unwrap().file_type().is_fifo() && own.is_dir());
    assert!(fs::metadata("/dev/null").unwrap().file_type().is_char_device());
    assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 2, "nothing else was left there");
}

#[test]
fn a_program_that_has_mapped_the_registers_is_named() {
    let emulator = Emulator::stepped();
    emulator.step(&["5ms"]);
    let attached = devices::attach(&emulator.name, "line", AttachMode::ReadWrite).unwrap();
    // The name of another mapped file is not UTF-8.
    let directory = TempDir::new().unwrap();
    let other = directory.path().join(OsStr::from_bytes(b"\xFF"));
    fs::write(&other, "content").unwrap();
    // SAFETY: Nobody changes the length of the file, and nobody reads the map.
    let _other = unsafe { memmap2::Mmap::map(&fs::File::open(&other).unwrap()) }.unwrap();
    let outcome = emulator.run("step", &["--back", "1ms"]);
    let me = format!("(process {}), which has mapped the registers, cannot go back", std::process::id());
    assert!(outcome.err.contains(&me), "{outcome:?}");
    assert_eq!(emulator.step(&["--back", "1ms", "--detached"]), "0.004000 s");
    let file = directory.path().join("a.snap");
    let file = file.to_str().unwrap();
    emulator.run("snapshot", &[file]).ok();
    let outcome = emulator.run("restore", &[file]);
    assert!(outcome.fails(1).contains(&me), "{outcome:?}");
    assert_eq!(emulator.run("restore", &[file, "--detached"]).ok(), "0.004000 s\n");
    emulator.step(&["2ms"]);
    // The error names a task in lockstep by its event.
    let task = attached.0.join_lockstep(12, Duration::ZERO, Duration::from_secs(60)).unwrap();
    for outcome in [emulator.run("step", &["--back", "1ms"]), emulator.run("restore", &[file])] {
        let me =
            format!("the task of event 12 of PLC 'line' (process {}), which takes part", std::process::id());
        assert!(outcome.fails(1).contains(&me), "{outcome:?}");
    }
    assert_eq!(emulator.step(&["--back", "1ms", "--detached"]), "0.005000 s");
    drop(task);
    drop(attached);
    // A client with a read-only mapping does not prevent the step.
    let attached = devices::attach(&emulator.name, "line", AttachMode::ReadOnly).unwrap();
    assert_eq!(emulator.step(&["--back", "500us"]), "0.004500 s");
    drop(attached);
}

/// The emulator goes back only while no program has mapped the registers for writing. So a client of the channel must
/// not map them, not even for a moment while it connects.
#[test]
fn connecting_clients_of_the_channel_do_not_map_registers() {
    /// If clients mapped the registers while they connect, the server would see this at about one of eleven clients. So
    /// this number of clients is enough to notice it.
    const CLIENTS: usize = 120;
    let emulator = Emulator::stepped();
    emulator.step(&["5ms"]);
    let image = format!("/dev/shm/commram.{}.line", emulator.name);
    for number in 0..CLIENTS {
        let args: &[&str] = if number % 2 == 0 { &["--back", "1us"] } else { &["0us"] };
        let mut client = emulator.command("step", args).stdout(Stdio::null()).spawn().unwrap();
        let maps = format!("/proc/{}/maps", client.id());
        let status = loop {
            for line in fs::read_to_string(&maps).unwrap_or_default().lines() {
                let of_header = line.starts_with(&header_page(line));
                assert!(!line.ends_with(&image) || !line.contains(" rw-s ") || of_header, "{line}");
            }
            if let Some(status) = client.try_wait().unwrap() {
                break status;
            }
        };
        assert!(status.success(), "client {number}: {status}");
    }
}

/// Shortens the range of addresses in a line of `/proc/PID/maps` to the length of the header page.
fn header_page(line: &str) -> String {
    let begin = line.split('-').next().unwrap();
    format!("{begin}-{:x} ", u64::from_str_radix(begin, 16).unwrap() + 4096)
}

#[test]
fn a_guest_at_a_door_is_named() {
    let directory = TempDir::new().unwrap();
    let plant = directory.path().join("plant.toml");
    let door = "[[plc]]\nname = 'line'\n[[bus]]\nname = 'open'\nkind = 'can'\nkbit_s = 125\ndoors = ['slcan-tcp:127.0.0.1:0']\n";
    fs::write(&plant, door).unwrap();
    let emulator = Emulator::start(&[plant.to_str().unwrap(), "--clock", "stepped"]);
    let file = directory.path().join("a.snap");
    let file = file.to_str().unwrap();
    emulator.run("snapshot", &[file]).ok();
    let doors = emulator.run("bus", &["list", "--format", "json"]);
    let port = doors.ok().split("127.0.0.1:").nth(1).unwrap().split('"').next().unwrap().parse().unwrap();
    let mut guest = TcpStream::connect(("127.0.0.1", port)).unwrap();
    guest.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    guest.write_all(b"O\r").unwrap();
    let mut answer = [0];
    guest.read_exact(&mut answer).unwrap();
    // The guest takes part after the clock advances.
    emulator.step(&["5ms"]);
    for outcome in [emulator.run("step", &["--back", "1ms"]), emulator.run("restore", &[file])] {
        let named = "at door slcan-tcp:127.0.0.1:";
        assert!(
            outcome.fails(1).contains(named) && outcome.err.contains("of bus 'open' cannot go back"),
            "{outcome:?}"
        );
    }
    assert_eq!(emulator.step(&["--back", "1ms", "--detached"]), "0.004000 s");
    assert_eq!(emulator.run("restore", &[file, "--detached"]).ok(), "0.000000 s\n");
    drop(guest);
    // The guest has disconnected after the clock advances.
    emulator.step(&["1ms"]);
    assert!(
        eventually(|| emulator.run("restore", &[file]).code == Some(0)),
        "a guest that has left is no obstacle"
    );
}
