//! Processes that run several scenarios, one after the other.

use super::{Scripts, without_real_times};
use crate::common::{Outcome, eventually, finish};
use crate::hostile_scenarios::endless_script;
use serde_json::Value;

/// A scenario that changes as much of its plant as possible, and prints what it has found.
const GOOD: &str = "print(`${peek(\"node2.w_CPU_CONTROL\")} at ${now()}`);\n\
                    poke(\"node2.w_CPU_CONTROL\", 1);\nforce(\"node2.b_AM\", 7);\nlet kept = snapshot(\"node2\");\n\
                    wait(\"node2.w_OPTION_STATUS\", 2, \"1ms\");\nexpect(\"node2.b_AM\", 7);\nprint(journal(0).len());";
/// A scenario that has 30 MiB in use at its end.
const LARGE: &str = "let one = []; one.pad(1_000_000, 1);\nlet two = one; two[0] = 2;\n\
                     expect(\"node2.w_CPU_CONTROL\", 0);\nprint(one.len() + two.len());";

/// Returns the number of processes in which the scenarios ran.
#[track_caller]
fn processes(outcome: &Outcome) -> usize {
    let line = outcome.err.lines().find_map(|line| line.split_once("processes of scenarios: "));
    line.unwrap_or_else(|| panic!("{outcome:?}")).1.parse().unwrap()
}

/// Returns the reports without the values that depend on the real time.
fn reports(outcome: &Outcome) -> Vec<Value> {
    let mut reports: Vec<Value> = serde_json::from_str(&outcome.out).unwrap();
    for report in &mut reports {
        let report = report.as_object_mut().unwrap();
        assert!(report.remove("started").is_some() && report.remove("real_us").is_some(), "{report:?}");
        // The size of the last allocation depends on the addresses of the process.
        if report["outcome"] == "died" {
            let message = report["message"].as_str().unwrap();
            report["message"] = message.replace(|sign: char| sign.is_ascii_digit(), "").into();
        }
    }
    reports
}

#[test]
fn scenarios_share_the_process_of_their_job() {
    let names: Vec<_> = (0..8).map(|number| format!("{number}.rhai")).collect();
    let files: Vec<_> = names.iter().map(|name| (name.as_str(), GOOD)).collect();
    let scripts = Scripts::new(&files);
    let outcome = scripts.run(&["-v", ".", "--jobs", "1"]);
    assert_eq!((outcome.code, processes(&outcome)), (Some(0), 1), "{outcome:?}");
    let alone = without_real_times(&scripts.run(&["0.rhai"]).out);
    let first = alone.lines().next().unwrap();
    for name in &names {
        let line = first.replace("0.rhai", name);
        assert!(without_real_times(&outcome.out).contains(&line), "{}\nlacks {line}", outcome.out);
    }
    let two = scripts.run(&["-v", ".", "--jobs", "2"]);
    assert!(two.code == Some(0) && (1..=2).contains(&processes(&two)), "{two:?}");
}

/// A scenario after another one has the same report as alone, whatever the other one does.
#[test]
fn a_scenario_does_not_change_the_next_one() {
    let bad = [
        ("ends.rhai", "step(\"1ms\"); expect_no_findings();", 1),
        ("fails.rhai", "poke(\"node2.w_CPU_CONTROL\", 1); expect(\"node2.w_CPU_CONTROL\", 2);", 1),
        ("throws.rhai", "force(\"node2.b_AM\", 9); throw \"no\";", 1),
        ("broken.rhai", "peek(1);", 1),
        ("skips.rhai", "poke(\"node2.b_AM\", 3); skip(\"not now\");", 1),
        ("endless.rhai", "loop {}", 1),
        ("memory.rhai", "let all = []; loop { all.push(snapshot(\"node2\")) }", 2),
        // The allocator may keep more memory than a process may keep.
        ("large.rhai", LARGE, 0),
    ];
    let limits =
        ["--max-operations", "500000", "--max-memory", "64", "--format", "json", "--jobs", "1", "-v"];
    let run = |scripts: &Scripts, files: &[&str]| scripts.run(&[files, &limits[..]].concat());
    for (name, text, expected) in bad {
        let scripts = Scripts::new(&[("good.rhai", GOOD), (name, text)]);
        let alone = [reports(&run(&scripts, &[name])), reports(&run(&scripts, &["good.rhai"]))].concat();
        let together = run(&scripts, &[name, "good.rhai"]);
        assert_eq!(reports(&together), alone, "{name}");
        assert!(expected == 0 || processes(&together) == expected, "{name}: {}", together.err);
    }
}

/// The limit of the memory applies to each scenario, whatever the scenarios before it have used.
#[test]
fn the_memory_of_a_scenario_does_not_count_for_the_next_one() {
    let scripts = Scripts::new(&[
        ("1.rhai", LARGE),
        ("2.rhai", LARGE),
        ("3.rhai", LARGE),
        ("4.rhai", "let all = []; loop { all.push(snapshot(\"node2\")) }"),
    ]);
    let outcome = scripts.run(&[".", "--max-memory", "64", "--jobs", "1", "--format", "json"]);
    let outcomes: Vec<_> = reports(&outcome).iter().map(|report| report["outcome"].clone()).collect();
    assert_eq!(outcomes, ["passed", "passed", "passed", "died"], "{}", outcome.out);
    assert!(outcome.out.contains("than the 64 MiB of --max-memory"), "{}", outcome.out);
}

/// A process reads at most 128 different folders of devices. This limit applies to each scenario, too.
#[test]
fn the_folders_of_a_scenario_do_not_count_for_the_next_one() {
    const EXAMPLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/devices/digital-io");
    let scripts = Scripts::new(&[]);
    let directory = scripts.0.path();
    let folders = |first: usize, count: usize| {
        let mut plant = String::new();
        for number in first..first + count {
            let card = directory.join(format!("card{number}"));
            std::fs::create_dir(&card).unwrap();
            for entry in std::fs::read_dir(EXAMPLE).unwrap().map(Result::unwrap) {
                if entry.path().is_file() {
                    std::fs::copy(entry.path(), card.join(entry.file_name())).unwrap();
                }
            }
            // Folders with equal files count once.
            let tables = card.join("handshakes.toml");
            let text = std::fs::read_to_string(&tables).unwrap();
            std::fs::write(&tables, format!("{text}# {number}\n")).unwrap();
            plant += &format!("[[device]]\nkind = './card{number}'\nname = 'card{number}'\n");
        }
        format!("plant(`{plant}`);\nstep(\"1ms\");\nexpect_that(now() == 1000, \"it runs\");")
    };
    for (name, first, count) in [("1.rhai", 0, 70), ("2.rhai", 70, 70), ("3.rhai", 140, 129)] {
        std::fs::write(directory.join(name), folders(first, count)).unwrap();
    }
    let outcome = scripts.run(&[
        "-v",
        "1.rhai",
        "2.rhai",
        "3.rhai",
        "--jobs",
        "1",
        "--format",
        "json",
        "--max-memory",
        "1024",
    ]);
    let reports = reports(&outcome);
    let outcomes: Vec<_> = reports.iter().map(|report| &report["outcome"]).collect();
    assert_eq!(outcomes, ["passed", "passed", "broken"], "{outcome:?}");
    assert_eq!(processes(&outcome), 1);
    assert!(outcome.out.contains("folders of devices"), "{}", outcome.out);
}

#[test]
fn a_killed_process_is_replaced() {
    let scripts = Scripts::new(&[("1-good.rhai", GOOD), ("3-good.rhai", GOOD)]);
    let pipe = endless_script(&scripts.0.path().join("2-pipe.rhai"));
    let mut command = scripts.command(&[
        "-v",
        "1-good.rhai",
        "2-pipe.rhai",
        "3-good.rhai",
        "--jobs",
        "1",
        "--format",
        "json",
    ]);
    let outcome = std::thread::scope(|scope| {
        let running = scope.spawn(|| finish(&mut command));
        // The second scenario runs now, in the process of the first one.
        let is_read = || rustix::io::ioctl_fionread(&pipe).unwrap() == 0;
        assert!(eventually(is_read), "the second scenario does not begin");
        let directory = scripts.0.path().canonicalize().unwrap();
        let is_worker = |pid: &str| {
            let words = std::fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
            let is_here = std::fs::read_link(format!("/proc/{pid}/cwd")).is_ok_and(|cwd| cwd == directory);
            is_here && words.split(|byte| *byte == 0).any(|word| word == b"test-scenario")
        };
        let names = std::fs::read_dir("/proc")
            .unwrap()
            .filter_map(|entry| entry.ok()?.file_name().into_string().ok());
        let workers: Vec<i32> = names.filter(|pid| is_worker(pid)).map(|pid| pid.parse().unwrap()).collect();
        assert_eq!(workers.len(), 1);
        let worker = rustix::process::Pid::from_raw(workers[0]).unwrap();
        rustix::process::kill_process(worker, rustix::process::Signal::KILL).unwrap();
        running.join().unwrap()
    });
    let reports = reports(&outcome);
    let expected = "-pipe.rhai: its process ended before the scenario was finished (signal:  (SIGKILL))";
    assert_eq!(reports[1]["message"], expected, "{outcome:?}");
    let without_name = |report: &Value| {
        let mut report = report.clone();
        for key in ["scenario", "file"] {
            report.as_object_mut().unwrap().remove(key).unwrap();
        }
        report
    };
    assert_eq!(reports[0]["outcome"], "passed");
    assert_eq!(without_name(&reports[0]), without_name(&reports[2]));
    assert_eq!(processes(&outcome), 2);
}
