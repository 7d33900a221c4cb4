//! The emulator's side of an image file: create it or take it over, and remove it at the end.

mod claim;
mod place;

pub(super) use claim::Claimed;

use super::{
    ClockMode, HEADER_SIZE, Header, MemoryError, Segment, State, View, Width, file::ImageFile, guard::Guard,
    header, process::ProcessId, room,
};
use crate::layout::Device;
use memmap2::MmapRaw;
use place::Place;
use rustix::{fs::FallocateFlags, io::Errno};
use std::{
    os::fd::{AsFd, AsRawFd, BorrowedFd},
    path::Path,
    sync::Arc,
};

/// What the creator of an image tells its clients.
#[derive(Clone, Debug)]
pub struct ImageSpec {
    /// The device: its name, the hash of its register map and the length of its segment.
    pub device: &'static Device,
    /// What drives the emulated time.
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
    /// Before the file.
    guard: Arc<Guard>,
    file: Arc<ImageFile>,
    segment: Segment,
    header: View<Header>,
    taken_over: Option<u32>,
    /// Its state at the end.
    end: State,
}

impl Image {
    /// Creates the image of a PLC, in state [`State::Starting`] and with all registers zero. The file has
    /// mode 0600. Once the registers have their start values, [`Image::set_ready`] lets clients in.
    ///
    /// A file that a killed emulator has left is taken over in place, so that clients that still map it
    /// meet the new emulator: its registers are zeroed and its generation counts up.
    ///
    /// # Errors
    /// Bad names; another emulator runs ([`MemoryError::AlreadyRunning`]); an emulator with another register map
    /// has left the image ([`MemoryError::LeftByOther`]); the path names something
    /// that is not an image of our own, which is then left alone; or the system refuses.
    pub fn create(instance: &str, plc: &str, spec: &ImageSpec) -> Result<Image, MemoryError> {
        claim::enter(&Place::new(instance, plc, spec)?)
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
        let guard = Arc::new(Guard::new(segment.base(), segment.size(), file.file.as_raw_fd()));
        Ok(Self { guard, file: Arc::new(file), segment, header, taken_over, end: State::Stopped })
    }

    /// Zeroes everything behind the header page without ever shortening the file, which would kill
    /// clients that touch their map. Nor is its memory given back, which others could take meanwhile.
    fn zero_registers(&self) -> Result<(), MemoryError> {
        let mut registers = (HEADER_SIZE as u32..self.segment.size() as u32).step_by(4);
        registers.try_for_each(|offset| self.segment.store(offset, Width::Dword, 0))
    }

    /// Fills the header of an image in state starting. The bells go on counting over a takeover, because
    /// clients may be waiting on them.
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
        // Whoever held this bell is dead, we hold its lock.
        header.doorbell.forget_waiters();
        header.magic.store(header::MAGIC);
        header.announce();
    }

    /// Lets clients in: the registers have their start values.
    pub fn set_ready(&self) {
        self.set_state(State::Ready);
    }

    /// Tells clients that nothing is answered any more.
    pub fn set_stopping(&self) {
        self.set_state(State::Stopping);
    }

    /// Notes for who has asked for the end that what has changed in NOVRAM could not be written.
    pub fn set_unsaved(&mut self) {
        self.end = State::Unsaved;
    }

    fn set_state(&self, state: State) {
        self.header.state.store(state.code());
        self.header.announce();
    }

    /// The other processes that have its registers mapped for writing, for people.
    #[cfg(feature = "emulator")]
    pub(crate) fn writers(&self) -> Vec<String> {
        super::mapped::writers_of(&self.file.path)
    }

    /// The emulated RAM.
    pub fn segment(&self) -> &Segment {
        &self.segment
    }

    /// The header page.
    pub fn header(&self) -> &View<Header> {
        &self.header
    }

    /// The image file.
    pub fn path(&self) -> &Path {
        &self.file.path
    }

    /// Counts the emulators that have used this file, from 1.
    pub fn generation(&self) -> u32 {
        self.header.generation.load()
    }

    /// Whether somebody has shortened the file while it was mapped. What the registers held is lost then. Known at once
    /// if anybody in this process has touched them since ([`super::survive_shortened_files`]), else after
    /// [`ImageFileWatch::look`].
    #[inline]
    pub fn was_shortened(&self) -> bool {
        self.guard.has_mended()
    }

    /// To look from another thread whether somebody changes the file. Must be dropped before the image.
    pub fn watch(&self) -> ImageFileWatch {
        ImageFileWatch {
            guard: Arc::clone(&self.guard),
            file: Arc::clone(&self.file),
            size: self.segment.size() as u64,
        }
    }

    /// Process id of the killed emulator whose image this one has taken over, if it has.
    pub fn taken_over(&self) -> Option<u32> {
        self.taken_over
    }

    /// Removes the image a killed emulator has left. Returns whether there was one.
    ///
    /// # Errors
    /// As [`Image::create`].
    pub fn remove_dead(instance: &str, plc: &str) -> Result<bool, MemoryError> {
        claim::remove_dead(&Place::new(instance, plc, ())?)
    }
}

impl Drop for Image {
    fn drop(&mut self) {
        // Nobody is left to be told; the file then is a dead one, which the next emulator takes over.
        let _ = self.file.unlink();
        // After that, so that who sees this finds the name free.
        self.set_state(self.end);
        // Last, because it ends the wait of `commram stop`. A map of the header page would keep the file open, and the lock
        // with it, as long as anything of this process has it.
        let _ = self.file.file.unlock();
    }
}

/// What others have done to an image file that is in use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileState {
    /// Nothing.
    Intact,
    /// It is longer than it was; nobody looks there.
    Lengthened {
        /// Its length in bytes.
        size: u64,
    },
    /// Its path names nothing or something else; who has mapped it goes on.
    Removed,
    /// It was shorter than its map. It has its length again, but what it held is lost.
    Shortened,
}

/// An image file, to be looked at from another thread.
#[derive(Debug)]
pub struct ImageFileWatch {
    guard: Arc<Guard>,
    file: Arc<ImageFile>,
    /// The length it should have, in bytes.
    size: u64,
}

impl ImageFileWatch {
    /// What others have done to the file. One that was shortened gets its length back.
    pub fn look(&self) -> FileState {
        self.guard.look();
        match (self.guard.has_mended(), self.file.size(), self.file.is_named()) {
            (true, ..) => FileState::Shortened,
            (_, Ok(size), _) if size > self.size => FileState::Lengthened { size },
            (.., Ok(false)) => FileState::Removed,
            _ => FileState::Intact,
        }
    }

    /// The image file.
    pub fn path(&self) -> &Path {
        &self.file.path
    }
}

impl AsFd for ImageFileWatch {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.file.file.as_fd()
    }
}

/// Gives the file all its memory now: later, a page that cannot be had would kill whoever touches it.
fn allocate(file: &ImageFile, needed: usize) -> Result<(), MemoryError> {
    match rustix::fs::fallocate(&file.file, FallocateFlags::empty(), 0, needed as u64) {
        Ok(()) => Ok(()),
        Err(Errno::NOSPC) => {
            let free_kib = room::free().unwrap_or(0) / 1024;
            Err(MemoryError::NoRoom { path: file.path.clone(), needed, free_kib })
        }
        // Not every file system can.
        Err(Errno::OPNOTSUPP) if file.size()? < needed as u64 => {
            file.file.set_len(needed as u64).map_err(|error| file.failed("size", error))
        }
        Err(Errno::OPNOTSUPP) => Ok(()),
        Err(errno) => Err(file.failed("allocate", errno.into())),
    }
}

#[cfg(test)]
pub(super) mod tests;
