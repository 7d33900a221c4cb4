//! Server-sent events.

use crate::common::Emulator;
use crate::server::Server;
use serde_json::{Value, json};
use std::time::{Duration, Instant};

#[test]
fn values_changes_records_and_the_clock_come_as_events() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let register = "node2.w_CPU_CONTROL";
    let mut events = server
        .events(&format!("follow={register},node2.w_OPTION_STATUS&journal=1&clock=1&findings=1&boards=1"));
    let clock = events.until("clock", |_| true);
    assert_eq!((&clock["time_us"], &clock["clock"]), (&json!(0), &json!("stepped")));
    let findings = events.until("findings", |_| true);
    assert_eq!(findings, json!({"findings": []}));
    let values = events.until("values", |_| true);
    let names: Vec<_> =
        values["values"].as_array().unwrap().iter().map(|it| it["register"].as_str().unwrap()).collect();
    assert_eq!(names, [register, "node2.w_OPTION_STATUS"]);
    emulator.poke(&["node2.w_CPU_CONTROL=16#0001"]);
    emulator.step(&["1ms"]);
    let (mut seen, mut status) = (Vec::new(), Value::Null);
    while !(["changes", "journal", "clock"].iter().all(|name| seen.iter().any(|it| it == name))
        && status == "16#0002")
    {
        let (name, data) = events.next().expect("an event");
        if name == "values" {
            let of_status = |it: &&Value| it["register"] == "node2.w_OPTION_STATUS";
            status = data["values"]
                .as_array()
                .unwrap()
                .iter()
                .find(of_status)
                .map_or(status, |it| it["hex"].clone());
        }
        if name == "changes" {
            let change = &data["changes"][0];
            assert!(
                change["register"].as_str().unwrap().starts_with("node2.w_") && change["by"].is_string(),
                "{data}"
            );
        }
        if name == "journal" {
            assert!(data["records"][0]["kind"].is_string(), "{data}");
        }
        seen.push(name);
    }
    emulator.step(&["--back", "500us"]);
    let turned = events.until("turned", |_| true);
    let journal = server.get(&server.path("journal?from=0&max=100")).ok();
    assert_eq!(
        (&turned["time_us"], &turned["begin"]),
        (&json!(500), &journal["journal"]["turn"]["begin"]),
        "{journal}"
    );
}

#[test]
fn kinds_of_records_can_be_selected() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let mut events = server.events("journal=channel_write&clock=1");
    events.until("clock", |_| true);
    emulator.poke(&["node2.w_CPU_CONTROL=16#0001"]);
    emulator.step(&["1ms"]);
    let records = events.until("journal", |_| true);
    let kinds: Vec<_> = records["records"].as_array().unwrap().iter().map(|it| &it["kind"]).collect();
    assert_eq!(kinds, ["channel_write"]);
}

/// Each register changes several times within a round.
#[test]
fn registers_of_which_only_values_are_requested_have_no_changes() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let (shown, followed) = ("node2.b_BT_0", "node2.b_BT_1");
    let mut events = server.events(&format!("values={shown},{followed}&follow={followed}&clock=1"));
    let first = events.until("values", |_| true);
    let registers = |values: &Value| {
        values["values"].as_array().unwrap().iter().map(|it| it["register"].clone()).collect::<Vec<_>>()
    };
    assert_eq!(registers(&first), [followed, shown], "a register in both lists is sent once");
    assert!(first["values"].as_array().unwrap().iter().all(|it| it.get("changed_us").is_none()), "{first}");
    let offsets = [register_offset(&server, shown), register_offset(&server, followed)];
    let mut change = |values: &[u64]| {
        let poke = |offset: &Value, value| json!({"poke": {"plc": 0, "offset": offset, "width": "Byte", "value": value}});
        let step =
            |value| [poke(&offsets[0], value), poke(&offsets[1], value), json!({"advance": {"us": 1}})];
        let operations: Vec<_> = values.iter().flat_map(|value| step(*value)).collect();
        server.post(&server.path("request"), &json!({ "operations": operations })).ok();
        let (mut changes, mut last) = (Vec::new(), json!(null));
        let end = json!(values.last());
        while changes.last() != Some(&json!(format!("16#{:02X}", end.as_u64().unwrap())))
            || last["value"] != end
        {
            let (name, data) = events.next().expect("an event");
            if name == "values" {
                let of_shown = |it: &&Value| it["register"] == shown;
                last = data["values"].as_array().unwrap().iter().find(of_shown).cloned().unwrap_or(last);
            }
            if name == "changes" {
                let of_round = data["changes"].as_array().unwrap();
                assert!(of_round.iter().all(|it| it["register"] == followed), "{data}");
                changes.extend(of_round.iter().map(|it| it["after"].clone()));
            }
        }
        (changes, last["changed_us"].clone())
    };
    let (changes, changed_us) = change(&[1, 2, 3, 4, 5]);
    assert_eq!(changes, ["16#01", "16#02", "16#03", "16#04", "16#05"]);
    assert_eq!(changed_us, 4);
    // The value equals the value at the end of the previous round, but its age has changed.
    assert_eq!(change(&[9, 5]), (vec![json!("16#09"), json!("16#05")], json!(6)));
}

/// The reader does not read until its connection is full.
#[test]
fn a_slow_reader_learns_its_losses_and_delays_no_client() {
    // Number of rounds that fill the connection. The next constant is more rounds than the server keeps for a reader.
    const FULL: usize = 10;
    const ROUNDS: usize = 60;
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let mut slow = server.events_for_a_small_buffer("follow=node2.b_BT_0&journal=1&clock=1");
    slow.until("clock", |_| true);
    let mut quick = server.events("clock=1");
    quick.until("clock", |_| true);
    let offset = register_offset(&server, "node2.b_BT_0");
    let start = Instant::now();
    for round in 1..=ROUNDS {
        let pokes = if round <= FULL { 250 } else { 0 };
        let operations: Vec<_> = (0..pokes)
            .map(|number| json!({"poke": {"plc": 0, "offset": offset, "width": "Byte", "value": (round + number) % 256}}))
            .chain([json!({"advance": {"us": 1}})])
            .collect();
        server.post(&server.path("request"), &json!({ "operations": operations })).ok();
        quick.until("clock", |clock| clock["time_us"] == round);
    }
    assert!(start.elapsed() < Duration::from_secs(50), "{:?}", start.elapsed());
    let lost = slow.until("lost", |_| true);
    assert!(lost["rounds"].as_u64().unwrap() > 0 || lost["records"].as_u64().unwrap() > 0, "{lost}");
    emulator.step(&["1us"]);
    slow.until("clock", |clock| clock["time_us"] == ROUNDS + 1);
}

/// Returns the byte offset of a register that programs write at any time.
fn register_offset(server: &Server, register: &str) -> Value {
    let answer = server.get(&server.path(&format!("show/operations?poke={register}%3D1"))).ok();
    answer["operations"][0]["poke"]["offset"].clone()
}

#[test]
fn an_empty_name_in_a_list_is_refused() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let lists = [
        ("follow", ","),
        ("follow", "node2.w_CPU_CONTROL,"),
        ("values", ",node2.w_CPU_CONTROL"),
        ("journal", "frame,,sync"),
    ];
    for (field, text) in lists {
        let problem = server.get(&server.path(&format!("events?{field}={text}"))).problem(400);
        let detail = problem["detail"].as_str().unwrap();
        assert!(detail.contains("has an empty name") && problem["field"] == field, "{problem}");
    }
}

#[test]
fn the_limit_of_registers_counts_both_lists() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let names = |count: usize| vec!["node2.b_BT_0"; count].join(",");
    let path = |follow, values| {
        server.path(&format!("events?follow={}&values={}&clock=1", names(follow), names(values)))
    };
    let problem = server.get(&path(128, 129)).problem(400);
    assert_eq!(problem["detail"], "events: at most 256 registers can be followed");
    let mut events = server.events(&format!("follow={}&values={}&clock=1", names(128), names(128)));
    events.until("clock", |_| true);
}

#[test]
fn a_reader_gets_everything_before_the_end_of_the_emulator() {
    for _ in 0..6 {
        let emulator = Emulator::stepped();
        let server = Server::of(&emulator, &[]);
        let mut events = server.events("journal=1&clock=1&follow=node2.b_AC");
        events.until("clock", |_| true);
        for value in 1..=8 {
            emulator.poke(&[&format!("node2.b_AC={value}")]);
        }
        emulator.run("stop", &[]).ok();
        let (mut records, mut changes) = (0, 0);
        let end = loop {
            let (name, data) = events.next().expect("the event `ended`");
            match name.as_str() {
                "journal" => records += data["records"].as_array().unwrap().len(),
                "changes" => changes += data["changes"].as_array().unwrap().len(),
                "ended" => break data,
                _ => assert_ne!(name, "lost"),
            }
        };
        assert_eq!((records, changes, &end["complete"]), (8, 8, &json!(true)), "{end}");
        assert_eq!(events.next(), None);
    }
}

#[test]
fn a_killed_emulator_does_not_tell_whether_records_are_missing() {
    let mut emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let mut events = server.events("journal=1&clock=1");
    events.until("clock", |_| true);
    emulator.kill();
    assert_eq!(events.until("ended", |_| true)["complete"], false);
}
