//! NOVRAM files that an emulator cannot write, and signals during the start of an emulator.

use crate::common::{Emulator, commram, eventually, finish, remove_remains, unique_name, wait_for};
use commram::devices::omega_drive_line_2::registers::{LAYOUT_HASH, RETAIN};
use commram::memory::{AttachMode, Image, Width};
use std::fs;
use std::io::Write;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

fn set_flag(emulator: &Emulator, value: u32) {
    let image = Image::attach(&emulator.name, "line", AttachMode::ReadWrite, Some(LAYOUT_HASH)).unwrap();
    image.segment().store(RETAIN as u32, Width::Byte, value).unwrap();
}

/// Creates a directory at the path of the new file, so that even root cannot write it.
fn block(directory: &Path) -> PathBuf {
    let new = directory.join("line.novram.new");
    fs::create_dir(&new).unwrap();
    new
}

#[test]
fn the_exit_code_reports_a_lost_flag() {
    let directory = tempfile::tempdir().unwrap();
    let mut emulator = Emulator::start(&["--novram", directory.path().to_str().unwrap()]);
    let _in_the_way = block(directory.path());
    set_flag(&emulator, 7);
    let stopped = emulator.run("stop", &[]);
    assert!(
        stopped.fails(1).contains("could not write NOVRAM: the last changes are lost"),
        "{}",
        stopped.err
    );
    assert_eq!(emulator.wait().code(), Some(1));
    let complaints = emulator.complaints();
    assert!(complaints.contains("the last changes are lost"), "{complaints}");
    assert!(emulator.files().is_empty(), "the rest ends in good order");
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

/// The output of the emulator is not read, so the emulator blocks during its start.
#[test]
fn a_signal_ends_an_emulator_that_hangs_in_its_start() {
    let (_reader, writer) = std::io::pipe().unwrap();
    fill(&writer);
    let name = unique_name();
    let mut command = commram();
    command.args(["run", "-i", &name]).stdout(writer).stderr(Stdio::null());
    let mut child = command.spawn().unwrap();
    let ready = || Image::attach(&name, "line", AttachMode::ReadOnly, None).is_ok();
    assert!(eventually(ready), "no image");
    assert!(Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap().success());
    let status = wait_for(&mut child, "an emulator that hangs");
    assert_eq!(status.signal(), Some(15));
    remove_remains(&name);
}

/// Fills a pipe.
fn fill(writer: &std::io::PipeWriter) {
    let flags = rustix::fs::fcntl_getfl(writer).unwrap();
    rustix::fs::fcntl_setfl(writer, flags | rustix::fs::OFlags::NONBLOCK).unwrap();
    let mut writing = writer;
    while writing.write(&[b'.'; 4096]).is_ok() {}
    rustix::fs::fcntl_setfl(writer, flags).unwrap();
}
