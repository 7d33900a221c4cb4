//! Configuration examples A to D of the manual (5.00005.03a p. 62-73): The example programs of `tools/examples` run in
//! step with a plant in this process, so that the test can count each event and each trigger.
#![allow(dead_code, reason = "each example has its own `main`")]
#![allow(clippy::duplicate_mod, reason = "each example has its own module `common`")]

#[path = "../../tools/examples/baps.rs"]
mod a;
#[path = "../../tools/examples/baps_timer.rs"]
mod b;
#[path = "../../tools/examples/baps_cansync.rs"]
mod c;
#[path = "../../tools/examples/timer_task.rs"]
mod d;

use crate::rig::{BOTH, Memory, segment};
use commram::devices::cansync::records::{Missed, OmittedFrame};
use commram::devices::omega_drive_line_2::Plc;
use commram::identity::DeviceIndex;
use commram::journal::{Event, Rule};
use commram::memory::Image;
use commram::memory::header::Start;
use commram::plant::{Plant, PlantConfig, Power};
use commram::plc::{Program, Progress, Ram, Tasks};
use std::time::Duration;

const PLANT: &str = "[[plc]]\nname = 'line'\nnode2 = 'drives'\n[plc.drive]\nlock_time_us = 50000\n\
    [[bus]]\nname = 'drives'\n";
/// Period in which the program scans, in us.
const SCAN_US: u64 = 50;
/// Emulated time within which every program ends.
const LONGEST_US: u64 = 20_000_000;

/// Wraps a program, and records the time of each event of the program's event tasks.
struct EventRecorder<P> {
    program: P,
    ram: Ram,
    event: usize,
    times: Vec<u64>,
    missed: u32,
    starts: Vec<Start>,
}

impl<P: Program<Error = String>> Program for EventRecorder<P> {
    type Error = String;

    fn initialize(&mut self, start: Start) {
        self.starts.push(start);
        self.program.initialize(start);
    }

    fn cold_start(&mut self) -> Result<Progress, String> {
        self.program.cold_start()
    }

    fn cyclic(&mut self) -> Result<Progress, String> {
        self.program.cyclic()
    }

    fn event(&mut self, number: usize, missed: u32) -> Result<(), String> {
        assert_eq!(number, self.event);
        self.missed += missed;
        self.times.push(self.ram.header().events[number].time_us.load());
        self.program.event(number, missed)
    }
}

struct Stage {
    plant: Plant,
    ram: Ram,
    _images: Vec<Image>,
}

impl Stage {
    fn new(memory: Memory) -> Stage {
        let drives: String = (1..=3)
            .map(|n| format!("[[bus.drive]]\nname = 'd{n}'\nslave_number = {n}\nlock_time_us = 50000\n"))
            .collect();
        let config = PlantConfig::parse("configurations", &format!("{PLANT}{drives}")).unwrap();
        let mut images = Vec::new();
        let plant = Plant::new(&config, |plc, device| segment(memory, plc, device, &mut images)).unwrap();
        let ram = Ram::of(plant.devices()[0].segment()).unwrap();
        Stage { plant, ram, _images: images }
    }

    fn load<P: Program<Error = String>>(&self, event: usize, program: P) -> Tasks<EventRecorder<P>> {
        let (ram, times, starts) = (self.ram.clone(), Vec::new(), Vec::new());
        let noted = EventRecorder { program, ram, event, times, missed: 0, starts };
        Tasks::load(&self.ram, noted, Duration::from_millis(10), &[event])
    }

    /// Runs a program to its end.
    fn run<P: Program<Error = String>>(&mut self, tasks: &mut Tasks<EventRecorder<P>>) {
        let start = self.plant.now();
        while self.scan(tasks) == Progress::Again {
            assert!(self.plant.now() - start < LONGEST_US, "it does not end");
        }
    }

    fn scan<P: Program<Error = String>>(&mut self, tasks: &mut Tasks<EventRecorder<P>>) -> Progress {
        self.plant.advance_to(self.plant.now() + SCAN_US);
        tasks.scan().unwrap()
    }

    /// Returns the counts of trigger 1, trigger 2 and trigger controller, each with the time of its last pulse.
    fn triggers(&self) -> [(u32, u64); 3] {
        self.ram.header().triggers.each_ref().map(|slot| (slot.bell.rings(), slot.time_us.load()))
    }

    fn parameter(&self, number: u16) -> u32 {
        self.plant.devices()[0].as_a::<Plc>().unwrap().baps().drive().parameter(number).unwrap()
    }

    /// Checks that the drive is in operation, synchronized to its trigger, and at the position that P258 demands.
    fn has_followed(&self, mask: u32) {
        assert_eq!(self.parameter(121) & 0x806F, 0x8027, "enabled and synchronized");
        let reference = self.parameter(258);
        assert_ne!(reference, 0);
        assert_eq!(reference & !mask, 0, "bits that do not count (p. 74)");
        assert!(self.parameter(303).abs_diff(reference) <= 32, "{} {reference}", self.parameter(303));
    }

    /// Returns the times at which frame 1 with reference values was released too late. Frame 2 is unused.
    fn missed_deadlines(&self) -> Vec<u64> {
        let frame_1 =
            |event: &Event| event.get().is_some_and(|it: Missed| it.what == OmittedFrame::ReferenceValue(1));
        let journal = self.plant.journal();
        journal.records().filter(|record| frame_1(&record.event)).flat_map(|it| it.times()).collect()
    }
}

/// Checks that the programs use the registers as the manual demands.
impl Drop for Stage {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            assert_eq!(
                self.plant.journal().findings().errors(),
                Vec::<&Rule>::new(),
                "the access checker finds nothing"
            );
        }
    }
}

/// No event is lost or handled twice: one call for each event, at equal intervals.
#[track_caller]
fn evenly<P: Program<Error = String>>(tasks: &Tasks<EventRecorder<P>>, period_us: u64, at_least: usize) {
    let noted = tasks.program();
    assert_eq!(noted.missed, 0);
    assert!(noted.times.len() >= at_least, "{} events", noted.times.len());
    assert!(noted.times.windows(2).all(|pair| pair[1] - pair[0] == period_us), "{:?}", noted.times);
}

/// Manual p. 62-63: the drive raises event 8 in each of its communications; `BAPS_INIT` starts it from the cyclic task.
#[test]
fn a_the_drive_starts_the_event_task() {
    for memory in BOTH {
        let mut stage = Stage::new(memory);
        let mut tasks = stage.load(8, a::Drive::new(stage.ram.clone()).unwrap());
        for _ in 0..50_000 / SCAN_US {
            stage.scan(&mut tasks);
        }
        assert_eq!(stage.ram.header().events[8].bell.rings(), 0, "five cycles of 10 ms first");
        stage.run(&mut tasks);
        evenly(&tasks, 2_000, 5);
        assert_eq!((stage.parameter(301), stage.parameter(121) & 0x6F), (5000, 0x27), "{memory:?}");
        assert_eq!(stage.triggers().map(|trigger| trigger.0), [0; 3], "it triggers no option card");
    }
}

/// Manual p. 64-66: board timer A starts the event task and is also the source of the triggers.
#[test]
fn b_board_timer_a_drives_task_and_triggers() {
    for memory in BOTH {
        let mut stage = Stage::new(memory);
        let mut tasks = stage.load(5, b::Timer::new(stage.ram.clone()).unwrap());
        stage.run(&mut tasks);
        evenly(&tasks, 1_000, 400);
        let [one, two, controller] = stage.triggers();
        assert_eq!((one, two), (controller, controller));
        assert_eq!(Some(&controller.1), tasks.program().times.last(), "{memory:?}");
        assert_eq!(stage.parameter(167), 1000);
        stage.has_followed(0xFFFF_FFF8);
    }
}

/// Manual p. 67-70: SYNC is event and trigger. The task serves the bus first, so it misses no deadline of the bus.
#[test]
fn c_sync_of_cansync_drives_task_and_triggers() {
    for memory in BOTH {
        let mut stage = Stage::new(memory);
        let mut tasks = stage.load(12, c::Master::new(stage.ram.clone()).unwrap());
        stage.run(&mut tasks);
        evenly(&tasks, 2_000, 400);
        let [one, two, controller] = stage.triggers();
        assert_eq!((one, two), (controller, controller));
        assert_eq!(Some(&controller.1), tasks.program().times.last(), "{memory:?}");
        let missed = stage.missed_deadlines();
        let first = tasks.program().times[0];
        assert!(missed.iter().all(|time| *time < first), "{missed:?} {first}");
        stage.has_followed(0xFFFF_FFF0);
    }
}

/// Manual p. 71-73: all four timer events; only board timer A triggers anything.
#[test]
fn d_a_timer_drives_a_task() {
    for (event, triggers) in [(0, false), (2, false), (5, true), (6, true)] {
        let mut stage = Stage::new(Memory::Heap);
        let mut tasks = stage.load(event, d::Timer::new(stage.ram.clone(), event));
        stage.run(&mut tasks);
        evenly(&tasks, 1_000, 1_000);
        assert!(tasks.program().times.len() <= 1_010, "disabled at the end");
        assert_eq!(stage.triggers().map(|trigger| trigger.0 > 0), [triggers; 3], "event {event}");
    }
}

/// Decision D-260: `OPT_INIT` is called in the start tasks (p. 59), and each start runs them.
#[test]
fn a_program_with_opt_init_starts_again() {
    let mut stage = Stage::new(Memory::Heap);
    let mut tasks = stage.load(5, b::Timer::new(stage.ram.clone()).unwrap());
    for _ in 0..200_000 / SCAN_US {
        stage.scan(&mut tasks);
    }
    // Turns the switch to STOP and to RUN, which is a warm start.
    for switch in [1, 0] {
        stage.ram.header().board.switch.store(switch);
        for _ in 0..20_000 / SCAN_US {
            stage.scan(&mut tasks);
        }
    }
    stage.run(&mut tasks);
    assert_eq!(tasks.program().starts, [Start::Cold, Start::Warm]);
    stage.has_followed(0xFFFF_FFF8);
    drop(tasks);
    stage.plant.advance_to(stage.plant.now() + 1_000);
    // A different program leads to a cold start. A program that starts after the supply was switched off and on also
    // has a cold start.
    for cycle in [false, true] {
        if cycle {
            stage.plant.set_power(DeviceIndex(0), Power::Off);
            stage.plant.set_power(DeviceIndex(0), Power::On);
        }
        let mut tasks = stage.load(12, c::Master::new(stage.ram.clone()).unwrap());
        stage.run(&mut tasks);
        assert_eq!(tasks.program().starts, [Start::Cold]);
        stage.has_followed(0xFFFF_FFF0);
    }
}
