//! Notation of registers, values and conditions, and search for registers.

use crate::common::{Emulator, run};

#[test]
fn registers_are_found_by_name_address_and_description() {
    let found = run(&["find", "bus-off"]);
    assert!(found.ok().starts_with("node1.w_CANsync_STATUS  %MW3.100004  WORD  firmware  "), "{}", found.out);
    assert!(found.out.contains("    bit 7 BUS-off  1: node deactivated (BUS-off)\n"), "{}", found.out);
    assert!(found.out.contains("  offset D-02, reset D-320  "), "{}", found.out);
    let inferred = run(&["find", "no parity bit"]);
    assert!(inferred.ok().contains("    16#00  no parity bit (inferred D-855)\n"), "{}", inferred.out);
    let json: serde_json::Value =
        serde_json::from_str(run(&["find", "%mw3.200002", "--format", "json"]).ok()).unwrap();
    assert_eq!(
        (json[0]["name"].as_str(), json.as_array().unwrap().len()),
        (Some("node2.w_OPTION_STATUS"), 1)
    );
    let by_name = run(&["find", "option", "status"]);
    assert!(by_name.ok().starts_with("node1.w_OPTION_STATUS "), "what has it in its name comes first");
    let nothing = run(&["find", "w_CPU_CONTRL"]);
    assert!(nothing.fails(1).ends_with("; did you mean w_CPU_CONTROL?\n"), "{}", nothing.err);
}

#[test]
fn peek_reads_patterns_bits_and_names_without_an_area() {
    let emulator = Emulator::stepped();
    emulator.set_up(&["node2.b_MAX_SL_NR=3"]);
    emulator.run("wait", &["node2.a_STAT_SL[1..3]==3"]).fails(2);
    emulator.run("wait", &["a_STAT_SL[1]==3", "a_STAT_SL[2]==3", "a_STAT_SL[3]==3", "--within", "2s"]).ok();
    let states = emulator.run("peek", &["node2.a_STAT_SL[1..3]", "--raw"]);
    assert_eq!(states.ok(), "16#03\n16#03\n16#03\n");
    let all = emulator.run(
        "peek",
        &["node2.w_CANsync_STATUS.7", "_CANsync_CTRL_MA.w_OPTION_STATUS", "node2.*OPTION_STATUS"],
    );
    assert_eq!(
        all.ok(),
        "node2.w_CANsync_STATUS.7 = 0  bit 7 of node2.w_CANsync_STATUS\n\
         node2.w_OPTION_STATUS = 16#0043  synchronous operation of the master is being set up\n\
         node2.w_OPTION_STATUS = 16#0043  synchronous operation of the master is being set up\n"
    );
    let dead = emulator.run("peek", &["node2.b_BT_*"]);
    assert!(
        dead.ok().lines().all(|line| line.ends_with("(CANsync_INIT_BMSTRUCT, not live)")),
        "{}",
        dead.out
    );
    assert!(emulator.run("peek", &["node2"]).fails(2).contains("`commram dump node2`"));
    let many = emulator.run("peek", &["*", "--raw"]);
    assert!(many.ok().lines().count() > 1_000, "more than one message takes one by one");
}

#[test]
fn values_are_written_by_name_and_as_in_structured_text() {
    let emulator = Emulator::stepped();
    emulator.poke(&["node2.w_CPU_CONTROL=handshake"]);
    assert_eq!(emulator.peek(&["node2.w_CPU_CONTROL"]), "16#0001");
    emulator.poke(&["node2.w_CPU_CONTROL := 2#10;"]);
    assert_eq!(emulator.peek(&["node2.w_CPU_CONTROL"]), "16#0002");
    let unknown = emulator.run("poke", &["node2.w_CPU_CONTROL=handshak"]);
    assert!(unknown.fails(2).ends_with("did you mean handshake?\n"), "{}", unknown.err);
    emulator.breaks(&["owner"]);
    let across = emulator.run("poke", &["%MD3.200000=1"]);
    assert_eq!(
        (across.code, across.err.as_str()),
        (
            Some(0),
            "commram: note: %MD3.200000 is not a whole register: node2.w_CPU_CONTROL, node2.w_OPTION_STATUS; \
             the value was written\n"
        )
    );
}

#[test]
fn several_conditions_hold_together_or_any_of_them() {
    let emulator = Emulator::stepped();
    emulator.poke(&["node2.w_CPU_CONTROL=1"]);
    let both = ["node2.w_OPTION_STATUS != start-up", "node2.w_CPU_CONTROL<=1", "--within", "10ms"];
    assert_eq!(
        emulator.run("wait", &both).ok(),
        "node2.w_OPTION_STATUS = 16#0002  waiting for \"take over initialization data\"  at 0.000500 s\n\
         node2.w_CPU_CONTROL = 16#0001  handshake  at 0.000500 s\n"
    );
    let any = ["node2.w_OPTION_STATUS==16#80", "node2.w_CPU_CONTROL > 0", "--any"];
    let outcome = emulator.run("wait", &any);
    assert_eq!(outcome.ok(), "node2.w_CPU_CONTROL = 16#0001  handshake  at 0.000500 s\n");
    let outcome =
        emulator.run("wait", &["node2.w_OPTION_STATUS==16#80", "node2.w_CPU_CONTROL==1", "--within", "1ms"]);
    assert_eq!(
        outcome.fails(1),
        "commram: these were not true at the same moment within 1 ms; at 0.001500 s:\n  \
         node2.w_OPTION_STATUS (%MW3.200002) holds 16#0002, waiting for \"take over initialization data\"; \
         expected: 16#0080\n  node2.w_CPU_CONTROL (%MW3.200000) holds 16#0001, handshake; as expected\n"
    );
    let unlisted = emulator.run("wait", &["node2.w_CPU_CONTROL != 1", "--within", "1ms"]);
    assert!(unlisted.fails(1).contains("did not become other than 16#0001 within 1 ms"), "{}", unlisted.err);
}
