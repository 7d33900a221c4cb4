//! `commram soak`: rounds that pass, one that fails, and wrong use.

use crate::common::run;
use serde_json::Value;

#[test]
fn the_same_seed_draws_the_same_rounds() {
    let [one, other] = [(); 2].map(|()| {
        let args = [
            "soak",
            "--quiet",
            "--seed",
            "42",
            "--rounds",
            "3",
            "--jobs",
            "2",
            "--exercise",
            "omega-baps",
            "--format",
            "json",
        ];
        let outcome = run(&args);
        let rows: Vec<Value> = serde_json::from_str(outcome.ok()).unwrap();
        let [row] = &rows[..] else { panic!("{rows:?}") };
        assert_eq!((row["rounds"].as_u64(), row["failed"].as_u64()), (Some(3), Some(0)));
        row["emulated_us"].as_u64().unwrap()
    });
    assert_eq!(one, other);
    assert!(one > 0);
}

/// The time limit is too short for any operation, so every round fails.
#[test]
fn a_failing_round_is_minimized_and_fails_alone() {
    let directory = tempfile::tempdir().unwrap();
    let keep = directory.path().to_str().unwrap();
    let args = [
        "soak",
        "--seed",
        "5",
        "--exercise",
        "cs0015-slave",
        "--max-time",
        "1ms",
        "--jobs",
        "1",
        "--keep",
        keep,
    ];
    let outcome = run(&args);
    assert_eq!(outcome.code, Some(1), "{}", outcome.err);
    assert!(
        outcome.err.contains("seed 5, cs0015-slave, ") && outcome.err.contains("\nit fails with 0 of its "),
        "{}",
        outcome.err
    );
    let file = directory.path().join("soak-5.rhai");
    let text = std::fs::read_to_string(&file).unwrap();
    assert!(text.contains("section(\"moves\");\n\nsection("), "no move is left: {text}");
    let alone = run(&["test", file.to_str().unwrap(), "--max-time", "1ms"]);
    assert_eq!(alone.code, Some(1), "{}", alone.err);
    assert!(run(&["test", file.to_str().unwrap()]).ok().contains("1 passed"), "it needs that limit to fail");
}

/// Each try of a shorter round without an end takes the whole real time of a scenario.
#[test]
fn a_round_without_an_end_is_shortened_within_its_real_time() {
    let directory = tempfile::tempdir().unwrap();
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/devices/mailbox");
    for name in ["device.toml", "MAILBOX.toml", "handshakes.toml", "firmware.rhai"] {
        std::fs::copy(std::path::Path::new(source).join(name), directory.path().join(name)).unwrap();
    }
    let exercise = "const MOVES = #{ a: [[1, 2]] };\nfn start() { pass(30000); }\n\
                    fn recover() { power_cycle(); start(); }\nfn a(r, x) { loop { print(\"x\"); } }\n";
    std::fs::write(directory.path().join("exercise.rhai"), exercise).unwrap();
    let folder = directory.path().to_str().unwrap();
    let limit = std::time::Duration::from_secs(3);
    let begun = std::time::Instant::now();
    let args =
        ["soak", "--exercise", folder, "--seed", "4711", "--rounds", "1", "--jobs", "1", "--keep", folder];
    let outcome = run(&[&args[..], &["--max-real-time", "3s"]].concat());
    let took = begun.elapsed();
    assert_eq!(outcome.code, Some(1), "{}", outcome.err);
    assert!(outcome.err.contains("--max-real-time"), "{}", outcome.err);
    // A run, the tries, and a last run; the rest is for starts of processes on a slow machine.
    assert!(took < 6 * limit, "{took:?}: {}", outcome.err);
}

#[test]
fn wrong_use_says_what_would_be_right() {
    for (args, expected) in [
        (&["soak", "--exercise", "nothing"][..], "the exercises are omega-cansync, omega-baps, "),
        (&["soak", "--hours", "0"], "a number above 0"),
        (&["soak", "--jobs", "0"], "0"),
    ] {
        let outcome = run(args);
        assert_eq!(outcome.code, Some(2), "{args:?}");
        assert!(outcome.err.contains(expected), "{args:?}: {}", outcome.err);
    }
}

#[test]
fn exercises_are_listed() {
    let outcome = run(&["soak", "--list"]);
    let names = [
        "omega-cansync",
        "omega-baps",
        "omega-serial",
        "bm4-cansync",
        "cs0015-slave",
        "cs0015-master",
        "can-dp2",
    ];
    for name in names {
        assert!(outcome.ok().contains(name), "{name}: {}", outcome.out);
    }
}

/// Drives have a separate supply: a drive stays failed when its PLC is switched off and on.
#[test]
fn a_failed_drive_runs_again_after_a_recovery() {
    let round = ["--exercise", "bm4-cansync", "--seed", "20261582", "--rounds", "1", "--jobs", "1"];
    let outcome = run(&[&["soak", "--format", "json"][..], &round].concat());
    let rows: Vec<Value> = serde_json::from_str(outcome.ok()).unwrap();
    let row = rows.iter().find(|row| row["rounds"] == 1).unwrap();
    assert_eq!((&row["exercise"], row["failed"].as_u64()), (&"bm4-cansync".into(), Some(0)));
}
