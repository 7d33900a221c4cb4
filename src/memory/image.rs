//! The emulator's side of an image file: create it or take it over, and remove it at the end.

mod claim;
mod site;

pub(super) use claim::LockableFile;

use super::{
    ClockMode, HEADER_SIZE, Header, MemoryError, Segment, State, View, Width, file::ImageFile, guard::Guard,
    header, process::ProcessId, room,
};
use crate::layout::DeviceLayout;
use memmap2::MmapRaw;
use rustix::{fs::FallocateFlags, io::Errno};
use site::ImageSite;
use std::{
    os::fd::{AsFd, AsRawFd, BorrowedFd},
    path::Path,
    sync::Arc,
};

/// Properties of an image that the emulator sets when it creates the image.
#[derive(Clone, Debug)]
pub struct ImageSpec {
    /// Layout of the device: its name, the hash of its register map and the length of its segment.
    pub device: &'static DeviceLayout,
    /// Source of the emulated time.
    pub clock_mode: ClockMode,
    /// Emulated time per real time x 1000; 0 in stepped mode.
    pub speed: u32,
    /// The processor cycle in microseconds.
    pub processor_cycle_us: u32,
}

/// The image file of a running emulator. It is locked for as long as this value lives, and removed when
/// it is dropped.
#[derive(Debug)]
pub struct Image {
    /// Declared before the file, so that it is dropped first.
    guard: Arc<Guard>,
    file: Arc<ImageFile>,
    segment: Segment,
    header: View<Header>,
    taken_over: Option<u32>,
    /// State to store when the image is dropped.
    end: State,
}

impl Image {
    /// Creates the image of a PLC, in state [`State::Starting`] and with all registers zero. The file has
    /// mode 0600. Once the registers have their start values, [`Image::set_ready`] lets clients in.
    ///
    /// The file of a killed emulator is taken over in place, so that clients that still map it reach the new emulator:
    /// its registers are zeroed and its generation is incremented.
    ///
    /// # Errors
    /// The names are invalid; another emulator runs ([`MemoryError::AlreadyRunning`]); a killed emulator with another
    /// register map has left the image ([`MemoryError::LeftByOther`]); the path exists but is not an image of this
    /// user, and stays unchanged; or the operating system refuses the operation.
    pub fn create(instance: &str, plc: &str, spec: &ImageSpec) -> Result<Image, MemoryError> {
        claim::enter(&ImageSite::new(instance, plc, spec)?)
    }

    fn take_over(file: ImageFile, spec: &ImageSpec) -> Result<Image, MemoryError> {
        let (before, found) = {
            let header = file.header()?;
            (header.firmware_pid.load(), header.layout_hash.load())
        };
        if found != spec.device.layout_hash {
            let (path, instance, expected) = (file.path, file.instance, spec.device.layout_hash);
            return Err(MemoryError::LeftByOther { path, instance, found, expected });
        }
        allocate(&file, spec.device.segment_size())?;
        let mut image = Self::map(file, spec.device.segment_size(), Some(before))?;
        image.header.state.store(State::Starting.code());
        image.zero_registers()?;
        image.fill(spec);
        Ok(image)
    }

    fn map(file: ImageFile, size: usize, taken_over: Option<u32>) -> Result<Image, MemoryError> {
        let map = MmapRaw::map_raw(&file.file).map_err(|error| file.failed("map", error))?;
        let (found, expected) = (map.len() as u64, size as u32);
        let segment = Segment::mapped(map, size, true).ok_or_else(|| MemoryError::TooShort {
            path: file.path.clone(),
            size: found,
            expected,
        })?;
        let header = segment.header()?;
        let guard = Arc::new(Guard::new(segment.first_byte(), segment.size(), file.file.as_raw_fd()));
        Ok(Self { guard, file: Arc::new(file), segment, header, taken_over, end: State::Stopped })
    }

    /// Zeroes all bytes after the header page. Does not shorten the file, because a shorter file would kill clients
    /// that access their map. The memory stays allocated, so that other processes cannot take it.
    fn zero_registers(&self) -> Result<(), MemoryError> {
        let mut registers = (HEADER_SIZE as u32..self.segment.size() as u32).step_by(4);
        registers.try_for_each(|offset| self.segment.store(offset, Width::Dword, 0))
    }

    /// Fills the header of an image in state [`State::Starting`]. If the image is taken over, bells keep their counts,
    /// because clients may wait on them.
    fn fill(&mut self, spec: &ImageSpec) {
        let header = &*self.header;
        let own = ProcessId::own();
        header.state.store(State::Starting.code());
        header.generation.increment();
        header.firmware_start.store(own.start);
        header.firmware_pid.store(own.pid);
        header.abi_version.store(header::ABI_VERSION);
        header.header_size.store(HEADER_SIZE as u32);
        header.segment_size.store(self.segment.size() as u32);
        header.clock_mode.store(spec.clock_mode.code());
        header.speed.store(spec.speed);
        header.processor_cycle_us.store(spec.processor_cycle_us);
        header.virtual_time_us.store(0);
        header.sync_counter.iter().for_each(|counter| counter.store(0));
        header::set_name(&header.instance, &self.file.instance);
        header::set_name(&header.plc, &self.file.plc);
        header.describe(spec.device);
        header.clear_board();
        // The previous owner of this bell is dead, because this process holds its lock.
        header.doorbell.forget_waiters();
        header.magic.store(header::MAGIC);
        header.announce();
    }

    /// Lets clients attach: the registers have their start values.
    pub fn set_ready(&self) {
        self.set_state(State::Ready);
    }

    /// Announces to clients that the emulator no longer answers.
    pub fn set_stopping(&self) {
        self.set_state(State::Stopping);
    }

    /// Records that changes in NOVRAM could not be saved. The process that has stopped the emulator reads this from the
    /// header page.
    pub fn set_unsaved(&mut self) {
        self.end = State::Unsaved;
    }

    fn set_state(&self, state: State) {
        self.header.state.store(state.code());
        self.header.announce();
    }

    /// Returns the other processes that have the registers mapped for writing, as text.
    #[cfg(feature = "emulator")]
    pub(crate) fn writers(&self) -> Vec<String> {
        super::writers::writers_of(&self.file.path)
    }

    /// Returns the emulated RAM.
    pub fn segment(&self) -> &Segment {
        &self.segment
    }

    /// Returns the header page.
    pub fn header(&self) -> &View<Header> {
        &self.header
    }

    /// Returns the image file.
    pub fn path(&self) -> &Path {
        &self.file.path
    }

    /// Returns the number of emulators that have used this file, from 1.
    pub fn generation(&self) -> u32 {
        self.header.generation.load()
    }

    /// True if another process has shortened the file while it was mapped; then the contents of the registers are lost.
    /// An access to the lost registers sets this immediately ([`super::survive_shortened_files`]); otherwise
    /// [`ImageFileWatch::look`] sets it.
    #[inline]
    pub fn was_shortened(&self) -> bool {
        self.guard.has_mended()
    }

    /// Like [`Image::was_shortened`], but checks the file now.
    pub fn is_shortened(&self) -> bool {
        self.guard.look();
        self.was_shortened()
    }

    /// Creates a watch to check the file from another thread. Must be dropped before the image.
    pub fn watch(&self) -> ImageFileWatch {
        ImageFileWatch {
            guard: Arc::clone(&self.guard),
            file: Arc::clone(&self.file),
            size: self.segment.size() as u64,
        }
    }

    /// Process id of the killed emulator from which this emulator has taken over the image.
    pub fn taken_over(&self) -> Option<u32> {
        self.taken_over
    }

    /// Removes the image of a killed emulator. Returns whether there was one.
    ///
    /// # Errors
    /// Returns the errors of [`Image::create`].
    pub fn remove_dead(instance: &str, plc: &str) -> Result<bool, MemoryError> {
        claim::remove_dead(&ImageSite::new(instance, plc, ())?)
    }
}

impl Drop for Image {
    fn drop(&mut self) {
        // An error cannot be reported here. If the file stays, the next emulator takes it over.
        let _ = self.file.unlink();
        // The state is set after the removal. So a process that reads the state `Stopped` can use the name for a new
        // image.
        self.set_state(self.end);
        // The unlock is the last step, because `commram stop` waits for it. Closing the file is not enough: it stays
        // open, and locked, while any part of this process has mapped the header page.
        let _ = self.file.file.unlock();
    }
}

/// Changes by others to an image file in use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileState {
    /// The file is unchanged.
    Intact,
    /// The file is longer than before; the added part is not used.
    Lengthened {
        /// New length of the file in bytes.
        size: u64,
    },
    /// The path of the file does not exist or names another file. Processes that have mapped the file continue.
    Removed,
    /// The file was shorter than its map. Its length is restored, but its contents are lost.
    Shortened,
}

/// An image file that can be checked from another thread.
#[derive(Debug)]
pub struct ImageFileWatch {
    guard: Arc<Guard>,
    file: Arc<ImageFile>,
    /// Expected length, in bytes.
    size: u64,
}

impl ImageFileWatch {
    /// Checks the file for changes by others. Restores the length of a shortened file.
    pub fn look(&self) -> FileState {
        self.guard.look();
        match (self.guard.has_mended(), self.file.size(), self.file.is_named()) {
            (true, ..) => FileState::Shortened,
            (_, Ok(size), _) if size > self.size => FileState::Lengthened { size },
            (.., Ok(false)) => FileState::Removed,
            _ => FileState::Intact,
        }
    }

    /// Returns the image file.
    pub fn path(&self) -> &Path {
        &self.file.path
    }
}

impl AsFd for ImageFileWatch {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.file.file.as_fd()
    }
}

/// Allocates all memory of the file at once. Otherwise, a later access to a page without memory would kill the process.
fn allocate(file: &ImageFile, needed: usize) -> Result<(), MemoryError> {
    match rustix::fs::fallocate(&file.file, FallocateFlags::empty(), 0, needed as u64) {
        Ok(()) => Ok(()),
        Err(Errno::NOSPC) => {
            let free_kib = room::free().unwrap_or(0) / 1024;
            Err(MemoryError::NoRoom { path: file.path.clone(), needed, free_kib })
        }
        // Some file systems do not support allocation.
        Err(Errno::OPNOTSUPP) if file.size()? < needed as u64 => {
            file.file.set_len(needed as u64).map_err(|error| file.failed("size", error))
        }
        Err(Errno::OPNOTSUPP) => Ok(()),
        Err(errno) => Err(file.failed("allocate", errno.into())),
    }
}

#[cfg(test)]
pub(super) mod tests;
