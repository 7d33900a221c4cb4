//! Runs a request against a [`Machine`].
//!
//! In stepped mode a request always runs to its end, letting the time pass where it asks for that. In
//! real time a wait cannot do so: [`Run::go`] returns [`Progress::Waiting`], and the caller calls it
//! again after every firmware step.

use super::op::{MAX_ADVANCE_US, MAX_OPS, MAX_RANGE, MAX_RECORDS};
use super::wire::{ReplyBuffer, WireOp};
use super::{ChannelError, Machine, Op};
use crate::memory::header::BoardSetting;
use crate::memory::{Address, Width};
use crate::plant::Forced;

/// Longest advance between two looks at [`Machine::should_stop`]: 100 ms of emulated time.
const SLICE_US: u64 = 100_000;

/// Whether a request is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// All operations are answered, or one of them by an error.
    Done,
    /// A wait goes on; try again after the next firmware step.
    Waiting,
}

/// A request under way.
#[derive(Debug, Default)]
pub struct Run {
    /// Position of the next operation.
    next: usize,
    /// End of the wait under way, in emulated microseconds.
    deadline: Option<u64>,
    /// The replies so far.
    pub replies: ReplyBuffer,
}

impl Run {
    /// Makes it ready for another request; the reply buffer's memory stays.
    pub fn reset(&mut self) {
        self.next = 0;
        self.deadline = None;
        self.replies.clear();
    }

    /// Executes `ops` from where the last call stopped. They are read once each, so it does no harm if a
    /// hostile client changes them meanwhile.
    pub fn go(&mut self, machine: &mut dyn Machine, ops: &[WireOp]) -> Progress {
        if ops.len() > MAX_OPS {
            let count = u32::try_from(ops.len()).unwrap_or(u32::MAX);
            self.replies.error(&ChannelError::TooManyOperations { count });
            return Progress::Done;
        }
        if self.next == 0 && self.deadline.is_none() {
            machine.begin_request();
        }
        while let Some(wire) = ops.get(self.next) {
            let outcome = decode(self.next, *wire).and_then(|op| self.execute(machine, op));
            match outcome {
                Ok(Progress::Done) => self.next += 1,
                Ok(Progress::Waiting) => return Progress::Waiting,
                Err(error) => {
                    self.replies.error(&error);
                    return Progress::Done;
                }
            }
        }
        Progress::Done
    }

    /// Ends a request that waits, because the emulator ends.
    pub fn abort(&mut self) {
        self.replies.error(&ChannelError::ShuttingDown);
    }

    fn execute(&mut self, machine: &mut dyn Machine, op: Op) -> Result<Progress, ChannelError> {
        match op {
            Op::Peek { plc, offset, width } => {
                let register = Register::check(machine, plc, offset, width)?;
                self.replies.value(register.load(machine)?)?;
            }
            Op::Poke { plc, offset, width, value } => {
                let register = Register::check(machine, plc, offset, width)?;
                register.fits(value)?;
                let Register { plc, address } = register;
                machine.store(plc, offset, width, value).map_err(|_| ChannelError::Unmapped { address })?;
                self.replies.written()?;
            }
            Op::CompareExchange { plc, offset, width, current, new } => {
                let register = Register::check(machine, plc, offset, width)?;
                register.fits(current)?;
                register.fits(new)?;
                let Register { plc, address } = register;
                let outcome = machine
                    .compare_exchange(plc, offset, width, current, new)
                    .map_err(|_| ChannelError::Unmapped { address })?;
                self.replies.exchanged(outcome)?;
            }
            Op::ReadRange { plc, offset, len } => self.read_range(machine, plc, offset, len)?,
            Op::Wait { plc, offset, width, mask, value, within_us } => {
                let register = Register::check(machine, plc, offset, width)?;
                register.fits(mask)?;
                register.fits(value)?;
                if value & !mask != 0 {
                    return Err(ChannelError::NeverMatches { address: register.address, mask, value });
                }
                return self.wait(machine, register, mask, value, within_us);
            }
            Op::Advance { us } => {
                stepped(machine)?;
                limit(us)?;
                let target = machine.now().saturating_add(us);
                advance(machine, target)?;
                self.replies.advanced(machine.now())?;
            }
            Op::AdvanceToSync { plc, node } => {
                stepped(machine)?;
                let number = known_plc(machine, plc)?;
                let sync = machine.next_sync(number, node).ok_or(ChannelError::NoSync { plc, node })?;
                limit(sync.saturating_sub(machine.now()))?;
                advance(machine, sync)?;
                self.replies.advanced(machine.now())?;
            }
            Op::AdvanceToEvent { within_us } => {
                stepped(machine)?;
                limit(within_us)?;
                let latest = machine.now().saturating_add(within_us);
                advance_to_event(machine, latest);
                self.replies.advanced(machine.now())?;
            }
            Op::Journal { from, max } => {
                self.replies.journal(machine.journal(), from, max.min(MAX_RECORDS) as usize)?;
            }
            Op::Force { plc, offset, width, value } => {
                Register::check(machine, plc, offset, width)?.fits(value)?;
                machine.force(Forced { plc, offset, width, value })?;
                self.replies.written()?;
            }
            Op::Unforce { plc, offset, width } => {
                let Register { address, .. } = Register::check(machine, plc, offset, width)?;
                if !machine.unforce(plc, offset) {
                    return Err(ChannelError::NotForced { address });
                }
                self.replies.written()?;
            }
            Op::Forces => self.replies.forces(machine.forces())?,
            Op::FaultAdd { fault } => {
                let id = machine.add_fault(fault).map_err(ChannelError::Fault)?;
                self.replies.fault_added(id)?;
            }
            Op::FaultList => self.replies.faults(&machine.faults())?,
            Op::FaultClear { id } => {
                let count = machine.clear_faults(id).map_err(ChannelError::Fault)?;
                self.replies.faults_cleared(count)?;
            }
            Op::Board { plc } => {
                let plc = known_plc(machine, plc)?;
                self.replies.board(&machine.board(plc))?;
            }
            Op::SetBoard { plc, setting } => {
                let number = known_plc(machine, plc)?;
                machine.set_board(number, setting);
                if matches!(setting, BoardSetting::Start(_)) && !machine.board(number).takes_starts() {
                    return Err(ChannelError::StartRefused { plc });
                }
                self.replies.written()?;
            }
            Op::Findings => self.replies.findings(machine.journal().findings())?,
            Op::ClearFindings => {
                machine.clear_findings();
                self.replies.cleared()?;
            }
            Op::Info => self.replies.info(&machine.info())?,
            Op::Stop => {
                machine.request_stop();
                self.replies.stopping()?;
            }
        }
        Ok(Progress::Done)
    }

    fn read_range(
        &mut self,
        machine: &dyn Machine,
        plc: u16,
        offset: u32,
        len: u32,
    ) -> Result<(), ChannelError> {
        let plc = known_plc(machine, plc)?;
        if len > MAX_RANGE {
            return Err(ChannelError::RangeTooLong { offset, len });
        }
        self.replies.bytes(len as usize, |to| {
            machine.read_range(plc, offset, to).map_err(|hole| ChannelError::RangeUnmapped {
                offset,
                len,
                hole: hole.offset,
            })
        })
    }

    fn wait(
        &mut self,
        machine: &mut dyn Machine,
        register: Register,
        mask: u32,
        value: u32,
        within_us: u64,
    ) -> Result<Progress, ChannelError> {
        limit(within_us)?;
        let deadline = match self.deadline {
            Some(deadline) => deadline,
            None => *self.deadline.insert(machine.now().saturating_add(within_us)),
        };
        loop {
            let found = register.load(machine)?;
            let now = machine.now();
            if found & mask == value {
                self.deadline = None;
                self.replies.waited(now, found)?;
                return Ok(Progress::Done);
            }
            if now >= deadline {
                let address = register.address;
                return Err(ChannelError::WaitTimedOut { address, last: found, time_us: now });
            }
            if machine.should_stop() {
                return Err(ChannelError::ShuttingDown);
            }
            if !machine.is_stepped() {
                return Ok(Progress::Waiting);
            }
            advance_to_event(machine, deadline.min(now.saturating_add(SLICE_US)));
        }
    }
}

/// A register whose PLC exists and whose address suits its width.
#[derive(Clone, Copy)]
struct Register {
    plc: usize,
    address: Address,
}

impl Register {
    fn check(machine: &dyn Machine, plc: u16, offset: u32, width: Width) -> Result<Self, ChannelError> {
        let plc = known_plc(machine, plc)?;
        let address = width.at(offset);
        if !offset.is_multiple_of(width.bytes()) {
            return Err(ChannelError::Misaligned { address });
        }
        Ok(Self { plc, address })
    }

    fn fits(self, value: u32) -> Result<(), ChannelError> {
        let address = self.address;
        if value > address.width().max_value() {
            return Err(ChannelError::ValueTooWide { address, value });
        }
        Ok(())
    }

    fn load(self, machine: &dyn Machine) -> Result<u32, ChannelError> {
        let Register { plc, address } = self;
        machine.load(plc, address.offset(), address.width()).map_err(|_| ChannelError::Unmapped { address })
    }
}

fn decode(index: usize, wire: WireOp) -> Result<Op, ChannelError> {
    Op::try_from(wire).map_err(|bad| ChannelError::Malformed {
        index: index as u16, // at most MAX_OPS
        field: bad.field,
        value: bad.value,
    })
}

fn known_plc(machine: &dyn Machine, plc: u16) -> Result<usize, ChannelError> {
    let count = machine.plc_count();
    if usize::from(plc) < count {
        return Ok(plc.into());
    }
    Err(ChannelError::UnknownPlc { plc, count: u16::try_from(count).unwrap_or(u16::MAX) })
}

fn stepped(machine: &dyn Machine) -> Result<(), ChannelError> {
    if machine.is_stepped() { Ok(()) } else { Err(ChannelError::ClockIsRealTime) }
}

fn limit(us: u64) -> Result<(), ChannelError> {
    if us > MAX_ADVANCE_US { Err(ChannelError::AdvanceTooLong { us }) } else { Ok(()) }
}

/// Goes to the next event, at the latest to time `latest`, which is not past.
fn advance_to_event(machine: &mut dyn Machine, latest: u64) {
    let event = machine.next_event().max(machine.now());
    machine.advance_to(event.min(latest));
}

/// Goes to time `target` in slices, so that an hour of emulated time does not make the emulator deaf.
fn advance(machine: &mut dyn Machine, target: u64) -> Result<(), ChannelError> {
    loop {
        let now = machine.now();
        if now >= target {
            return Ok(());
        }
        if machine.should_stop() {
            return Err(ChannelError::ShuttingDown);
        }
        machine.advance_to(target.min(now.saturating_add(SLICE_US)));
    }
}

#[cfg(test)]
mod tests;
