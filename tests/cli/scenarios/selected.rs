//! Selection of the scenarios to run, and the conditions under which they pass.

use super::*;
use crate::common::{eventually, wait_for};
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::Stdio;
use std::sync::{Arc, Mutex};

const GOOD: &str = "expect(\"node2.w_OPTION_STATUS\", 1);";
const BAD: &str = "expect(\"node2.w_OPTION_STATUS\", 2);";

/// Returns a folder with subfolders.
fn tree() -> Scripts {
    let scripts = Scripts::new(&[]);
    for folder in ["winder/slow", "common"] {
        std::fs::create_dir_all(scripts.0.path().join(folder)).unwrap();
    }
    for (name, text) in [
        ("first.rhai", "import \"common/check\" as check;\ncheck::check();"),
        ("common/check.rhai", "fn check() { expect(\"node2.w_OPTION_STATUS\", 1); }"),
        ("winder/start.rhai", GOOD),
        ("winder/slow/stop.rhai", GOOD),
    ] {
        std::fs::write(scripts.0.path().join(name), text).unwrap();
    }
    scripts
}

#[test]
fn subfolders_filters_and_shards_say_which_scenarios_run() {
    let scripts = tree();
    let listed = |args: &[&str]| scripts.run(&[&[".", "--list"], args].concat()).ok().replace('\n', " ");
    assert_eq!(listed(&[]), "first.rhai winder/slow/stop.rhai winder/start.rhai ");
    assert_eq!(listed(&["--filter", "winder", "--filter", "f*"]), listed(&[]));
    assert_eq!(listed(&["--filter", "st??t"]), "winder/start.rhai ");
    assert_eq!(listed(&["--shard", "1/2"]), "first.rhai winder/start.rhai ");
    assert_eq!(listed(&["--shard", "2/2"]), "winder/slow/stop.rhai ");
    let json = scripts.run(&[".", "--list", "--filter", "stop", "--format", "json"]);
    let json: serde_json::Value = serde_json::from_str(json.ok()).unwrap();
    assert_eq!(json, serde_json::json!([{ "scenario": "stop", "file": "winder/slow/stop.rhai" }]));
    let outcome = scripts.run(&["."]);
    let lines: Vec<_> =
        outcome.ok().lines().map(|line| line.split("  ").nth(1).unwrap_or_default()).collect();
    assert_eq!(lines, ["first.rhai", "winder/slow/stop.rhai", "winder/start.rhai", ""]);
    assert!(scripts.run(&[".", "--filter", "nothing"]).fails(2).contains("`nothing`: no scenario has this"));
    assert!(scripts.run(&[".", "--shard", "3/2"]).fails(2).contains("shards are counted from 1 up to 2"));
    let none = scripts.run(&[".", "--jobs", "0"]);
    assert!(none.fails(2).contains("write a whole number, 1 or more"), "{}", none.err);
    let part = scripts.run(&["common"]);
    assert_eq!(part.code, Some(1), "no scenario there imports it: {}", part.out);
}

/// A scenario in the folder of a device needs the device, and not the built-in plant.
#[test]
fn scenarios_in_a_device_folder_get_its_device() {
    let scripts = Scripts::new(&[("first.rhai", GOOD)]);
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/devices/mailbox");
    let card = scripts.0.path().join("cards/mailbox");
    std::fs::create_dir_all(card.join("tests/more")).unwrap();
    for entry in std::fs::read_dir(&example).unwrap().chain(std::fs::read_dir(example.join("tests")).unwrap())
    {
        let path = entry.unwrap().path();
        if path.is_file() {
            let place = path.strip_prefix(&example).unwrap();
            std::fs::copy(&path, card.join(place)).unwrap();
        }
    }
    std::fs::write(card.join("tests/more/box.rhai"), "expect(\"box.w_FUNCTION\", 0);").unwrap();
    let built_in = "plant(\"[[plc]]\\nname = 'line'\\n\"); expect(\"node1.w_CPU_CONTROL\", 0);";
    std::fs::write(card.join("tests/own.rhai"), built_in).unwrap();
    scripts.run(&["."]).ok();
    // Only the scenarios that need a wrong device fail, with its message.
    std::fs::write(card.join("firmware.rhai"), "fn poll( {}").unwrap();
    let outcome = scripts.run(&["."]);
    assert_eq!(outcome.code, Some(2), "{}{}", outcome.out, outcome.err);
    assert!(outcome.out.contains("cards/mailbox/firmware.rhai:1: "), "{}", outcome.out);
    let passed = outcome.out.lines().filter(|line| line.starts_with("passed"));
    assert_eq!(passed.count(), 2, "{}", outcome.out);
}

#[test]
fn reports_of_shards_merge_to_the_report_of_a_single_run() {
    let good = "poke(\"node2.w_CPU_CONTROL\", 1); wait(\"node2.w_OPTION_STATUS\", 2, \"1ms\");";
    let scripts = Scripts::new(&[
        ("a.rhai", good),
        ("b.rhai", "expect(\"node2.w_OPTION_STATUS\", 7);"),
        ("c.rhai", good),
        // The blanks and line ends at both ends of the output stay.
        ("d.rhai", "print(\"  heading \"); print(\"\"); print(\"\"); expect_that(true, \"x\");"),
        ("e.rhai", "nothing("),
    ]);
    let ended = ["0/3", "1/3", "2/3"].map(|shard| {
        let xml = format!("{}.xml", &shard[..1]);
        let outcome = scripts.run(&[".", "--shard-index", shard, "--junit", &xml, "--format", "json"]);
        std::fs::write(scripts.0.path().join(format!("{}.json", &shard[..1])), outcome.out).unwrap();
        outcome.code
    });
    assert_eq!(ended, [Some(0), Some(2), Some(0)], "a and d, b and e, c");
    let whole = scripts.run(&[".", "--junit", "whole.xml", "--format", "json"]);
    let merged = scripts.run(&["merge", "2.xml", "0.xml", "1.xml", "--output", "all.xml"]);
    assert_eq!((merged.code, whole.code), (Some(2), Some(2)), "{}", merged.err);
    assert_eq!(merged.out, "3 passed, 1 failed, 1 broken\n");
    let text = |name: &str| scripts.read(name);
    let names =
        |text: &str| text.split("<testcase name=\"").skip(1).map(|it| it[..1].to_owned()).collect::<String>();
    assert_eq!(names(&text("all.xml")), "abcde");
    // Times differ between runs.
    let without_times = |name: &str| {
        let (mut rest, mut all) = (text(name), String::new());
        while let Some(at) = rest.find(" time") {
            all.push_str(&rest[..at]);
            rest = rest[at..].splitn(3, '"').nth(2).unwrap().to_owned();
        }
        all + &rest
    };
    assert_eq!(without_times("all.xml"), without_times("whole.xml"));
    assert!(text("all.xml").contains("<system-out>  heading \n\n\n</system-out>"), "{}", text("all.xml"));

    let merged = scripts.run(&["merge", "0.json", "1.json", "2.json"]);
    assert_eq!(merged.code, Some(2));
    let outcomes = |text: &str| -> Vec<(String, String)> {
        let lines: serde_json::Value = serde_json::from_str(text).unwrap();
        let of = |line: &serde_json::Value, name: &str| line[name].as_str().unwrap().to_owned();
        lines.as_array().unwrap().iter().map(|line| (of(line, "file"), of(line, "outcome"))).collect()
    };
    assert_eq!(outcomes(&merged.out), outcomes(&whole.out));
    assert!(!merged.out.contains("shard"));

    // Without a scenario, a report does not say how many shards there are.
    std::fs::write(scripts.0.path().join("none.json"), "[]").unwrap();
    let merged = scripts.run(&["merge", "none.json"]);
    assert_eq!(merged.code, Some(2), "{}", merged.out);
    assert!(merged.err.contains("reports of other shards are missing"), "{}", merged.err);

    for (given, why) in [
        (&["0.xml", "2.xml"][..], "missing: shard 2/3"),
        (&["0.xml", "1.xml", "2.xml", "1.xml"], "it is shard 2/3, as is 1.xml"),
        (&["0.xml", "1.json"], "it is not a JUnit report, but others are"),
        (&["whole.xml"], "it does not name its shard"),
        (&["a.rhai"], "it is not a report"),
        (&["none.xml"], "No such file"),
    ] {
        let outcome = scripts.run(&[&["merge"], given].concat());
        assert!(outcome.fails(2).contains(why), "{given:?}: {}", outcome.err);
    }
}

#[test]
fn a_scenario_without_expectations_fails_unless_allowed() {
    let scripts = Scripts::new(&[
        ("empty.rhai", ""),
        ("steps.rhai", "poke(\"node2.w_CPU_CONTROL\", 1); step(\"1ms\");"),
        ("waits.rhai", "poke(\"node2.w_CPU_CONTROL\", 1); wait(\"node2.w_OPTION_STATUS\", 2, \"1ms\");"),
        ("fault.rhai", "fault(\"lose_frame slot=WRC1 required\"); clear_faults(); throw 1"),
    ]);
    let outcome = scripts.run(&["empty.rhai", "steps.rhai", "waits.rhai", "--format", "json"]);
    assert_eq!(outcome.code, Some(1));
    let reports: serde_json::Value = serde_json::from_str(&outcome.out).unwrap();
    let seen: Vec<_> = reports
        .as_array()
        .unwrap()
        .iter()
        .map(|it| (&it["outcome"], &it["kind"], &it["expectations"]))
        .collect();
    let (failed, none) = ("failed".into(), serde_json::Value::Null);
    let empty = (&failed, &"empty".into(), &0.into());
    assert_eq!(seen, [empty, empty, (&"passed".into(), &none, &1.into())]);
    scripts.run(&["empty.rhai", "steps.rhai", "--allow-empty"]).ok();
    let thrown = scripts.run(&["fault.rhai", "--format", "json"]);
    let thrown_report: serde_json::Value = serde_json::from_str(&thrown.out).unwrap();
    assert_eq!((thrown.code, &thrown_report[0]["kind"]), (Some(1), &"throw".into()));
}

#[test]
fn fail_fast_starts_no_scenario_after_a_failure() {
    let scripts = Scripts::new(&[("1.rhai", GOOD), ("2.rhai", BAD), ("3.rhai", GOOD)]);
    let outcome = scripts.run(&[".", "--jobs", "1", "--fail-fast", "--junit", "report.xml"]);
    assert_eq!(outcome.code, Some(1));
    assert!(
        outcome.out.contains("\nnot run  3.rhai  another scenario has not passed (--fail-fast)\n"),
        "{}",
        outcome.out
    );
    assert!(outcome.out.contains("\n1 passed, 1 failed, 0 broken, 1 not run; "), "{}", outcome.out);
    assert!(
        scripts
            .read("report.xml")
            .contains("<skipped message=\"another scenario has not passed (--fail-fast)\"/>")
    );
}

#[test]
fn watch_mode_runs_changed_scenarios_again() {
    let scripts = tree();
    let child = scripts.command(&[".", "--watch"]).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let mut child = child.unwrap();
    let seen = Arc::new(Mutex::new(Vec::<String>::new()));
    let (lines, copy) = (BufReader::new(child.stdout.take().unwrap()).lines(), Arc::clone(&seen));
    let reader = std::thread::spawn(move || {
        lines.map_while(Result::ok).for_each(|line| copy.lock().unwrap().push(line))
    });
    let shows = |what: &str| {
        let is_there = || seen.lock().unwrap().iter().any(|line| line.starts_with(what));
        assert!(eventually(is_there), "no {what} in {:?}", seen.lock().unwrap());
        seen.lock().unwrap().clear();
    };
    shows("3 passed, 0 failed, 0 broken; ");
    let part = scripts.0.path().join("common/check.rhai");
    std::fs::write(part, "fn check() { expect(\"node2.w_OPTION_STATUS\", 77); }").unwrap();
    shows("0 passed, 1 failed, 0 broken; ");
    std::fs::write(scripts.0.path().join("new.rhai"), GOOD).unwrap();
    shows("1 passed, 0 failed, 0 broken; ");
    // A file of a device folder has changed.
    let card = scripts.0.path().join("card");
    std::fs::create_dir(&card).unwrap();
    let example = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/devices/digital-io");
    for entry in std::fs::read_dir(example).unwrap().map(Result::unwrap) {
        if entry.file_type().unwrap().is_file() {
            std::fs::copy(entry.path(), card.join(entry.file_name())).unwrap();
        }
    }
    let text = "plant(\"[[device]]\\nname = 'io'\\nkind = './card'\"); expect(\"data.w_OUT\", 0);";
    std::fs::write(scripts.0.path().join("of-card.rhai"), text).unwrap();
    shows("1 passed, 0 failed, 0 broken; ");
    let path = card.join("handshakes.toml");
    let changed = std::fs::read_to_string(&path).unwrap() + "\n# changed\n";
    std::fs::write(path, changed).unwrap();
    shows("1 passed, 0 failed, 0 broken; ");
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    assert!(!wait_for(&mut child, "a test that watches").success());
    reader.join().unwrap();
}
