//! The part of the RAM that survives power-off, kept in files.
//!
//! What a device has in NOVRAM, registers and retain flags, its description in the plant tells. commram keeps them in `<plc>.novram` in a directory of the user's choice: a new file beside it, synced, then
//! renamed over it, so that whenever the emulator is killed the file holds either the old or the new content. A file
//! that is not ours or is damaged is set aside, never overwritten. The directory belongs to one emulator at a time.
//!
//! The registers are written when the device has stored them, the retain flags once a second if they have changed, both
//! at the end. A thread of its own writes, because syncing takes longer than an interval of a bus. What cannot be written
//! is tried again until it can; what cannot be written at the end either is an error of the emulator.

mod directory;
mod error;
mod file;
#[cfg(test)]
mod tests;
mod writer;

pub use directory::Directory;
pub use error::NovramError;
pub use writer::Keeper;

use crate::devices::DeviceConfig;
use crate::memory::{Segment, Width};
use file::{Content, Size};
use std::path::PathBuf;

/// What was found at power-on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Found {
    /// No file yet: delivery state.
    Nothing,
    /// The content was restored.
    Content {
        /// Whether there are retain flags that are not 0.
        retain: bool,
    },
    /// The file was damaged or foreign; it now has this name, and the device is in delivery state.
    SetAside(PathBuf),
}

/// The NOVRAM of one PLC.
#[derive(Debug)]
pub struct Novram {
    /// Name of the file.
    name: String,
    segment: Segment,
    /// What is in the file, or on its way there.
    saved: Content,
    /// Number of the registers' content in it.
    generation: u32,
    /// Where the first retain flag lies.
    flags: u32,
    /// To read retain flags into.
    scratch: Vec<u8>,
}

impl Novram {
    /// Restores the NOVRAM of a device from `directory`; `None` if it has none. The device's firmware must not have started
    /// yet.
    ///
    /// # Errors
    /// [`NovramError`] if the file cannot be read, or could not be written. A damaged file is no error, see [`Found`].
    pub fn power_on(
        directory: &Directory,
        device: &dyn DeviceConfig,
        segment: &Segment,
    ) -> Result<Option<(Self, Found)>, NovramError> {
        let retain_bytes = device.retain_bytes();
        let kept = device.novram().and_then(|area| Some((area, area.structures.first()?)));
        let bytes = kept.map_or(0, |(_, placed)| placed.structure.bytes) as usize;
        if bytes == 0 && retain_bytes == 0 {
            return Ok(None);
        }
        let name = format!("{}.novram", device.name());
        let retain = device.layout().retain.map(|retain| &retain.area);
        let size = Size { registers: bytes, flags: retain.map_or(0, |area| area.bytes) as usize };
        let (content, found) = file::load(directory, &name, size)?;
        let first = retain.map_or(0, |area| area.first);
        let novram = Novram {
            name,
            segment: segment.clone(),
            saved: content.at_least(retain_bytes as usize),
            generation: 0,
            flags: first,
            scratch: vec![0; retain_bytes as usize],
        };
        for register in kept.into_iter().flat_map(|(area, placed)| area.registers_of(placed)) {
            let part = novram.saved.registers().iter().skip(register.offset_in_structure() as usize);
            let mut bytes = [0; 4];
            let width = Width::of(register.ty());
            bytes.iter_mut().take(width.bytes() as usize).zip(part).for_each(|(to, from)| *to = *from);
            novram.segment.store(register.offset(), width, u32::from_le_bytes(bytes))?;
        }
        // An image that was taken over is zeroed, so flags that are 0 need not be stored.
        let flags = novram.saved.retain().as_chunks::<4>().0;
        for (offset, bytes) in (first..first + retain_bytes).step_by(4).zip(flags) {
            if *bytes != [0; 4] {
                novram.segment.store(offset, Width::Dword, u32::from_le_bytes(*bytes))?;
            }
        }
        Ok(Some((novram, found)))
    }

    /// The content to write, if the registers were stored, see [`Device::novram`](crate::devices::Device::novram), or,
    /// `retain` permitting, a retain flag has changed since last time.
    fn changed(&mut self, (registers, generation): (&[u8], u32), retain: bool) -> Option<Content> {
        let stored = generation != self.generation && self.saved.registers() != registers;
        self.generation = generation;
        let flags = retain && self.read_flags();
        if !stored && !flags {
            return None;
        }
        // Both, so that no file ever has less than the one before.
        if !flags {
            self.read_flags();
        }
        self.saved.replace(registers, &self.scratch);
        Some(self.saved.clone())
    }

    /// Reads the retain flags; tells whether they are others than in the file.
    fn read_flags(&mut self) -> bool {
        // They lie in the segment.
        self.segment.read_range(self.flags, &mut self.scratch).is_ok()
            && !self.saved.retain().starts_with(&self.scratch)
    }
}
