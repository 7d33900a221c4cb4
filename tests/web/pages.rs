//! Data for the pages are the data that the commands print.

use crate::common::Emulator;
use crate::server::Server;
use serde_json::{Value, json};

fn command(emulator: &Emulator, args: &[&str]) -> Value {
    let outcome = emulator.run(args[0], &[&args[1..], &["--format", "json"]].concat());
    serde_json::from_str(outcome.ok()).unwrap()
}

#[test]
fn pages_get_what_the_commands_print() {
    let emulator = Emulator::stepped();
    emulator.step(&["5ms"]);
    let server = Server::of(&emulator, &[]);
    let show = |what: &str| server.get(&server.path(&format!("show/{what}"))).ok();
    assert_eq!(json!([show("status")["status"]]), command(&emulator, &["status"]));
    assert_eq!(show("boards")["boards"], command(&emulator, &["board", "get"]));
    assert_eq!(show("rules")["rules"], command(&emulator, &["check", "--rules"]));
    let names = "registers?name=node2.w_OPTION_STATUS&name=node2.a_STAT_SL%5B1..3%5D";
    let registers = command(&emulator, &["peek", "node2.w_OPTION_STATUS", "node2.a_STAT_SL[1..3]"]);
    assert_eq!(show(names)["registers"], registers);
    let map = show("map?full=1")["entries"].clone();
    let printed = command(&emulator, &["map", "--full"]);
    assert_eq!(map.as_array().unwrap().len(), printed.as_array().unwrap().len());
    for (placed, entry) in map.as_array().unwrap().iter().zip(printed.as_array().unwrap()) {
        let fields = entry.as_object().unwrap();
        assert!(fields.iter().all(|(name, value)| placed[name] == *value), "{placed} {entry}");
        assert!(placed["offset"].is_u64() && placed["width"].is_string() && placed["plc"] == 0, "{placed}");
    }
    let found = show("find?text=option%20status")["entries"].clone();
    assert_eq!(found, command(&emulator, &["find", "option", "status"]));
    assert_eq!(show("devices")["devices"][0]["plc"], "line");
    assert!(show("fault-kinds")["kinds"].as_array().unwrap().len() > 5);
    assert!(show("plant")["plant"].as_str().unwrap().contains("[[plc]]"));
    assert!(show("objects")["objects"].is_array());
    let plot = server.get(&server.path("show/plot.svg?name=node2.w_OPTION_STATUS&since=1ms"));
    assert!(plot.status == 200 && plot.body.contains("<svg"), "{plot:?}");
}

/// The page has the registers of an option card among those of its PLC.
#[test]
fn pages_have_the_registers_of_an_option_card() {
    let place = tempfile::tempdir().unwrap();
    let plant = place.path().join("plant.toml");
    let card = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/devices/encoder");
    let section = format!("[[plc.option]]\nslot = 1\ncard = '{card}'\n");
    std::fs::write(&plant, format!("[[plc]]\nname = 'line'\n{section}")).unwrap();
    let emulator = Emulator::start(&[plant.to_str().unwrap(), "--clock", "stepped"]);
    emulator.poke(&["line:encoder1.di_SPEED=1000"]);
    emulator.step(&["20ms"]);
    let server = Server::of(&emulator, &[]);
    let show = |what: &str| server.get(&server.path(&format!("show/{what}"))).ok();
    let names = ["line:encoder1.di_POSITION", "line:encoder1.w_STATUS"];
    let shown = show(&format!("registers?name={}&name={}", names[0], names[1]));
    assert_eq!(shown["registers"], command(&emulator, &["peek", names[0], names[1]]));
    assert_ne!(shown["registers"][0]["value"], 0, "{shown}");
    let map = show("map?full=1&plc=line")["entries"].to_string();
    assert!(map.contains("encoder1.di_POSITION"), "{map}");
    let found = show("find?text=sync%20latch")["entries"].clone();
    assert_eq!(found, command(&emulator, &["find", "sync", "latch"]));
    let boards = show("boards")["boards"].to_string();
    assert!(boards.contains("line-option1"), "{boards}");
}

/// The buses of the plant have a running master after the demonstration's set-up.
#[test]
fn the_last_intervals_have_their_frames() {
    let emulator = Emulator::stepped();
    emulator.set_up(&[]);
    emulator.step(&["20ms"]);
    let server = Server::of(&emulator, &[]);
    let intervals = server.get(&server.path("show/frames?bus=drives&count=3")).ok();
    let intervals = intervals["intervals"].as_array().unwrap();
    assert_eq!(intervals.len(), 3);
    let begins: Vec<_> = intervals.iter().map(|it| it["window"]["begin_us"].as_u64().unwrap()).collect();
    assert!(begins.is_sorted() && begins[0] < begins[2], "{begins:?}");
    let frames = |interval: &Value| interval["frames"].as_array().unwrap().len();
    assert!(intervals.iter().any(|interval| frames(interval) > 0), "{intervals:?}");
}
