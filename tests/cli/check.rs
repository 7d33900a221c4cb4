//! `commram check`: findings of a running emulator, and the meaning of its exit codes.

use crate::common::{Emulator, run, unique_name};

/// Returns the output of `check`. Its stderr is empty, with or without findings.
#[track_caller]
fn check(emulator: &Emulator, args: &[&str], code: i32) -> String {
    let outcome = emulator.run("check", args);
    assert_eq!((outcome.code, outcome.err.as_str()), (Some(code), ""), "{}", outcome.out);
    outcome.out
}

#[test]
fn a_program_without_violations_passes() {
    let emulator = Emulator::stepped();
    emulator.poke(&["node2.w_CPU_CONTROL=16#0001"]);
    emulator.step(&["1ms"]);
    let text = check(&emulator, &[], 0);
    assert!(text.ends_with("at 0.001000 s: no violations of the manual\n"), "{text}");
    assert_eq!(check(&emulator, &["--format", "json"], 0), "[]\n");
}

#[test]
fn an_error_fails_with_all_its_details() {
    let emulator = Emulator::stepped();
    emulator.breaks(&["owner"]);
    emulator.step(&["2ms"]);
    for value in ["16#0043", "16#0080"] {
        emulator.poke(&[&format!("node2.w_OPTION_STATUS={value}")]);
        emulator.step(&["1ms"]);
    }
    let expected = format!(
        "\
instance '{}' at 0.004000 s: 1 error, 0 warnings
SEVERITY  RULE   REGISTER               ADDRESS        VALUE    COUNT  FIRST       LAST        LATE
error     owner  node2.w_OPTION_STATUS  %MW3.200002    16#0080  2      0.002000 s  0.003000 s  -

owner (the register's page; D-17)
  A register that only the firmware writes was written; the value stays there until the firmware writes the register the next time, which may be never, and the firmware does not read it. Only read such a register; a copy of a whole structure (VAR_IN_OUT of IEC programs, memcpy) writes it back.
",
        emulator.name
    );
    let words = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
    assert_eq!(words(&check(&emulator, &[], 1)), words(&expected));

    let json: serde_json::Value = serde_json::from_str(&check(&emulator, &["--format", "json"], 1)).unwrap();
    let finding = &json[0];
    assert_eq!((&finding["rule"], &finding["severity"]), (&"owner".into(), &"error".into()));
    assert_eq!((&finding["register"], &finding["value"]), (&"node2.w_OPTION_STATUS".into(), &0x0080.into()));
    assert_eq!((&finding["first_us"], &finding["count"]), (&2000.into(), &2.into()));
    assert_eq!(finding["late_us"], serde_json::Value::Null);
    assert!(check(&emulator, &["--format", "csv"], 1).contains("\nerror,owner,node2.w_OPTION_STATUS,"));

    // The finding is in the journal too, once for each value.
    let trace = emulator.run("trace", &["--kind", "finding"]);
    assert_eq!(
        trace.ok().lines().filter(|line| line.contains("error owner: node2.w_OPTION_STATUS")).count(),
        2
    );
}

#[test]
fn warnings_do_not_fail() {
    let emulator = Emulator::stepped();
    emulator.poke(&["node2.w_CPU_CONTROL=1"]);
    emulator.step(&["1ms"]);
    emulator.poke(&["node2.b_BT_1=16#1C", "node2.b_TIME_PATTERN=2", "node2.w_CPU_CONTROL=2"]);
    emulator.step(&["1ms"]);
    let text = check(&emulator, &[], 0);
    assert!(text.contains(": 0 errors, 2 warnings\n") && text.contains("init-controller"), "{text}");
}

#[test]
fn cleared_findings_are_shown_once_more() {
    let emulator = Emulator::stepped();
    emulator.poke(&["node1.w_OMEGA_NR=5"]);
    check(&emulator, &["--clear"], 1);
    check(&emulator, &[], 0);
}

/// A client that maps the image sends no request. With several PLCs the finding names the PLC.
#[test]
fn writes_through_the_map_are_seen() {
    use commram::devices::omega_drive_line_2::registers::{CANsync_INIT_BMSTRUCT, LAYOUT_HASH, NODE1};
    use commram::memory::{AttachMode, Image};
    let path = std::env::temp_dir().join(format!("{}.toml", unique_name()));
    std::fs::write(&path, "[[plc]]\nname = 'saw'\n[[plc]]\nname = 'press'\n").unwrap();
    let emulator = Emulator::start(&["--clock", "stepped", path.to_str().unwrap()]);
    emulator.breaks(&["owner"]);
    std::fs::remove_file(&path).unwrap();
    let press = Image::attach(&emulator.name, "press", AttachMode::ReadWrite, Some(LAYOUT_HASH)).unwrap();
    let node1 = press.segment().view::<CANsync_INIT_BMSTRUCT>(NODE1).unwrap();
    node1.i_SW1_NR.store(7);
    emulator.step(&["1ms"]);
    let text = check(&emulator, &[], 1);
    assert!(text.contains("press:node1.i_SW1_NR"), "{text}");
}

#[test]
fn all_rules_are_listed_without_an_emulator() {
    let text = run(&["check", "--rules"]).ok().to_owned();
    for rule in &commram::devices::catalogue().rules {
        assert!(text.contains(&format!("{rule} ({}, {})", rule.severity(), rule.source())), "{rule}");
    }
    let rows: serde_json::Value =
        serde_json::from_str(run(&["check", "--rules", "--format", "json"]).ok()).unwrap();
    assert_eq!(rows.as_array().map(Vec::len), Some(commram::devices::catalogue().rules.len()));
}

/// Exit code 1 means findings, so an unreachable emulator gives another exit code.
#[test]
fn an_unreachable_emulator_is_no_finding() {
    let name = unique_name();
    assert!(run(&["check", "-i", &name]).fails(3).contains("is not running"));
    run(&["check", "--rules", "--clear"]).fails(2);
}
