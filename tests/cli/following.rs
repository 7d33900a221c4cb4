//! The end of commands that follow an instance: after the end of the emulator, and if their output is not read or their
//! terminal is closed.

use crate::common::{Emulator, Follower, commram, eventually, files_of, finish, unique_name, wait_for};
use crate::scenarios::Scripts;
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use std::fs::File;
use std::io::{BufRead, BufReader, PipeReader, PipeWriter, Read, Write};
use std::os::fd::OwnedFd;
use std::process::{Child, Command, Stdio};

/// Creates a pipe without room.
pub(crate) fn full_pipe() -> (PipeReader, PipeWriter) {
    let (reader, mut writer) = std::io::pipe().unwrap();
    let flags = fcntl_getfl(&writer).unwrap();
    fcntl_setfl(&writer, flags | OFlags::NONBLOCK).unwrap();
    while writer.write(&[0; 4096]).is_ok() {}
    fcntl_setfl(&writer, flags).unwrap();
    (reader, writer)
}

/// Creates a terminal; returns its two ends.
fn terminal() -> (OwnedFd, File) {
    let controller = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC).unwrap();
    grantpt(&controller).unwrap();
    unlockpt(&controller).unwrap();
    let name = ptsname(&controller, Vec::new()).unwrap();
    (controller, File::options().read(true).write(true).open(name.to_str().unwrap()).unwrap())
}

/// Waits for the first message of a command that watches, and keeps the message stream open.
fn watching(child: &mut Child) -> impl BufRead + use<> {
    let mut notes = BufReader::new(child.stderr.take().unwrap());
    let mut note = String::new();
    assert!(notes.read_line(&mut note).unwrap() > 0 && note.contains("watching"), "{note}");
    notes
}

/// True if a thread of the process waits in a system call with one of the outputs as first argument.
pub(crate) fn is_blocked_by_output(child: &Child) -> bool {
    let threads = std::fs::read_dir(format!("/proc/{}/task", child.id())).unwrap();
    let calls =
        threads.filter_map(|thread| std::fs::read_to_string(thread.ok()?.path().join("syscall")).ok());
    let mut outputs = calls.map(|call| matches!(call.split_ascii_whitespace().nth(1), Some("0x1" | "0x2")));
    outputs.any(|is_output| is_output)
}

pub(crate) fn signal(child: &Child, signal: &str) {
    assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
}

#[test]
fn the_first_signal_ends_a_command_whose_output_is_not_read() {
    for number in ["-INT", "-TERM", "-HUP"] {
        let emulator = Emulator::stepped();
        emulator.poke(&["node2.w_CPU_CONTROL=1"]);
        let watch = &["node2.w_OPTION_STATUS"][..];
        for (subcommand, args) in [("watch", watch), ("trace", &["--follow"])] {
            let (_reader, writer) = full_pipe();
            let mut child =
                emulator.command(subcommand, args).stdout(writer).stderr(Stdio::piped()).spawn().unwrap();
            let _notes = (subcommand == "watch").then(|| watching(&mut child));
            emulator.step(&["1ms"]);
            assert!(eventually(|| is_blocked_by_output(&child)), "{subcommand} writes");
            signal(&child, number);
            assert_eq!(wait_for(&mut child, subcommand).code(), Some(130), "{subcommand} {number}");
        }
    }
}

/// An emulator that does not answer keeps a client for 10 s.
#[test]
fn the_first_signal_ends_a_command_whose_emulator_does_not_answer() {
    let emulator = Emulator::stepped();
    let mut child = emulator
        .command("watch", &["node2.w_OPTION_STATUS"])
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let _notes = watching(&mut child);
    emulator.signal("-STOP");
    // The command sends twenty requests per second. So one of its requests is probably in progress when the signal
    // arrives.
    std::thread::sleep(std::time::Duration::from_millis(200));
    signal(&child, "-INT");
    let start = std::time::Instant::now();
    let code = wait_for(&mut child, "watch").code();
    emulator.signal("-CONT");
    assert_eq!(code, Some(130));
    assert!(start.elapsed() < std::time::Duration::from_secs(8), "{:?}", start.elapsed());
}

#[test]
fn a_closed_terminal_ends_a_command_like_a_signal() {
    let scripts = Scripts::new(&[("good.rhai", "step(\"1ms\");")]);
    let emulator = Emulator::stepped();
    emulator.poke(&["node2.w_CPU_CONTROL=1"]);
    let mut test = commram();
    test.args(["test", "--watch"]).arg(scripts.0.path());
    for mut command in [
        emulator.command("watch", &["node2.w_OPTION_STATUS"]),
        emulator.command("trace", &["--follow"]),
        test,
    ] {
        // Without a step the command only waits when its terminal closes; with a step it may be writing.
        for is_writing in [false, true] {
            let (controller, place) = terminal();
            let mut child = command
                .stdout(place.try_clone().unwrap())
                .stderr(place.try_clone().unwrap())
                .spawn()
                .unwrap();
            command.stdout(Stdio::null()).stderr(Stdio::null());
            drop(place);
            let mut shown = BufReader::new(File::from(controller));
            // This line is the note of `watch` and `test --watch`, or the first record.
            assert!(shown.read_line(&mut String::new()).unwrap() > 0);
            if is_writing {
                emulator.step(&["1ms"]);
            }
            drop(shown);
            // The terminal is not the controlling terminal of the command, so the kernel sends no signal.
            assert_eq!(wait_for(&mut child, "a command").code(), Some(130), "{command:?} {is_writing}");
        }
    }
}

/// Number of rounds of a test that would often pass by chance.
const ROUNDS: u32 = 6;
const VALUES: [&str; 8] = ["1", "2", "3", "4", "5", "6", "7", "8"];

/// Writes the values into a register, each by one command.
fn write_values(emulator: &Emulator) {
    VALUES.iter().for_each(|value| emulator.poke(&[&format!("node2.b_AC={value}")]));
}

/// Checks the output of a follower whose emulator has ended: all values, and no note about missing ones.
#[track_caller]
fn assert_complete(follower: Follower, what: &str) {
    let (code, lines, err) = follower.end();
    let written = lines.iter().filter(|line| line.contains("node2.b_AC")).count();
    assert_eq!((code, written), (Some(0), VALUES.len()), "{what}: {lines:?} {err}");
    assert!(err.contains("is ending") && !err.contains("may be missing"), "{what}: {err}");
}

#[test]
fn a_command_that_follows_reads_everything_before_the_end_of_the_emulator() {
    for round in 0..ROUNDS {
        for clock in ["stepped", "realtime"] {
            let mut emulator = Emulator::start(&["--clock", clock]);
            emulator.poke(&["node1.b_AC=1"]);
            let mut trace = Follower::start(&emulator, "trace", &["--follow", "--format", "jsonl"]);
            trace.line();
            let mut watch = Follower::start(&emulator, "watch", &["node2.b_AC", "--format", "jsonl"]);
            assert!(watch.note().contains("watching"));
            write_values(&emulator);
            if round % 2 == 0 {
                emulator.run("stop", &[]).ok();
            } else {
                emulator.signal("-TERM");
            }
            assert_eq!(emulator.wait().code(), Some(0));
            assert_complete(trace, "trace");
            assert_complete(watch, "watch");
        }
    }
}

#[test]
fn a_command_that_follows_reads_everything_before_the_end_of_a_command_or_parent() {
    const WRITES: &str = "for value in 1 2 3 4 5 6 7 8; do $COMMRAM poke -i $NAME node2.b_AC=$value; done";
    const FOLLOWS: &str = "$COMMRAM poke -i $NAME node1.b_AC=1; $COMMRAM trace --follow --format jsonl -i $NAME >$OUT & trace=$!
        until grep -qs seq $OUT; do sleep 0.01; done";
    let name = unique_name();
    let with_command = format!(
        "mkfifo $OUT.go; $COMMRAM with --clock stepped -i $NAME -- sh -c 'read go <$OUT.go; {WRITES}' & with=$!
        until $COMMRAM status -i $NAME >/dev/null 2>&1; do sleep 0.01; done
        {FOLLOWS}; echo go >$OUT.go; wait $with; wait $trace; rm $OUT.go"
    );
    let with_parent = format!(
        "sh -c '$COMMRAM run --parent $$ -i $NAME --clock stepped; :' >/dev/null & parent=$!
        until $COMMRAM status -i $NAME >/dev/null 2>&1; do sleep 0.01; done
        {FOLLOWS}; {WRITES}; kill -KILL $parent; wait $trace"
    );
    for _ in 0..ROUNDS / 2 {
        for script in [&with_command, &with_parent] {
            let place = tempfile::tempdir().unwrap();
            let out = place.path().join("out");
            let mut shell = Command::new("sh");
            shell.args(["-c", script]).env("COMMRAM", commram().get_program());
            let outcome = finish(shell.env("NAME", &name).env("OUT", &out));
            let lines = std::fs::read_to_string(&out).unwrap();
            assert_eq!(lines.matches("node2.b_AC").count(), VALUES.len(), "{outcome:?} {lines}");
            assert!(!outcome.err.contains("may be missing"), "{}", outcome.err);
        }
    }
}

/// Starts `trace --follow` with an output that is not read, and writes more records than the output takes.
fn blocked_trace(emulator: &Emulator) -> (PipeReader, Child) {
    let (reader, writer) = full_pipe();
    let mut command = emulator.command("trace", &["--follow", "--format", "jsonl"]);
    let child = command.stdout(writer).stderr(Stdio::piped()).spawn().unwrap();
    emulator.poke(&vec!["node2.b_AC=1"; 200]);
    assert!(eventually(|| is_blocked_by_output(&child)));
    emulator.poke(&vec!["node2.b_AC=2"; 200]);
    (reader, child)
}

#[test]
fn a_command_that_is_late_reports_that_the_end_may_be_missing() {
    let mut emulator = Emulator::stepped();
    let (mut reader, mut child) = blocked_trace(&emulator);
    emulator.run("stop", &[]).ok();
    assert_eq!(emulator.wait().code(), Some(0));
    let mut out = Vec::new();
    reader.read_to_end(&mut out).unwrap();
    assert_eq!(wait_for(&mut child, "trace").code(), Some(0));
    assert_eq!(String::from_utf8_lossy(&out).matches("node2.b_AC").count(), 200);
    let mut err = String::new();
    child.stderr.take().unwrap().read_to_string(&mut err).unwrap();
    let note = format!("instance '{}' has ended; its last records may be missing", emulator.name);
    assert!(err.contains(&note), "{err}");
}

/// The emulator removes the files of its channel, although clients that are suspended or wait for their outputs have not left
/// it. However such a client ends then, no file remains.
#[test]
fn a_command_that_outlives_its_emulator_leaves_no_files() {
    for end in ["-TERM", "-INT", "-KILL"] {
        let mut emulator = Emulator::stepped();
        let (reader, mut child) = blocked_trace(&emulator);
        let mut watch = Follower::start(&emulator, "watch", &["node2.b_AC"]);
        assert!(watch.note().contains("watching"));
        signal(&watch.child, "-STOP");
        let prefix = format!("/dev/shm/commram.{}.iox.d/prefix", emulator.name);
        let prefix = std::fs::read_to_string(prefix).unwrap();
        emulator.run("stop", &[]).ok();
        assert_eq!(emulator.wait().code(), Some(0));
        for client in [&mut child, &mut watch.child] {
            signal(client, end);
            signal(client, "-CONT");
            wait_for(client, "a client");
        }
        drop(reader);
        let objects = std::fs::read_dir("/dev/shm").unwrap().map(|entry| entry.unwrap().path());
        let left = objects.filter(|path| path.to_string_lossy().contains(prefix.trim()));
        let left: Vec<_> = left.chain(files_of(&emulator.name)).collect();
        assert!(left.is_empty(), "{end}: {left:?}");
    }
}
