//! Access: the token, the key of a session, hosts, origins, other users, a server that only reads.

use crate::common::{Emulator, finish, run};
use crate::server::Server;
use serde_json::json;
use std::os::unix::fs::MetadataExt;
use std::os::unix::process::CommandExt;
use std::process::Command;

/// User ID of another user.
const OTHER: u32 = 65_534;

#[test]
fn every_request_needs_the_token_and_the_files_of_the_page_do_not() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let json = ("content-type", "application/json");
    for (method, path) in [
        ("GET", "/api/v1/instances".to_owned()),
        ("GET", "/api/v1/openapi.json".to_owned()),
        ("GET", "/api/v1/session".to_owned()),
        ("DELETE", "/api/v1/session".to_owned()),
        ("GET", "/api/nothing".to_owned()),
        ("GET", server.path("info")),
        ("GET", server.path("events")),
        ("GET", server.path("show/status")),
        ("POST", server.path("advance")),
        ("POST", server.path("request")),
        ("POST", server.path("scenario")),
    ] {
        for authorization in ["", "Bearer ", "Bearer 0", &format!("Basic {}", server.token), &server.token] {
            let answer = server.request(method, &path, &[json, ("authorization", authorization)], "{}");
            answer.problem(401);
            assert_eq!(answer.header("www-authenticate"), "Bearer", "{path}");
        }
    }
    let page = server.request("GET", "/", &[], "");
    assert_eq!((page.status, page.header("content-type")), (200, "text/html; charset=utf-8"));
    assert!(page.header("content-security-policy").contains("default-src 'none'"), "{page:?}");
    assert!(page.header("content-security-policy").contains("frame-ancestors 'none'"), "{page:?}");
    assert_eq!(page.header("x-content-type-options"), "nosniff");
    assert_eq!(page.header("access-control-allow-origin"), "", "no other origin may read anything");
    let tag = page.header("etag").to_owned();
    assert_eq!(server.request("GET", "/", &[("if-none-match", &tag)], "").status, 304);
    server.get("/api/v1/instances").ok();
}

#[test]
fn the_token_is_only_in_the_address_and_in_a_private_file() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let file = server.token_file();
    assert_eq!(file.metadata().unwrap().mode() & 0o7777, 0o600);
    assert_eq!(server.runtime_directory().metadata().unwrap().mode() & 0o7777, 0o700);
    assert_eq!(std::fs::read_to_string(&file).unwrap(), format!("{}\n", server.token));
    assert!(server.token.len() == 64 && server.token.bytes().all(|digit| digit.is_ascii_hexdigit()));
    for part in ["cmdline", "environ", "comm"] {
        let bytes = std::fs::read(format!("/proc/{}/{part}", server.child.id())).unwrap();
        assert!(!String::from_utf8_lossy(&bytes).contains(&server.token), "{part}");
    }
    server.get(&server.path("info")).ok();
    let journal = emulator.run("trace", &["--format", "jsonl"]);
    assert!(!journal.ok().contains(&server.token));
    let other = Server::of(&emulator, &[]);
    assert_ne!(server.token, other.token, "each server has its own token");
    other.request("GET", "/api/v1/instances", &[("authorization", &server.bearer())], "").problem(401);
}

#[test]
fn another_user_can_connect_but_not_do_anything() {
    if !rustix::process::geteuid().is_root() {
        eprintln!("SKIPPED: only root can be another user");
        return;
    }
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let as_other = |script: String| {
        finish(Command::new("bash").args(["-c", &script]).current_dir("/").uid(OTHER).gid(OTHER))
    };
    assert_ne!(as_other(format!("cat {}", server.token_file().display())).code, Some(0));
    for path in ["info", "show/status"] {
        let path = server.path(path);
        let port = server.address.port();
        let request = format!("GET {path} HTTP/1.1\\r\\nhost: 127.0.0.1\\r\\nconnection: close\\r\\n\\r\\n");
        let script = format!("exec 3<>/dev/tcp/127.0.0.1/{port}; printf '{request}' >&3; cat <&3");
        let outcome = as_other(script);
        assert!(outcome.out.starts_with("HTTP/1.1 401"), "{}{}", outcome.out, outcome.err);
        assert!(!outcome.out.contains("time_us"), "{}", outcome.out);
    }
}

/// A browser sends cookies to all ports of a host, also to those of other users. So the page has no cookie.
#[test]
fn the_page_exchanges_the_token_for_a_key() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let json = ("content-type", "application/json");
    for token in ["", "0", &"0".repeat(64)] {
        let body = json!({ "token": token }).to_string();
        server.request("POST", "/api/v1/session", &[json], &body).problem(401);
    }
    let body = json!({ "token": server.token }).to_string();
    let answer = server.request("POST", "/api/v1/session", &[json], &body);
    assert_eq!(answer.header("set-cookie"), "");
    let key = answer.ok()["key"].as_str().unwrap().to_owned();
    assert!(key.len() == 64 && key != server.token);
    let bearer = format!("Bearer {key}");
    let signed_in = [("authorization", bearer.as_str()), json];
    server.request("GET", "/api/v1/session", &signed_in, "").ok();
    let advance = server.path("advance");
    assert_eq!(server.request("POST", &advance, &signed_in, r#"{"us":1}"#).ok(), json!({"time": 1}));
    for cookie in [format!("key={key}"), format!("commram-{}={key}", emulator.name)] {
        server.request("GET", "/api/v1/session", &[("cookie", &cookie)], "").problem(401);
    }
    let other = Server::of(&emulator, &[]);
    other.request("GET", "/api/v1/session", &signed_in, "").problem(401);
    assert_eq!(server.request("DELETE", "/api/v1/session", &signed_in, "").status, 204);
    server.request("GET", "/api/v1/session", &signed_in, "").problem(401);
}

#[test]
fn signing_out_ends_the_event_streams_of_the_key() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let [key, other] = [(); 2].map(|()| server.sign_in());
    let [mut of_key, mut of_other] = [&key, &other].map(|key| server.events_of_key(key, "clock=1"));
    let mut of_token = server.events("clock=1");
    for stream in [&mut of_key, &mut of_other, &mut of_token] {
        stream.until("clock", |_| true);
    }
    let bearer = format!("Bearer {key}");
    assert_eq!(server.request("DELETE", "/api/v1/session", &[("authorization", &bearer)], "").status, 204);
    while of_key.next().is_some() {}
    emulator.step(&["5us"]);
    for stream in [&mut of_other, &mut of_token] {
        stream.until("clock", |clock| clock["time_us"] == 5);
    }
}

#[test]
fn signing_in_again_and_again_signs_out_no_page() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &[]);
    let [page, hidden, unused] = [(); 3].map(|()| server.sign_in());
    let mut stream = server.events_of_key(&page, "clock=1");
    stream.until("clock", |_| true);
    server.events_of_key(&hidden, "clock=1").until("clock", |_| true);
    for _ in 0..70 {
        server.sign_in();
    }
    let status = |key: &str| {
        server.request("GET", "/api/v1/session", &[("authorization", &format!("Bearer {key}"))], "").status
    };
    assert_eq!([&page, &hidden, &unused].map(|key| status(key)), [200, 200, 401]);
    emulator.step(&["5us"]);
    stream.until("clock", |clock| clock["time_us"] == 5);
}

#[test]
fn requests_of_other_sites_are_refused() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &["--origin", "https://plant.example"]);
    let bearer = server.bearer();
    let signed_in = ("authorization", bearer.as_str());
    for host in ["evil.example", "evil.example:80", "127.0.0.1.evil.example", "localhost.example"] {
        // The host name of another site may lead to this server (DNS rebinding). Under such a name, not even the page
        // is served.
        for path in ["/", "/api/v1/instances"] {
            server.request("GET", path, &[("host", host), signed_in], "").problem(421);
        }
    }
    for host in ["localhost", "127.0.0.1:1", "[::1]:8080", "plant.example"] {
        server.request("GET", "/api/v1/instances", &[("host", host), signed_in], "").ok();
    }
    // An absolute target names the host, too.
    let own = server.address.to_string();
    for host in ["evil.example", "127.0.0.1"] {
        let target = format!("http://{host}/api/v1/instances");
        server.request("GET", &target, &[("host", &own), signed_in], "").problem(421);
    }
    let target = format!("http://{own}/api/v1/instances");
    server.request("GET", &target, &[("host", &own), signed_in], "").ok();
    for foreign in
        ["https://evil.example", "null", "http://127.0.0.1:1", "https://plant.example.evil.example"]
    {
        let headers = [("origin", foreign), signed_in, ("content-type", "application/json")];
        server.request("POST", &server.path("advance"), &headers, r#"{"us":1}"#).problem(403);
    }
    server
        .request("GET", "/api/v1/instances", &[("sec-fetch-site", "cross-site"), signed_in], "")
        .problem(403);
    let own = format!("http://{}", server.address);
    for origin in [own.as_str(), "https://plant.example"] {
        server.request("GET", "/api/v1/instances", &[("origin", origin), signed_in], "").ok();
    }
    for content_type in ["text/plain", "application/x-www-form-urlencoded", "multipart/form-data"] {
        let headers = [signed_in, ("content-type", content_type)];
        server.request("POST", &server.path("advance"), &headers, r#"{"us":1}"#).problem(415);
    }
    assert_eq!(server.get(&server.path("time")).ok(), json!({"time": 0}), "nothing has happened");
}

#[test]
fn a_server_that_only_reads_refuses_every_other_operation() {
    let emulator = Emulator::stepped();
    let server = Server::of(&emulator, &["--read-only"]);
    let table: serde_json::Value =
        serde_json::from_str(include_str!("../../docs/reference/operations.json")).unwrap();
    let mut refused = 0;
    for operation in table["operations"].as_array().unwrap() {
        if operation["class"] == "looks" {
            continue;
        }
        let (name, fields) = crate::operations::sample(operation);
        let problem = server.post(&server.path(&name), &fields).problem(403);
        assert_eq!(problem["type"], "urn:commram:problem:read-only", "{name}");
        let one = if fields == json!({}) { json!(name) } else { json!({ name: fields }) };
        server.post(&server.path("request"), &json!({"operations": ["time", one]})).problem(403);
        refused += 1;
    }
    assert!(refused > 20, "{refused}");
    server.post(&server.path("request"), &json!({"operations": ["time", "info"]})).ok();
    assert_eq!(server.get("/api/v1/session").ok(), json!({"read_only": true}));
    assert_eq!(emulator.step(&["1us"]), "0.000001 s", "the emulator runs, and no time has passed");
}

#[test]
fn addresses_of_the_network_need_a_permission() {
    let emulator = Emulator::stepped();
    for address in ["0.0.0.0:0", "[::]:0"] {
        let message = emulator.run("web", &["--listen", address]).fails(2).to_owned();
        assert!(message.contains("--allow-network") && message.contains(address), "{message}");
    }
    let server = Server::of(&emulator, &["--allow-network"]);
    server.get("/api/v1/instances").ok();
    let address = server.address.to_string();
    let message = emulator.run("web", &["--listen", &address]).fails(3).to_owned();
    assert!(message.contains(&format!("cannot listen at {address}")), "{message}");
    assert!(run(&["web", "-i", "nothing-runs"]).fails(3).contains("is not running"));
}
