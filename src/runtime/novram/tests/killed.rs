//! Kills a process at random moments while it writes.

use super::*;
use std::io::{BufRead, BufReader};
use std::os::unix::process::ExitStatusExt;
use std::process::{Command, Stdio};

const DIRECTORY: &str = "COMMRAM_TEST_NOVRAM";
const KILLS: u64 = 300;
/// Longest time for which the child process writes before the kill. On a slow machine it gets more time, until it has
/// written something.
const LONGEST_US: u64 = 4_000;
const SLOWEST_US: u64 = 500_000;

/// The body of the child processes, and not a real test.
#[test]
fn child() {
    let Some(directory) = std::env::var_os(DIRECTORY) else { return };
    let segment = segment();
    let mut directory = Directory::open(Path::new(&directory)).unwrap();
    let (novram, found) = restored(&directory, "[[plc]]\nname = 'line'\n", &segment).unwrap();
    assert!(!matches!(found, RestoreOutcome::SetAside { .. }), "{found:?}");
    let first = novram.saved.registers()[0];
    println!("\nwriting");
    for byte in (0..=u8::MAX).cycle().skip(usize::from(first) + 1) {
        file::store(&mut directory, &novram.name, &content(byte)).unwrap();
    }
}

#[test]
fn the_file_holds_the_old_or_the_new_content_never_a_mixture() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("line.novram");
    // The same random numbers in every run.
    let mut numbers = fastrand::Rng::with_seed(4711);
    let mut contents = std::collections::BTreeSet::new();
    let (mut longest_us, mut last) = (LONGEST_US, None);
    for _ in 0..KILLS {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "runtime::novram::tests::killed::child", "--nocapture"])
            .env(DIRECTORY, directory.path())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        assert!(lines.any(|line| line.unwrap() == "writing"), "the child has ended by itself");
        let (start, moment) = (Instant::now(), Duration::from_micros(numbers.u64(..longest_us)));
        while start.elapsed() < moment {
            std::hint::spin_loop();
        }
        child.kill().unwrap();
        assert_eq!(child.wait().unwrap().signal(), Some(9));
        let found = fs::read(&path).ok().map(|bytes| decode(&bytes, SIZE).expect("whole"));
        let byte = found.as_ref().map(|found| found.registers()[0]);
        assert_eq!(found, byte.map(content), "no mixture");
        longest_us = if byte == last { (2 * longest_us).min(SLOWEST_US) } else { LONGEST_US };
        last = byte;
        contents.extend(byte);
    }
    assert!(contents.len() > 10, "the kills meet different contents: {contents:?}");
    power_on(&directory, &segment()).unwrap();
    assert_eq!(names(&directory), ["line.novram"], "the next one cleans up");
}
