//! A plant in this process, on heap memory, with a stepped clock.

use super::ScenarioError;
use super::backend::{Backend, BackendError, Spot, Waited};
use crate::check::Entry;
use crate::devices::omega_drive_line_2::registers::{DEVICE, SEGMENT_END};
use crate::fault::Fault;
use crate::journal::{Names, Record};
use crate::memory::header::{BoardSetting, BoardState};
use crate::memory::{Address, HEADER_SIZE, RegisterWidths, Segment, Unmapped};
use crate::plant::{ForceError, Forced, Plant, PlantConfig};
use core::num::NonZeroU16;

/// A plant of its own.
pub(super) struct Local {
    plant: Plant,
    names: Names,
    widths: RegisterWidths,
}

impl Local {
    /// Builds the plant and powers it on.
    ///
    /// # Errors
    /// The plant is refused.
    pub fn new(config: &PlantConfig) -> Result<Self, ScenarioError> {
        let plant = Plant::new(config, |_plc| Ok::<_, ScenarioError>(Segment::heap(SEGMENT_END)))?;
        Ok(Self { names: plant.names(), plant, widths: RegisterWidths::of(&DEVICE) })
    }

    /// The plant; what its boards were asked for is answered first, as before a request through the channel.
    fn plant(&mut self) -> &mut Plant {
        self.plant.look_at_boards();
        &mut self.plant
    }

    fn name(&self, plc: u16) -> String {
        self.names.plcs.get(usize::from(plc)).cloned().unwrap_or_default()
    }

    fn ram(&self, plc: u16, offset: u32) -> Result<&Segment, Unmapped> {
        self.plant.devices().get(usize::from(plc)).map(|device| device.segment()).ok_or(Unmapped { offset })
    }

    fn note_write(&mut self, spot: Spot, value: u32) {
        // A width is 1, 2 or 4.
        self.plant.note_channel_write(spot.plc.into(), spot.offset, spot.width.bytes() as u8, value);
    }
}

fn unmapped(spot: Spot) -> impl Fn(Unmapped) -> BackendError {
    move |_| BackendError::Unmapped { address: spot.address() }
}

impl Backend for Local {
    fn names(&self) -> &Names {
        &self.names
    }

    fn now(&mut self) -> Result<u64, BackendError> {
        Ok(self.plant.now())
    }

    fn load(&mut self, spot: Spot) -> Result<u32, BackendError> {
        let Spot { plc, offset, width } = spot;
        self.plant();
        self.ram(plc, offset)
            .and_then(|segment| self.widths.load(segment, offset, width))
            .map_err(unmapped(spot))
    }

    fn store(&mut self, spot: Spot, value: u32) -> Result<(), BackendError> {
        let Spot { plc, offset, width } = spot;
        self.plant();
        self.ram(plc, offset)
            .and_then(|segment| self.widths.store(segment, offset, width, value))
            .map_err(unmapped(spot))?;
        self.note_write(spot, value);
        Ok(())
    }

    fn compare_exchange(
        &mut self,
        spot: Spot,
        current: u32,
        new: u32,
    ) -> Result<Result<u32, u32>, BackendError> {
        let Spot { plc, offset, width } = spot;
        self.plant();
        let outcome = self
            .ram(plc, offset)
            .and_then(|segment| self.widths.compare_exchange(segment, offset, width, current, new))
            .map_err(unmapped(spot))?;
        if outcome.is_ok() {
            self.note_write(spot, new);
        }
        Ok(outcome)
    }

    fn read_range(&mut self, plc: u16, offset: u32, len: u32) -> Result<Vec<u8>, BackendError> {
        let mut bytes = vec![0; len as usize];
        self.plant();
        self.ram(plc, offset)
            .and_then(|segment| self.widths.read_range(segment, offset, &mut bytes))
            .map_err(|hole| BackendError::Unmapped { address: Address::byte(hole.offset) })?;
        Ok(bytes)
    }

    fn advance(&mut self, us: u64) -> Result<u64, BackendError> {
        let plant = self.plant();
        plant.advance_to(plant.now().saturating_add(us));
        Ok(plant.now())
    }

    fn advance_to_sync(&mut self, plc: u16, node: u8) -> Result<u64, BackendError> {
        let Some(edge) = self.plant().next_sync(plc.into(), node) else {
            return Err(BackendError::NoSync { plc: self.name(plc), node });
        };
        self.plant.advance_to(edge);
        Ok(self.plant.now())
    }

    fn advance_to_event(&mut self, within_us: u64) -> Result<u64, BackendError> {
        let plant = self.plant();
        // Every event lies ahead, or handling it now makes it so.
        let event = plant.next_event().max(plant.now());
        plant.advance_to(event.min(plant.now().saturating_add(within_us)));
        Ok(plant.now())
    }

    fn wait(&mut self, spot: Spot, mask: u32, value: u32, within_us: u64) -> Result<Waited, BackendError> {
        let deadline = self.plant().now().saturating_add(within_us);
        loop {
            let found = self.load(spot)?;
            let matched = found & mask == value;
            let left_us = deadline.saturating_sub(self.plant.now());
            if matched || left_us == 0 {
                return Ok(Waited { matched, value: found });
            }
            self.advance_to_event(left_us)?;
        }
    }

    fn force(&mut self, spot: Spot, value: u32) -> Result<(), BackendError> {
        let Spot { plc, offset, width } = spot;
        let address = spot.address();
        self.plant().force(Forced { plc, offset, width, value }).map_err(|source| match source {
            ForceError::NoArea(_) | ForceError::Memory(_) => BackendError::Unmapped { address },
            source => BackendError::Force { address, source },
        })
    }

    fn unforce(&mut self, spot: Spot) -> Result<(), BackendError> {
        let forced = self.plant().unforce(spot.plc, spot.offset);
        if forced { Ok(()) } else { Err(BackendError::NotForced { address: spot.address() }) }
    }

    fn forces(&mut self) -> Result<Vec<Forced>, BackendError> {
        Ok(self.plant.forces().to_vec())
    }

    fn add_fault(&mut self, fault: Fault) -> Result<u16, BackendError> {
        self.plant().add_fault(fault).map_err(BackendError::Fault)
    }

    fn clear_faults(&mut self, number: Option<NonZeroU16>) -> Result<(), BackendError> {
        match number {
            Some(number) => self.plant().clear_fault(number.get()).map_err(BackendError::Fault),
            None => {
                self.plant().clear_faults();
                Ok(())
            }
        }
    }

    fn board(&mut self, plc: u16) -> Result<BoardState, BackendError> {
        Ok(self.plant().devices().get(usize::from(plc)).map(|device| device.board()).unwrap_or_default())
    }

    fn set_board(&mut self, plc: u16, setting: BoardSetting) -> Result<(), BackendError> {
        self.plant().set_board(plc.into(), setting);
        if matches!(setting, BoardSetting::Start(_)) && !self.board(plc)?.takes_starts() {
            return Err(BackendError::StartRefused { plc: self.name(plc) });
        }
        Ok(())
    }

    fn answer_boards(&mut self) -> Result<(), BackendError> {
        self.plant();
        Ok(())
    }

    fn findings(&mut self) -> Result<Vec<Entry>, BackendError> {
        Ok(self.plant().journal().findings().iter().copied().collect())
    }

    fn clear_findings(&mut self) -> Result<(), BackendError> {
        self.plant().clear_findings();
        Ok(())
    }

    fn segment(&mut self, plc: u16) -> Result<Segment, BackendError> {
        let segment = self.ram(plc, HEADER_SIZE as u32).cloned();
        segment.map_err(|hole| BackendError::Unmapped { address: Address::byte(hole.offset) })
    }

    fn journal_end(&mut self) -> Result<u64, BackendError> {
        Ok(self.plant().journal().end())
    }

    fn journal(&mut self, from: u64) -> Result<(Vec<Record>, u64), BackendError> {
        let journal = self.plant().journal();
        let records = journal.read(from).copied().chain(journal.pending()).collect();
        Ok((records, journal.end()))
    }
}
