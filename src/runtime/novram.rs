//! The part of the RAM that survives power-off, kept in files.
//!
//! The device and the plant file determine which registers and retain flags are in NOVRAM. commram stores them in
//! `<plc>.novram` in a directory of the user's choice. It writes a new file, syncs it and renames it. So the file has
//! either the old or the new content, even if the process is killed at any moment. A damaged file, or a file that is
//! not a NOVRAM file, is renamed, never overwritten. An emulator that finds a file of another version does not start.
//! Only one emulator at a time can use the directory.
//!
//! Registers are written to the file when the device has stored them. Retain flags are written once a second if they
//! have changed. At the end both are written. If another program has damaged or removed a file, the emulator restores
//! the file at the end. A separate thread writes the files, because syncing a file takes longer than an interval of a
//! bus. The thread retries failed writes until they succeed. A failure at the end is an error of the emulator.

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

/// Content of the NOVRAM at power-on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RestoreOutcome {
    /// The file does not exist yet: the device is in delivery state.
    Nothing,
    /// The content was restored.
    Content {
        /// True if a retain flag is not 0.
        retain: bool,
    },
    /// The file was damaged, or not a NOVRAM file, and was renamed. The device is in delivery state.
    SetAside {
        /// New path of the file.
        path: PathBuf,
        /// Paths of older files that were removed, because only the last eight are kept.
        removed: Vec<PathBuf>,
    },
}

/// The NOVRAM of one PLC.
#[derive(Debug)]
pub struct Novram {
    /// Name of the file.
    name: String,
    segment: Segment,
    /// Content of the file; while a write is in progress, the content that is being written.
    saved: Content,
    /// Generation number of the saved registers.
    generation: u32,
    /// Offset of the first retain flag.
    flags: u32,
    /// Buffer for reading retain flags.
    scratch: Vec<u8>,
}

impl Novram {
    /// Restores the NOVRAM of a device from `directory`; `None` if the device has none. Call it before the device's
    /// firmware starts.
    ///
    /// # Errors
    /// [`NovramError`] if the file cannot be read or written, or has another version. A damaged file is not an error,
    /// see [`RestoreOutcome`].
    pub fn power_on(
        directory: &Directory,
        device: &dyn DeviceConfig,
        segment: &Segment,
    ) -> Result<Option<(Self, RestoreOutcome)>, NovramError> {
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
        // All flags of an image are 0 at the start, even if the image was taken over. So flags with the value 0 need no
        // store.
        let flags = novram.saved.retain().as_chunks::<4>().0;
        for (offset, bytes) in (first..first + retain_bytes).step_by(4).zip(flags) {
            if *bytes != [0; 4] {
                novram.segment.store(offset, Width::Dword, u32::from_le_bytes(*bytes))?;
            }
        }
        Ok(Some((novram, found)))
    }

    /// Returns the content to write if the device has stored its registers, see
    /// [`Device::novram`](crate::devices::Device::novram), or if `retain` is set and a retain flag has changed since
    /// the last call.
    fn changed(&mut self, (registers, generation): (&[u8], u32), retain: bool) -> Option<Content> {
        let stored = generation != self.generation && self.saved.registers() != registers;
        self.generation = generation;
        let flags = retain && self.read_flags();
        if !stored && !flags {
            return None;
        }
        // A write always contains both flags and registers. The part that has not changed is written again.
        if !flags {
            self.read_flags();
        }
        self.saved.replace(registers, &self.scratch);
        Some(self.saved.clone())
    }

    /// Reads the retain flags; returns true if they differ from the file.
    fn read_flags(&mut self) -> bool {
        // The flags are inside the memory segment.
        self.segment.read_range(self.flags, &mut self.scratch).is_ok()
            && !self.saved.retain().starts_with(&self.scratch)
    }
}
