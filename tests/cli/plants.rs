//! Checks of plant files before they run, and plants of many PLCs.

use crate::common::{Emulator, Outcome, commram, finish};
use std::path::Path;
use tempfile::TempDir;

fn run_in(directory: &Path, args: &[&str]) -> Outcome {
    finish(commram().args(args).current_dir(directory))
}

#[test]
fn a_plant_is_judged_without_being_started() {
    let directory = TempDir::new().unwrap();
    let judge = |text: &str, args: &[&str]| {
        std::fs::write(directory.path().join("plant.toml"), text).unwrap();
        run_in(directory.path(), &[&["run", "--check", "plant.toml"], args].concat())
    };
    let fine = "[[plc]]\nname = \"line\"\nnode2 = \"drives\"\n[[bus]]\nname = \"drives\"\n";
    assert_eq!(judge(fine, &[]).ok(), "plant.toml: fine: 1 device, 1 bus with 0 drives, 0 faults\n");
    let json: serde_json::Value = serde_json::from_str(judge(fine, &["--format", "json"]).ok()).unwrap();
    assert_eq!(
        (&json[0]["fine"], &json[0]["devices"][0]["ports"][1]["bus"]),
        (&true.into(), &"drives".into())
    );
    for (text, line, message) in [
        ("[[plc]]\nname = \"line\"\ndip = 32\n", 3, "dip of 'line' is 32; it must be 0 to 31"),
        ("[[plc]]\nname = \"line\"\nnode = 3\n", 3, "unknown field `node`"),
        ("[[bus]]\nname = \"b\"\nkind = \"lan\"\n", 3, "there is no bus of kind 'lan'; kinds are: "),
        ("bus = 5\n", 1, "[[bus]] begins a section; there can be several"),
    ] {
        assert!(judge(text, &[]).fails(2).contains(message), "{text}");
        let refused = judge(text, &["--format", "json"]);
        let json: serde_json::Value = serde_json::from_str(&refused.out).unwrap();
        assert_eq!(
            (refused.code, &json[0]["fine"], &json[0]["line"]),
            (Some(2), &false.into(), &line.into())
        );
        assert!(json[0]["message"].as_str().unwrap().starts_with(message), "{json}");
    }
    assert!(run_in(directory.path(), &["run", "--format", "json"]).fails(2).contains("--check"));
}

/// An option with which the emulator would not start.
#[test]
fn the_other_options_are_checked_without_a_start() {
    let directory = TempDir::new().unwrap();
    let write = |name: &str, text: &str| std::fs::write(directory.path().join(name), text).unwrap();
    write("plant.toml", "[[plc]]\nname = 'line'\nnode2 = 'drives'\n[[bus]]\nname = 'drives'\n");
    write("fine.toml", "period = '1ms'\n[[publish]]\nvalue = 'node2.w_CPU_CONTROL'\n");
    write("wrong.toml", "period = '1ms'\n[[publish]]\nvalue = 'node2.w_NONE'\n");
    std::fs::create_dir(directory.path().join("novram")).unwrap();
    let check = |args: &[&str]| run_in(directory.path(), &[&["run", "--check", "plant.toml"], args].concat());
    for args in [
        &["--speed", "10", "--record", "node2.w_CPU_CONTROL,node1"][..],
        &["--clock", "stepped", "--exchange", "fine.toml"],
        &["--novram", "novram"],
        &["--novram", "missing/novram"],
    ] {
        assert!(check(args).ok().starts_with("plant.toml: fine"), "{args:?}");
    }
    for (args, message) in [
        (&["--speed", "0"][..], "speed 0: must be 0.001 to 1000"),
        (&["--speed", "NaN"], "speed NaN: must be 0.001 to 1000"),
        (&["--clock", "stepped", "--speed", "10"], "so there is no speed"),
        (&["--record", "node2.w_NONE"], "w_NONE"),
        (&["--record", "press:node2.w_CPU_CONTROL"], "press"),
        (&["--clock", "stepped", "--exchange", "none.toml"], "none.toml"),
        (&["--clock", "stepped", "--exchange", "wrong.toml"], "w_NONE"),
        (&["--exchange", "fine.toml"], "add --clock stepped"),
        (&["--layout", "none"], "none"),
        (&["--novram", "plant.toml"], "plant.toml"),
    ] {
        let outcome = check(args);
        assert!(matches!(outcome.code, Some(1..=3)), "{args:?}: {outcome:?}");
        assert!(outcome.err.contains(message) && outcome.out.is_empty(), "{args:?}: {outcome:?}");
        let started = run_in(
            directory.path(),
            &[&["run", "plant.toml", "-i", &crate::common::unique_name()], args].concat(),
        );
        assert_eq!(started.code, outcome.code, "{args:?}: {}", started.err);
    }
    let mut names: Vec<_> = directory.path().read_dir().unwrap().map(|it| it.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["fine.toml", "novram", "plant.toml", "wrong.toml"]);
}

/// One request has a maximum number of operations, and a maximum size of the replies.
#[test]
fn commands_divide_their_requests_for_a_plant_of_many_plcs() {
    let directory = TempDir::new().unwrap();
    let plant = directory.path().join("plant.toml");
    let plc = |number: usize| format!("[[plc]]\nname = \"P{number:030}\"\n");
    std::fs::write(&plant, (0..257).map(plc).collect::<String>()).unwrap();
    let emulator = Emulator::start(&[plant.to_str().unwrap(), "--clock", "stepped"]);
    let last = format!("P{:030}", 256);
    for (command, args) in
        [("board", &["get"][..]), ("dump", &["--all"]), ("status", &[]), ("drive", &["list"])]
    {
        let shown = emulator.run(command, args);
        assert!(shown.ok().contains(&last), "{command}");
    }
}
