//! `commram board`, and the same operations through the channel.

use crate::common::{Emulator, run, unique_name};

const TWO_PLCS: &str = "\
[[plc]]
name = 'saw'
node2 = 'b'

[[plc]]
name = 'press'
dip = 3
node1 = 'b'

[[bus]]
name = 'b'
";

fn two_plcs(directory: &tempfile::TempDir) -> Emulator {
    let path = directory.path().join("plant.toml");
    std::fs::write(&path, TWO_PLCS).unwrap();
    Emulator::start(&[path.to_str().unwrap(), "--clock", "stepped"])
}

fn board(emulator: &Emulator, plc: &str) -> serde_json::Value {
    let outcome = emulator.run("board", &["get", plc, "--format", "json"]);
    let mut rows: Vec<serde_json::Value> = serde_json::from_str(outcome.ok()).unwrap();
    assert_eq!(rows.len(), 1);
    rows.remove(0)
}

#[test]
fn a_board_is_a_line_of_a_table() {
    let emulator = Emulator::stepped();
    let outcome = emulator.run("board", &["get"]);
    let lines: Vec<&str> = outcome.ok().lines().collect();
    assert!(
        lines[0].starts_with("PLC   DISPLAY  LEDS    SWITCH  POWER  DIP  DIP LATCHED  PROGRAM"),
        "{}",
        lines[0]
    );
    assert!(
        lines[1].starts_with("line  0        2#0000  run     on     0    0            none"),
        "{}",
        lines[1]
    );
}

#[test]
fn switches_are_turned_and_the_dip_switch_counts_after_the_reset() {
    let directory = tempfile::tempdir().unwrap();
    let emulator = two_plcs(&directory);
    emulator.run("board", &["set", "press:dip=9", "press:leds=2#0110", "press:switch=stop"]).ok();
    let press = board(&emulator, "press");
    assert_eq!((&press["dip"], &press["dip_latched"]), (&9.into(), &3.into()));
    assert_eq!((&press["leds"], &press["switch"]), (&"2#0110".into(), &"stop".into()));
    assert_eq!(emulator.peek(&["press:node1.w_OMEGA_NR"]), "16#0003");
    emulator.run("board", &["reset", "press"]).ok();
    let press = board(&emulator, "press");
    assert_eq!(
        (&press["dip_latched"], &press["restarts"], &press["leds"]),
        (&9.into(), &2.into(), &"2#0000".into())
    );
    assert_eq!(emulator.peek(&["press:node1.w_OMEGA_NR"]), "16#0009");
    let saw = board(&emulator, "saw");
    assert_eq!((&saw["restarts"], &saw["switch"]), (&1.into(), &"run".into()), "the other one goes on");
}

#[test]
fn a_plc_without_power_is_dark_and_empty() {
    let directory = tempfile::tempdir().unwrap();
    let emulator = two_plcs(&directory);
    emulator.poke(&["saw:node2.w_CPU_CONTROL=1"]);
    emulator.step(&["1ms"]);
    assert_eq!(emulator.peek(&["saw:node2.w_OPTION_STATUS"]), "16#0002");
    emulator.run("board", &["set", "saw:power=off"]).ok();
    let saw = board(&emulator, "saw");
    assert_eq!((&saw["power"], &saw["display"]), (&"off".into(), &" ".into()));
    emulator.poke(&["saw:node2.w_CPU_CONTROL=1"]);
    emulator.step(&["1ms"]);
    assert_eq!(emulator.peek(&["saw:node2.w_OPTION_STATUS"]), "16#0001");
    emulator.run("board", &["set", "saw:power=on"]).ok();
    assert_eq!(emulator.peek(&["saw:node2.w_CPU_CONTROL", "saw:node2.w_OPTION_STATUS"]), "16#0000 16#0001");
    emulator.run("board", &["power-cycle", "saw"]).ok();
    assert_eq!(board(&emulator, "saw")["restarts"], 3);
    let trace = emulator.run("trace", &["--kind", "board"]);
    let downs = trace.ok().lines().filter(|line| line.contains("off, or held in RESET")).count();
    assert_eq!(downs, 2, "{}", trace.out);
}

#[test]
fn a_start_needs_a_program() {
    let emulator = Emulator::stepped();
    for start in ["start=cold", "start=stop"] {
        let outcome = emulator.run("board", &["set", start]);
        let named = "PLC 'line': a start or stop needs a loaded program, the switch at RUN";
        assert!(outcome.fails(1).contains(named), "{}", outcome.err);
    }
    let trace = emulator.run("trace", &["--kind", "board"]);
    assert!(trace.ok().contains("start refused (cold)"), "{}", trace.out);
    assert_eq!(board(&emulator, "line")["start"], "none");
}

/// The address that the DIP switch selects, checked through the registers.
#[test]
fn the_ip_address_follows_the_dip_switch_at_the_reset() {
    let emulator = Emulator::stepped();
    emulator.breaks(&["ip-address"]);
    let last = || emulator.peek(&["ethernet.a_IP_ADDRESS[3]"]);
    assert_eq!(last(), "16#01");
    emulator.run("board", &["set", "dip=30"]).ok();
    assert_eq!(last(), "16#01");
    emulator.run("board", &["reset"]).ok();
    assert_eq!(last(), "16#1F", "192.168.1.31");
    // The board replaces an address that is not allowed by the previous one, even if the write of d_IP_CONFIG does not
    // change its value.
    emulator.poke(&["ethernet_config.a_IP_ADDRESS[3]=7", "ethernet_config.d_IP_CONFIG=16#12345678"]);
    assert_eq!(last(), "16#07");
    emulator.poke(&["ethernet_config.a_IP_ADDRESS[3]=255", "ethernet_config.d_IP_CONFIG=16#12345678"]);
    assert_eq!(last(), "16#07");
    assert_eq!(emulator.peek(&["ethernet_config.a_IP_ADDRESS[3]"]), "16#07");
    let trace = emulator.run("trace", &["--kind", "board"]);
    assert!(trace.ok().contains("IP address 0.0.0.255"), "{}", trace.out);
}

#[test]
fn mistakes_are_named() {
    let emulator = Emulator::stepped();
    for (args, code, text) in [
        (vec!["set", "dip=32"], 2, "dip is a number from 0 to 31"),
        (vec!["set", "display=8"], 2, "the settings are dip, leds, switch, power, start, project"),
        (vec!["set", "press:dip=1"], 2, "press"),
        (vec!["get", "press"], 2, "press"),
    ] {
        let outcome = emulator.run("board", &args);
        assert!(outcome.fails(code).contains(text), "{args:?}: {}", outcome.err);
    }
    let name = unique_name();
    assert!(run(&["board", "get", "-i", &name]).fails(3).contains(&name));
}

/// Manual p. 37: a project that was sent but not stored is lost.
#[test]
fn a_project_can_be_sent_and_is_lost_by_a_reset() {
    let emulator = Emulator::stepped();
    let shown = || {
        let board = board(&emulator, "line");
        ["project", "display", "program"].map(|key| board[key].as_str().unwrap().to_owned())
    };
    assert_eq!(shown(), ["none", "0", "none"]);
    emulator.run("board", &["set", "project=sent"]).ok();
    assert_eq!(shown(), ["sent", "1", "stopped"]);
    emulator.run("board", &["set", "start=hot"]).ok();
    emulator.run("board", &["reset"]).ok();
    assert_eq!(shown(), ["none", "0", "none"]);
    emulator.run("board", &["set", "switch=run"]).ok();
    assert!(emulator.run("board", &["set", "start=hot"]).fails(1).contains("needs a loaded program"));
    emulator.run("board", &["set", "project=boot"]).ok();
    emulator.run("board", &["power-cycle"]).ok();
    assert_eq!(shown(), ["boot", "1", "stopped"]);
    assert!(emulator.run("board", &["set", "project=new"]).fails(2).contains("projects are boot and sent"));
}

#[test]
fn the_message_about_several_boards_has_a_command_that_works() {
    let plant = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(plant.path(), "[[plc]]\nname = 'one'\n[[plc]]\nname = 'two'\n").unwrap();
    let emulator = Emulator::start(&[plant.path().to_str().unwrap(), "--clock", "stepped"]);
    for command in ["reset", "power-cycle"] {
        let refused = emulator.run("board", &[command]);
        let right =
            format!("it has several PLCs (one, two); write for example `commram board {command} one`");
        assert!(refused.fails(2).contains(&right), "{}", refused.err);
        emulator.run("board", &[command, "one"]).ok();
    }
}
