//! A host for tests: a plant with a clock that the test controls.

use super::{Code, Execution, Host, InstanceInfo, Op, Refused, Reply, Travel};
use crate::memory::{Segment, Width};
use crate::plant::{Plant, PlantConfig, PlantError};
use core::cell::Cell;
use core::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// An area of plain RAM: no firmware writes to it.
pub(crate) const RAM: Range<u32> = 1_000_000..1_262_144;

/// A plant of two PLCs. The first PLC is master of a bus with a drive. The processor cycle is 1 ms.
const PLANT: &str = r#"
processor_cycle_us = 1000

[[plc]]
name = "press"
node2 = "drives"

[[plc]]
name = "saw"

[[bus]]
name = "drives"

[[bus.drive]]
name = "drive"
slave_number = 1
"#;

pub(crate) struct TestHost {
    pub plant: Plant,
    pub is_stepped: bool,
    pub stop: Arc<AtomicBool>,
    /// Stores of another program, each with time, offset and value: a WORD in PLC 0.
    pub script: Vec<(u64, u32, u16)>,
    /// Number of calls that have advanced the plant.
    pub steps: usize,
    /// Number of requests that have begun.
    pub requests: usize,
    /// Raises `stop` at this time, in microseconds.
    pub stop_at: u64,
    /// True if operations pause at every opportunity, and continue for one part.
    pub pauses: bool,
    /// True if an operation has paused.
    has_paused: Cell<bool>,
    /// The clock waits for a participant that has its turn. The turn ends at the call of [`Host::advance_to`] with this
    /// number.
    pub turn_left: usize,
    /// True if the real-time clock of the test server is stopped.
    #[cfg_attr(not(feature = "channel"), expect(dead_code, reason = "for the tests of the channel"))]
    pub is_frozen: bool,
    travel: Travel,
    /// Description of participants outside of this process, if there are any.
    pub outsiders: Option<String>,
    /// While this is true, a return to an earlier moment does not begin.
    pub holds_returns: Arc<AtomicBool>,
}

impl TestHost {
    pub(crate) fn new(is_stepped: bool) -> Self {
        Self::of(&PlantConfig::parse("test", PLANT).unwrap(), is_stepped)
    }

    pub(crate) fn of(config: &PlantConfig, is_stepped: bool) -> Self {
        Self {
            plant: Plant::new(config, |_plc, device| Ok::<_, NoPlant>(Segment::of(device))).unwrap(),
            is_stepped,
            stop: Arc::default(),
            script: Vec::new(),
            steps: 0,
            requests: 0,
            stop_at: u64::MAX,
            pauses: false,
            has_paused: Cell::default(),
            turn_left: 0,
            is_frozen: false,
            travel: Travel::default(),
            outsiders: None,
            holds_returns: Arc::default(),
        }
    }

    /// Runs the plant up to time `t`, in either mode.
    pub(crate) fn run_to(&mut self, t: u64) {
        self.plant.advance_to(t);
        self.steps += 1;
        let due = self.script.extract_if(.., |(time, ..)| *time <= t);
        for (_, offset, value) in due {
            self.plant.devices()[0].segment().store(offset, Width::Word, value.into()).unwrap();
        }
        if t >= self.stop_at {
            self.stop.store(true, Ordering::Relaxed);
        }
    }

    /// Returns the time of the next action of the script.
    fn next_of_script(&self) -> u64 {
        let ahead = self.script.iter().map(|event| event.0).filter(|time| *time > self.plant.now());
        ahead.fold(u64::MAX, u64::min)
    }

    /// Writes a WORD of PLC 0 as another program does.
    #[cfg_attr(not(feature = "channel"), expect(dead_code, reason = "for the tests of the channel"))]
    pub(crate) fn store(&self, offset: u32, value: u16) {
        self.plant.devices()[0].segment().store(offset, Width::Word, value.into()).unwrap();
    }

    /// Executes operations up to the first refusal. No operation may wait.
    pub(crate) fn request(&mut self, ops: &[Op]) -> Vec<Reply> {
        self.begin_request();
        let (mut replies, mut execution) = (Vec::new(), Execution::default());
        for op in ops {
            match execution.run(self, op) {
                Ok(reply) => replies.push(reply.expect("it does not wait")),
                Err(refused) => {
                    replies.push(Reply::Error(refused));
                    break;
                }
            }
        }
        replies
    }

    /// Returns the refusal of an operation.
    #[track_caller]
    pub(crate) fn refused(&mut self, op: Op) -> Refused {
        match self.request(&[op]).pop() {
            Some(Reply::Error(refused)) => refused,
            other => panic!("{op:?} should be refused, got {other:?}"),
        }
    }

    /// Code and text of the refusal of an operation.
    #[track_caller]
    pub(crate) fn refusal(&mut self, op: Op) -> (Code, String) {
        let Refused { code, text, .. } = self.refused(op);
        (code, text)
    }
}

/// Reason why there is no plant.
#[derive(Debug, thiserror::Error)]
enum NoPlant {
    #[error(transparent)]
    Plant(#[from] PlantError),
    #[error(transparent)]
    Memory(#[from] crate::memory::MemoryError),
}

impl Host for TestHost {
    fn plant(&self) -> &Plant {
        &self.plant
    }

    fn plant_mut(&mut self) -> &mut Plant {
        &mut self.plant
    }

    fn plant_and_travel(&mut self) -> (&mut Plant, &mut Travel) {
        (&mut self.plant, &mut self.travel)
    }

    fn outsiders(&mut self) -> Option<String> {
        while self.holds_returns.load(Ordering::Relaxed) {
            std::thread::yield_now();
        }
        self.outsiders.clone()
    }

    fn is_stepped(&self) -> bool {
        self.is_stepped
    }

    fn begin_request(&mut self) {
        self.requests += 1;
    }

    fn next_event(&self) -> u64 {
        self.next_of_script().min(self.plant.next_event())
    }

    fn next_change(&self) -> u64 {
        self.next_of_script().min(self.plant.next_change())
    }

    fn advance_to(&mut self, t: u64) -> bool {
        assert!(self.is_stepped, "only the stepped clock may be advanced");
        self.turn_left = self.turn_left.saturating_sub(1);
        if self.turn_left > 0 {
            return false;
        }
        self.run_to(t);
        true
    }

    fn should_pause(&self) -> bool {
        self.pauses && !self.has_paused.replace(!self.has_paused.get())
    }

    fn info(&self) -> InstanceInfo {
        InstanceInfo {
            name: "test".into(),
            is_stepped: self.is_stepped,
            speed: if self.is_stepped { 0 } else { 1_000 },
            time_us: self.plant.now(),
            generation: 3,
            pid: std::process::id(),
            abi_version: 1,
            version: env!("CARGO_PKG_VERSION").into(),
            waits_for: None,
            names: self.plant.names(),
        }
    }

    fn request_stop(&mut self, _by: Option<u32>) {
        self.stop.store(true, Ordering::Relaxed);
    }

    fn should_stop(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}
