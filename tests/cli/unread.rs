//! Commands with unread outputs: the first signal ends them cleanly, and an emulator serves its clients.

use crate::common::{Emulator, commram, eventually, files_of, finish, promised, unique_name, wait_for};
use crate::following::{full_pipe, is_blocked_by_output, signal};
use crate::scenarios::Scripts;
use std::io::PipeReader;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

const NOTHING: Vec<PathBuf> = Vec::new();

/// Starts a command with unread outputs.
fn unread(command: &mut Command) -> (Child, PipeReader) {
    let (reader, writer) = full_pipe();
    let child = command.stdout(writer.try_clone().unwrap()).stderr(writer).spawn().unwrap();
    (child, reader)
}

/// The first signal ends a command that is writing.
#[track_caller]
fn ends_at_the_first_signal(child: &mut Child, what: &str, number: &str) {
    assert!(eventually(|| is_blocked_by_output(child)), "{what} writes");
    signal(child, number);
    let status = promised(Duration::from_secs(2), || wait_for(child, what));
    assert_eq!(status.code(), Some(130), "{what} {number}: {status}");
}

fn content(directory: &Path) -> Vec<PathBuf> {
    directory.read_dir().unwrap().map(|entry| entry.unwrap().path()).collect()
}

#[test]
fn an_unread_demonstration_ends_at_the_first_signal() {
    for number in ["-INT", "-TERM", "-HUP"] {
        let (mut child, _reader) = unread(commram().arg("demo"));
        ends_at_the_first_signal(&mut child, "demo", number);
        assert_eq!(files_of(&format!("demo-{}", child.id())), NOTHING);
    }
}

#[test]
fn unread_rounds_and_scenarios_end_at_the_first_signal() {
    let files = tempfile::tempdir().unwrap();
    // Without `--seed` the command prints the seed as a note. The command with one round ends soon and prints a table.
    for args in [&["--rounds", "100000"][..], &["--rounds", "1", "--seed", "1"]] {
        let mut soak = commram();
        soak.args(["soak", "--jobs", "1"]).args(args).current_dir(files.path()).env("TMPDIR", files.path());
        let (mut child, _reader) = unread(&mut soak);
        ends_at_the_first_signal(&mut child, "soak", "-INT");
        assert_eq!(content(files.path()), NOTHING);
    }
    let scripts = Scripts::new(&[("good.rhai", "step(\"1ms\"); expect_that(true, \"fine\");")]);
    for args in [&["--watch"][..], &[], &["--format", "json"]] {
        let (mut child, _reader) = unread(commram().arg("test").args(args).arg(scripts.0.path()));
        ends_at_the_first_signal(&mut child, "test", "-TERM");
    }
}

#[test]
fn an_unread_server_ends_at_the_first_signal() {
    let (emulator, files) = (Emulator::stepped(), tempfile::tempdir().unwrap());
    let token = files.path().join("token");
    let listen = ["--listen", "127.0.0.1:0", "--token-file", token.to_str().unwrap()];
    let (mut child, _reader) = unread(&mut emulator.command("web", &listen));
    ends_at_the_first_signal(&mut child, "web", "-INT");
    assert_eq!(content(files.path()), NOTHING);
}

/// No program reads the line that the emulator prints at its start.
#[test]
fn an_unread_emulator_serves_and_ends_in_good_order() {
    for (end, code) in [(Some("-INT"), 130), (Some("-TERM"), 0), (Some("-HUP"), 0), (None, 0)] {
        let name = unique_name();
        let (mut child, _reader) = unread(commram().args(["run", "-i", &name]));
        assert!(eventually(|| is_blocked_by_output(&child)), "it writes");
        let command = |subcommand| finish(commram().args([subcommand, "-i", &name]));
        assert!(command("status").ok().contains(&name));
        match end {
            Some(number) => signal(&child, number),
            None => assert_eq!(command("stop").ok(), format!("instance '{name}' has stopped\n")),
        }
        let status = promised(Duration::from_secs(2), || wait_for(&mut child, "an emulator"));
        assert_eq!((status.code(), files_of(&name)), (Some(code), NOTHING), "{end:?}: {status}");
    }
}

/// The emulator prints a note during its start, and its output is not read. So the start does not end, but the images
/// exist already.
#[test]
fn an_unread_start_ends_in_good_order() {
    let (name, files) = (unique_name(), tempfile::tempdir().unwrap());
    let novram = files.path().join("new");
    let (mut child, _reader) =
        unread(commram().args(["run", "-i", &name, "--novram", novram.to_str().unwrap()]));
    assert!(eventually(|| is_blocked_by_output(&child) && !files_of(&name).is_empty()), "it writes");
    signal(&child, "-TERM");
    let status = promised(Duration::from_secs(2), || wait_for(&mut child, "an emulator"));
    assert_eq!((status.code(), files_of(&name)), (Some(0), NOTHING), "{status}");
}

/// The emulator writes a warning because another program has shortened its channel. The output for this warning is not
/// read.
#[test]
fn an_unread_warning_delays_no_end() {
    for number in ["-INT", "-TERM"] {
        let name = unique_name();
        let (reader, writer) = full_pipe();
        let mut child =
            commram().args(["run", "-i", &name]).stdout(Stdio::null()).stderr(writer).spawn().unwrap();
        let command = |args: &[&str]| finish(commram().args(args).args(["-i", &name]));
        assert!(eventually(|| command(&["status"]).code == Some(0)));
        let prefix = std::fs::read_to_string(format!("/dev/shm/commram.{name}.iox.d/prefix")).unwrap();
        for entry in std::fs::read_dir("/dev/shm").unwrap().flatten() {
            if entry.file_name().to_string_lossy().starts_with(prefix.trim_end()) {
                std::fs::File::options().write(true).open(entry.path()).unwrap().set_len(0).unwrap();
            }
        }
        // Registers are then read from the image.
        let is_lost = || command(&["peek", "node2.w_CPU_CONTROL"]).err.contains("has no channel");
        assert!(eventually(is_lost));
        signal(&child, number);
        promised(Duration::from_secs(2), || wait_for(&mut child, "an emulator"));
        assert_eq!(files_of(&name), NOTHING);
        drop(reader);
    }
}

/// The log of the background process must not be one of its outputs: the parent reads the outputs until they are
/// closed.
#[test]
fn the_log_of_a_background_process_is_none_of_its_outputs() {
    let (name, files) = (unique_name(), tempfile::tempdir().unwrap());
    let link = files.path().join("link");
    std::os::unix::fs::symlink("/dev/stderr", &link).unwrap();
    for log in ["/dev/stdout", "/dev/stderr", "/proc/self/fd/1", "/dev/fd/2", link.to_str().unwrap()] {
        let refused = finish(commram().args(["run", "--detach", "-i", &name, "--log", log]));
        let message = refused.fails(2);
        assert!(message.contains(&format!("--log {log}")) && message.contains("name a file"), "{message}");
        assert_eq!(files_of(&name), NOTHING);
    }
    // The caller gives the background process a pipe as another file. The process must not use this pipe as its output.
    let script =
        "$COMMRAM run --detach -i $0 --log /dev/fd/3 3>&1 >/dev/null | true; exec $COMMRAM stop -i $0";
    let mut shell = Command::new("sh");
    shell.args(["-c", script, &name]).env("COMMRAM", commram().get_program()).stdin(Stdio::null());
    assert_eq!(finish(&mut shell).ok(), format!("instance '{name}' has stopped\n"));
}
