//! Scenarios on a running instance: `--attach`.

use super::*;
use crate::common::{Emulator, unique_name};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

const START: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenarios/01-start-of-the-master.rhai");

#[test]
fn a_scenario_runs_alike_on_a_running_instance() {
    let emulator = Emulator::stepped();
    let own = run(&["test", START]);
    let there = run(&["test", START, "--attach", &emulator.name]);
    assert_eq!(without_real_times(there.ok()), without_real_times(own.ok()));
    assert_eq!(emulator.peek(&["node2.w_OPTION_STATUS"]), "16#0080");
}

/// Returns the plant file of a scenario: the file that it names, or its embedded plant.
fn plant_of(script: &Path, directory: &TempDir) -> Option<PathBuf> {
    let text = std::fs::read_to_string(script).unwrap();
    let (_, plant) = text.split_once("\nplant(")?;
    if let Some((file, _)) = plant.strip_prefix('"').and_then(|rest| rest.split_once('"')) {
        return Some(script.with_file_name(file));
    }
    let (toml, _) = plant.strip_prefix('`').and_then(|rest| rest.split_once('`')).unwrap();
    let path = directory.path().join("plant.toml");
    std::fs::write(&path, toml).unwrap();
    Some(path)
}

/// Violations of the manual that some scenarios show on purpose; all other scenarios have none.
const ON_PURPOSE: [(&str, &str); 3] =
    [("04-deadlines", "late-reference"), ("12-forced-registers", "owner"), ("21-ip-address", "ip-address")];

/// All verbs behave on a live instance as on a private plant, to the microsecond: blocks, forces, faults, findings,
/// boards.
#[test]
fn every_scenario_of_the_tutorial_passes_alike_on_a_running_instance() {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scenarios");
    let entries = directory.read_dir().unwrap().map(|entry| entry.unwrap().path());
    let mut scripts: Vec<_> =
        entries.filter(|path| path.extension().is_some_and(|it| it == "rhai")).collect();
    scripts.sort();
    assert!(scripts.len() > 20, "{scripts:?}");
    let next = AtomicUsize::new(0);
    let work = || {
        while let Some(script) = scripts.get(next.fetch_add(1, Ordering::Relaxed)) {
            let plants = TempDir::new().unwrap();
            let plant = plant_of(script, &plants);
            let plant = plant.iter().map(|path| path.to_str().unwrap());
            let emulator =
                Emulator::start(&["--clock", "stepped"].into_iter().chain(plant).collect::<Vec<_>>());
            let broken = ON_PURPOSE.iter().find(|(name, _)| script.file_stem() == Some(name.as_ref()));
            emulator.breaks(broken.map(|(_, rule)| *rule).as_slice());
            let there = run(&["test", script.to_str().unwrap(), "--attach", &emulator.name]);
            assert_eq!((there.code, there.err.as_str()), (Some(0), ""), "{}", there.out);
            let own = run(&["test", script.to_str().unwrap()]);
            assert_eq!(without_real_times(&there.out), without_real_times(&own.out));
        }
    };
    // More workers than processors would only slow down each of them.
    let workers = std::thread::available_parallelism().map_or(1, usize::from).min(4);
    std::thread::scope(|scope| (0..workers).for_each(|_| drop(scope.spawn(work))));
}

/// Another program records the register, and has changed it before.
#[test]
fn a_history_begins_when_the_script_records_the_register() {
    let emulator = Emulator::start(&["--clock", "stepped", "--record", "node2"]);
    emulator.poke(&["node2.b_AC=3"]);
    let place = TempDir::new().unwrap();
    let script = place.path().join("history.rhai");
    std::fs::write(
        &script,
        "record(\"node2.b_AC\"); poke(\"node2.b_AC\", 1); step(\"1ms\"); poke(\"node2.b_AC\", 0);
         expect_history(\"node2.b_AC\", [1, 0]); print(history(\"node2.b_AC\").len());",
    )
    .unwrap();
    let script = script.to_str().unwrap();
    for _ in 0..2 {
        let there = run(&["test", script, "--attach", &emulator.name]);
        assert_eq!(there.code, Some(0), "{there:?}");
    }
    assert_eq!(run(&["test", script]).code, Some(0));
}

/// A script that prints the emulated times at which verbs see changes, to the microsecond. It also shows which verbs
/// take no time.
const MOMENTS: &str = r#"
    print(`start ${now()}`);
    poke("node2.w_CPU_CONTROL", 1);
    print(`condition after ${wait_until(|| peek("node2.w_OPTION_STATUS") == 2, "10ms")}, at ${now()}`);
    for data in [["b_AC", 0xFF], ["b_AM", 0xFF], ["b_BT_1", 0x1C], ["b_OUTPUT_CONTROL", 0xFA], ["b_CLOCK_DIVIDER", 7],
                 ["b_TIME_PATTERN", 2], ["a_SL_TYP[1]", 1]] {
        poke("node2." + data[0], data[1]);
    }
    for command in [[0x02, 0x03], [0x20, 0x43]] {
        poke("node2.w_CPU_CONTROL", command[0]);
        print(`register after ${wait("node2.w_OPTION_STATUS", command[1], "10ms")}`);
    }
    expect_frame("drives", 0x501, "*", "10ms");
    print(`frame at ${now()}`);
    wait_until(|| peek("node2.a_STAT_SL[1]") == 3, "2s");
    print(`synchronized at ${now()}`);

    // Steps to a time between two events, and to the exact time of an event.
    step(37);
    fault("bus_off plc=line node=2");
    print(`off after ${wait_until(|| peek("node2.w_CANsync_STATUS") == 0xC0, "10ms")}`);
    clear_faults();

    let timer = block("INTR_SET", "line");
    timer.i_EVENT = 0;
    timer.i_PAR1 = 3;
    timer.x_EN = true;
    cycle(timer);
    step(1000);
    print(`${event_count(0)} events`);
    timer.i_PAR1 = -1;
    cycle(timer);
    cycle(timer);
    print(`refused: ${timer.x_ERR}, at ${now()}`);
    set_board("switch=stop");
    print(`display ${board().display}`);
    set_board("start=cold");
"#;

#[test]
fn a_script_sees_the_same_moments_on_a_running_instance() {
    let emulator = Emulator::stepped();
    let scripts = Scripts::new(&[("moments.rhai", MOMENTS)]);
    let own = scripts.run(&["moments.rhai"]);
    let there = scripts.run(&["moments.rhai", "--attach", &emulator.name]);
    assert_eq!(without_real_times(&there.out), without_real_times(&own.out));
    assert!(own.out.contains("PLC 'line': a start or stop needs a loaded program"), "{}", own.out);
    assert_eq!((own.code, there.code), (Some(1), Some(1)));
}

/// An instance keeps at most 64 snapshots for all its clients.
#[test]
fn the_snapshots_of_a_scenario_are_released_at_its_end() {
    let emulator = Emulator::stepped();
    let many = "for number in 0..40 { save(); } expect_that(true, \"\");";
    let scripts = Scripts::new(&[
        ("passes.rhai", many),
        ("fails.rhai", &format!("{many} expect_that(false, \"on purpose\");")),
    ]);
    for (script, code) in [("passes.rhai", 0), ("fails.rhai", 1), ("passes.rhai", 0)] {
        let outcome = scripts.run(&[script, "--attach", &emulator.name]);
        assert_eq!(outcome.code, Some(code), "{script}: {}", outcome.out);
    }
}

#[test]
fn a_scenario_reports_verbs_that_an_instance_does_not_support() {
    let emulator = Emulator::stepped();
    let scripts = Scripts::new(&[
        ("plant.rhai", "plant(`[[plc]]\nname = \"other\"`);"),
        ("fails.rhai", "expect(\"node2.w_OPTION_STATUS\", 9);"),
        ("sync.rhai", "step_to_sync();"),
    ]);
    let on = |script: &str, name: &str| scripts.run(&[script, "--attach", name]);
    let plant = on("plant.rhai", &emulator.name);
    assert_eq!(plant.code, Some(2));
    assert!(plant.out.contains("the instance has another plant, its PLCs are line"), "{}", plant.out);
    let fails = on("fails.rhai", &emulator.name);
    assert_eq!(fails.code, Some(1));
    assert!(fails.out.contains("is 16#0001, not 16#0009"), "{}", fails.out);
    assert_eq!(on("sync.rhai", &emulator.name).code, Some(1));
    let absent = unique_name();
    assert!(on("fails.rhai", &absent).fails(3).contains("is not running"));
    let both = scripts.run(&["fails.rhai", "--attach", &absent, "--jobs", "2"]);
    assert!(both.fails(2).contains("cannot be used with"));
}

#[test]
fn a_clock_that_runs_by_itself_can_be_waited_for_but_not_stepped() {
    let emulator = Emulator::start(&[]);
    let scripts = Scripts::new(&[
        (
            "wait.rhai",
            "poke(\"node2.w_CPU_CONTROL\", 1); wait(\"node2.w_OPTION_STATUS\", 2, \"30s\");
                       wait_until(|| peek(\"node2.w_OPTION_STATUS\") == 2, \"30s\");",
        ),
        ("step.rhai", "step(\"1ms\");"),
    ]);
    let outcome = scripts.run(&["wait.rhai", "step.rhai", "--attach", &emulator.name]);
    assert!(outcome.out.contains("passed  wait.rhai"), "{}", outcome.out);
    assert!(outcome.out.contains("the clock runs in real time"), "{}", outcome.out);
    assert_eq!(outcome.code, Some(1));
}
