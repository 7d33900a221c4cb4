//! `force` and `unforce` on a running emulator.

use crate::common::Emulator;

#[test]
fn a_forced_register_keeps_its_value_and_is_marked_everywhere() {
    let emulator = Emulator::stepped();
    emulator.breaks(&["owner"]);
    emulator.run("force", &["node2.w_OPTION_STATUS=16#0080", "node2.w_CANsync_STATUS=16#00FF"]).ok();
    let poked = emulator.run("poke", &["node2.w_OPTION_STATUS=16#0001", "node2.w_CPU_CONTROL=16#0001"]);
    let note = "commram: note: node2.w_OPTION_STATUS (%MW3.200002) is forced and keeps its value; `commram unforce` releases it\n";
    assert_eq!((poked.code, poked.err.as_str()), (Some(0), note));
    emulator.step(&["10ms"]);
    let marked = "node2.w_OPTION_STATUS = 16#0080  [forced] synchronous operation of the master is active\n";
    assert_eq!(emulator.run("peek", &["node2.w_OPTION_STATUS"]).ok(), marked);
    let dump = emulator.run("dump", &["node2"]).ok().to_owned();
    assert!(dump.contains("16#0080  [forced] synchronous operation"), "{dump}");

    let list = emulator.run("force", &[]).ok().to_owned();
    assert_eq!(list.lines().count(), 2);
    assert!(list.contains("node2.w_OPTION_STATUS   %MW3.200002  16#0080"), "{list}");
    let json = emulator.run("force", &["--format", "json"]).ok().to_owned();
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(json[0]["forced"], true);
    assert_eq!(json[0]["value"], 0x80);

    emulator.run("unforce", &["node2.w_OPTION_STATUS"]).ok();
    emulator.run("unforce", &["--all"]).ok();
    assert_eq!(emulator.run("force", &[]).ok(), "no register is forced\n");
    emulator.poke(&["node2.w_CPU_CONTROL=16#0000"]);
    emulator.step(&["10ms"]);
    assert!(!emulator.run("peek", &["node2.w_OPTION_STATUS"]).ok().contains("forced"));
    let trace = emulator.run("trace", &[]).ok().to_owned();
    assert!(trace.contains("w_OPTION_STATUS (%MW3.200002) forced to 16#0080"), "{trace}");
    assert!(trace.contains("w_OPTION_STATUS (%MW3.200002) no longer forced"), "{trace}");
}

/// Two structures share these addresses. The cyclic structure is not live until the node has taken over its
/// initialization data.
#[test]
fn the_list_names_the_live_register() {
    let emulator = Emulator::stepped();
    emulator.run("force", &["node2.b_AC=3"]).ok();
    assert_eq!(emulator.run("force", &[]).ok(), "node2.b_AC  %MB3.200013  16#03  no meaning\n");
}

#[test]
fn mistakes_are_explained() {
    let emulator = Emulator::stepped();
    let complaint = |command, args: &[&str]| emulator.run(command, args).fails(2).to_owned();
    assert!(
        complaint("unforce", &["node2.w_OPTION_STATUS"])
            .contains("node2.w_OPTION_STATUS (%MW3.200002) is not forced")
    );
    let part = complaint("force", &["%MB3.200003=1"]);
    assert!(part.contains("%MB3.200003: only a whole register can be forced, here %MW3.200002"), "{part}");
    emulator.run("unforce", &[]).fails(2);
    emulator.run("force", &["node2.w_OPTION_STATUS"]).fails(2);
}
