//! The end of a server: by signals, by the end of its emulator, beside an emulator.

use crate::common::{Emulator, commram, eventually, finish, unique_name};
use crate::server::Server;
use serde_json::json;
use std::io::{BufRead, BufReader, Read};
use std::net::TcpListener;
use std::process::{Command, Stdio};

#[test]
fn a_signal_ends_the_server_and_nothing_remains() {
    let emulator = Emulator::stepped();
    for signal in ["-INT", "-TERM", "-HUP"] {
        let mut server = Server::of(&emulator, &[]);
        let mut events = server.events("clock=1");
        events.until("clock", |_| true);
        assert!(server.token_file().exists());
        let pid = server.child.id().to_string();
        assert!(Command::new("kill").args([signal, &pid]).status().unwrap().success());
        assert_eq!(server.wait().code(), Some(130), "{signal}");
        assert_eq!(std::fs::read_dir(server.runtime()).unwrap().count(), 0, "{signal}");
        TcpListener::bind(server.address).expect("the port is free");
    }
    emulator.step(&["1us"]);
}

#[test]
fn the_server_ends_with_its_emulator_and_informs_its_readers() {
    let emulator = Emulator::stepped();
    let mut server = Server::of(&emulator, &[]);
    let mut events = server.events("clock=1");
    events.until("clock", |_| true);
    emulator.run("stop", &[]);
    events.until("ended", |_| true);
    assert_eq!(server.wait().code(), Some(0));
    assert_eq!(std::fs::read_dir(server.runtime()).unwrap().count(), 0);
    let emulator = Emulator::stepped();
    let mut server = Server::of(&emulator, &[]);
    assert_eq!(server.post(&server.path("stop"), &json!({})).ok(), json!("stopping"));
    assert_eq!(server.wait().code(), Some(0));
}

#[test]
fn a_server_of_all_instances_continues_without_them() {
    let server = Server::start("none", &["--all"]);
    server.get(&server.path("info")).problem(404);
    let name = unique_name();
    for _ in 0..2 {
        let emulator = Emulator::start_as(&name, &["--clock", "stepped"]);
        let path = format!("/api/v1/instances/{name}/time");
        assert_eq!(server.get(&path).ok(), json!({"time": 0}));
        let all = server.get("/api/v1/instances").ok();
        let names = all["instances"].as_array().unwrap().iter().map(|it| it["name"].as_str().unwrap());
        assert!(names.into_iter().any(|listed| listed == name), "{all}");
        emulator.run("stop", &[]);
        assert!(eventually(|| server.get(&path).status == 404));
    }
}

#[test]
fn a_server_beside_an_emulator_starts_and_ends_with_it() {
    let (name, runtime) = (unique_name(), tempfile::tempdir().unwrap());
    let mut command = commram();
    command.args(["run", "--clock", "stepped", "-i", &name, "--web=127.0.0.1:0"]);
    let mut child = command.env("XDG_RUNTIME_DIR", runtime.path()).stdout(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    assert!(lines.next().unwrap().unwrap().contains("ready"));
    let line = lines.next().unwrap().unwrap();
    assert!(line.contains("http://127.0.0.1:") && line.contains("/#token="), "{line}");
    assert_eq!(std::fs::read_dir(runtime.path().join("commram")).unwrap().count(), 1);
    assert_eq!(finish(commram().args(["stop", "-i", &name])).code, Some(0));
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert_eq!(std::fs::read_dir(runtime.path()).unwrap().count(), 0);
}

#[test]
fn an_emulator_does_not_start_without_its_server() {
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap();
    for detach in [&[][..], &["--detach"]] {
        let name = unique_name();
        let mut command = commram();
        command.args(["run", "--clock", "stepped", "-i", &name, &format!("--web={address}")]).args(detach);
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut message = String::new();
        child.stderr.take().unwrap().read_to_string(&mut message).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(3), "{message}");
        assert!(message.contains(&format!("cannot listen at {address}")), "{message}");
        assert!(crate::common::files_of(&name).is_empty());
    }
}
