//! The example programs of `tools/examples`, each as a separate process at a live emulator.

use crate::common::{Emulator, eventually, python};
use std::process::{Child, Command, Stdio};

const PLANT: &str = "tools/examples/plant.toml";

/// A running example. It is killed when this value is dropped.
struct Example {
    name: &'static str,
    child: Child,
}

impl Example {
    fn start(name: &'static str, emulator: &Emulator, arguments: &[&str]) -> Self {
        let mut command = Command::new(crate::common::example(name));
        command.args(["-i", &emulator.name]).args(arguments);
        let child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
        Example { name, child: child.unwrap() }
    }

    /// Waits for a successful end of the program, and returns its output.
    fn output(mut self) -> String {
        let name = self.name;
        let ended = eventually(|| self.child.try_wait().unwrap().is_some());
        if !ended {
            let _ = self.child.kill();
        }
        let read = |stream: Option<&mut dyn std::io::Read>| {
            let mut text = String::new();
            stream.unwrap().read_to_string(&mut text).unwrap();
            text
        };
        let out = read(self.child.stdout.as_mut().map(|stream| stream as &mut dyn std::io::Read));
        let err = read(self.child.stderr.as_mut().map(|stream| stream as &mut dyn std::io::Read));
        let status = self.child.wait().unwrap();
        assert!(ended && status.success() && err.is_empty(), "{name}: {status}\n{out}{err}");
        out
    }
}

impl Drop for Example {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn the_master_brings_up_the_built_in_plant() {
    let emulator = Emulator::start(&[]);
    let out = Example::start("master", &emulator, &[]).output();
    assert!(out.contains("initialized, waiting for slaves [1, 2, 3]"), "{out}");
    assert!(out.contains("parameter 301 of slave 1: 5000"), "{out}");
}

#[test]
fn master_slave_and_cluster_work_together() {
    let emulator = Emulator::start(&[PLANT]);
    let slave = Example::start("slave", &emulator, &[]);
    let cluster = Example::start("cluster", &emulator, &[]);
    let master = Example::start("master", &emulator, &["line", "1", "4", "5"]);
    let out = master.output();
    assert!(out.contains("all slaves have reached reference value 5000"), "{out}");
    assert!(slave.output().contains("last reference value 5000"));
    assert!(cluster.output().contains("the drive was at 5000"));
}

/// Configuration example A of the manual (p. 62-63).
#[test]
fn the_drive_at_the_baps_runs() {
    let emulator = Emulator::start(&[]);
    let out = Example::start("baps", &emulator, &[]).output();
    assert!(out.contains("the drive runs at 5000"), "{out}");
    assert!(out.contains("parameter 305: "), "{out}");
}

/// Runs configuration examples B and D one after the other on one emulator. This is possible because each start may run
/// `OPT_INIT` once (D-260).
#[test]
fn board_timers_drive_event_tasks() {
    let emulator = Emulator::start(&[]);
    for _ in 0..2 {
        let out = Example::start("baps_timer", &emulator, &[]).output();
        assert!(out.contains("the drive has followed timer A to angle"), "{out}");
    }
    for event in ["2", "0", "5", "6"] {
        let out = Example::start("timer_task", &emulator, &["line", event]).output();
        assert!(out.contains(&format!("event {event}: 1")), "{out}");
    }
}

/// Configuration example C (p. 67-70).
#[test]
fn the_sync_signal_drives_bus_and_baps_in_one_task() {
    let emulator = Emulator::start(&[]);
    let out = Example::start("baps_cansync", &emulator, &[]).output();
    assert!(out.contains("the drive has followed SYNC to angle"), "{out}");
    assert!(out.contains("slaves [1, 2, 3] have reached reference value 5000"), "{out}");
}

/// One command starts each example with a private emulator, and leaves no files or processes.
#[test]
fn each_example_is_one_command() {
    let built = crate::common::example("master");
    let programs = built.ancestors().nth(2).unwrap();
    let mut examples = vec![
        ("master", "parameter 301 of slave 1: 5000\n"),
        ("slave", "last reference value 5000\n"),
        ("cluster", "the drive was at 5000\n"),
        ("baps", "the drive runs at 5000\n"),
        ("baps_timer", "the drive has followed timer A to angle"),
        ("baps_cansync", "the drive has followed SYNC to angle"),
        ("timer_task", "event 2: 1"),
        ("c", "a_RD_BMARRAY[1][0] = 5000\n"),
    ];
    if python(&[]).is_some() {
        examples.push(("python", "a_RD_BMARRAY[1][0] = 5000\n"));
    }
    examples.push(("scenario", "1 passed, 0 failed, 0 broken; "));
    for (example, expected) in examples {
        let mut command = Command::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tools/examples/run"));
        let outcome = crate::common::finish(command.arg(example).env("COMMRAM_PROGRAMS", programs));
        assert!(outcome.ok().contains(expected), "{example}: {}", outcome.out);
        let (_, following) = outcome.out.split_once('\'').unwrap();
        let (instance, _) = following.split_once('\'').unwrap();
        assert_eq!(crate::common::files_of(instance), Vec::<std::path::PathBuf>::new(), "{example}");
    }
}

/// In stepped mode the emulated time waits for the event tasks: one long step misses no event.
#[test]
fn a_stepped_clock_waits_for_event_tasks() {
    use commram::memory::header::SeatState;
    use commram::memory::{AttachMode, Image};

    let emulator = Emulator::stepped();
    let attach = || Image::attach(&emulator.name, "line", AttachMode::ReadWrite, None).unwrap();
    let programs = [
        // The program ends at the event after the thousandth one.
        ("timer_task", "event 2: 1001 ms\nmissed 0, longest run 0 us"),
        ("baps_timer", "the drive has followed timer A to angle"),
        ("baps_cansync", "slaves [1, 2, 3] have reached reference value 5000"),
    ];
    for (program, wanted) in programs {
        let running = Example::start(program, &emulator, &[]);
        let image = attach();
        let seats = &image.header().unwrap().lockstep;
        assert!(eventually(|| seats.iter().any(|seat| seat.state.load() == SeatState::Seated.code())));
        // The emulated time also waits for the start task.
        emulator.step(&["5s"]);
        let out = running.output();
        assert!(out.contains(wanted), "{out}");
    }
}
