//! The three ways to wait for an event, each from a separate process: futex, polling, iceoryx2.

use crate::active;
use crate::common::Emulator;
use commram::channel::{EventListener, HeaderBells};
use commram::devices::omega_drive_line_2::registers::LAYOUT_HASH;
use commram::memory::names::channel_root;
use commram::memory::{AttachMode, Attached, Image};
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

const LONG: Duration = Duration::from_secs(60);
const SYNC: usize = 12;
/// `<way>:<instance>`.
const ROLE: &str = "COMMRAM_TEST_EVENTS";
const WAYS: [&str; 3] = ["futex", "poll", "iceoryx2"];

fn attach(instance: &str) -> Attached {
    Image::attach(instance, "line", AttachMode::ReadWrite, Some(LAYOUT_HASH)).unwrap()
}

fn listen(instance: &str) -> EventListener {
    let bells = Box::new(HeaderBells::of_client(attach(instance)).unwrap());
    EventListener::connect(instance, &channel_root(instance).unwrap(), "line", bells).unwrap()
}

/// A PLC process that waits until the emulator ends, and prints each event count that it sees. It is not a test.
#[test]
fn child() {
    let Ok(role) = std::env::var(ROLE) else { return };
    let (way, instance) = role.split_once(':').unwrap();
    let image = attach(instance);
    let slot = &image.header().unwrap().events[SYNC];
    let listener = (way == "iceoryx2").then(|| listen(instance));
    let mut seen = slot.bell.rings();
    println!("\nready {seen}");
    loop {
        let now = match &listener {
            Some(listener) => match listener.wait(LONG) {
                Ok(events) => {
                    assert_eq!(events & !(1 << SYNC), 0, "no other event");
                    slot.bell.rings()
                }
                Err(_) => break,
            },
            None if way == "futex" => match image.wait_event(SYNC, seen, LONG) {
                Ok(rings) => rings,
                Err(_) => break,
            },
            None => {
                if image.check().is_err() {
                    break;
                }
                std::thread::sleep(Duration::from_micros(200));
                slot.bell.rings()
            }
        };
        if now != seen {
            println!("event {now} {}", slot.time_us.load());
            seen = now;
        }
    }
    println!("end {seen}");
}

struct Waiter {
    child: Child,
    lines: std::io::Lines<BufReader<std::process::ChildStdout>>,
    way: &'static str,
}

impl Waiter {
    fn start(way: &'static str, instance: &str) -> Self {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "events::child", "--nocapture"])
            .env(ROLE, format!("{way}:{instance}"))
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let mut waiter = Waiter { child, lines, way };
        waiter.next("ready");
        waiter
    }

    /// Returns the numbers of the next line with this prefix.
    fn next(&mut self, what: &str) -> Vec<u64> {
        loop {
            let line = self.lines.next().expect("the waiter goes on").unwrap();
            let mut words = line.split_whitespace();
            if words.next() == Some(what) {
                return words.map(|word| word.parse().unwrap()).collect();
            }
            assert!(!line.starts_with("end"), "{} has ended early", self.way);
        }
    }
}

impl Drop for Waiter {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn enable_sync(image: &Attached) {
    let header = image.header().unwrap();
    let request = header.interrupts[SYNC].ask(0, true);
    header.submit_request();
    image.wait_until("INTR_SET", LONG, |_| header.interrupts[SYNC].outcome(request)).unwrap();
}

/// In stepped mode each process sees the last count and time of each step. After 10 steps it has seen all events.
#[test]
fn stepped_events_reach_processes_in_three_ways_without_loss() {
    let emulator = Emulator::stepped();
    let image = attach(&emulator.name);
    active::activate(image.segment(), 1..=3, |us| drop(emulator.step(&[&format!("{us}us")])));
    emulator.step(&["--to-sync"]);
    enable_sync(&image);
    let mut waiters = WAYS.map(|way| Waiter::start(way, &emulator.name));
    let slot = &image.header().unwrap().events[SYNC];
    let first = slot.bell.rings();
    for step in 1..=10 {
        // Odd steps raise one event, even steps raise 49. So the test covers events that are raised together and may be
        // merged.
        emulator.step(&[if step % 2 == 1 { "2ms" } else { "98ms" }]);
        let (count, time) = (u64::from(slot.bell.rings()), slot.time_us.load());
        assert_eq!(count - u64::from(first), (step / 2) * 50 + step % 2);
        for waiter in &mut waiters {
            let way = waiter.way;
            // Many events may reach the listener in several parts. The test waits until all have arrived.
            let seen = std::iter::repeat_with(|| waiter.next("event")).find(|seen| seen[0] >= count).unwrap();
            assert_eq!(seen, [count, time], "{way}, step {step}");
        }
    }
}

/// In real time the processes follow the events and notice the end.
#[test]
fn real_time_events_reach_processes_in_three_ways() {
    let mut emulator = Emulator::start(&[]);
    let image = attach(&emulator.name);
    let header = image.header().unwrap();
    active::activate(image.segment(), 1..=3, |us| {
        let until = header.virtual_time_us.load() + us;
        assert!(crate::common::eventually(|| header.virtual_time_us.load() >= until));
    });
    enable_sync(&image);
    for way in WAYS {
        let mut waiter = Waiter::start(way, &emulator.name);
        let first = waiter.next("event");
        let mut last = first.clone();
        while last[0] < first[0] + 20 {
            let next = waiter.next("event");
            // The time is read after the count, so it may already belong to the next event.
            assert!(next[0] > last[0] && next[1] >= last[1], "{way}: {last:?} {next:?}");
            last = next;
        }
    }
    let mut waiters = WAYS.map(|way| Waiter::start(way, &emulator.name));
    emulator.run("stop", &[]).ok();
    emulator.wait();
    for waiter in &mut waiters {
        assert!(waiter.lines.by_ref().any(|line| line.unwrap().starts_with("end")), "{}", waiter.way);
    }
}

/// A killed listener does not affect the other listeners.
#[test]
fn a_killed_listener_does_not_disturb() {
    let emulator = Emulator::stepped();
    let image = attach(&emulator.name);
    active::activate(image.segment(), 1..=3, |us| drop(emulator.step(&[&format!("{us}us")])));
    enable_sync(&image);
    let dead = Waiter::start("iceoryx2", &emulator.name);
    let mut alive = Waiter::start("iceoryx2", &emulator.name);
    drop(dead);
    emulator.step(&["10ms"]);
    assert!(alive.next("event")[0] > 0);
}
