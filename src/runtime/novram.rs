//! The part of the RAM that survives power-off, kept in files.
//!
//! On the device the Ethernet configuration and the retain flags lie in NOVRAM (manual 5.00005.03a p. 41, 61).
//! commram keeps them in `<plc>.novram` in a directory of the user's choice: a new file beside it, synced, then
//! renamed over it, so that whenever the emulator is killed the file holds either the old or the new content. A file
//! that is not ours or is damaged is set aside, never overwritten. The directory belongs to one emulator at a time.
//!
//! The Ethernet configuration is written when it was stored, the retain flags once a second if they have changed, both
//! at the end. A thread of its own writes, because syncing takes longer than a CANsync interval. What cannot be written
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

use crate::devices::omega_drive_line_2::ethernet::Stored;
use crate::devices::omega_drive_line_2::registers::ETHERNET_CONFIG;
use crate::layout::flags::RETAIN_OFFSET;
use crate::memory::{Segment, Width};
use file::{Content, ETHERNET_SIZE};
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
    /// Number of the Ethernet configuration in it.
    generation: u32,
    /// To read retain flags into.
    scratch: Vec<u8>,
}

impl Novram {
    /// Restores the NOVRAM of PLC `plc`, with so many retain flags, from `directory`. The PLC's firmware must not have started yet.
    ///
    /// # Errors
    /// [`NovramError`] if the file cannot be read, or could not be written. A damaged file is no error, see [`Found`].
    pub fn power_on(
        directory: &Directory,
        plc: &str,
        segment: &Segment,
        retain_bytes: u32,
    ) -> Result<(Self, Found), NovramError> {
        let name = format!("{plc}.novram");
        let (content, found) = file::load(directory, &name)?;
        let novram = Novram {
            name,
            segment: segment.clone(),
            saved: content.at_least(retain_bytes as usize),
            generation: 0,
            scratch: vec![0; retain_bytes as usize],
        };
        for (offset, width, range) in registers() {
            let mut bytes = [0; 4];
            let part = &novram.saved.ethernet()[range];
            bytes[..part.len()].copy_from_slice(part);
            novram.segment.store(offset, width, u32::from_le_bytes(bytes))?;
        }
        // An image that was taken over is zeroed, so flags that are 0 need not be stored.
        let flags = novram.saved.retain().as_chunks::<4>().0;
        for (offset, bytes) in (RETAIN_OFFSET..RETAIN_OFFSET + retain_bytes).step_by(4).zip(flags) {
            if *bytes != [0; 4] {
                novram.segment.store(offset, Width::Dword, u32::from_le_bytes(*bytes))?;
            }
        }
        Ok((novram, found))
    }

    /// The content to write, if the Ethernet configuration was stored or, `retain` permitting, a retain flag has
    /// changed since last time.
    fn changed(&mut self, (ethernet, generation): (&Stored, u32), retain: bool) -> Option<Content> {
        let stored = generation != self.generation && self.saved.ethernet() != ethernet;
        self.generation = generation;
        let flags = retain && self.read_flags();
        if !stored && !flags {
            return None;
        }
        // Both, so that no file ever has less than the one before.
        if !flags {
            self.read_flags();
        }
        self.saved.replace(ethernet, &self.scratch);
        Some(self.saved.clone())
    }

    /// Reads the retain flags; tells whether they are others than in the file.
    fn read_flags(&mut self) -> bool {
        // They lie in the segment.
        self.segment.read_range(RETAIN_OFFSET, &mut self.scratch).is_ok()
            && !self.saved.retain().starts_with(&self.scratch)
    }
}

/// The registers of `ETHERNET_CONFIG_BMSTRUCT`, each with its place in the content: two DWORDs with two
/// USINT arrays between them (manual p. 76).
fn registers() -> impl Iterator<Item = (u32, Width, core::ops::Range<usize>)> {
    let dword = |at: usize| (ETHERNET_CONFIG as u32 + at as u32, Width::Dword, at..at + 4);
    let last = ETHERNET_SIZE - 4;
    let bytes = (4..last).map(|at: usize| (ETHERNET_CONFIG as u32 + at as u32, Width::Byte, at..at + 1));
    [dword(0)].into_iter().chain(bytes).chain([dword(last)])
}
