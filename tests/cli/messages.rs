//! Messages for wrong input: the error, its place and the right form.

use crate::common::{Emulator, run};

fn refused(args: &[&str]) -> String {
    run(args).fails(2).to_owned()
}

#[test]
fn a_wrong_number_is_refused_with_its_option_and_its_range() {
    for (args, expected) in [
        (&["watch", "-n", "x"][..], "invalid value 'x' for '--count <N>': write a whole number, 1 or more"),
        (&["trace", "--last", "x"], "invalid value 'x' for '--last <N>': write a whole number, 0 or more"),
        (
            &["run", "--threads", "65"],
            "invalid value '65' for '--threads <N>': write a whole number from 1 to 64",
        ),
        (
            &["run", "--speed", "fast"],
            "invalid value 'fast' for '--speed <FACTOR>': write a factor from 0.001 to 1000",
        ),
        (&["run", "--keep-states", "-"], "write a whole number from 0 to 4096"),
        (&["test", "x.rhai", "--max-memory", "1"], "write a whole number from 64 to 1048575"),
        (&["test", "x.rhai", "--jobs", "0"], "write a whole number, 1 or more"),
        (&["soak", "--seed", "x"], "write a whole number, 0 or more"),
        (&["fault", "clear", "x"], "write a whole number from 1 to 65535"),
        (&["step", "99999999999h"], "too long: emulated time has at most 5124095576h"),
    ] {
        let message = refused(args);
        assert!(message.contains(expected), "{args:?}: {message}");
    }
}

#[test]
fn times_are_named_in_the_unit_in_which_they_were_given() {
    let emulator = Emulator::stepped();
    let message = emulator.run("step", &["30h"]).fails(2).to_owned();
    assert!(message.contains("'30h'") && message.contains("at most 24 h of emulated time"), "{message}");
    let message = emulator.run("wait", &["node2.w_CPU_CONTROL==1", "--within", "2000h"]).fails(2).to_owned();
    assert!(message.contains("invalid value '2000h' for '--within <TIME>'"), "{message}");
    let message = emulator.run("wait", &["node2.w_CPU_CONTROL==1", "--within", "1h"]).fails(1).to_owned();
    assert!(message.contains(" within 1 h; at 3600.000000 s"), "{message}");
    let message = emulator.run("fault", &["add", "lose_sync", "duration=2h"]).fails(2).to_owned();
    assert!(
        message.contains("duration_us is 7200000000 (2 h); it must be 1 to 3600000000 (1 h)"),
        "{message}"
    );
}

#[test]
fn a_missing_argument_is_named_with_the_options_in_its_place() {
    for (args, expected) in [
        (&["step"][..], "tip: `--to-sync` advances to the next SYNC, `--back TIME` goes back"),
        (&["unforce"], "tip: `--all` means all forced registers"),
        (&["fault", "clear"], "tip: `--all` means all faults"),
        (&["fault", "add"], "tip: the kinds are "),
    ] {
        let message = refused(args);
        assert!(message.contains(expected) && message.contains("\nUsage: commram "), "{args:?}: {message}");
        assert!(!message.contains("\n\n\n"), "{message}");
    }
    assert!(refused(&["fault", "add"]).contains(", lose_sync, "));
}

#[test]
fn an_address_without_its_percent_sign_is_recognized() {
    for args in [
        &["peek", "MW3.200000"][..],
        &["poke", "MW3.200000=1"],
        &["map", "MW3.200000"],
        &["wait", "MW3.200000==1"],
    ] {
        assert!(refused(args).contains("`MW3.200000` is spelled `%MW3.200000`"), "{args:?}");
    }
}

#[test]
fn a_demonstration_is_only_offered_for_devices_that_have_one() {
    let message = refused(&["demo", "--device", "cs0015x"]);
    assert!(message.contains("[possible values: omega-drive-line-2"), "{message}");
    let help = run(&["demo", "--help"]);
    let offered = help.ok().matches("\n          - ").count();
    let devices = run(&["map", "--help"]).ok().matches("\n          - ").count();
    assert!(offered < devices, "{offered} of {devices}");
}

#[test]
fn meanings_are_written_as_they_are_read() {
    let emulator = Emulator::stepped();
    emulator.breaks(&["owner"]);
    for (register, value) in [
        ("node2.w_OPTION_STATUS", "16#0043"),
        ("node2.w_CPU_CONTROL", "16#0020"),
        ("node1.w_CANsync_STATUS", "16#0080"),
    ] {
        emulator.poke(&[&format!("{register}={value}")]);
        let line = emulator.run("peek", &[register]).ok().to_owned();
        let meaning = line.trim_end().split_once("  ").unwrap().1.to_owned();
        emulator.poke(&[&format!("{register}=0")]);
        emulator.poke(&[&format!("{register}={meaning}")]);
        assert_eq!(emulator.peek(&[register]), value, "{line}");
    }
}

#[test]
fn the_map_describes_a_single_bit() {
    let by_name = run(&["map", "node1.w_CANsync_STATUS.7"]);
    let by_address = run(&["map", "%MX3.100004.7"]);
    assert_eq!(by_name.ok(), by_address.ok());
    for part in ["node1.w_CANsync_STATUS.7\n", "  type            BOOL\n", "%MX3.100004.7", "BUS-off"] {
        assert!(by_name.out.contains(part), "{part}: {}", by_name.out);
    }
    assert!(!by_name.out.contains("bit 6"), "{}", by_name.out);
    assert!(refused(&["map", "node1.w_CANsync_STATUS.16"]).contains("a WORD has bits 0 to 15, not 16"));
    assert!(refused(&["map", "baps.i_ERR_DETAIL.16"]).contains("an INT has bits 0 to 15, not 16"));
}
