//! A CS0015 at an open bus: canopen as its master, its board and its NOVRAM.

use crate::common::{Emulator, finish, python, run};
use serde_json::Value;
use std::fs;
use std::path::Path;
use std::thread;

/// The plant that the documentation shows.
const PLANT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/plants/cs0015.toml");

/// A master with an attached program, and a door for its node.
const TWO_WORLDS: &str = "
[[device]]
kind = 'cs0015'
name = 'plc'
bus = 'open'
node_id = 1
program = 'attached'

[[bus]]
name = 'open'
kind = 'can'
kbit_s = 125
doors = ['slcan-tcp:127.0.0.1:0']
";

/// An I/O module, and a door for its master.
const MODULE: &str = "
[[device]]
kind = 'cr201x'
module = 'cr2011'
name = 'valves'
bus = 'open'
node_id = 3

[[bus]]
name = 'open'
kind = 'can'
kbit_s = 125
doors = ['slcan-tcp:127.0.0.1:0']
";

/// Returns the port of the first door.
fn port(emulator: &Emulator) -> String {
    let buses: Value = serde_json::from_str(emulator.run("bus", &["list", "--format", "json"]).ok()).unwrap();
    let door = buses[0]["doors"][0].as_str().unwrap();
    door.strip_prefix("slcan-tcp:127.0.0.1:").unwrap().to_owned()
}

/// Runs a canopen script with the door of a plant and a device's data sheet. Returns `None` if canopen is missing.
fn canopen(script: &str, device: &str, plant: &str) -> Option<Emulator> {
    let mut command = python(&["can", "canopen", "serial"])?;
    let directory = tempfile::tempdir().unwrap();
    let eds = directory.path().join("device.eds");
    run(&["export", "eds", "--device", device, "--output", eds.to_str().unwrap()]).ok();
    let emulator = Emulator::start(&[plant]);
    command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python").join(script));
    command.arg(port(&emulator)).arg("125000").arg(&eds);
    let outcome = finish(&mut command);
    assert_eq!(outcome.code, Some(0), "{}{}", outcome.out, outcome.err);
    Some(emulator)
}

/// The write changes no value, so only the channel can report it.
#[test]
fn the_checker_judges_a_write_of_the_current_value() {
    let emulator = Emulator::start(&[PLANT, "--clock", "stepped"]);
    emulator.breaks(&["owner"]);
    emulator.poke(&["panel:inputs.I0=0"]);
    let found = emulator.run("check", &["--format", "json"]);
    let found: Value = serde_json::from_str(&found.out).unwrap();
    assert_eq!((&found[0]["rule"], &found[0]["register"]), (&"owner".into(), &"inputs.I0".into()));
}

#[test]
fn canopen_is_the_master_of_a_cs0015() {
    let Some(emulator) = canopen("check_cs0015.py", "cs0015", PLANT) else { return };
    let parameters = emulator.peek(&["panel:parameters.b_NODE_ID", "panel:flags.NODEID"]);
    assert_eq!(parameters, "16#05 16#05");
}

#[test]
fn canopen_is_the_master_of_an_io_module() {
    let directory = tempfile::tempdir().unwrap();
    let plant = directory.path().join("module.toml");
    fs::write(&plant, MODULE).unwrap();
    let Some(emulator) = canopen("check_cr201x.py", "cr201x", plant.to_str().unwrap()) else { return };
    assert_eq!(emulator.peek(&["valves:channels.a_OUTPUT[1]"]), "16#01F4");
}

/// The program of a CS0015 runs in a separate process, in step with the emulated time. It is the master of a canopen
/// node.
#[test]
fn a_program_by_mmap_is_the_master_of_a_node_of_canopen() {
    let Some(mut command) = python(&["can", "canopen", "serial"]) else { return };
    let directory = tempfile::tempdir().unwrap();
    let [module, plant] = ["commram.py", "two-worlds.toml"].map(|name| directory.path().join(name));
    run(&["export", "python", "--device", "cs0015", "--output", module.to_str().unwrap()]).ok();
    fs::write(&plant, TWO_WORLDS).unwrap();
    let emulator = Emulator::start(&[plant.to_str().unwrap(), "--clock", "stepped"]);
    command.env("PYTHONPATH", directory.path());
    command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/python/check_cs0015_master.py"));
    command.arg(&emulator.name).arg(port(&emulator)).arg("125000");
    let program = thread::spawn(move || finish(&mut command));
    // Advances the clock in small steps, so that the node can answer.
    while !program.is_finished() {
        emulator.step(&["20ms"]);
    }
    let outcome = program.join().unwrap();
    assert_eq!(outcome.code, Some(0), "{}{}", outcome.out, outcome.err);
}

/// Manual p. 13-17.
#[test]
fn the_board_has_the_switches_and_the_led_of_the_front_panel() {
    let emulator = Emulator::start(&[PLANT, "--clock", "stepped"]);
    let board = || -> Value {
        let board = emulator.run("board", &["get", "panel", "--format", "json"]);
        serde_json::from_str::<Value>(board.ok()).unwrap()[0].take()
    };
    emulator.step(&["300ms"]);
    let running = board();
    assert_eq!((&running["state"], &running["stat"]), (&"run".into(), &"green 0.5 Hz".into()));
    assert_eq!((&running["program"], &running["s1"]), (&"cyclic".into(), &"lock".into()));
    emulator.run("board", &["set", "panel:inputs=16#8001", "panel:s2=7", "panel:s3=on"]).ok();
    emulator.poke(&["panel:outputs.Q0=16#8000"]);
    emulator.step(&["40ms"]);
    assert_eq!(emulator.peek(&["panel:%IW0", "panel:inputs.S2", "panel:%IX1.8"]), "16#8001 16#07 1");
    assert_eq!((&board()["outputs"], &board()["inputs"]), (&0x8000.into(), &0x8001.into()));
    let locked = emulator.run("board", &["set", "panel:s2=8", "panel:program=stop"]);
    let message = locked.fails(1);
    assert!(message.contains("PLC 'panel' refuses program=stop: S1 is at LOCK"), "{message}");
    assert!(message.contains("set before the error: panel:s2=8"), "{message}");
    emulator.run("board", &["set", "panel:s1=unlock", "panel:program=stop"]).ok();
    emulator.step(&["20ms"]);
    let stopped = board();
    assert_eq!((&stopped["state"], &stopped["stat"]), (&"stop".into(), &"green".into()));
    assert_eq!((&stopped["outputs"], &stopped["program"]), (&0.into(), &"stopped".into()));
    let text = emulator.run("board", &["get"]);
    assert!(text.ok().contains("state stop, stat green, outputs 0"), "{}", text.out);
    let refused = emulator.run("board", &["set", "panel:s2=16"]);
    assert!(refused.fails(2).contains("s2 can be 0 to 15"), "{}", refused.err);
}

/// No program is attached here, so the changes come from the command.
#[test]
fn a_recorded_switch_is_changed_through_the_channel() {
    let emulator = Emulator::start(&[PLANT, "--clock", "stepped", "--record", "panel:front"]);
    emulator.run("board", &["set", "panel:inputs=5", "panel:s1=unlock"]).ok();
    emulator.step(&["1ms"]);
    let trace = emulator.run("trace", &["--kind", "changed", "--format", "jsonl"]);
    let changes: Vec<Value> = trace.ok().lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let of = |register: &str| -> Vec<_> {
        let changes =
            changes.iter().filter(|change| change["register"].as_str().unwrap().ends_with(register));
        changes.map(|change| change["by"].as_str().unwrap()).collect()
    };
    assert_eq!((of("inputs"), of("s1")), (vec!["channel"], vec!["channel"]), "{}", trace.out);
}

/// Manual p. 107, 154: each flag has an address. The error for an invalid address lists the addresses of the addressed
/// device.
#[test]
fn addresses_are_those_of_the_addressed_device() {
    let emulator = Emulator::start(&[PLANT, "--clock", "stepped"]);
    assert_eq!(emulator.peek(&["panel:%MW4032", "panel:%MW4095", "panel:%MX4095.15"]), "16#0000 16#0000 0");
    for text in ["%IW9", "%MW20000", "%MZ4", "panel:%IW9", "%MB3.80000"] {
        for command in ["peek", "wait", "poke"] {
            let argument = match command {
                "wait" => format!("{text}==1"),
                "poke" => format!("{text}=1"),
                _ => text.to_owned(),
            };
            let refused = emulator.run(command, &[&argument]);
            let message = refused.fails(2);
            let own = "%IW0 to %IW3 (inputs), %QW0 to %QW1 (outputs), %MW0 to %MW4095 (flags)";
            assert!(
                message.contains(own) && !message.contains("%MB3.80000 to"),
                "{command} {argument}: {message}"
            );
        }
    }
    let refused = emulator.run("peek", &["%MX10.16"]);
    assert!(refused.fails(2).contains("%MX10.16: a WORD has bits 0 to 15, not 16"), "{}", refused.err);
    // Without a running instance, an address that no device of the program has may belong to a device in a folder.
    for (text, code, expected) in [
        ("%IW9", 3, "'nothing-runs-here' is not running"),
        ("%IX1.16", 2, "%IX1.16: a WORD has bits 0 to 15, not 16"),
        ("%MW90000", 3, "'nothing-runs-here' is not running"),
    ] {
        let refused = run(&["peek", text, "--instance", "nothing-runs-here"]);
        assert!(refused.fails(code).contains(expected), "{}", refused.err);
    }
}

/// Manual p. 107, 155.
#[test]
fn retained_data_is_stored_in_a_file() {
    let directory = tempfile::tempdir().unwrap();
    let arguments = [PLANT, "--clock", "stepped", "--novram", directory.path().to_str().unwrap()];
    let emulator = Emulator::start(&arguments);
    emulator.step(&["300ms"]);
    emulator.poke(&["panel:%MW0=16#1234", "panel:%MW128=16#1234", "panel:parameters.b_NODE_ID=16#07"]);
    emulator.step(&["20ms"]);
    emulator.run("stop", &[]).ok();
    drop(emulator);
    let emulator = Emulator::start(&arguments);
    emulator.step(&["300ms"]);
    let kept = emulator.peek(&["panel:%MW0", "panel:%MW128", "panel:flags.NODEID"]);
    assert_eq!(kept, "16#1234 16#0000 16#07");
}

#[test]
fn the_demonstration_shows_start_pdos_and_a_guarding_failure() {
    let demo = run(&["demo", "--device", "cs0015"]);
    for line in [
        "panel  finds flags.NODEID (%MB7970) = 16#05",
        "panel  finds flags.COP_PREOPERATIONAL (%MB7951) = 16#00",
        "panel  finds rx_pdo.a_RX_PDO[2][0] (%MW2008) = 16#1234",
        "master finds rx_pdo.a_RX_PDO[2][3] (%MW2011) = 16#5678",
        "master finds flags.COP_GUARDFAIL_NODEID (%MB7950) = 16#05",
        "master finds flags.COP_GUARDFAIL_NODEID (%MB7950) = 16#00",
    ] {
        assert!(demo.ok().contains(line), "{line}\n{}", demo.out);
    }
}
