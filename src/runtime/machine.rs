//! The emulator as the channel sees it.

use super::emulator::Emulator;
use crate::channel::{ChannelError, InstanceInfo, Machine, Unmapped};
use crate::fault::{Fault, FaultStatus, Refusal};
use crate::journal::Journal;
use crate::memory::header::{BoardSetting, BoardState};
use crate::memory::{Segment, Width};
use crate::plant::{ForceError, Forced};
use core::num::NonZeroU16;

impl Emulator {
    /// The RAM of PLC `plc`, for an access at `offset`.
    fn segment(&self, plc: usize, offset: u32) -> Result<&Segment, Unmapped> {
        self.plant.devices().get(plc).map(|device| device.segment()).ok_or(Unmapped { offset })
    }
}

impl Machine for Emulator {
    fn plc_count(&self) -> usize {
        self.plant.devices().len()
    }

    fn load(&self, plc: usize, offset: u32, width: Width) -> Result<u32, Unmapped> {
        self.registers.load(self.segment(plc, offset)?, offset, width)
    }

    fn store(&mut self, plc: usize, offset: u32, width: Width, value: u32) -> Result<(), Unmapped> {
        self.registers.store(self.segment(plc, offset)?, offset, width, value)?;
        self.plant.note_channel_write(plc, offset, width.bytes() as u8, value);
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
        let outcome =
            self.registers.compare_exchange(self.segment(plc, offset)?, offset, width, current, new)?;
        if outcome.is_ok() {
            self.plant.note_channel_write(plc, offset, width.bytes() as u8, new);
        }
        Ok(outcome)
    }

    fn read_range(&self, plc: usize, offset: u32, to: &mut [u8]) -> Result<(), Unmapped> {
        self.registers.read_range(self.segment(plc, offset)?, offset, to)
    }

    fn now(&self) -> u64 {
        self.plant.now()
    }

    fn is_stepped(&self) -> bool {
        self.options.clock.is_stepped()
    }

    fn next_event(&self) -> u64 {
        self.plant.next_event().min(self.lockstep.next_turn())
    }

    fn begin_request(&mut self) {
        if self.options.clock.is_stepped() {
            self.look_at_rings();
        }
    }

    fn advance_to(&mut self, t: u64) {
        let stop = &self.stop;
        self.lockstep.advance(&mut self.plant, t, || stop.load(std::sync::atomic::Ordering::Acquire));
        self.tell_events();
    }

    fn next_sync(&self, plc: usize, node: u8) -> Option<u64> {
        self.plant.next_sync(plc, node)
    }

    fn force(&mut self, forced: Forced) -> Result<(), ChannelError> {
        let address = forced.width.at(forced.offset);
        self.plant.force(forced).map_err(|error| match error {
            ForceError::TooMany => ChannelError::TooManyForces { count: self.plant.forces().len() as u32 },
            ForceError::NotWhole { asked, right } => ChannelError::NotWhole { asked, right },
            ForceError::TooWide { address, value } => ChannelError::ValueTooWide { address, value },
            ForceError::NoSuchPlc | ForceError::NoArea(_) | ForceError::Memory(_) => {
                ChannelError::Unmapped { address }
            }
        })
    }

    fn unforce(&mut self, plc: u16, offset: u32) -> bool {
        self.plant.unforce(plc, offset)
    }

    fn forces(&self) -> &[Forced] {
        self.plant.forces()
    }

    fn board(&self, plc: usize) -> BoardState {
        self.plant.devices().get(plc).map(|device| device.board()).unwrap_or_default()
    }

    fn set_board(&mut self, plc: usize, setting: BoardSetting) {
        self.plant.set_board(plc, setting);
        self.announce();
    }

    fn journal(&self) -> &Journal {
        self.plant.journal()
    }

    fn add_fault(&mut self, fault: Fault) -> Result<u16, Refusal> {
        self.plant.add_fault(fault)
    }

    fn clear_faults(&mut self, id: Option<NonZeroU16>) -> Result<u16, Refusal> {
        match id {
            Some(id) => self.plant.clear_fault(id.get()).map(|()| 1),
            None => Ok(self.plant.clear_faults()),
        }
    }

    fn faults(&self) -> Vec<FaultStatus> {
        self.plant.faults().collect()
    }

    fn clear_findings(&mut self) {
        self.plant.clear_findings();
    }

    fn info(&self) -> InstanceInfo {
        let header = self.header();
        let names = self.plant.names();
        InstanceInfo {
            name: self.options.instance.clone(),
            clock_mode: self.options.clock.mode(),
            speed: header.speed.load(),
            time_us: self.plant.now(),
            generation: header.generation.load(),
            pid: header.firmware_pid.load(),
            layout_hash: header.layout_hash.load(),
            abi_version: header.abi_version.load(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            plcs: names.plcs,
            buses: names.buses,
        }
    }

    fn request_stop(&mut self) {
        self.stop.store(true, std::sync::atomic::Ordering::Release);
    }

    fn should_stop(&self) -> bool {
        self.is_stopping()
    }
}
