//! A test double of the emulator.

use super::{ChannelError, InstanceInfo, Machine, Unmapped};
use crate::fault::{Fault, FaultStatus, Refusal};
use crate::journal::Journal;
use crate::memory::header::{BoardSetting, BoardState};
use crate::memory::{ClockMode, Width};
use crate::plant::Forced;
use std::num::NonZeroU16;
use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The bytes that are mapped.
pub(crate) const MAPPED: Range<u32> = 1_000..200_000;

/// Two PLCs of plain bytes, a processor cycle of 1 ms, SYNC each 2 ms on node 1 of PLC 0.
pub(crate) struct Fake {
    memory: Vec<Vec<u8>>,
    /// Which setting came last, as DIP number, and its value, as LEDs.
    pub boards: Vec<BoardState>,
    now: u64,
    pub stepped: bool,
    pub journal: Journal,
    forces: Vec<Forced>,
    faults: Vec<FaultStatus>,
    pub stop: Arc<AtomicBool>,
    /// Stores of the "firmware": time, offset, value (WORD in PLC 0).
    pub script: Vec<(u64, u32, u16)>,
    /// Number of calls of `advance_to`.
    pub steps: usize,
    /// Number of requests that have begun.
    pub requests: usize,
    /// Raises `stop` at this time.
    pub stop_at: u64,
    /// Whether the real-time clock of the test server stands still.
    pub frozen: bool,
}

impl Fake {
    pub fn new(stepped: bool) -> Self {
        Self {
            memory: vec![vec![0; MAPPED.end as usize]; 2],
            boards: vec![BoardState::default(); 2],
            now: 0,
            stepped,
            journal: Journal::default(),
            forces: Vec::new(),
            faults: Vec::new(),
            stop: Arc::default(),
            script: Vec::new(),
            steps: 0,
            requests: 0,
            stop_at: u64::MAX,
            frozen: false,
        }
    }

    fn at(&self, plc: usize, offset: u32, len: usize) -> Result<Range<usize>, Unmapped> {
        assert!(plc < self.memory.len(), "the executor checks the PLC");
        let hole = (u64::from(offset)..u64::from(offset) + len as u64)
            .find(|at| !(u64::from(MAPPED.start)..u64::from(MAPPED.end)).contains(at));
        match hole {
            Some(at) => Err(Unmapped { offset: at as u32 }),
            None => Ok(offset as usize..offset as usize + len),
        }
    }

    fn register(&self, plc: usize, offset: u32, width: Width) -> Result<Range<usize>, Unmapped> {
        assert!(offset.is_multiple_of(width.bytes()), "the executor checks the alignment");
        self.at(plc, offset, width.bytes() as usize)
    }

    /// Runs the firmware up to time `t`, in either mode.
    pub fn run_to(&mut self, t: u64) {
        assert!(t >= self.now, "the time does not run backwards");
        self.now = t;
        self.steps += 1;
        for (time, offset, value) in std::mem::take(&mut self.script) {
            if time <= t {
                self.store(0, offset, Width::Word, value.into()).unwrap();
            } else {
                self.script.push((time, offset, value));
            }
        }
        if t >= self.stop_at {
            self.stop.store(true, Ordering::Relaxed);
        }
    }
}

impl Machine for Fake {
    fn plc_count(&self) -> usize {
        self.memory.len()
    }

    fn load(&self, plc: usize, offset: u32, width: Width) -> Result<u32, Unmapped> {
        let range = self.register(plc, offset, width)?;
        Ok(self.memory[plc][range].iter().rev().fold(0, |value, byte| value << 8 | u32::from(*byte)))
    }

    fn store(&mut self, plc: usize, offset: u32, width: Width, value: u32) -> Result<(), Unmapped> {
        assert!(value <= width.max_value(), "the executor checks the value");
        let range = self.register(plc, offset, width)?;
        let len = range.len();
        self.memory[plc][range].copy_from_slice(&value.to_le_bytes()[..len]);
        Ok(())
    }

    fn compare_exchange(
        &mut self,
        plc: usize,
        offset: u32,
        width: Width,
        current: u32,
        new: u32,
    ) -> Result<Result<u32, u32>, Unmapped> {
        let found = self.load(plc, offset, width)?;
        if found != current {
            return Ok(Err(found));
        }
        self.store(plc, offset, width, new)?;
        Ok(Ok(found))
    }

    fn read_range(&self, plc: usize, offset: u32, to: &mut [u8]) -> Result<(), Unmapped> {
        let range = self.at(plc, offset, to.len())?;
        to.copy_from_slice(&self.memory[plc][range]);
        Ok(())
    }

    fn now(&self) -> u64 {
        self.now
    }

    fn is_stepped(&self) -> bool {
        self.stepped
    }

    fn next_event(&self) -> u64 {
        let cycle = (self.now / 1_000 + 1) * 1_000;
        self.script.iter().map(|event| event.0).filter(|t| *t > self.now).fold(cycle, u64::min)
    }

    fn begin_request(&mut self) {
        self.requests += 1;
    }

    fn advance_to(&mut self, t: u64) {
        assert!(self.stepped, "only the stepped clock may be advanced");
        self.run_to(t);
    }

    fn next_sync(&self, plc: usize, node: u8) -> Option<u64> {
        (plc == 0 && node == 1).then_some((self.now / 2_000 + 1) * 2_000)
    }

    fn force(&mut self, forced: Forced) -> Result<(), ChannelError> {
        let Forced { plc, offset, width, value } = forced;
        let address = width.at(offset);
        self.store(plc.into(), offset, width, value).map_err(|_| ChannelError::Unmapped { address })?;
        self.forces.push(forced);
        Ok(())
    }

    fn unforce(&mut self, plc: u16, offset: u32) -> bool {
        let before = self.forces.len();
        self.forces.retain(|forced| (forced.plc, forced.offset) != (plc, offset));
        self.forces.len() < before
    }

    fn forces(&self) -> &[Forced] {
        &self.forces
    }

    fn board(&self, plc: usize) -> BoardState {
        self.boards[plc]
    }

    fn set_board(&mut self, plc: usize, setting: BoardSetting) {
        let (which, value) = setting.numbers();
        self.boards[plc] = BoardState { dip: which, leds: value, ..BoardState::default() };
    }

    fn journal(&self) -> &Journal {
        &self.journal
    }

    /// Takes any fault.
    fn add_fault(&mut self, fault: Fault) -> Result<u16, Refusal> {
        let id = self.faults.last().map_or(1, |last| last.id + 1);
        self.faults.push(FaultStatus { id, fault, acting: true, hits: 0 });
        Ok(id)
    }

    fn clear_faults(&mut self, id: Option<NonZeroU16>) -> Result<u16, Refusal> {
        let before = self.faults.len();
        self.faults.retain(|fault| id.is_some_and(|id| id.get() != fault.id));
        match (id, (before - self.faults.len()) as u16) {
            (Some(id), 0) => Err(Refusal::UnknownFault { id: id.get() }),
            (_, count) => Ok(count),
        }
    }

    fn faults(&self) -> Vec<FaultStatus> {
        self.faults.clone()
    }

    fn clear_findings(&mut self) {
        self.journal.clear_findings();
    }

    fn info(&self) -> InstanceInfo {
        InstanceInfo {
            name: "fake".into(),
            clock_mode: if self.stepped { ClockMode::Stepped } else { ClockMode::RealTime },
            speed: if self.stepped { 0 } else { 1_000 },
            time_us: self.now,
            generation: 3,
            pid: std::process::id(),
            layout_hash: 0x1234_5678_9ABC_DEF0,
            abi_version: 1,
            version: env!("CARGO_PKG_VERSION").into(),
            plcs: vec!["press".into(), "saw".into()],
            buses: vec!["drives".into()],
        }
    }

    fn request_stop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }

    fn should_stop(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}
