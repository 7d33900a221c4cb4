//! Recorded actions become a scenario that passes when it is run.

use crate::common::{Emulator, Outcome, commram, finish};
use crate::server::Server;
use serde_json::{Value, json};

/// Sends operations as a page does, and records them.
struct Recorder<'a> {
    server: &'a Server,
    actions: Vec<Value>,
}

impl Recorder<'_> {
    fn time(&self) -> u64 {
        self.server.get(&self.server.path("time")).ok()["time"].as_u64().unwrap()
    }

    /// Does the operations of these words of the command line.
    fn words(&mut self, words: &str) {
        let path = self.server.path(&format!("show/operations?{words}"));
        for operation in self.server.get(&path).ok()["operations"].as_array().unwrap() {
            self.act(operation.clone());
        }
    }

    fn act(&mut self, operation: Value) {
        let begin = self.time();
        self.server.post(&self.server.path("request"), &json!({"operations": [operation.clone()]})).ok();
        self.actions.push(json!({"time_us": begin, "end_us": self.time(), "operation": operation}));
    }

    /// Executes operations as one request, and records each of them.
    fn act_together(&mut self, operations: Vec<Value>) {
        let begin = self.time();
        self.server.post(&self.server.path("request"), &json!({"operations": &operations})).ok();
        let end = self.time();
        let last = operations.len() - 1;
        // Only the last operation of the words advances the clock or goes back, so only its action has an end.
        let action = |(at, operation)| {
            let end = (at == last).then_some(end);
            json!({"time_us": begin, "end_us": end, "operation": operation})
        };
        self.actions.extend(operations.into_iter().enumerate().map(action));
    }

    fn expect(&mut self, register: &str, value: &str) {
        let time = self.time();
        self.actions.push(json!({"time_us": time, "expect": {"register": register, "value": value}}));
    }

    fn scenario(&self) -> String {
        let body = json!({"name": "recorded", "actions": self.actions});
        let answer = self.server.post(&self.server.path("scenario"), &body).ok();
        answer["scenario"].as_str().unwrap().to_owned()
    }
}

fn test(scenario: &str) -> Outcome {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("recorded.rhai");
    std::fs::write(&file, scenario).unwrap();
    finish(commram().arg("test").arg(&file))
}

#[test]
fn a_recording_passes_as_a_scenario_and_fails_with_another_expectation() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let mut recorder = Recorder { server: &server, actions: Vec::new() };
    recorder.actions.push(json!({"time_us": 0, "section": "a \"start\""}));
    recorder.words("poke=node2.w_CPU_CONTROL%3D16%230001");
    recorder.act(json!({"wait": {"plc": 0, "offset": 200_002, "width": "Word", "mask": 65535, "value": 2, "within_us": 10_000}}));
    // The conditions of these waits are true already, so the waits take no time. Such waits are recorded, too.
    let condition = |compare: &str, mask: u32, value: u32| {
        json!({"condition": {"plc": 0, "offset": 200_002, "width": "Word",
            "test": {"mask": mask, "compare": compare, "is_signed": false, "value": value}}})
    };
    let wait_for = json!({"wait_for": {"any": false, "within_us": 1000}});
    for conditions in [
        vec![condition("equal", 65535, 2)],
        vec![condition("equal", 2, 2)],
        vec![condition("greater", 65535, 1), condition("not_equal", 1, 1)],
    ] {
        recorder.act_together(conditions.into_iter().chain([wait_for.clone()]).collect());
    }
    recorder.expect("node2.w_OPTION_STATUS", "16#0002");
    recorder.words("fault=lose_frame%20slot%3DWRC1%20count%3D3&board=dip%3D5&force=node1.b_BT_0%3D7");
    recorder.act(json!({"advance": {"us": 3000}}));
    recorder.words("poke=node1.w_CPU_CONTROL%3D16%230001");
    recorder.act(json!({"advance": {"us": 5000}}));
    recorder.act(json!({"back": {"us": 5000, "detached": false}}));
    recorder.act(json!({"advance_to_event": {"within_us": 1000}}));
    recorder.act(json!({"advance_to_event": {"within_us": 0}}));
    recorder.act(json!("forces"));
    recorder.words("unforce=node1.b_BT_0");
    recorder.act(json!({"fault_clear": {"id": null}}));
    let status = emulator.peek(&["node2.w_OPTION_STATUS"]);
    recorder.expect("node2.w_OPTION_STATUS", &status);
    recorder.expect("node1.b_BT_0", "7");
    recorder.actions.push(json!({"time_us": recorder.time(), "expect": {"no_findings": true}}));
    let scenario = recorder.scenario();
    for line in [
        "// recorded",
        "section(\"a \\\"start\\\"\");",
        "poke(\"node2.w_CPU_CONTROL\", \"16#0001\");",
        "wait(\"",
        ", 2, \"1000us\");\nwait_bits(\"",
        ", 2, 2, \"1000us\");\nwait_until(|| peek(\"",
        ") > 1 && (peek(\"",
        ") & 1) != 1, \"1000us\");",
        "fault(\"lose_frame bus=drives slot=WRC1 count=3\");",
        "set_board(\"line:dip=5\");",
        "step(\"3000us\");",
        "// `advance_to_event` handled the events of this moment here.",
        "expect_no_findings();",
        "clear_faults();",
    ] {
        assert!(scenario.contains(line), "{line} is not in\n{scenario}");
    }
    let outcome = test(&scenario);
    assert_eq!(outcome.code, Some(0), "{scenario}\n{}{}", outcome.out, outcome.err);
    let outcome =
        test(&scenario.replace("expect(\"node1.b_BT_0\", \"7\")", "expect(\"node1.b_BT_0\", \"8\")"));
    assert_eq!(outcome.code, Some(1), "{}{}", outcome.out, outcome.err);
}

/// A return to a condition takes the conditions of the request. The next wait has only its own conditions.
#[test]
fn the_condition_of_a_way_back_is_not_part_of_the_next_wait() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let mut recorder = Recorder { server: &server, actions: Vec::new() };
    let condition = |offset: u32, value: u32| {
        json!({"condition": {"plc": 0, "offset": offset, "width": "Word",
            "test": {"mask": 65535, "compare": "equal", "is_signed": false, "value": value}}})
    };
    let wait_for = json!({"wait_for": {"any": false, "within_us": 10_000}});
    recorder.words("poke=node2.w_CPU_CONTROL%3D16%230001");
    recorder.act_together(vec![condition(200_002, 2), wait_for.clone()]);
    recorder.act(json!({"advance": {"us": 2000}}));
    recorder
        .act_together(vec![condition(200_002, 2), json!({"back_until": {"any": false, "detached": false}})]);
    recorder.act_together(vec![condition(200_000, 1), wait_for]);
    let scenario = recorder.scenario();
    assert!(!scenario.contains("wait_until"), "{scenario}");
    let outcome = test(&scenario);
    assert_eq!(outcome.code, Some(0), "{scenario}\n{}{}", outcome.out, outcome.err);
}

#[test]
fn the_plant_is_part_of_the_scenario() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("plant.toml");
    std::fs::write(&file, "[[plc]]\nname = \"one\"\n[[plc]]\nname = \"two\" # \"quoted\" \\\\\n").unwrap();
    let emulator = Emulator::start(&["--clock", "stepped", file.to_str().unwrap()]);
    let server = Server::of(&emulator, &[]);
    let mut recorder = Recorder { server: &server, actions: Vec::new() };
    recorder.words("poke=two:node2.b_BT_0%3D5");
    recorder.act(json!({"advance": {"us": 1000}}));
    recorder.expect("two:node2.b_BT_0", "5");
    let outcome = test(&recorder.scenario());
    assert_eq!(outcome.code, Some(0), "{}\n{}{}", recorder.scenario(), outcome.out, outcome.err);
}

#[test]
fn consecutive_steps_are_one_step() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let advance =
        |from: u64| json!({"time_us": from, "end_us": from + 1000, "operation": {"advance": {"us": 1000}}});
    let mut actions: Vec<_> = (0..5000).map(|at| advance(at * 1000)).collect();
    actions.insert(2000, json!({"time_us": 2_000_000, "section": "later"}));
    let answer = server.post(&server.path("scenario"), &json!({"actions": actions})).ok();
    assert_eq!(answer["scenario"], "step(\"2000000us\");\nsection(\"later\");\nstep(\"3000000us\");\n");
}

#[test]
fn actions_that_no_scenario_repeats_are_named() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let path = server.path("scenario");
    for (action, reason) in [
        (
            json!({"time_us": 0, "operation": {"set_parameter": {"drive": 0, "number": 1, "value": 1}}}),
            "no verb",
        ),
        (json!({"time_us": 0, "operation": {"advance": {"us": 1}}}), "end_us"),
        (json!({"time_us": 0, "operation": {"restore": {"detached": false}}}), "ways back"),
        (json!({"time_us": 0, "expect": {"register": "node2.w_NOTHING", "value": 1}}), "w_NOTHING"),
        (json!({"time_us": 0, "expect": {"register": "node2.w_CPU_CONTROL", "value": "x"}}), "x"),
        (json!({"time_us": 0}), "exactly one"),
        (
            json!({"time_us": 0, "operation": {"clear_findings": {"id": 1}}}),
            "clear_findings: it has no fields",
        ),
        (json!({"time_us": 0, "operation": 5}), "5 is no operation: write its name"),
        (
            json!({"time_us": 0, "register": "node2.b_BT_0", "operation":
            {"poke": {"plc": 0, "offset": 200_000, "width": "Word", "value": 1}}}),
            "is not the register",
        ),
    ] {
        let body = json!({"actions": [{"time_us": 0, "section": "first"}, action]});
        let problem = server.post(&path, &body).problem(400);
        assert_eq!(problem["index"], 1, "{problem}");
        assert!(problem["detail"].as_str().unwrap().contains(reason), "{reason}: {problem}");
    }
    let poke = |value: u64| json!({"poke": {"plc": 0, "offset": 200_000, "width": "Word", "value": value}});
    let pokes: Vec<_> = (0..2500).map(|at| json!({"time_us": at, "operation": poke(at)})).collect();
    let problem = server.post(&path, &json!({"actions": pokes})).problem(400);
    assert!(problem["detail"].as_str().unwrap().contains("reads at most 65536"), "{problem}");
    for operation in [json!("clear_findings"), json!({"clear_findings": {}})] {
        let actions = json!([{"time_us": 0, "operation": operation}]);
        let answer = server.post(&path, &json!({"actions": actions})).ok();
        assert_eq!(answer, json!({"scenario": "clear_findings();\n"}));
    }
    let real_time = Emulator::start(&[]);
    let server = Server::of(&real_time, &[]);
    let body = |plant: Value| json!({"actions": [], "plant": plant});
    assert_eq!(server.post(&server.path("scenario"), &body(Value::Null)).problem(400)["field"], "plant");
    let answer = server.post(&server.path("scenario"), &body(json!("my.toml"))).ok();
    assert_eq!(answer, json!({"scenario": "plant(\"my.toml\");\n"}));
}
