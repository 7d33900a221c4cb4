//! Operations of the table by HTTP.

use crate::common::{Emulator, finish, python_for};
use crate::server::Server;
use serde_json::{Map, Value, json};

/// Returns the name and sample fields of an operation of the table.
pub(crate) fn sample(operation: &Value) -> (String, Value) {
    let fields = operation["fields"].as_array().unwrap().iter().map(|field| {
        let schema = &field["schema"];
        let value = match (&schema["enum"][0], schema["type"].as_str()) {
            (first, _) if !first.is_null() => first.clone(),
            (_, Some("integer")) => json!(schema["minimum"].as_i64().unwrap().max(0)),
            (_, Some("boolean")) => json!(false),
            (_, Some("array")) => json!([]),
            (_, Some("string")) => json!("slcan-pty"),
            (_, Some("object")) => sample_object(schema),
            // A field that may be null.
            _ => Value::Null,
        };
        (field["name"].as_str().unwrap().to_owned(), value)
    });
    (operation["name"].as_str().unwrap().to_owned(), Value::Object(fields.collect::<Map<_, _>>()))
}

/// Returns a test of a register, a setting of a board, or a fault.
fn sample_object(schema: &Value) -> Value {
    let has = |name: &str| !schema["properties"][name].is_null();
    if has("compare") {
        json!({"mask": 255, "compare": "equal", "is_signed": false, "value": 0})
    } else if has("which") {
        json!({"which": 1, "value": 5})
    } else {
        json!({"kind": "lose_frame", "index": 0, "number": 0, "values": {}, "at_us": 0, "limit": {"Count": 1}})
    }
}

fn query(fields: &Value) -> String {
    let text = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    let pairs = fields.as_object().unwrap().iter().map(|(name, value)| format!("{name}={}", text(value)));
    pairs.collect::<Vec<_>>().join("&")
}

#[test]
fn every_operation_of_the_table_is_reached_by_its_method() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let table: Value = serde_json::from_str(include_str!("../../docs/reference/operations.json")).unwrap();
    let mut operations = table["operations"].as_array().unwrap().clone();
    // The last one ends the emulator.
    operations.sort_by_key(|operation| operation["class"] == "ends");
    for operation in &operations {
        let (name, fields) = sample(operation);
        let path = server.path(&name);
        let by_query = format!("{path}?{}", query(&fields));
        let (right, wrong) = match operation["class"] == "looks" {
            true => (server.get(&by_query), server.post(&path, &fields)),
            false => {
                let wrong = server.get(&path);
                let mut more = fields.clone();
                more["nothing"] = json!(1);
                let problem = server.post(&path, &more).problem(400);
                assert!(problem["detail"].as_str().unwrap().contains(&name), "{problem}");
                (server.post(&path, &fields), wrong)
            }
        };
        let problem = wrong.problem(405);
        assert_eq!(wrong.header("allow"), problem["allow"].as_str().unwrap(), "{name}");
        if right.status == 200 {
            let reply = right.ok();
            let answered =
                reply.as_str().or(reply.as_object().and_then(|it| it.keys().next()).map(String::as_str));
            assert_eq!(answered, operation["reply"].as_str(), "{name}: {reply}");
        } else {
            // The plant does not have the names of the sample, so the emulator has refused the operation. This is an
            // answer, too.
            let problem = right.problem(right.status);
            assert!(problem["code"].is_u64() && problem["exit_code"].is_u64(), "{name}: {problem}");
        }
    }
}

#[test]
fn errors_have_the_exit_code_and_the_text_of_the_commands() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let wait = json!({"plc": 0, "offset": 200_002, "width": "Word", "mask": 65535, "value": 9999, "within_us": 1000});
    let problem = server.post(&server.path("wait"), &wait).problem(409);
    assert_eq!((&problem["exit_code"], &problem["code"]), (&json!(1), &json!(10)));
    assert_eq!(problem["waited"]["time_us"], 1000, "{problem}");
    let problem = server
        .post(&server.path("poke"), &json!({"plc": 9, "offset": 0, "width": "Word", "value": 0}))
        .problem(400);
    assert_eq!((&problem["exit_code"], &problem["code"]), (&json!(2), &json!(8)));
    let real_time = Emulator::start(&[]);
    let server = Server::of(&real_time, &[]);
    let problem = server.post(&server.path("advance"), &json!({"us": 1})).problem(409);
    let message = real_time.run("step", &["1us"]);
    assert_eq!(message.code, problem["exit_code"].as_i64().map(|code| code as i32));
    assert_eq!(message.err.trim_end(), format!("commram: {}", problem["detail"].as_str().unwrap()));
}

#[test]
fn several_operations_are_one_request() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let words = "poke=node2.w_CPU_CONTROL%3D1&condition=node2.w_OPTION_STATUS%3D%3D2";
    let mut operations =
        server.get(&server.path(&format!("show/operations?{words}"))).ok()["operations"].clone();
    let list = operations.as_array_mut().unwrap();
    list.push(json!({"wait_for": {"any": false, "within_us": 10_000}}));
    list.push(json!("time"));
    let replies = server.post(&server.path("request"), &json!({ "operations": operations })).ok();
    assert_eq!((&replies["replies"][0], &replies["replies"][1]), (&json!("written"), &json!("written")));
    assert_eq!(replies["replies"][2]["waited"]["time_us"], replies["replies"][3]["time"], "{replies}");
    assert_eq!(emulator.peek(&["node2.w_OPTION_STATUS"]), "16#0002");
    let operations = json!(["time", {"fault_clear": {"id": 77}}, "time"]);
    let problem = server.post(&server.path("request"), &json!({ "operations": operations })).problem(400);
    assert_eq!(problem["index"], 1);
    assert_eq!(problem["replies"].as_array().unwrap().len(), 1, "{problem}");
    let operations = json!([{"time": {}}, {"forces": null}, {"fault_clear": {}}, "findings"]);
    let replies = server.post(&server.path("request"), &json!({ "operations": operations })).ok();
    assert_eq!(replies["replies"].as_array().unwrap().len(), 4, "{replies}");
    let operations = json!(["time", {"time": {"us": 1}}]);
    let problem = server.post(&server.path("request"), &json!({ "operations": operations })).problem(400);
    let detail = "operation 1: time: it has no fields, so no `us`";
    assert_eq!((&problem["index"], &problem["detail"]), (&json!(1), &json!(detail)));
    let too_many = json!({"operations": vec!["time"; 257]});
    server.post(&server.path("request"), &too_many).problem(400);
}

#[test]
fn words_for_single_bits_leave_the_other_bits_unchanged() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    emulator.poke(&["node2.w_CPU_CONTROL=16#8100"]);
    let execute = |words: &str| {
        let operations =
            server.get(&server.path(&format!("show/operations?{words}"))).ok()["operations"].clone();
        server.post(&server.path("request"), &json!({ "operations": operations })).ok()["replies"].clone()
    };
    let replies = execute("poke=node2.w_CPU_CONTROL.6%3D1&poke=node2.w_CPU_CONTROL.15%3D0");
    assert_eq!(replies[1]["exchanged"]["ok"], true, "{replies}");
    assert_eq!(emulator.peek(&["node2.w_CPU_CONTROL"]), "16#0140");
    execute("force=node2.w_CPU_CONTROL.9%3D1");
    assert_eq!(emulator.peek(&["node2.w_CPU_CONTROL"]), "16#0340");
    assert!(emulator.run("force", &[]).ok().contains("node2.w_CPU_CONTROL"));
    execute("unforce=node2.w_CPU_CONTROL.9");
    assert_eq!(emulator.run("force", &[]).ok(), "no register is forced\n");
}

/// Requests that change nothing have a separate connection.
#[test]
fn others_are_answered_while_the_clock_advances() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    std::thread::scope(|scope| {
        let step = scope.spawn(|| server.post(&server.path("advance"), &json!({"us": 120_000_000})).ok());
        let begun = || server.get(&server.path("time")).ok()["time"].as_u64().is_some_and(|time| time > 0);
        assert!(crate::common::eventually(begun));
        assert_eq!(step.join().unwrap(), json!({"time": 120_000_000}));
    });
}

#[test]
fn the_description_is_valid_openapi() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let document = server.get("/api/v1/openapi.json").ok();
    assert_eq!(document["openapi"], "3.1.0");
    let Some(mut python) = python_for("openapi-spec-validator", &["openapi_spec_validator"]) else { return };
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), document.to_string()).unwrap();
    let check = "import json, sys, openapi_spec_validator as v; v.validate(json.load(open(sys.argv[1])))";
    let outcome = finish(python.args(["-c", check]).arg(file.path()));
    assert_eq!(outcome.code, Some(0), "{}", outcome.err);
}

/// A client generator without any code for commram makes a client from the description.
#[test]
fn a_generated_client_brings_a_master_into_active_operation() {
    let packages = ["openapi_python_client", "httpx", "attrs"];
    let Some(mut python) = python_for("openapi-python-client", &packages) else { return };
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let directory = tempfile::tempdir().unwrap();
    let (document, package) = (directory.path().join("openapi.json"), directory.path().join("package"));
    std::fs::write(&document, server.get("/api/v1/openapi.json").ok().to_string()).unwrap();
    let program = python.get_program().to_owned();
    let outcome = finish(
        python
            .args(["-m", "openapi_python_client", "generate", "--path"])
            .arg(&document)
            .arg("--output-path")
            .arg(&package),
    );
    assert_eq!(outcome.code, Some(0), "{}{}", outcome.out, outcome.err);
    let address = format!("http://{}", server.address);
    let mut script = std::process::Command::new(program);
    script.arg("tests/web/generated_client.py").arg(&package).args([
        &address,
        &server.token,
        &server.instance,
    ]);
    let outcome = finish(&mut script);
    assert_eq!((outcome.code, outcome.out.trim()), (Some(0), "active"), "{}", outcome.err);
    assert_eq!(emulator.peek(&["node2.w_OPTION_STATUS"]), "16#0080");
}

/// Two sessions send snapshot files part by part, with their parts in turn.
#[test]
fn each_session_brings_its_own_snapshot() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let json = ("content-type", "application/json");
    let bearer = || {
        let body = json!({ "token": server.token }).to_string();
        let answer = server.request("POST", "/api/v1/session", &[json], &body).ok();
        format!("Bearer {}", answer["key"].as_str().unwrap())
    };
    let bearers = [bearer(), bearer()];
    let post = |session: usize, operation: &str, fields: &Value| {
        let headers = [("authorization", bearers[session].as_str()), json];
        server.request("POST", &server.path(operation), &headers, &fields.to_string())
    };
    // Snapshots of two moments.
    let directory = tempfile::tempdir().unwrap();
    let files = ["a", "b"].map(|name| {
        let path = directory.path().join(name);
        emulator.step(&["1ms"]);
        emulator.run("snapshot", &[path.to_str().unwrap()]).ok();
        std::fs::read(path).unwrap()
    });
    // A request has at most 1 MiB.
    let bring = |session: usize, operations: &[Value]| {
        let headers = [("authorization", bearers[session].as_str()), json];
        let path = server.path("request");
        let body = json!({ "operations": operations }).to_string();
        server.request("POST", &path, &headers, &body).ok();
    };
    let parts = files.each_ref().map(|file| {
        let parts = file.chunks(16).enumerate();
        parts
            .map(|(index, part)| json!({"bring_saved": {"at": 16 * index, "part": part}}))
            .collect::<Vec<_>>()
    });
    for chunk in 0..parts[0].len().max(parts[1].len()).div_ceil(100) {
        for session in [0, 1] {
            let own = parts[session].iter().skip(100 * chunk).take(100).cloned().collect::<Vec<_>>();
            if !own.is_empty() {
                bring(session, &own);
            }
        }
    }
    for (session, time) in [(0, 1000), (1, 2000)] {
        assert_eq!(post(session, "restore", &json!({"detached": false})).ok()["time"], time);
    }
    let none = post(0, "restore", &json!({"detached": false}));
    assert_ne!(none.status, 200, "{none:?}");
}
