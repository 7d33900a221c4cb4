//! The scenarios of the tutorial, and the details that failures report in addition to the expectation.

use super::Scripts;
use crate::common::run;
use std::path::Path;

/// Violations of the manual that scenarios of the tutorial show on purpose.
const ABOUT_FINDINGS: [(&str, &[&str]); 4] = [
    ("04-deadlines.rhai", &["late-reference"]),
    ("11-restart-of-the-master.rhai", &["left-behind"]),
    // Shows a forced register of the firmware.
    ("12-forced-registers.rhai", &["owner"]),
    ("21-ip-address.rhai", &["ip-address"]),
];

/// Number of commands that run the tutorial.
const PARTS: usize = 6;

/// A tutorial shows correct use, so the access checker must find no other violation.
#[test]
fn every_scenario_of_the_tutorial_passes_without_findings() {
    let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/scenarios");
    let directory = tempfile::tempdir().unwrap();
    std::os::unix::fs::symlink(from.join("common"), directory.path().join("common")).unwrap();
    let mut scripts = 0;
    for entry in from.read_dir().unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "rhai") {
            continue;
        }
        let name = path.file_name().unwrap().to_str().unwrap();
        let allowed =
            ABOUT_FINDINGS.iter().find(|(about, _)| *about == name).map_or(&[][..], |(_, rules)| rules);
        let text = std::fs::read_to_string(&path).unwrap();
        let text = format!("{text}\nexpect_no_findings({allowed:?});\n");
        std::fs::write(directory.path().join(name), text).unwrap();
        scripts += 1;
    }
    // Runs the scenarios in parts: on a busy machine, all scenarios together take longer than the watchdog of a command
    // allows.
    let mut all = 0;
    for part in 1..=PARTS {
        let shard = format!("{part}/{PARTS}");
        let outcome = run(&["test", directory.path().to_str().unwrap(), "--shard", &shard]);
        let passed = outcome.ok().lines().filter(|line| line.starts_with("passed ")).count();
        let summary = outcome.out.lines().last().unwrap();
        assert!(summary.starts_with(&format!("{passed} passed, 0 failed, 0 broken; ")), "{}", outcome.out);
        all += passed;
    }
    assert_eq!(all, scripts);
}

#[test]
fn failures_report_findings_required_faults_and_similar_block_names() {
    let scripts = Scripts::new(&[
        ("fault.rhai", "step(\"1ms\");\nfault(\"lose_frame slot=WRC1 required\");\nstep(\"1ms\");\n"),
        (
            "finding.rhai",
            "poke(\"node2.w_OPTION_STATUS\", 5);\nstep(\"1ms\");\nexpect(\"node2.w_CPU_CONTROL\", 9);\n",
        ),
        ("block.rhai", "block(\"CANsync_INI\", \"node2\");\n"),
    ]);
    let outcome = scripts.run(&["."]);
    for part in [
        "fault.rhai:2: fault(\"lose_frame slot=WRC1 required\");",
        "  access checker: 1 finding\n      error: owner: node2.w_OPTION_STATUS (%MW3.200002) := 16#0005, 1 time since",
        "`CANsync_INI`: no such function block; did you mean CANsync_INIT",
    ] {
        assert!(outcome.out.contains(part), "{part}\n{}", outcome.out);
    }
    assert!(!outcome.out.contains("NMT"), "blocks of other devices: {}", outcome.out);
}
