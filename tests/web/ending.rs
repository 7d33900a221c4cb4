//! The end of a server: by signals, by the end of its emulator, beside an emulator.

use crate::common::{Emulator, commram, eventually, finish, unique_name};
use crate::server::Server;
use serde_json::json;
use std::io::{BufRead, BufReader, Lines, Read};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};

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
    server.get(&server.path("time")).ok();
    server.post(&server.path("advance"), &json!({"us": 1})).ok();
    let channel = format!("/dev/shm/commram.{}.iox.d", emulator.name);
    let prefix = std::fs::read_to_string(format!("{channel}/prefix")).unwrap();
    emulator.run("stop", &[]);
    events.until("ended", |_| true);
    assert_eq!(server.wait().code(), Some(0));
    assert_eq!(std::fs::read_dir(server.runtime()).unwrap().count(), 0);
    // The server may still be in the channel when the emulator ends.
    let left = || {
        let entries = std::fs::read_dir("/dev/shm").unwrap().map(|entry| entry.unwrap().file_name());
        let mut names = entries.map(|name| name.to_string_lossy().into_owned());
        names.find(|name| name.contains(prefix.trim()) || channel.ends_with(name.as_str()))
    };
    assert!(eventually(|| left().is_none()), "{:?} remains", left());
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

/// A name may never be used again, so the server notices the end of an instance without a request for it.
#[test]
fn a_server_of_all_instances_keeps_nothing_of_ended_ones() {
    let server = Server::start("none", &["--all"]);
    let process = PathBuf::from(format!("/proc/{}", server.child.id()));
    let links_of_threads = || {
        let threads = std::fs::read_dir(process.join("task")).unwrap().map(Result::unwrap);
        let name = |thread: std::fs::DirEntry| std::fs::read_to_string(thread.path().join("comm"));
        threads.filter_map(|thread| name(thread).ok()).filter(|name| name.trim() == "web-link").count()
    };
    let shared_files = || {
        let files = std::fs::read_dir(process.join("fd")).unwrap().map(Result::unwrap);
        files
            .filter(|file| std::fs::read_link(file.path()).is_ok_and(|to| to.starts_with("/dev/shm")))
            .count()
    };
    let emulators: [_; 3] = std::array::from_fn(|_| Emulator::stepped());
    for emulator in &emulators {
        server.get(&format!("/api/v1/instances/{}/time", emulator.name)).ok();
        server.post(&format!("/api/v1/instances/{}/advance", emulator.name), &json!({"us": 1})).ok();
    }
    assert!(links_of_threads() >= 6 && shared_files() > 0);
    for emulator in &emulators {
        emulator.run("stop", &[]).ok();
    }
    let state = || (links_of_threads(), shared_files());
    assert!(eventually(|| state() == (0, 0)), "{:?}", state());
}

/// The device folder of an instance is edited before its next start.
#[test]
fn a_server_of_all_instances_knows_the_present_faults_of_a_device_folder() {
    let (server, name, folder) =
        (Server::start("none", &["--all"]), unique_name(), tempfile::tempdir().unwrap());
    let example = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/devices/mailbox");
    let card = folder.path().join("card");
    std::fs::create_dir(&card).unwrap();
    for entry in std::fs::read_dir(example).unwrap().map(Result::unwrap) {
        if entry.file_type().unwrap().is_file() {
            std::fs::copy(entry.path(), card.join(entry.file_name())).unwrap();
        }
    }
    let plant = folder.path().join("plant.toml");
    std::fs::write(&plant, "[[device]]\nname = 'box'\nkind = './card'\n").unwrap();
    let mut before = "function";
    for field in ["function", "number"] {
        for file in ["handshakes.toml", "firmware.rhai"] {
            let path = card.join(file);
            let text = std::fs::read_to_string(&path).unwrap();
            let text = text.replace(&format!("\"{before}\""), &format!("\"{field}\""));
            let text = text.replace(&format!("fields.{before}"), &format!("fields.{field}"));
            std::fs::write(&path, text).unwrap();
        }
        before = field;
        let emulator = Emulator::start_as(&name, &[plant.to_str().unwrap(), "--clock", "stepped"]);
        let path = |rest: &str| format!("/api/v1/instances/{name}/{rest}");
        let words = format!("show/operations?fault=lost_answer%20{field}%3D2");
        let operation = server.get(&path(&words)).ok()["operations"][0].clone();
        server.post(&path("request"), &json!({ "operations": [operation] })).ok();
        let listed = emulator.run("fault", &["list"]);
        assert!(listed.ok().contains(&format!("lost_answer plc=box {field}=2")), "{}", listed.out);
        if field == "number" {
            server.get(&path("show/operations?fault=lost_answer%20function%3D2")).problem(400);
        }
        emulator.run("stop", &[]).ok();
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

fn signal(name: &str, pid: u32) {
    assert!(Command::new("kill").args([name, &pid.to_string()]).status().unwrap().success());
}

/// Starts a stepped emulator with a server, and waits until both are ready. Returns name, process and further lines.
fn emulator_with_server(runtime: &Path) -> (String, Child, Lines<BufReader<ChildStdout>>) {
    let (name, child, mut lines) = emulator_with_address(runtime);
    assert!(lines.next().unwrap().is_ok());
    (name, child, lines)
}

/// Does the same, but leaves the line with the address of the server unread.
fn emulator_with_address(runtime: &Path) -> (String, Child, Lines<BufReader<ChildStdout>>) {
    let name = unique_name();
    let mut command = commram();
    command.args(["run", "--clock", "stepped", "-i", &name, "--web=127.0.0.1:0"]);
    command.env("XDG_RUNTIME_DIR", runtime).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    assert!(lines.next().unwrap().is_ok());
    (name, child, lines)
}

/// Returns the only child of a process.
fn child_of(pid: u32) -> u32 {
    let children = std::fs::read_dir(format!("/proc/{pid}/task")).unwrap().find_map(|task| {
        let children = std::fs::read_to_string(task.unwrap().path().join("children")).unwrap();
        children.split_whitespace().next().map(str::to_owned)
    });
    children.unwrap().parse().unwrap()
}

#[test]
fn several_signals_at_once_leave_no_file() {
    let emulator = Emulator::stepped();
    for names in [["-TERM", "-TERM"], ["-INT", "-INT"], ["-TERM", "-HUP"]] {
        let mut server = Server::of(&emulator, &[]);
        names.iter().for_each(|name| signal(name, server.child.id()));
        assert_eq!(server.wait().code(), Some(130), "{names:?}");
        assert_eq!(std::fs::read_dir(server.runtime()).unwrap().count(), 0, "{names:?}");
    }
}

#[test]
fn files_of_killed_servers_are_removed_by_the_next_one_and_by_stop_clean() {
    let emulator = Emulator::stepped();
    let mut killed = Server::of(&emulator, &[]);
    killed.child.kill().unwrap();
    killed.wait();
    let file = killed.token_file();
    let clean = || {
        finish(
            commram()
                .args(["stop", "--clean", "-i", "no-such-instance"])
                .env("XDG_RUNTIME_DIR", killed.runtime()),
        )
    };
    let living = |name: &str| killed.runtime_directory().join(name);
    // The file of a living server stays.
    let held = std::fs::File::create(living("held-1")).unwrap();
    std::fs::write(living("held-1"), "0\n").unwrap();
    held.lock().unwrap();
    clean();
    assert!(!file.exists() && living("held-1").exists());
    drop(held);
    clean();
    assert_eq!(std::fs::read_dir(killed.runtime()).unwrap().count(), 0);
}

/// A service manager starts the server again with the same options.
#[test]
fn a_named_file_of_a_killed_server_is_replaced_by_the_next_one() {
    let emulator = Emulator::stepped();
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("token");
    let options = ["--token-file", path.to_str().unwrap()];
    let mut killed = Server::of(&emulator, &options);
    killed.child.kill().unwrap();
    killed.wait();
    let next = Server::of(&emulator, &options);
    assert_eq!(std::fs::read_to_string(&path).unwrap().trim(), next.token);
    next.get("/api/v1/instances").ok();
    drop(next);
    std::fs::write(&path, "my notes\n").unwrap();
    let refused = finish(emulator.command("web", &["--listen", "127.0.0.1:0"]).args(options));
    assert!(refused.fails(3).contains("it is not the token of a server that has ended"), "{}", refused.err);
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "my notes\n");
}

#[test]
fn a_stopped_server_does_not_hold_up_the_end_of_its_emulator() {
    let runtime = tempfile::tempdir().unwrap();
    let (name, mut child, _lines) = emulator_with_server(runtime.path());
    signal("-STOP", child_of(child.id()));
    assert_eq!(finish(commram().args(["stop", "-i", &name])).code, Some(0));
    assert_eq!(child.wait().unwrap().code(), Some(0));
    assert_eq!(std::fs::read_dir(runtime.path()).unwrap().count(), 0);
}

#[test]
fn an_emulator_reports_the_end_of_its_server_and_goes_on() {
    let runtime = tempfile::tempdir().unwrap();
    let (name, mut child, _lines) = emulator_with_server(runtime.path());
    let mut notes = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    signal("-KILL", child_of(child.id()));
    assert!(notes.any(|note| note.contains("`commram web` has ended (signal: 9")), "the note is missing");
    assert_eq!(finish(commram().args(["step", "1us", "-i", &name])).code, Some(0));
    assert_eq!(finish(commram().args(["stop", "-i", &name])).code, Some(0));
    assert_eq!(child.wait().unwrap().code(), Some(0));
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
        assert!(message.contains("`--web=127.0.0.1:0` selects a free port"), "{message}");
        assert!(crate::common::files_of(&name).is_empty());
    }
}

/// Returns the command that starts an emulator with a server.
fn with_server(name: &str, web: &str) -> Command {
    let mut command = commram();
    command.args(["run", "--clock", "stepped", "--detach", "-i", name, web]);
    command
}

/// The server of a killed emulator ends a moment later; if it is suspended, only when the next emulator continues it. If
/// the parent of the orphaned server is in another session, the kernel continues the server. So the suspended server gets a
/// parent in its session: the shell, as the first process of a namespace.
#[test]
fn the_next_emulator_waits_for_the_server_of_a_killed_one() {
    let runtime = tempfile::tempdir().unwrap();
    let (name, mut child, mut lines) = emulator_with_address(runtime.path());
    let line = lines.next().unwrap().unwrap();
    let address = line.split_once("http://").unwrap().1.split_once("/#").unwrap().0.to_owned();
    let server = child_of(child.id());
    child.kill().unwrap();
    child.wait().unwrap();
    let web = format!("--web={address}");
    let outcome = finish(with_server(&name, &web).env("XDG_RUNTIME_DIR", runtime.path()));
    let page = format!("http://{address}/#token=");
    assert!(outcome.code == Some(0) && outcome.out.contains(&page), "{outcome:?}");
    let has_ended = || !Path::new(&format!("/proc/{server}/exe")).exists();
    assert!(eventually(has_ended), "the server of the killed emulator remains");
    assert_eq!(finish(commram().args(["stop", "-i", &name])).code, Some(0));
    assert!(eventually(|| std::fs::read_dir(runtime.path()).unwrap().count() == 0));

    let script = "out=$XDG_RUNTIME_DIR/out
        has_stopped() { grep -q '^State:.T' /proc/$server/status; }
        until_true() { n=0; until \"$@\"; do n=$((n + 1)); [ $n -lt 200 ] || exit 99; sleep 0.05; done; }
        $COMMRAM run --clock stepped --web=127.0.0.1:0 >$out 2>&1 & emulator=$!
        until_true grep -q '/#token=' $out
        address=$(sed -n 's|.*http://\\(.*\\)/#token.*|\\1|p' $out)
        set -- $(cat /proc/$emulator/task/*/children); server=$1
        kill -STOP $server
        until_true has_stopped
        kill -KILL $emulator
        wait $emulator
        has_stopped || exit 98
        $COMMRAM run --clock stepped --detach --web=$address; code=$?
        $COMMRAM stop
        $COMMRAM stop --clean
        rm $out
        exit $code";
    let mut shell = Command::new("unshare");
    shell.args(["--pid", "--fork", "--kill-child", "--mount-proc", "sh", "-c", script]);
    shell.env("COMMRAM", commram().get_program()).env("COMMRAM_INSTANCE", unique_name());
    let outcome = finish(shell.env("COMMRAM_CONFIG", "").env("XDG_RUNTIME_DIR", runtime.path()));
    if outcome.err.contains("unshare: ") {
        eprintln!("SKIPPED: no PID namespace: {}", outcome.err);
        return;
    }
    assert!(outcome.code == Some(0) && outcome.out.contains("/#token="), "{outcome:?}");
}

/// A suspended server that the user has started keeps the port, and gets no signal.
#[test]
fn the_next_emulator_signals_no_server_that_an_emulator_has_not_started() {
    let runtime = tempfile::tempdir().unwrap();
    let name = unique_name();
    let emulator = Emulator::start_as(&name, &["--clock", "stepped"]);
    let mut command = emulator.command("web", &["--listen", "127.0.0.1:0"]);
    command.env("XDG_RUNTIME_DIR", runtime.path()).stdout(Stdio::piped()).stderr(Stdio::null());
    let mut server = command.spawn().unwrap();
    let mut line = String::new();
    BufReader::new(server.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let address = line.split_once("http://").unwrap().1.split_once("/#").unwrap().0.to_owned();
    signal("-STOP", server.id());
    drop(emulator);
    let web = format!("--web={address}");
    let outcome = finish(with_server(&name, &web).env("XDG_RUNTIME_DIR", runtime.path()));
    assert!(outcome.fails(3).contains("cannot listen at"), "{outcome:?}");
    let state = std::fs::read_to_string(format!("/proc/{}/stat", server.id())).unwrap();
    assert_eq!(state.rsplit(") ").next().unwrap().chars().next(), Some('T'), "{state}");
    server.kill().unwrap();
    server.wait().unwrap();
}
