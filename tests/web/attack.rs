//! Attacks: floods, half-open connections, hostile requests.

use crate::common::Emulator;
use crate::server::Server;
use serde_json::json;
use std::io::{Read, Write};
use std::time::{Duration, Instant};

/// An answer to a client with the token takes less time than this, independently of other clients.
const SOON: Duration = Duration::from_secs(20);

#[track_caller]
fn answers(server: &Server) {
    let start = Instant::now();
    server.get(&server.path("time")).ok();
    assert!(start.elapsed() < SOON, "{:?}", start.elapsed());
}

#[test]
fn connections_without_a_token_take_no_place_from_others() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let mut open = Vec::new();
    for number in 0..600 {
        let mut stream = server.connect();
        // Some connections send nothing, others begin a request and never end it.
        if number % 2 == 0 {
            let _ = stream.write_all(b"GET /api/v1/instances HTTP/1.1\r\nhost: 127.0.0.1\r\nx-slow: ");
        }
        open.push(stream);
        if number % 100 == 99 {
            answers(&server);
        }
    }
    let mut events = server.events("clock=1");
    assert_eq!(events.status(), 200);
    for _ in 0..300 {
        open.push(server.connect());
    }
    events.until("clock", |_| true);
    emulator.step(&["5us"]);
    events.until("clock", |clock| clock["time_us"] == 5);
}

#[test]
fn a_thousand_event_streams_are_bounded() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let mut open = Vec::new();
    let mut refused = 0;
    for _ in 0..1000 {
        let mut stream = server.events("clock=1&journal=1&scene=1");
        match stream.status() {
            200 => open.push(stream),
            503 => refused += 1,
            other => panic!("{other}"),
        }
    }
    assert_eq!((open.len(), refused), (64, 936));
    answers(&server);
    emulator.step(&["1ms"]);
    for stream in &mut open {
        stream.until("clock", |clock| clock["time_us"] == 1000);
    }
    drop(open);
    let place = || server.events("clock=1").status() == 200;
    assert!(crate::common::eventually(place), "readers that have gone make room");
}

#[test]
fn hostile_bodies_and_queries_are_refused_with_a_problem() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let (bearer, path) = (server.bearer(), server.path("advance"));
    let headers = [("authorization", bearer.as_str()), ("content-type", "application/json")];
    let deep = "[".repeat(100_000);
    let deep_object = "{\"us\":".repeat(50_000);
    for body in [
        "nothing",
        "[]",
        "5",
        "null",
        "\"us\"",
        "{",
        r#"{"us":}"#,
        r#"{"us":-1}"#,
        r#"{"us":1e99}"#,
        r#"{"us":1.5}"#,
        r#"{"us":NaN}"#,
        r#"{"us":99999999999999999999999999}"#,
        r#"{"us":[1]}"#,
        r#"{"us":1,"us":2,"them":3}"#,
        r#"{"us":"\ud800"}"#,
        r#"{"":1}"#,
        "{\"us\":1}trailing",
        &deep,
        &deep_object,
    ] {
        let answer = server.request("POST", &path, &headers, body);
        assert_eq!(answer.problem(400)["exit_code"], 2, "{body:.80}");
    }
    let bytes = [
        b"POST ",
        path.as_bytes(),
        b" HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\nauthorization: ",
        bearer.as_bytes(),
        b"\r\ncontent-type: application/json\r\ncontent-length: 4\r\n\r\n\xFF\xFE\x00\x01",
    ]
    .concat();
    server.raw(&bytes).problem(400);
    let large = format!("{{\"us\":\"{}\"}}", "x".repeat(2 << 20));
    server.request("POST", &path, &headers, &large).problem(413);
    for query in
        ["plc=x&offset=0&width=Word", "plc=0", "plc=0&offset=0&width=Word&more=1", "%", "plc=%FF", "=", "&&&"]
    {
        server.get(&server.path(&format!("peek?{query}"))).problem(400);
    }
    let many = format!("peek?{}", "plc=0&".repeat(10_000));
    let answer = server.get(&server.path(&many));
    assert!(matches!(answer.status, 0 | 400 | 414 | 431), "{}", answer.status);
    for what in [
        "operations?fault=x",
        "operations?poke=node2.w_CPU_CONTROL",
        "registers?name=%00",
        "map?plc=../x",
        "frames?bus=x",
        "frames?bus=drives&count=1000000",
        "find?text=",
        "plot.svg?name=x",
        "status?x=1",
    ] {
        let answer = server.get(&server.path(&format!("show/{what}")));
        assert!((200..500).contains(&answer.status), "{what}: {answer:?}");
    }
    let events: String = (0..300).map(|number| format!("node2.a_STAT_SL[{}],", number % 4)).collect();
    server.get(&server.path(&format!("events?follow={events}"))).problem(400);
    answers(&server);
    assert_eq!(server.get(&server.path("time")).ok(), json!({"time": 0}), "nothing has happened");
}

#[test]
fn requests_of_another_form_get_problems_that_name_what_is_wrong() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let (bearer, time) = (server.bearer(), server.path("time"));
    let token = [("authorization", bearer.as_str())];
    for method in ["PUT", "OPTIONS", "DELETE", "FOO"] {
        let answer = server.request(method, &time, &token, "");
        answer.problem(405);
        assert_eq!(answer.header("allow"), "GET", "{method}");
    }
    let head = server.request("HEAD", &time, &token, "");
    assert_eq!((head.status, head.body.as_str()), (200, ""));
    let unknown = server.get(&format!("{time}?x=1")).problem(400);
    assert_eq!(unknown["detail"], "time: it has no fields, so no `x`");
    let other = server.post(&server.path("advance"), &json!({"us": 1, "ms": 1})).problem(400);
    assert_eq!(other["detail"], "advance: it has no field `ms`, only `us`");
    let setting = server.post(&server.path("set_board"), &json!({"plc": 0, "setting": "reset"})).problem(400);
    assert!(
        setting["detail"].as_str().unwrap().contains("field `setting` is \"reset\", not an object"),
        "{setting}"
    );
    server.get("/api/v1/instances/%FF/time").problem(400);
    let json = [("authorization", bearer.as_str()), ("content-type", "application/json")];
    let twice = server.request("POST", &server.path("advance"), &json, r#"{"us":1,"us":2}"#).problem(400);
    assert!(twice["detail"].as_str().unwrap().contains("the field `us` occurs twice"), "{twice}");
    for query in [
        "peek?plc=0&offset=200000&width=Word&offset=200002",
        "show/find?text=a&text=b",
        "events?clock=1&clock=1",
        "events?follow=node2.w_CPU_CONTROL&follow=node2.w_OPTION_STATUS",
    ] {
        let twice = server.get(&server.path(query)).problem(400);
        assert!(twice["detail"].as_str().unwrap().contains("occurs twice"), "{twice}");
    }
    for query in ["events?clock=2", "events?findings=yes", "show/find?text=status&full=x"] {
        let wrong = server.get(&server.path(query)).problem(400);
        assert!(wrong["detail"].as_str().unwrap().contains("not 1 or 0"), "{wrong}");
    }
    let backwards = json!({"plant": "p.toml", "actions": [{"time_us": 9, "end_us": 0, "operation": {"advance": {"us": 1}}}]});
    let wrong = server.post(&server.path("scenario"), &backwards).problem(400);
    assert!(wrong["detail"].as_str().unwrap().contains("before its begin"), "{wrong}");
    let poke = |time_us: u64| {
        let fields = json!({"plc": 0, "offset": 200_000, "width": "Word", "value": 1});
        json!({"time_us": time_us, "operation": {"poke": fields}})
    };
    let far = json!({"plant": "p.toml", "actions": [poke(u64::MAX)]});
    let wrong = server.post(&server.path("scenario"), &far).problem(400);
    assert!(wrong["detail"].as_str().unwrap().contains("at most 86400000000 us"), "{wrong}");
    let earlier = json!({"plant": "p.toml", "actions": [poke(1000), poke(0)]});
    let scenario = server.post(&server.path("scenario"), &earlier).ok();
    assert!(
        scenario["scenario"].as_str().unwrap().contains("was recorded at 0 us, before the end"),
        "{scenario}"
    );
    let record = server.get(&server.path("events?journal=nope")).problem(400);
    assert!(record["detail"].as_str().unwrap().contains("no kind of record `nope`, only "), "{record}");
    let post = |rest: &str| {
        let path = server.path("advance");
        let head = format!(
            "POST {path} HTTP/1.1\r\nhost: localhost\r\nconnection: close\r\nauthorization: {bearer}\r\n\
             content-type: application/json\r\n{rest}"
        );
        server.raw(head.as_bytes())
    };
    post("content-length: 2000000\r\n\r\n").problem(413);
    post("transfer-encoding: chunked\r\n\r\n-8\r\n").problem(400);
    let sign_in = format!("{{\"token\": \"{}\"}}", "0".repeat(2000));
    server.request("POST", "/api/v1/session", &[("content-type", "application/json")], &sign_in).problem(413);
}

#[test]
fn an_operation_ends_with_the_connection_of_its_client() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let day = |us: u64| {
        let body = json!({ "us": us }).to_string();
        let mut stream = server.connect();
        let (path, length) = (server.path("advance"), body.len());
        let head = format!(
            "POST {path} HTTP/1.1\r\nhost: localhost\r\nauthorization: {}\r\n\
             content-type: application/json\r\ncontent-length: {length}\r\n\r\n{body}",
            server.bearer()
        );
        stream.write_all(head.as_bytes()).unwrap();
        stream
    };
    // Twenty operations of a day each. Their clients close the connections while the first one is in progress.
    let clients: Vec<_> = (0..20).map(|_| day(86_400_000_000)).collect();
    let begun = || server.get(&server.path("time")).ok()["time"].as_u64() > Some(0);
    assert!(crate::common::eventually(begun));
    drop(clients);
    let start = Instant::now();
    server.post(&server.path("advance"), &json!({"us": 1})).ok();
    assert!(start.elapsed() < SOON, "{:?}", start.elapsed());
}

/// Many clients send the head and the body of a request in two packets.
#[test]
fn a_refused_request_does_not_cost_the_next_one_on_its_connection() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let mut stream = server.connect();
    let head = |method: &str, path: &str, kind: &str, length: usize| {
        format!(
            "{method} {path} HTTP/1.1\r\nhost: localhost\r\nauthorization: {}\r\ncontent-type: {kind}\r\n\
             content-length: {length}\r\n\r\n",
            server.bearer()
        )
    };
    let mut begin = [0; 4096];
    for (method, path, kind, status) in [
        ("POST", server.path("nonsense"), "application/json", "404"),
        ("PUT", server.path("advance"), "application/json", "405"),
        ("POST", server.path("advance"), "application/json", "400"),
    ] {
        stream.write_all(head(method, &path, kind, 8).as_bytes()).unwrap();
        stream.set_read_timeout(Some(Duration::from_millis(100))).unwrap();
        let early = stream.read(&mut begin).unwrap_or_default();
        assert_eq!(String::from_utf8_lossy(&begin[..early]), "", "an answer before the body has arrived");
        stream.set_read_timeout(Some(SOON)).unwrap();
        stream.write_all(b"{\"xx\":1}").unwrap();
        let length = stream.read(&mut begin).unwrap();
        let answer = String::from_utf8_lossy(&begin[..length]);
        assert!(answer.starts_with(&format!("HTTP/1.1 {status} ")), "{answer}");
        assert!(!answer.to_lowercase().contains("connection: close"), "{answer}");
    }
    stream.write_all(head("GET", &server.path("time"), "application/json", 0).as_bytes()).unwrap();
    let length = stream.read(&mut begin).unwrap();
    assert!(begin[..length].starts_with(b"HTTP/1.1 200 "), "{}", String::from_utf8_lossy(&begin[..length]));
    // A request that the server does not take at all: its body is not read, so the connection ends, and the client
    // learns it.
    stream.write_all(head("POST", &server.path("advance"), "text/plain", 8).as_bytes()).unwrap();
    let length = stream.read(&mut begin).unwrap();
    let answer = String::from_utf8_lossy(&begin[..length]);
    assert!(answer.starts_with("HTTP/1.1 415 ") && answer.contains("connection: close"), "{answer}");
}

/// A proxy that divides requests by Content-Length must not get an answer to a request within the body.
#[test]
fn a_request_with_a_transfer_encoding_is_the_last_one_on_its_connection() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let head = |path: &str, lengths: &str| {
        format!(
            "POST {path} HTTP/1.1\r\nhost: localhost\r\nauthorization: {}\r\n\
             content-type: application/json\r\n{lengths}\r\n",
            server.bearer()
        )
    };
    let answers = |lengths: &str, body: &str| {
        let path = server.path("advance");
        let hidden = head(&path, "content-length: 8\r\n") + "{\"us\":1}";
        let mut stream = server.connect();
        stream.write_all((head(&path, lengths) + body + &hidden).as_bytes()).unwrap();
        let mut answers = String::new();
        // An error is ignored: the server closes the connection before it has read all bytes.
        let _ = stream.read_to_string(&mut answers);
        answers.split("HTTP/1.1 ").skip(1).map(|answer| answer[..3].to_owned()).collect::<Vec<_>>()
    };
    let chunk = "8\r\n{\"us\":1}\r\n0\r\n\r\n";
    for lengths in [
        "transfer-encoding: chunked\r\n",
        "content-length: 4\r\ntransfer-encoding: chunked\r\n",
        "transfer-encoding: chunked\r\ncontent-length: 4\r\n",
    ] {
        assert_eq!(answers(lengths, chunk), ["200"], "{lengths}");
    }
    assert_eq!(answers("content-length: 8\r\ncontent-length: 9\r\n", "{\"us\":1}"), ["400"]);
}

#[test]
fn a_connection_without_room_is_refused_with_a_problem() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let head = format!(
        "GET {} HTTP/1.1\r\nhost: localhost\r\nauthorization: {}\r\n\r\n",
        server.path("time"),
        server.bearer()
    );
    let mut open = Vec::new();
    for _ in 0..256 {
        let mut stream = server.connect();
        stream.write_all(head.as_bytes()).unwrap();
        // The test waits until the connection has shown its token before it opens the next one.
        stream.read_exact(&mut [0; 12]).unwrap();
        open.push(stream);
    }
    let refused = server.get(&server.path("time")).problem(503);
    assert!(refused["detail"].as_str().unwrap().starts_with("all connections"), "{refused}");
    drop(open.pop());
    assert!(crate::common::eventually(|| server.get(&server.path("time")).status == 200));
}

#[test]
fn few_descriptors_leave_room_for_the_connection_to_the_emulator() {
    let emulator = Emulator::stepped();
    let limited = Server::with_files(&emulator, "-HS", 100);
    let idle: Vec<_> = (0..100).map(|_| limited.connect()).collect();
    answers(&limited);
    drop(idle);
}

#[test]
fn paths_lead_nowhere_else() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    for path in [
        "/../../../../etc/passwd",
        "/..%2f..%2fetc/passwd",
        "/%2e%2e/%2e%2e/etc/passwd",
        "//etc/passwd",
        "/./index.html",
        "/assets/app.js",
        "/index.html/",
        "/index.html%00",
        "/src/cli/web.rs",
        "/proc/self/environ",
        "/%",
    ] {
        let answer = server.get(path);
        assert!(matches!(answer.status, 400 | 404), "{path}: {answer:?}");
    }
    for path in [
        "/api/v1/instances/../info",
        "/api/v1/instances/..%2f..%2f/info",
        "/api/v1/instances//info",
        "/api/v1/instances/other/info",
        "/api/v2/instances",
        "/api/v1/instances/x/y/z",
        &format!("/api/v1/instances/{}%2e%2e/info", server.instance),
        &server.path("nothing"),
        &server.path("show/nothing"),
        &server.path("show/../info"),
    ] {
        server.get(path).problem(404);
    }
    for bytes in
        [&b"\x16\x03\x01\x02\x00"[..], b"GET\r\n\r\n", b"GET / HTTP/9.9\r\n\r\n", b"\r\n\r\n\r\n", &[0; 5000]]
    {
        let answer = server.raw(bytes);
        assert!(matches!(answer.status, 0 | 400 | 505), "{answer:?}");
    }
    // HTTP/2 begins with a request that no version of HTTP/1 has, and with a frame of settings.
    let http2 = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0\0\x04\0\0\0\0\0";
    assert_eq!(server.raw(http2).status, 400);
    assert_eq!(server.raw(&http2[..24]).status, 400);
    let headers: String = (0..1000).map(|number| format!("x-{number}: y\r\n")).collect();
    let answer = server.raw(format!("GET / HTTP/1.1\r\nhost: localhost\r\n{headers}\r\n").as_bytes());
    assert!(matches!(answer.status, 0 | 431), "{answer:?}");
    server.raw(b"GET / HTTP/1.1\r\nconnection: close\r\n\r\n").problem(400);
    server.raw(b"GET / HTTP/1.1\r\nhost: localhost\r\nhost: evil\r\nconnection: close\r\n\r\n").problem(400);
    answers(&server);
}

/// Another program removes a part of the channel. The server gets SIGBUS when it accesses the missing part.
#[test]
fn a_shortened_channel_of_one_instance_ends_no_other() {
    let emulators = [Emulator::stepped(), Emulator::stepped()];
    let mut server = Server::start(&emulators[0].name, &["--all"]);
    let path = |of: usize, rest: &str| format!("/api/v1/instances/{}/{rest}", emulators[of].name);
    for of in [0, 1] {
        server.get(&path(of, "time")).ok();
        server.post(&path(of, "advance"), &json!({"us": 1})).ok();
    }
    let prefix =
        std::fs::read_to_string(format!("/dev/shm/commram.{}.iox.d/prefix", emulators[0].name)).unwrap();
    for entry in std::fs::read_dir("/dev/shm").unwrap().flatten() {
        if entry.file_name().to_string_lossy().starts_with(prefix.trim_end()) {
            std::fs::File::options().write(true).open(entry.path()).unwrap().set_len(0).unwrap();
        }
    }
    for _ in 0..20 {
        let lost = server.get(&path(0, "time")).problem(503);
        let detail = lost["detail"].as_str().unwrap();
        assert!(detail.contains("the channel is damaged") || detail.contains("no channel"), "{lost}");
        assert_eq!(server.post(&path(0, "advance"), &json!({"us": 1})).status, 503);
        server.get(&path(1, "time")).ok();
        server.post(&path(1, "advance"), &json!({"us": 1})).ok();
    }
    // The server also serves the next emulator with the name of the killed one.
    emulators[0].run("stop", &[]).ok();
    let again = Emulator::start_with(&emulators[0].name, &["--clock", "stepped"], &[]);
    assert!(crate::common::eventually(|| server.get(&path(0, "time")).status == 200));
    drop(again);
    rustix::process::kill_process(
        rustix::process::Pid::from_child(&server.child),
        rustix::process::Signal::TERM,
    )
    .unwrap();
    assert_eq!(server.wait().code(), Some(130));
    assert!(std::fs::read_dir(server.runtime()).unwrap().next().is_none());
}

/// The soft limit of open files is low for the sake of programs that use `select`. The server raises it.
#[test]
fn a_server_raises_its_soft_limit_of_open_files() {
    let emulator = Emulator::stepped();
    let server = Server::with_files(&emulator, "-S", 80);
    let idle: Vec<_> = (0..100).map(|_| server.connect()).collect();
    answers(&server);
    let limits = std::fs::read_to_string(format!("/proc/{}/limits", server.child.id())).unwrap();
    let files = limits.lines().find(|line| line.starts_with("Max open files")).unwrap();
    let soft: u64 = files.split_ascii_whitespace().nth(3).unwrap().parse().unwrap();
    assert!(soft > 80, "{files}");
    drop(idle);
}
