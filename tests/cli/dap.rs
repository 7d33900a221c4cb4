//! Tests `commram dap` as a process: an editor debugs a scenario.

use crate::common::commram;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Stdio};
use std::sync::mpsc;

/// A scenario with a function; its last line fails.
const SCENARIO: &str = "\
import \"common\" as common;
let speed = 7;

fn start(node) {
    let name = node + \".w_CPU_CONTROL\";
    poke(name, 1);
}

start(\"node2\");
step(\"2ms\");
speed += 1;
common::twice(speed);
print(\"started\");
expect(\"node2.w_CPU_CONTROL\", 5);
";
const COMMON: &str = "fn twice(number) {\n    let result = number * 2;\n    result\n}\n";

/// Longest life of a session that has to end itself.
const WATCHDOG: core::time::Duration = core::time::Duration::from_secs(60);

/// An editor with its adapter.
struct Editor {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
    sent: u64,
    /// Events that no test has asked for.
    events: Vec<Value>,
    /// Ends the watchdog when the session is dropped.
    watchdog: Option<mpsc::Sender<()>>,
}

impl Editor {
    fn new() -> Self {
        let mut child = commram()
            .arg("dap")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let input = child.stdin.take().unwrap();
        let output = BufReader::new(child.stdout.take().unwrap());
        Self { child, input, output, sent: 0, events: Vec::new(), watchdog: None }
    }

    /// Starts a scenario with breakpoints; the result has the answer for the breakpoints.
    fn launch(program: &Path, arguments: &Value, breakpoints: &[(&Path, &[u32])]) -> (Self, Vec<Value>) {
        let mut editor = Self::new();
        editor.ok("initialize", json!({ "adapterID": "commram" }));
        editor.event("initialized");
        let mut all = json!({ "program": program });
        all.as_object_mut().unwrap().extend(arguments.as_object().unwrap().clone());
        editor.ok("launch", all);
        let mut set = Vec::new();
        for (file, lines) in breakpoints {
            let lines: Vec<_> = lines.iter().map(|line| json!({ "line": line })).collect();
            let answer =
                editor.ok("setBreakpoints", json!({ "source": { "path": file }, "breakpoints": lines }));
            set.extend(answer["breakpoints"].as_array().unwrap().clone());
        }
        editor.ok("configurationDone", json!({}));
        (editor, set)
    }

    fn message(&mut self) -> Value {
        let mut line = String::new();
        self.output.read_line(&mut line).unwrap();
        let length = line.trim().strip_prefix("Content-Length: ").unwrap().parse().unwrap();
        self.output.read_line(&mut line).unwrap();
        let mut text = vec![0_u8; length];
        self.output.read_exact(&mut text).unwrap();
        serde_json::from_slice(&text).unwrap()
    }

    fn request(&mut self, command: &str, arguments: Value) -> Value {
        self.sent += 1;
        let message =
            json!({ "seq": self.sent, "type": "request", "command": command, "arguments": arguments });
        let text = message.to_string();
        write!(self.input, "Content-Length: {}\r\n\r\n{text}", text.len()).unwrap();
        loop {
            let message = self.message();
            if message["type"] == "response" {
                assert_eq!(message["request_seq"], self.sent, "{message}");
                return message;
            }
            self.events.push(message);
        }
    }

    fn ok(&mut self, command: &str, arguments: Value) -> Value {
        let mut answer = self.request(command, arguments);
        assert_eq!(answer["success"], true, "{answer}");
        answer["body"].take()
    }

    fn refused(&mut self, command: &str, arguments: Value) -> String {
        let answer = self.request(command, arguments);
        assert_eq!(answer["success"], false, "{answer}");
        answer["message"].as_str().unwrap().to_owned()
    }

    /// The body of the next event with this name.
    fn event(&mut self, name: &str) -> Value {
        loop {
            if let Some(at) = self.events.iter().position(|event| event["event"] == name) {
                return self.events.remove(at)["body"].take();
            }
            let message = self.message();
            assert_eq!(message["type"], "event", "{message}");
            self.events.push(message);
        }
    }

    /// The reason of the next stop, with the functions and lines of the call stack.
    fn stop(&mut self) -> (String, Vec<(String, u64)>) {
        let reason = self.event("stopped")["reason"].as_str().unwrap().to_owned();
        let stack = self.ok("stackTrace", json!({ "threadId": 1 }));
        let frame = |frame: &Value| {
            let name = frame["name"].as_str().unwrap();
            (name.split(" at ").next().unwrap().to_owned(), frame["line"].as_u64().unwrap())
        };
        (reason, stack["stackFrames"].as_array().unwrap().iter().map(frame).collect())
    }

    fn resume(&mut self, command: &str) -> (String, Vec<(String, u64)>) {
        self.ok(command, json!({ "threadId": 1 }));
        self.stop()
    }

    fn value(&mut self, expression: &str) -> String {
        let answer = self.ok("evaluate", json!({ "expression": expression, "frameId": 0 }));
        answer["result"].as_str().unwrap().to_owned()
    }

    /// Ends the session, and expects that the adapter ends well.
    fn disconnect(mut self) {
        self.ok("disconnect", json!({}));
        assert_eq!(self.child.wait().unwrap().code(), Some(0));
    }
}

/// A directory with the scenario, its import, and their paths.
fn scenario() -> (tempfile::TempDir, std::path::PathBuf, std::path::PathBuf) {
    let directory = tempfile::tempdir().unwrap();
    let (own, common) = (directory.path().join("own.rhai"), directory.path().join("common.rhai"));
    std::fs::write(&own, SCENARIO).unwrap();
    std::fs::write(&common, COMMON).unwrap();
    (directory, own, common)
}

fn at(reason: &str, frames: &[(&str, u64)]) -> (String, Vec<(String, u64)>) {
    (reason.to_owned(), frames.iter().map(|(name, line)| ((*name).to_owned(), *line)).collect())
}

#[test]
fn breakpoints_and_steps_stop_at_their_lines() {
    let (_directory, own, common) = scenario();
    let (mut editor, set) = Editor::launch(&own, &json!({}), &[(&own, &[3, 4, 200]), (&common, &[2])]);
    // No statement begins in lines 3 and 4, so the breakpoint moves to the next statement.
    let lines: Vec<_> = set.iter().map(|point| (point["verified"].clone(), point["line"].clone())).collect();
    assert_eq!(
        lines,
        [
            (json!(true), json!(5)),
            (json!(true), json!(5)),
            (json!(false), Value::Null),
            (json!(true), json!(2))
        ]
    );
    assert_eq!(editor.stop(), at("breakpoint", &[("start", 5), ("(scenario)", 9)]));
    assert_eq!(editor.value("node"), "node2");
    assert_eq!(editor.resume("next"), at("step", &[("start", 6), ("(scenario)", 9)]));
    assert_eq!(editor.resume("stepOut"), at("step", &[("(scenario)", 10)]));
    assert_eq!(editor.resume("next"), at("step", &[("(scenario)", 11)]));
    assert_eq!(editor.value("now()"), "2000");
    assert_eq!(editor.resume("next"), at("step", &[("(scenario)", 12)]));
    assert_eq!(editor.resume("continue"), at("breakpoint", &[("twice", 2), ("(scenario)", 12)]));
    editor.disconnect();
}

/// The registers of an option card are among those of its PLC.
#[test]
fn registers_of_an_option_card_are_shown_and_changed() {
    let directory = tempfile::tempdir().unwrap();
    let own = directory.path().join("card.rhai");
    let card = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/devices/encoder");
    let plant = format!("[[plc]]\nname = 'line'\n[[plc.option]]\nslot = 1\ncard = '{card}'\n");
    std::fs::write(directory.path().join("plant.toml"), plant).unwrap();
    let text =
        "plant(\"plant.toml\");\nstep(\"1ms\");\nstep(\"3ms\");\nexpect(\"line:encoder1.w_COMMAND\", 6);\n";
    std::fs::write(&own, text).unwrap();
    let (mut editor, _) = Editor::launch(&own, &json!({}), &[(&own, &[3])]);
    assert_eq!(editor.stop(), at("breakpoint", &[("(scenario)", 3)]));
    let scopes = editor.ok("scopes", json!({ "frameId": 0 }));
    let areas =
        editor.ok("variables", json!({ "variablesReference": scopes["scopes"][1]["variablesReference"] }));
    let areas = areas["variables"].as_array().unwrap();
    let encoder = areas.iter().find(|it| it["name"] == "line:encoder1").unwrap();
    let register =
        json!({ "variablesReference": encoder["variablesReference"], "name": "w_COMMAND", "value": "7" });
    editor.ok("setVariable", register);
    // With the changed register the card answers, and the scenario passes.
    editor.ok("continue", json!({}));
    assert_eq!(editor.event("exited")["exitCode"], 0);
    editor.event("terminated");
}

#[test]
fn variables_and_registers_are_shown_and_registers_are_changed() {
    let (_directory, own, _) = scenario();
    let (mut editor, _) = Editor::launch(&own, &json!({}), &[(&own, &[12])]);
    assert_eq!(editor.stop(), at("breakpoint", &[("(scenario)", 12)]));
    let scopes = editor.ok("scopes", json!({ "frameId": 0 }));
    let variables =
        editor.ok("variables", json!({ "variablesReference": scopes["scopes"][0]["variablesReference"] }));
    let speed = variables["variables"].as_array().unwrap().iter().find(|it| it["name"] == "speed").unwrap();
    assert_eq!(speed["value"], "8");
    let areas =
        editor.ok("variables", json!({ "variablesReference": scopes["scopes"][1]["variablesReference"] }));
    let node = areas["variables"].as_array().unwrap().iter().find(|it| it["name"] == "node2").unwrap();
    let reference = node["variablesReference"].clone();
    let page = editor.ok("variables", json!({ "variablesReference": reference, "start": 1, "count": 2 }));
    assert_eq!(page["variables"].as_array().unwrap().len(), 2);
    let changed = editor.ok(
        "setVariable",
        json!({ "variablesReference": reference, "name": "w_CPU_CONTROL", "value": "16#0005" }),
    );
    assert!(changed["value"].as_str().unwrap().starts_with("16#0005"), "{changed}");
    assert!(editor.value("node2.w_CPU_CONTROL").contains("16#0005"));
    // An expression has no effects.
    assert_eq!(editor.value("speed * 2"), "16");
    assert!(
        editor
            .refused("evaluate", json!({ "expression": "poke(\"node2.w_CPU_CONTROL\", 2)" }))
            .contains("poke")
    );
    let refusal = editor.refused("evaluate", json!({ "expression": "sleep(1000)" }));
    assert!(refusal.contains("emulated time only"), "{refusal}");
    let refusal =
        editor.refused("setVariable", json!({ "variablesReference": 1, "name": "speed", "value": "1" }));
    assert!(refusal.contains("only a register can be changed"), "{refusal}");
    // With the changed register the scenario passes.
    editor.ok("continue", json!({}));
    assert_eq!(editor.event("output")["output"], "started\n");
    assert_eq!(editor.event("exited")["exitCode"], 0);
    editor.event("terminated");
    editor.disconnect();
}

#[test]
fn a_failure_stops_the_scenario_where_it_fails() {
    let (_directory, own, _) = scenario();
    let (mut editor, _) = Editor::launch(&own, &json!({ "stopOnEntry": true }), &[]);
    assert_eq!(editor.stop(), at("entry", &[("(scenario)", 1)]));
    assert_eq!(editor.resume("continue"), at("exception", &[("(scenario)", 14)]));
    let info = editor.ok("exceptionInfo", json!({ "threadId": 1 }));
    assert!(info["description"].as_str().unwrap().contains("w_CPU_CONTROL"), "{info}");
    assert!(editor.value("node2.w_CPU_CONTROL").contains("16#0001"));
    editor.ok("continue", json!({}));
    assert_eq!(editor.event("exited")["exitCode"], 1);
    editor.disconnect();
}

#[test]
fn steps_back_reach_earlier_lines_with_their_state() {
    let (_directory, own, _) = scenario();
    let (mut editor, _) = Editor::launch(&own, &json!({}), &[(&own, &[6, 11])]);
    assert_eq!(editor.stop(), at("breakpoint", &[("start", 6), ("(scenario)", 9)]));
    assert_eq!(editor.resume("continue"), at("breakpoint", &[("(scenario)", 11)]));
    assert_eq!((editor.value("now()"), editor.value("speed")), ("2000".to_owned(), "7".to_owned()));
    assert_eq!(editor.resume("next"), at("step", &[("(scenario)", 12)]));
    assert_eq!(editor.value("speed"), "8");
    // The variables, the registers and the emulated time are those of the earlier line.
    assert_eq!(editor.resume("stepBack"), at("step", &[("(scenario)", 11)]));
    assert_eq!(editor.value("speed"), "7");
    assert_eq!(editor.resume("stepBack"), at("step", &[("(scenario)", 10)]));
    assert_eq!(editor.value("now()"), "0");
    assert!(editor.value("node2.w_CPU_CONTROL").contains("16#0001"));
    assert_eq!(editor.resume("reverseContinue"), at("breakpoint", &[("start", 6), ("(scenario)", 9)]));
    // The first verb has not run.
    assert!(editor.value("node2.w_CPU_CONTROL").contains("16#0000"));
    assert_eq!(editor.resume("stepBack"), at("step", &[("start", 5), ("(scenario)", 9)]));
    assert_eq!(editor.resume("reverseContinue"), at("entry", &[("(scenario)", 1)]));
    // Nothing is before the first line.
    assert_eq!(editor.resume("stepBack"), at("entry", &[("(scenario)", 1)]));
    assert_eq!(editor.resume("continue"), at("breakpoint", &[("start", 6), ("(scenario)", 9)]));
    editor.disconnect();
}

#[test]
fn a_failure_is_stepped_back_and_mended_by_a_change() {
    let (_directory, own, _) = scenario();
    let (mut editor, _) = Editor::launch(&own, &json!({}), &[]);
    assert_eq!(editor.stop(), at("exception", &[("(scenario)", 14)]));
    assert_eq!(editor.event("output")["output"], "started\n");
    assert_eq!(editor.resume("stepBack"), at("step", &[("(scenario)", 14)]));
    // An earlier run has printed this line.
    assert!(editor.events.iter().all(|event| event["event"] != "output"), "{:?}", editor.events);
    let areas = editor.ok("variables", json!({ "variablesReference": 2 }));
    let node = areas["variables"].as_array().unwrap().iter().find(|it| it["name"] == "node2").unwrap();
    let change = json!({
        "variablesReference": node["variablesReference"], "name": "w_CPU_CONTROL", "value": "16#0005",
    });
    editor.ok("setVariable", change);
    editor.ok("continue", json!({}));
    assert_eq!(editor.event("exited")["exitCode"], 0);
    editor.disconnect();
}

#[test]
fn a_scenario_without_expectations_has_the_exit_code_of_the_command_test() {
    let directory = tempfile::tempdir().unwrap();
    let own = directory.path().join("own.rhai");
    for (text, code, message) in [
        ("step(\"1ms\");\n", 1, "the scenario has no expectation, so it cannot fail; add an expectation\n"),
        ("skip(\"later\");\n", 0, "skipped: later\n"),
    ] {
        std::fs::write(&own, text).unwrap();
        let (mut editor, _) = Editor::launch(&own, &json!({}), &[]);
        let printed = editor.event("output")["output"].as_str().unwrap().to_owned();
        assert!(printed.contains(message), "{printed}");
        assert_eq!(editor.event("exited")["exitCode"], code);
        editor.disconnect();
        let tested = commram().arg("test").arg(&own).output().unwrap();
        assert_eq!(tested.status.code(), Some(code), "{text}");
    }
}

#[test]
fn a_scenario_without_debugging_stops_nowhere() {
    let (_directory, own, _) = scenario();
    let arguments = json!({ "stopOnEntry": true, "noDebug": true });
    let (mut editor, _) = Editor::launch(&own, &arguments, &[(&own, &[9])]);
    assert_eq!(editor.event("exited")["exitCode"], 1);
    assert!(editor.events.iter().all(|event| event["event"] != "stopped"), "{:?}", editor.events);
    editor.disconnect();
}

#[test]
fn an_endless_scenario_is_paused_and_ended_at_once() {
    let directory = tempfile::tempdir().unwrap();
    let own = directory.path().join("own.rhai");
    std::fs::write(&own, "let count = 0;\nprint(\"begins\");\nloop {\n    count += 1;\n}\n").unwrap();
    let (mut editor, _) = Editor::launch(&own, &json!({}), &[]);
    editor.event("output");
    assert!(editor.refused("stackTrace", json!({ "threadId": 1 })).contains("pause it first"));
    editor.ok("pause", json!({ "threadId": 1 }));
    let (reason, _) = editor.stop();
    assert_eq!(reason, "pause");
    editor.ok("continue", json!({}));
    editor.ok("terminate", json!({}));
    editor.event("terminated");
    editor.disconnect();
}

/// Starts a scenario with this text and breakpoints. A session that hangs is ended, so that its test fails.
fn watched(text: &str, breakpoints: &[u32]) -> (tempfile::TempDir, Editor) {
    let directory = tempfile::tempdir().unwrap();
    let own = directory.path().join("own.rhai");
    std::fs::write(&own, text).unwrap();
    let (mut editor, _) = Editor::launch(&own, &json!({}), &[(&own, breakpoints)]);
    let process = rustix::process::Pid::from_child(&editor.child);
    let (end, ended) = mpsc::channel();
    std::thread::spawn(move || {
        if ended.recv_timeout(WATCHDOG) == Err(mpsc::RecvTimeoutError::Timeout) {
            let _ = rustix::process::kill_process(process, rustix::process::Signal::KILL);
        }
    });
    editor.watchdog = Some(end);
    (directory, editor)
}

#[test]
fn a_loop_with_a_call_as_its_only_statement_stops_in_each_round() {
    for (text, line) in [
        ("loop {\n    step(\"1us\");\n}\n", 2),
        ("fn own() { 1 }\nloop {\n    own();\n}\n", 3),
        ("for i in 0..1000000000 { now(); }\n", 1),
        ("while now() >= 0 { }\n", 1),
        ("let all = [1];\nloop {\n    all.len();\n}\n", 3),
    ] {
        let (_directory, mut editor) = watched(text, &[line]);
        for round in 0..3 {
            if round > 0 {
                editor.ok("continue", json!({ "threadId": 1 }));
            }
            let (reason, frames) = editor.stop();
            assert_eq!((reason.as_str(), frames[0].1), ("breakpoint", u64::from(line)), "{text}");
        }
        editor.disconnect();
        let (_directory, mut editor) = watched(text, &[]);
        editor.ok("pause", json!({ "threadId": 1 }));
        assert_eq!(editor.stop().0, "pause", "{text}");
        editor.disconnect();
    }
}

/// Functions often end with such a line.
#[test]
fn a_line_that_is_only_a_value_is_a_stop() {
    for value in [
        "x",
        "x && x",
        "5",
        "-1",
        "\"text\"",
        "`text ${x}`",
        "[\n        x,\n        1]",
        "#{a: x}",
        "()",
        "x;",
    ] {
        let text =
            format!("fn own(x) {{\n    step(\"1us\");\n    {value}\n}}\nown(true);\nown(false);\nnow();\n");
        let (_directory, mut editor) = watched(&text, &[3]);
        for caller in [5, 6] {
            if value.lines().count() > 1 {
                // The position of the call follows the lines of the value.
                let (reason, frames) = editor.stop();
                assert_eq!((reason.as_str(), frames[0].1), ("breakpoint", 3), "{text}");
            } else {
                assert_eq!(editor.stop(), at("breakpoint", &[("own", 3), ("(scenario)", caller)]), "{text}");
            }
            editor.ok("continue", json!({ "threadId": 1 }));
        }
        editor.event("terminated");
        editor.disconnect();
    }
    let (_directory, mut editor) =
        watched("fn own(x) {\n    x\n}\nlet y = own(\n    1\n);\ny;\nnow();\n", &[4]);
    assert_eq!(editor.stop(), at("breakpoint", &[("(scenario)", 4)]));
    assert_eq!(editor.resume("stepIn"), at("step", &[("own", 2), ("(scenario)", 4)]));
    for line in [7, 8] {
        assert_eq!(editor.resume("next"), at("step", &[("(scenario)", line)]));
    }
    editor.disconnect();
}

#[test]
fn the_parts_of_a_call_are_no_stops() {
    let text = "let sum = 0;\nsum = abs(abs(1) + abs(2)) + abs(3);\nabs(abs(sum));\nsum = 9;\n";
    let (_directory, mut editor) = watched(text, &[2]);
    assert_eq!(editor.stop(), at("breakpoint", &[("(scenario)", 2)]));
    assert_eq!(editor.resume("stepIn"), at("step", &[("(scenario)", 3)]));
    assert_eq!(editor.resume("stepIn"), at("step", &[("(scenario)", 4)]));
    editor.disconnect();
}

#[test]
fn requests_overtake_the_lines_of_a_scenario_that_prints_without_end() {
    let text = "loop {\n    print(\"x\");\n    let q = 1;\n}\n";
    let (_directory, mut editor) = watched(text, &[]);
    // The scenario prints before the first request.
    editor.event("output");
    editor.events.clear();
    editor.ok("pause", json!({ "threadId": 1 }));
    // Lines that wait in the adapter (64) and in the pipe (64 KiB, more than 90 bytes a line).
    assert!(editor.events.len() < 1500, "{} lines came before the answer", editor.events.len());
    assert_eq!(editor.stop().0, "pause");
    editor.ok("continue", json!({ "threadId": 1 }));
    editor.events.clear();
    editor.ok("disconnect", json!({}));
    assert!(editor.events.len() < 1500, "{} lines came before the answer", editor.events.len());
    assert_eq!(editor.child.wait().unwrap().code(), Some(0));
}

#[test]
fn a_scenario_that_prints_ends_with_the_connection() {
    let text = "loop {\n    print(\"x\");\n    let q = 1;\n}\n";
    let (_directory, mut editor) = watched(text, &[]);
    editor.event("output");
    let Editor { mut child, input, output, .. } = editor;
    drop((input, output));
    assert_eq!(child.wait().unwrap().code(), Some(0));
}

#[test]
fn registers_are_known_before_the_first_verb() {
    let directory = tempfile::tempdir().unwrap();
    let own = directory.path().join("own.rhai");
    std::fs::write(&own, "let a = 1;\nexpect(\"node2.w_CPU_CONTROL\", 5);\n").unwrap();
    let (mut editor, _) = Editor::launch(&own, &json!({ "stopOnEntry": true }), &[]);
    assert_eq!(editor.stop().0, "entry");
    assert!(editor.value("node2.w_CPU_CONTROL").contains("16#0000"));
    let areas = editor.ok("variables", json!({ "variablesReference": 2 }));
    let node = areas["variables"].as_array().unwrap().iter().find(|it| it["name"] == "node2").unwrap();
    let change = json!({
        "variablesReference": node["variablesReference"], "name": "w_CPU_CONTROL", "value": "5",
    });
    // The first verb uses the plant that the editor has shown and changed.
    editor.ok("setVariable", change);
    editor.ok("continue", json!({}));
    assert_eq!(editor.event("exited")["exitCode"], 0, "{:?}", editor.events);
    editor.disconnect();
}

#[test]
fn an_expression_before_the_first_verb_does_not_replace_the_plant_of_the_scenario() {
    let directory = tempfile::tempdir().unwrap();
    let (own, common) = (directory.path().join("own.rhai"), directory.path().join("common.rhai"));
    let plant = "plant(`[[plc]]\nname = \"own\"\n`);";
    for (text, import) in [
        (format!("let a = 1;\n{plant}\nexpect_that(now() == 0, \"none\");\n"), String::new()),
        (
            "import \"common\" as common;\ncommon::begin();\nexpect_that(now() == 0, \"none\");\n".to_owned(),
            format!("fn begin() {{\n    {plant}\n}}\n"),
        ),
    ] {
        std::fs::write(&own, &text).unwrap();
        std::fs::write(&common, &import).unwrap();
        let (mut editor, _) = Editor::launch(&own, &json!({ "stopOnEntry": true }), &[]);
        assert_eq!(editor.stop().0, "entry");
        for expression in ["now()", "node2.w_CPU_CONTROL"] {
            let answer = editor.request("evaluate", json!({ "expression": expression, "frameId": 0 }));
            // A scenario that calls the verb itself has no registers before it.
            assert_eq!(answer["success"], !import.is_empty(), "{answer}");
            if import.is_empty() {
                let message = answer["message"].as_str().unwrap();
                assert!(message.contains("this verb has not run"), "{message}");
            }
        }
        editor.ok("continue", json!({}));
        assert_eq!(editor.event("exited")["exitCode"], 0, "{:?}", editor.events);
        editor.disconnect();
    }
}

#[test]
fn wrong_launches_and_hostile_input_get_an_error() {
    let mut editor = Editor::new();
    let refusal = editor.refused("launch", json!({ "program": "/nonexistent/own.rhai" }));
    assert_eq!(refusal, "program: /nonexistent/own.rhai is not a file; name a scenario");
    assert_eq!(editor.refused("goto", json!({})), "this adapter has no request `goto`");
    assert_eq!(editor.refused("stepBack", json!({})), "the scenario has not started");
    write!(editor.input, "Content-Length: x\r\n\r\n").unwrap();
    let output = editor.child.wait().unwrap();
    assert_eq!(output.code(), Some(2));
    // An editor that dies closes the input.
    let Editor { mut child, input, .. } = Editor::new();
    drop(input);
    assert_eq!(child.wait().unwrap().code(), Some(0));
}
