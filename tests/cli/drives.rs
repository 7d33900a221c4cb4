//! `commram drive`, `commram status`, and the messages about drives with another bit rate than their bus.

use crate::common::{Emulator, run};
use serde_json::Value;

fn json(emulator: &Emulator, command: &str, args: &[&str]) -> Vec<Value> {
    let outcome = emulator.run(command, &[args, &["--format", "json"]].concat());
    serde_json::from_str(outcome.ok()).unwrap()
}

#[test]
fn drives_are_listed_shown_and_set() {
    let emulator = Emulator::stepped();
    let drives = json(&emulator, "drive", &["list"]);
    let names: Vec<_> = drives.iter().map(|it| it["drive"].as_str().unwrap()).collect();
    assert_eq!(names, ["drive1", "drive2", "drive3", "line:drive"]);
    let first = &drives[0];
    assert_eq!((&first["bus"], &first["number"]), (&"drives".into(), &1.into()));
    assert_eq!((&first["state"], &first["synchronized"]), (&"operation_enabled".into(), &false.into()));
    assert_eq!((&drives[3]["bus"], &drives[3]["state"]), (&Value::Null, &"switch_on_disabled".into()));

    emulator.run("drive", &["set", "drive1", "P167=4000", "P300=-1000"]).ok();
    emulator.run("drive", &["set", "line:drive", "P120=16#0006"]).ok();
    let shown = &json(&emulator, "drive", &["show", "drive1"])[0];
    assert_eq!((&shown["reference"], &shown["zk"]["0"]), (&(-1000).into(), &300.into()));
    let parameters = shown["parameters"].as_array().unwrap();
    let slot = parameters.iter().find(|it| it["number"] == 167).unwrap();
    assert_eq!((&slot["value"], &slot["read_only"]), (&4000.into(), &false.into()));
    assert_eq!(slot["provenance"], "manual: 5.00005.03a p. 74; inferred: values D-863");
    let drives = json(&emulator, "drive", &["list"]);
    assert_eq!(drives[3]["state"], "ready_to_switch_on");
    // Without SYNC a drive continues with its local clock.
    emulator.step(&["100ms"]);
    assert_eq!(json(&emulator, "drive", &["list"])[0]["speed"], -1000);
    let trace = emulator.run("trace", &[]);
    assert!(trace.ok().contains("drive 1: P300 set to -1000 by hand"), "{}", trace.out);
    let text = emulator.run("drive", &["show", "drive1"]);
    for part in ["operation_enabled", "P167", "SYNC", "inferred: parameter D-27", "ZK 25"] {
        assert!(text.ok().contains(part), "{part}\n{}", text.out);
    }
}

#[test]
fn settings_that_a_drive_does_not_accept_are_refused() {
    let emulator = Emulator::stepped();
    for (args, message) in [
        (&["show", "drive9"][..], ", not this one; did you mean drive"),
        (&["set", "drive1", "P4095=1"], "drive 'drive1': P4095 = 1: it has no such parameter"),
        (&["set", "drive1", "P121=1"], "P121 = 1: only the drive itself writes it"),
        (&["set", "drive1", "P167=70000"], "P167 = 70000: it takes 0 to "),
        (&["set", "drive1", "P167"], "write NUMBER=VALUE"),
    ] {
        let outcome = emulator.run("drive", args);
        assert!(outcome.fails(2).contains(message), "{message}\n{}", outcome.err);
    }
    emulator.run("fault", &["add", "slave_off", "slave=2"]).ok();
    emulator.step(&["1ms"]);
    assert_eq!(json(&emulator, "drive", &["list"])[1]["state"], "off");
    let off = emulator.run("drive", &["set", "drive2", "P300=1"]);
    assert!(off.fails(1).contains("the drive has no supply"), "{}", off.err);
}

#[test]
fn status_shows_the_current_state_of_the_plant() {
    let emulator = Emulator::stepped();
    emulator.run("poke", &["node2.w_CPU_CONTROL=1"]).ok();
    emulator.step(&["2ms"]);
    let status = &json(&emulator, "status", &[])[0];
    assert_eq!((&status["clock"], &status["time_us"]), (&"stepped".into(), &2000.into()));
    assert_eq!((&status["plcs"][0]["plc"], &status["plcs"][0]["power"]), (&"line".into(), &"on".into()));
    let node = &status["nodes"][1];
    assert_eq!(
        (&node["node"], &node["bus"], &node["state"]),
        (&"line:node2".into(), &"drives".into(), &2.into())
    );
    assert_eq!(
        (&status["nodes"][0]["bus"], &status["buses"][0]["load_percent"]),
        (&Value::Null, &0.0.into())
    );
    assert_eq!(status["drives"].as_array().unwrap().len(), 4);
    let text = emulator.run("status", &[]);
    for part in [
        "at 0.002000 s, clock stepped",
        "line:node2   drives  16#0002  waiting",
        "0 errors, 0 warnings; 0 faults",
    ] {
        assert!(text.ok().contains(part), "{part}\n{}", text.out);
    }
}

/// Decisions D-540, D-541.
#[test]
fn every_command_reports_a_drive_with_another_bit_rate() {
    let directory = tempfile::tempdir().unwrap();
    let plant = directory.path().join("plant.toml");
    let text = "[[plc]]\nname = 'line'\nnode2 = 'b'\n[[bus]]\nname = 'b'\n\
                [[bus.drive]]\nname = 'winder'\nslave_number = 3\nkbit_s = 250\n";
    std::fs::write(&plant, text).unwrap();
    let plant = plant.to_str().unwrap();
    let message = "line 9: warning: drive 'winder' is set to 250 kbit/s and will hear nothing";
    let checked = run(&["run", "--check", plant]);
    assert!(checked.ok().contains(message), "{}", checked.out);
    let checked: Value =
        serde_json::from_str(run(&["run", "--check", "--format", "json", plant]).ok()).unwrap();
    assert_eq!((&checked[0]["fine"], &checked[0]["warnings"][0]["line"]), (&true.into(), &9.into()));

    let emulator = Emulator::start(&[plant, "--clock", "stepped"]);
    let rates = |bus: &Value| (bus["kbit_s"].clone(), bus["other_rates"][0]["name"].clone());
    assert_eq!(rates(&json(&emulator, "bus", &["list"])[0]), (500.into(), "winder".into()));
    let table = emulator.run("bus", &["list"]);
    assert!(table.ok().contains("winder (250)"), "{}", table.out);
    for writes in [
        &["node2.w_CPU_CONTROL=1"][..],
        &[
            "node2.b_BT_1=16#1C",
            "node2.b_OUTPUT_CONTROL=16#FA",
            "node2.b_CLOCK_DIVIDER=7",
            "node2.b_TIME_PATTERN=2",
            "node2.a_SL_TYP[3]=1",
            "node2.w_CPU_CONTROL=2",
        ],
        &["node2.w_CPU_CONTROL=16#20"],
    ] {
        emulator.run("poke", writes).ok();
        emulator.step(&["1ms"]);
    }
    let check = emulator.run("check", &[]);
    assert_eq!(check.code, Some(1), "{}", check.err);
    assert!(check.out.contains("drive-baud-rate  b:slave3"), "{}", check.out);
    assert!(check.out.contains("5.01010.01 p. 10, 13"), "{}", check.out);
    emulator.breaks(&["drive-baud-rate"]);
    let trace = emulator.run("trace", &["--kind", "drive_baud_rate_mismatch"]);
    assert!(
        trace.ok().contains("drive 3 is set to 250 kbit/s, the bus runs at 500: it hears nothing"),
        "{}",
        trace.out
    );
}

#[test]
fn poke_says_that_only_the_firmware_writes_a_register() {
    let emulator = Emulator::stepped();
    let outcome = emulator.run("poke", &["node2.w_OPTION_STATUS=16#0042"]);
    assert_eq!((outcome.code, outcome.out.as_str()), (Some(0), ""));
    let message = "note: only the firmware writes node2.w_OPTION_STATUS (%MW3.200002): the value was written";
    assert!(outcome.err.contains(message), "{}", outcome.err);
    assert_eq!(emulator.peek(&["node2.w_OPTION_STATUS"]), "16#0042");
    assert_eq!(emulator.run("poke", &["node2.w_CPU_CONTROL=0"]).err, "");
    emulator.breaks(&["owner"]);
}
