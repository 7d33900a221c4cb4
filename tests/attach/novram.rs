//! NOVRAM files that an emulator cannot write.

use crate::common::{Emulator, commram, finish, unique_name};
use commram::devices::omega_drive_line_2::registers::{LAYOUT_HASH, RETAIN};
use commram::memory::{AttachMode, Image, Width};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

fn set_flag(emulator: &Emulator, value: u32) {
    let image = Image::attach(&emulator.name, "line", AttachMode::ReadWrite, Some(LAYOUT_HASH)).unwrap();
    image.segment().store(RETAIN, Width::Byte, value).unwrap();
}

/// Creates a directory at the path of the new file, so that even root cannot write it.
fn block(directory: &Path) -> PathBuf {
    let new = directory.join("line.novram.new");
    fs::create_dir(&new).unwrap();
    new
}

/// Stops an emulator that cannot write its NOVRAM, and checks both exit codes. Returns what it has complained about.
fn stop_with_a_loss(emulator: &mut Emulator) -> String {
    let stopped = emulator.run("stop", &[]);
    let lost = "could not write NOVRAM: the last changes are lost";
    assert!(stopped.fails(1).contains(lost), "{}", stopped.err);
    assert_eq!(emulator.wait().code(), Some(1));
    emulator.complaints()
}

#[test]
fn the_exit_code_reports_a_lost_flag() {
    let directory = tempfile::tempdir().unwrap();
    let mut emulator = Emulator::start(&["--novram", directory.path().to_str().unwrap()]);
    let _in_the_way = block(directory.path());
    set_flag(&emulator, 7);
    let complaints = stop_with_a_loss(&mut emulator);
    assert!(complaints.contains("the last changes are lost"), "{complaints}");
    assert!(emulator.files().is_empty(), "the rest ends cleanly");
}

/// Several clients, of which one ends the emulator, or a signal that comes first: each client that reports the end also
/// reports the loss. A client that arrives after the end finds no instance.
#[test]
fn every_client_that_waits_for_the_end_reports_a_lost_flag() {
    for round in 0..6 {
        let directory = tempfile::tempdir().unwrap();
        let mut emulator = Emulator::start(&["--novram", directory.path().to_str().unwrap()]);
        block(directory.path());
        set_flag(&emulator, 7);
        if round % 2 == 1 {
            emulator.signal("-TERM");
        }
        let stop = || emulator.command("stop", &[]).stderr(Stdio::piped()).spawn().unwrap();
        let clients: Vec<_> = (0..4).map(|_| stop()).collect();
        let outcomes = clients.into_iter().map(|client| client.wait_with_output().unwrap());
        for outcome in outcomes.collect::<Vec<_>>() {
            let err = String::from_utf8(outcome.stderr).unwrap();
            let is_late = outcome.status.code() == Some(3) && err.contains("is not running");
            let reports = outcome.status.code() == Some(1) && err.contains("the last changes are lost");
            assert!(is_late || reports, "round {round}, {}: {err}", outcome.status);
        }
        assert_eq!(emulator.wait().code(), Some(1));
    }
}

#[test]
fn another_instance_on_the_same_directory_is_refused() {
    let directory = tempfile::tempdir().unwrap();
    let arguments = ["--novram", directory.path().to_str().unwrap()];
    let first = Emulator::start(&arguments);
    let name = unique_name();
    let outcome = finish(commram().arg("run").args(arguments).args(["-i", &name]));
    assert!(outcome.fails(1).contains("another emulator uses this directory"), "{}", outcome.err);
    drop(first);
    drop(Emulator::start(&arguments));
}

/// A program may remove the lock file. The first emulator that writes then has the directory.
#[test]
fn two_emulators_never_write_to_one_directory() {
    let directory = tempfile::tempdir().unwrap();
    let arguments = ["--novram", directory.path().to_str().unwrap()];
    let lock = directory.path().join(".lock");
    let mut first = Emulator::start(&arguments);
    fs::remove_file(&lock).unwrap();
    set_flag(&first, 7);
    first.run("stop", &[]).ok();
    assert_eq!(first.wait().code(), Some(0));
    assert!(lock.exists());

    let mut first = Emulator::start(&arguments);
    fs::remove_file(&lock).unwrap();
    let mut second = Emulator::start(&arguments);
    set_flag(&first, 8);
    let complaints = stop_with_a_loss(&mut first);
    assert!(complaints.contains("another emulator uses this directory"), "{complaints}");
    assert_eq!(second.peek(&["%MB10000000"]), "16#07");
    second.run("stop", &[]).ok();
    assert_eq!(second.wait().code(), Some(0));
}

/// A directory with a pipe as NOVRAM file must not block the start.
#[test]
fn a_pipe_instead_of_a_file_is_refused_at_once() {
    let directory = tempfile::tempdir().unwrap();
    let pipe = directory.path().join("line.novram");
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let arguments = ["run", "--novram", directory.path().to_str().unwrap(), "-i", &unique_name()];
    let outcome = finish(commram().args(arguments));
    assert!(outcome.fails(1).contains("this is a pipe"), "{}", outcome.err);
}
