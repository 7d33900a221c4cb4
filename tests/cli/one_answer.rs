//! A C program, a Python program, a Rust soft-PLC and a scenario each start the master of the built-in plant with a
//! reference value of 5000. All read the same answer from the same drive.

use crate::common::{Emulator, Outcome, finish, python, run};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Returns the answer of drive 1: status of the master, state of the slave, reference value, actual value, and the
/// drive's last frame on the bus.
fn answer(emulator: &Emulator) -> String {
    let registers =
        ["node2.w_OPTION_STATUS", "node2.a_STAT_SL[1]", "node2.a_WR_VALUE[0]", "node2.a_RD_BMARRAY[1][0]"];
    let trace = emulator.run("trace", &["--bus", "drives", "--format", "candump"]);
    let mut frames = trace.ok().lines().filter_map(|line| line.split(' ').nth(2));
    let last = frames.rfind(|frame| frame.starts_with("301#")).unwrap_or("no frame");
    format!("{} {last}", emulator.peek(&registers))
}

/// Expected answer: active operation, drive responds and is synchronized, 5000 in both directions, and the drive's
/// frame. The frame has the value with its low byte first, then the status word 16#8037: operation enabled,
/// synchronized.
const ANSWER: &str = "16#0080 16#03 16#00001388 16#00001388 301#8813000037800000";

/// Runs a program with a separate emulator. The program must succeed, and the drive must have answered.
#[track_caller]
fn sees_the_answer(program: impl FnOnce(&Emulator) -> Outcome, expected: &str) {
    let emulator = Emulator::start(&[]);
    let outcome = program(&emulator);
    assert!(outcome.ok().contains(expected), "{}", outcome.out);
    assert_eq!(answer(&emulator), ANSWER);
}

fn root(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

#[test]
fn a_c_program_reads_the_answer_of_a_drive() {
    let directory = tempfile::tempdir().unwrap();
    run(&["export", "c", "--output", directory.path().join("commram.h").to_str().unwrap()]).ok();
    let program = directory.path().join("soft_plc");
    let mut compile = Command::new("cc");
    compile.args(["-Wall", "-Werror", "-I"]).arg(directory.path()).arg(root("tools/c/soft_plc.c"));
    finish(compile.arg("-o").arg(&program)).ok();
    sees_the_answer(
        |emulator| {
            let image = format!("/dev/shm/commram.{}.line", emulator.name);
            finish(Command::new(&program).args([&image, "5000"]))
        },
        "a_RD_BMARRAY[1][0] = 5000\n",
    );
}

#[test]
fn a_python_program_reads_the_answer_of_a_drive() {
    let Some(python) = python(&[]) else { return };
    let directory = tempfile::tempdir().unwrap();
    run(&["export", "python", "--output", directory.path().join("commram.py").to_str().unwrap()]).ok();
    sees_the_answer(
        |emulator| {
            let mut command = Command::new(python.get_program());
            command.arg(root("tools/python/soft_plc.py")).args([&emulator.name, "5000"]);
            command.env("PYTHONPATH", directory.path()).env("PYTHONDONTWRITEBYTECODE", "1");
            finish(&mut command)
        },
        "a_RD_BMARRAY[1][0] = 5000\n",
    );
}

#[test]
fn a_rust_program_reads_the_answer_of_a_drive() {
    let example = crate::common::example("master");
    sees_the_answer(
        |emulator| finish(Command::new(&example).args(["-i", &emulator.name])),
        "all slaves have reached reference value 5000\n",
    );
}

#[test]
fn a_scenario_reads_the_answer_of_a_drive() {
    sees_the_answer(
        |emulator| {
            let script = root("tests/scenarios/28-one-answer.rhai");
            finish(crate::common::commram().arg("test").arg(script).args(["--attach", &emulator.name]))
        },
        "| a_RD_BMARRAY[1][0] = 5000\n",
    );
}
