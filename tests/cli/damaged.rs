//! A program of the same user damages a channel: no process hangs, each one ends with a message, and `stop` ends the
//! emulator.

use crate::common::{Emulator, Follower, Outcome, eventually, finish, promised, remove_remains};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Returns the shared memory objects of the channel with this suffix.
fn objects(emulator: &Emulator, ending: &str) -> Vec<PathBuf> {
    let prefix = std::fs::read_to_string(format!("/dev/shm/commram.{}.iox.d/prefix", emulator.name)).unwrap();
    let named = |path: &PathBuf| {
        let name = path.file_name().unwrap().to_string_lossy();
        name.starts_with(prefix.trim_end()) && name.ends_with(ending)
    };
    std::fs::read_dir("/dev/shm").unwrap().flatten().map(|entry| entry.path()).filter(named).collect()
}

fn shorten(objects: &[PathBuf], length: impl Fn(u64) -> u64) {
    assert!(!objects.is_empty());
    for path in objects {
        let object = std::fs::File::options().write(true).open(path).unwrap();
        object.set_len(length(object.metadata().unwrap().len())).unwrap();
    }
}

/// Returns the files in the channel's directory with this suffix.
fn files(emulator: &Emulator, ending: &str) -> Vec<PathBuf> {
    fn below(directory: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(directory).unwrap().flatten() {
            let path = entry.path();
            if path.is_dir() { below(&path, found) } else { found.push(path) }
        }
    }
    let mut found = Vec::new();
    below(Path::new(&format!("/dev/shm/commram.{}.iox.d", emulator.name)), &mut found);
    found.retain(|path| path.to_string_lossy().ends_with(ending));
    found
}

/// Replaces the files by pipes. A process that opens a pipe without a writer blocks without a timeout.
fn put_pipes_in_place_of(files: &[PathBuf]) {
    assert!(!files.is_empty());
    for path in files {
        std::fs::remove_file(path).unwrap();
        assert_eq!(finish(std::process::Command::new("mkfifo").arg(path)).code, Some(0));
    }
}

#[test]
fn a_truncated_channel_blocks_no_process_and_the_emulator_stops() {
    for ending in ["global_mgmt", "data", "dynamic"] {
        let mut emulator = Emulator::start(&[]);
        let parts = objects(&emulator, ending);
        shorten(&parts, |_| 0);
        let outcome = emulator.run("peek", &["node2.w_OPTION_STATUS"]);
        // The client detects the damage, or the emulator has detected it before and has closed the channel.
        assert!(said_damaged(&outcome) || outcome.err.contains("has no channel"), "{ending}: {outcome:?}");
        assert!(emulator.run("stop", &[]).ok().contains("has stopped"));
        assert_eq!(emulator.wait().code(), Some(0));
        assert_eq!(emulator.files(), Vec::<PathBuf>::new());
        assert!(parts.iter().all(|part| !part.exists()));
    }
}

fn said_damaged(outcome: &Outcome) -> bool {
    outcome.code == Some(3)
        && outcome.err.contains("the channel is damaged")
        && outcome.err.contains("commram stop")
}

#[test]
fn a_part_that_iceoryx2_waits_for_without_a_limit_blocks_no_process() {
    for ending in ["details", "node_monitor_context"] {
        let mut emulator = Emulator::stepped();
        put_pipes_in_place_of(&files(&emulator, ending));
        let _ = emulator.run("peek", &["node2.w_OPTION_STATUS"]);
        let outcome = emulator.run("stop", &[]);
        assert_eq!(outcome.ok(), format!("instance '{}' has stopped\n", emulator.name), "{ending}");
        assert_eq!(emulator.wait().code(), Some(0));
        assert_eq!(emulator.files(), Vec::<PathBuf>::new());
    }
}

/// In this test no client is connected, so the emulator itself notices the damage. With a client, iceoryx2 may access
/// the missing part first and crash.
#[test]
fn an_emulator_continues_without_a_channel_that_was_shortened() {
    use commram::memory::{AttachMode, Image, Width};
    for (ending, part) in [("data", 0), ("data", 2), ("dynamic", 0), ("dynamic", 2)] {
        let mut emulator = Emulator::start(&[]);
        let parts = objects(&emulator, ending);
        let attached = Image::attach(&emulator.name, "line", AttachMode::ReadWrite, None).unwrap();
        shorten(&parts, |length| length.checked_div(part).unwrap_or(0));
        // The emulator removes the parts when it closes the channel.
        assert!(eventually(|| parts.iter().all(|part| !part.exists())), "{ending} {part}");
        let outcome = emulator.run("peek", &["node2.w_OPTION_STATUS"]);
        assert!(outcome.code == Some(0) && outcome.err.contains("has no channel"), "{outcome:?}");
        let within = std::time::Duration::from_secs(60);
        attached.post(200_000, Width::Word, 1).unwrap();
        attached.wait_register(200_002, Width::Word, within, |status| status == 2).unwrap();
        let outcome = emulator.run("stop", &[]);
        assert_eq!(outcome.ok(), format!("instance '{}' has stopped\n", emulator.name), "{ending} {part}");
        assert_eq!(emulator.wait().code(), Some(0));
        let complaints = emulator.complaints();
        assert!(complaints.contains("the channel is lost: another program has shortened"), "{complaints}");
        assert_eq!(emulator.files(), Vec::<PathBuf>::new());
    }
}

/// The emulator has not noticed the damage yet. It receives the request to end and finds the damage then.
#[test]
fn an_emulator_that_ends_with_a_shortened_channel_ends_in_good_order() {
    let mut emulator = Emulator::stepped();
    emulator.signal("-STOP");
    shorten(&objects(&emulator, ".dynamic"), |_| 0);
    let outcome = promised(Duration::from_secs(2), || emulator.run("stop", &[]));
    assert_eq!(
        (outcome.code, outcome.out.as_str()),
        (Some(0), format!("instance '{}' has stopped\n", emulator.name).as_str()),
        "{}",
        outcome.err
    );
    assert_eq!(emulator.wait().code(), Some(0));
    assert!(emulator.files().is_empty());
}

/// All parts are present, but their content is invalid, and iceoryx2 crashes. `stop` must not report success.
#[test]
fn an_emulator_that_is_killed_while_it_ends_has_not_stopped() {
    let mut emulator = Emulator::stepped();
    for object in objects(&emulator, ".dynamic") {
        let length = object.metadata().unwrap().len() as usize;
        std::fs::write(&object, vec![0xFF; length]).unwrap();
    }
    let outcome = emulator.run("stop", &[]);
    assert!(outcome.fails(3).contains("was killed"), "{}", outcome.err);
    assert_eq!(emulator.wait().code(), None);
    emulator.run("stop", &["--clean"]).ok();
    assert!(emulator.files().is_empty());
}

/// A client in the middle of an operation prints a message; a bare crash would explain nothing.
#[test]
fn a_client_reports_that_its_memory_is_shortened() {
    let emulator = Emulator::stepped();
    let before = objects(&emulator, ".data");
    let mut client = Follower::start(&emulator, "watch", &["node2.w_OPTION_STATUS"]);
    // When this note arrives, the client has connected and has sent its first request.
    assert!(client.note().contains("watching"));
    let mut own = objects(&emulator, ".data");
    own.retain(|path| !before.contains(path));
    shorten(&own, |_| 0);
    let ended = eventually(|| client.child.try_wait().unwrap().is_some());
    let _ = client.child.kill();
    let (code, _, words) = client.end();
    assert!(ended);
    assert_eq!(code, Some(3), "{words}");
    assert!(words.contains("shortened") && words.contains("commram stop --clean"), "{words}");
    let _ = emulator.run("stop", &[]);
    remove_remains(&emulator.name);
}
