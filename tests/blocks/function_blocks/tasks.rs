//! The runner of tasks, in step with a plant in this process.

use crate::omega::cansync::bench::Bench;
use crate::rig::{BOTH, Memory};
use commram::devices::omega_drive_line_2::blocks::*;
use commram::identity::DeviceIndex;
use commram::memory::header::{ProgramState, Start};
use commram::plant::Power;
use std::cell::RefCell;
use std::convert::Infallible;
use std::rc::Rc;
use std::time::Duration;

/// A program that records its calls with their times.
struct CallRecorder {
    ram: Ram,
    sync: INTR_SET,
    /// Cycles since the start.
    cycles: u32,
    log: Rc<RefCell<Vec<(u64, &'static str)>>>,
}

/// Returns an `INTR_SET` that enables the CANsync event.
fn enabled() -> INTR_SET {
    INTR_SET { i_EVENT: 12, x_EN: true, ..Default::default() }
}

impl CallRecorder {
    fn note(&self, what: &'static str) {
        self.log.borrow_mut().push((self.ram.now_us(), what));
    }
}

impl Program for CallRecorder {
    type Error = Infallible;

    fn initialize(&mut self, start: Start) {
        assert!(matches!(start, Start::Cold | Start::Warm));
        self.cycles = 0;
        self.sync = enabled();
    }

    fn cold_start(&mut self) -> Result<Progress, Infallible> {
        self.note("cold");
        self.sync.call(&self.ram);
        Ok(Progress::done_if(self.sync.is_answered()))
    }

    fn warm_start(&mut self) -> Result<Progress, Infallible> {
        self.note("warm");
        self.sync.call(&self.ram);
        Ok(Progress::done_if(self.sync.is_answered()))
    }

    fn cyclic(&mut self) -> Result<Progress, Infallible> {
        self.cycles += 1;
        assert_eq!(self.ram.header().program_cycles.load(), self.cycles, "reported to the board");
        self.note("cyclic");
        Ok(Progress::Again)
    }

    fn event(&mut self, number: usize, missed: u32) -> Result<(), Infallible> {
        assert_eq!(number, 12);
        self.note(if missed == 0 { "event" } else { "event, missed some" });
        Ok(())
    }
}

struct Stage {
    bench: Bench,
    tasks: Tasks<CallRecorder>,
    log: Rc<RefCell<Vec<(u64, &'static str)>>>,
}

impl Stage {
    fn new(memory: Memory) -> Stage {
        let bench = Bench::active(memory);
        let ram = Ram::of(bench.rig.plant.devices()[0].segment()).unwrap();
        let log = Rc::default();
        let notes = CallRecorder { ram: ram.clone(), sync: enabled(), cycles: 0, log: Rc::clone(&log) };
        let tasks = Tasks::load(&ram, notes, Duration::from_millis(5), &[12]);
        Stage { bench, tasks, log }
    }

    /// Scans every 100 us for `ms`, and returns the calls.
    fn pass(&mut self, ms: u64) -> Vec<(u64, &'static str)> {
        self.log.borrow_mut().clear();
        for _ in 0..ms * 10 {
            self.bench.rig.step(100);
            assert_eq!(self.tasks.scan().unwrap(), Progress::Again);
        }
        self.log.take()
    }

    fn state(&self) -> u32 {
        self.tasks.program().ram.header().program.state.load()
    }

    fn display(&self) -> Option<char> {
        char::from_u32(self.tasks.program().ram.header().board.display.load())
    }
}

fn times(log: &[(u64, &str)], what: &str) -> Vec<u64> {
    log.iter().filter(|(_, name)| *name == what).map(|(time, _)| *time).collect()
}

/// Manual p. 38-43: cold start, then event and cyclic tasks at their periods.
#[test]
fn a_program_starts_cold_and_runs_its_tasks() {
    for memory in BOTH {
        let mut stage = Stage::new(memory);
        assert_eq!(stage.tasks.next_us(), None, "nothing before the board has ordered it");
        let log = stage.pass(40);
        let first = log.iter().position(|(_, what)| *what != "cold").unwrap();
        assert!(first >= 2, "the board has to answer INTR_SET first");
        assert!(times(&log[first..], "cold").is_empty());
        let (events, cycles) = (times(&log, "event"), times(&log, "cyclic"));
        assert!((18..=20).contains(&events.len()), "{log:?}");
        assert!(events.windows(2).all(|pair| pair[1] - pair[0] == 2000), "{memory:?} {events:?}");
        assert!(cycles[1..].windows(2).all(|pair| pair[1] - pair[0] == 5000), "{memory:?} {cycles:?}");
        assert!((7..=8).contains(&cycles.len()));
        assert_eq!((stage.state(), stage.display()), (ProgramState::Cyclic.code(), Some('3')));
    }
}

/// Manual p. 38, 40: STOP and RUN, and a reset, which is a warm start with an empty board.
#[test]
fn the_switch_stops_and_starts_a_program() {
    let mut stage = Stage::new(Memory::Heap);
    stage.pass(10);
    stage.bench.rig.plant.set_power(DeviceIndex(0), Power::HoldReset);
    assert_eq!(stage.pass(10), []);
    stage.bench.rig.plant.set_power(DeviceIndex(0), Power::ReleaseReset);
    assert_eq!(stage.pass(10), [], "the switch is at STOP");
    assert_eq!(stage.state(), ProgramState::Stopped.code());
    stage.tasks.program().ram.header().board.switch.store(0);
    let log = stage.pass(10);
    assert_eq!(log[0].1, "warm");
    assert!(!times(&log, "cyclic").is_empty());
    assert!(times(&log, "cold").is_empty());
}

/// Manual p. 37: a project that was only sent is lost by a reset, and comes back when it is sent again.
#[test]
fn a_program_that_was_only_sent_is_lost_by_a_reset() {
    use commram::memory::header::{BoardSetting, Project, RunSwitch};
    let mut stage = Stage::new(Memory::Heap);
    stage.bench.rig.plant.set_board(DeviceIndex(0), BoardSetting::Project(Project::Sent));
    assert_eq!(stage.pass(10)[0].1, "cold");
    stage.bench.rig.plant.set_board(DeviceIndex(0), BoardSetting::Reset);
    stage.bench.rig.plant.set_board(DeviceIndex(0), BoardSetting::Switch(RunSwitch::Run));
    assert_eq!(stage.pass(10), []);
    assert_eq!((stage.state(), stage.display()), (ProgramState::None.code(), Some('0')));
    stage.bench.rig.plant.set_board(DeviceIndex(0), BoardSetting::Project(Project::Sent));
    assert_eq!(stage.pass(10)[0].1, "cold");
    assert_eq!(stage.state(), ProgramState::Cyclic.code());
}

/// Manual p. 38: the starts of the control dialog.
#[test]
fn starts_can_be_ordered() {
    let mut stage = Stage::new(Memory::Heap);
    stage.pass(10);
    for (start, expected) in [(Start::Hot, None), (Start::Warm, Some("warm")), (Start::Cold, Some("cold"))] {
        let ram = stage.tasks.program().ram.clone();
        ram.header().program.start_request.store(start.code());
        ram.header().submit_request();
        let log = stage.pass(10);
        let started = log.iter().map(|(_, what)| *what).find(|what| matches!(*what, "warm" | "cold"));
        assert_eq!(started, expected);
        assert!(!times(&log, "cyclic").is_empty());
    }
    let ram = stage.tasks.program().ram.clone();
    ram.header().program.start_request.store(Start::Stop.code());
    ram.header().submit_request();
    stage.pass(2);
    assert_eq!(stage.pass(10), []);
}

/// The runner reports events that a slow program misses, and skips cyclic periods that the program misses.
#[test]
fn missed_events_are_reported() {
    let mut stage = Stage::new(Memory::Heap);
    stage.pass(10);
    stage.log.borrow_mut().clear();
    stage.bench.rig.step(23_000);
    stage.tasks.scan().unwrap();
    let names: Vec<_> = stage.log.take().iter().map(|(_, what)| *what).collect();
    assert_eq!(names, ["event, missed some", "cyclic"]);
    assert!(stage.pass(4).len() <= 3);
}

/// When a program ends, no project stays loaded. So a second program is a new project and starts cold.
#[test]
fn the_next_program_starts_cold() {
    let mut stage = Stage::new(Memory::Heap);
    stage.pass(10);
    let ram = stage.tasks.program().ram.clone();
    let Stage { mut bench, tasks, log } = stage;
    drop(tasks);
    bench.rig.step(1000);
    assert_eq!(ram.header().board.display.load(), u32::from('0'));
    let notes = CallRecorder { ram: ram.clone(), sync: enabled(), cycles: 0, log: Rc::clone(&log) };
    let tasks = Tasks::load(&ram, notes, Duration::from_millis(5), &[12]);
    let mut stage = Stage { bench, tasks, log };
    assert_eq!(stage.pass(10)[0].1, "cold");

    // When a program has died, its state stays in the header page.
    let Stage { bench, tasks, log } = stage;
    std::mem::forget(tasks);
    let notes = CallRecorder { ram: ram.clone(), sync: enabled(), cycles: 0, log: Rc::clone(&log) };
    let tasks = Tasks::load(&ram, notes, Duration::from_millis(5), &[12]);
    let mut stage = Stage { bench, tasks, log };
    assert_eq!(stage.pass(10)[0].1, "cold");
}
