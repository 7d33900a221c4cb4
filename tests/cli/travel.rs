//! `snapshot`, `restore`, `run --from` and `step --back` on running emulators.
#![cfg(feature = "channel")]

use crate::common::{Emulator, Follower, run};
use commram::devices;
use commram::memory::AttachMode;
use std::fs;
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
    let told = emulator.run("snapshot", &[file]);
    assert!(told.ok().starts_with(&format!("{file}: the state at 0.005000 s, ")), "{told:?}");
    emulator.set_up(&[]);
    let later = emulator.peek(&[STATUS]);
    assert_eq!(emulator.run("restore", &[file]).ok(), "0.005000 s\n");
    let waiting = emulator.peek(&[STATUS]);
    assert!(waiting != later && waiting.contains("16#0002"), "{waiting}");
    // Started from the file, everything comes as it does here.
    let other = Emulator::start(&["--clock", "stepped", "--from", file]);
    assert_eq!(other.peek(&[STATUS]), waiting);
    for emulator in [&emulator, &other] {
        emulator.set_up(&[]);
        emulator.step(&["50ms"]);
    }
    let [one, two] = [&emulator, &other].map(|emulator| emulator.run("trace", &[]).ok().to_owned());
    assert_eq!(one, two);
}

#[test]
fn what_is_no_snapshot_or_of_another_plant_is_refused_by_name() {
    let emulator = Emulator::stepped();
    let directory = TempDir::new().unwrap();
    let file = directory.path().join("a.snap");
    let path = file.to_str().unwrap();
    emulator.run("snapshot", &[path]).ok();
    let mut bytes = fs::read(&file).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&file, &bytes).unwrap();
    let told = emulator.run("restore", &[path]);
    assert!(told.fails(2).contains("its checksum is wrong"), "{told:?}");
    fs::write(&file, "{}").unwrap();
    assert!(emulator.run("restore", &[path]).fails(2).contains("it is no snapshot of commram"));
    assert!(run(&["run", "--from", path]).fails(2).contains("it is no snapshot of commram"));
    let plant = directory.path().join("plant.toml");
    fs::write(&plant, "[[plc]]\nname = 'press'\n").unwrap();
    let other = Emulator::start(&[plant.to_str().unwrap(), "--clock", "stepped"]);
    other.run("snapshot", &[path]).ok();
    let told = emulator.run("restore", &[path]);
    assert!(told.err.contains("it is of another plant: it has PLCs press and buses none"), "{told:?}");
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
    let told = emulator.run("step", &["--back", "1s"]);
    assert!(told.err.contains("one can go back to 0 us"), "{told:?}");
}

#[test]
fn a_program_that_has_mapped_the_registers_is_named() {
    let emulator = Emulator::stepped();
    emulator.step(&["5ms"]);
    let attached = devices::attach(&emulator.name, "line", AttachMode::ReadWrite).unwrap();
    let told = emulator.run("step", &["--back", "1ms"]);
    let me = format!("(process {}), which has mapped the registers, cannot go back", std::process::id());
    assert!(told.err.contains(&me), "{told:?}");
    assert_eq!(emulator.step(&["--back", "1ms", "--detached"]), "0.004000 s");
    drop(attached);
    // Who only looks is no obstacle.
    let attached = devices::attach(&emulator.name, "line", AttachMode::ReadOnly).unwrap();
    assert_eq!(emulator.step(&["--back", "1ms"]), "0.003000 s");
    drop(attached);
}
