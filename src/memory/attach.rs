//! The client's side of an image: attaches, exchanges registers, and detects the end of the emulator.

mod lockstep;

pub use lockstep::LockstepTask;

use super::{
    Bell, Header, Image, MemoryError, Segment, State, View, Width,
    file::{self, ImageFile},
};
use memmap2::MmapOptions;
use std::{
    path::Path,
    time::{Duration, Instant},
};

/// Interval at which a waiting client checks that the emulator still runs.
const LIVENESS: Duration = Duration::from_millis(100);
/// Interval at which a read-only client polls. Such a client cannot register as a waiter of a bell.
const READ_ONLY_POLL: Duration = Duration::from_millis(1);

/// Access rights of an attached client.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AttachMode {
    /// Read and write registers, ring bells and wait for them.
    ReadWrite,
    /// Read only. The memory is mapped read-only, so even a faulty program cannot write. The image of a
    /// dead emulator can be read, too.
    ReadOnly,
    /// Ring bells and wait for them, without access to the registers: only the header page is mapped. Clients of the
    /// channel attach in this mode, because the emulator can return to an earlier time only while no program has mapped
    /// the registers for writing.
    HeaderOnly,
}

/// The image of a running emulator, as mapped by a client. Dropping it detaches and changes nothing.
#[derive(Debug)]
pub struct Attached {
    file: ImageFile,
    segment: Segment,
    header: Option<View<Header>>,
    generation: u32,
}

impl Image {
    /// Attaches to the image of a PLC. `layout_hash` is the hash of the register map that the program
    /// was built with; a tool that takes the map from the image passes `None`.
    ///
    /// # Errors
    /// Each reason has its own error: bad name, no image, no regular file of this user, wrong magic, other ABI version,
    /// other layout, too short, emulator dead (for reading and writing only), not ready.
    pub fn attach(
        instance: &str,
        plc: &str,
        mode: AttachMode,
        expected_layout_hash: Option<u64>,
    ) -> Result<Attached, MemoryError> {
        let writable = mode != AttachMode::ReadOnly;
        let Some(file) = ImageFile::open(instance, plc, writable)? else {
            let path = super::names::image_path(instance, plc)?;
            return Err(MemoryError::NotThere { instance: instance.to_owned(), path });
        };
        let header = file.own_header()?;
        file.check_shape(&header)?;
        file.check_instance(&header)?;
        let maps = [header.layout_hash.load(), header.base_layout_hash.load()];
        if let Some(expected) = expected_layout_hash.filter(|hash| !maps.contains(hash)) {
            return Err(MemoryError::OtherLayout {
                path: file.path,
                device: super::header::name(&header.device),
                found: header.layout_hash.load(),
                expected,
            });
        }
        if file.is_alive(&header) {
            let state = State::from_code(header.state.load());
            if state != Some(State::Ready) {
                return Err(MemoryError::NotReady { path: file.path, state });
            }
        } else if writable {
            return Err(dead(&file, &header));
        }
        let size = match mode {
            AttachMode::ReadWrite | AttachMode::ReadOnly => header.segment_size.load() as usize,
            AttachMode::HeaderOnly => super::HEADER_SIZE,
        };
        Attached::map(file, writable, size, &header)
    }
}

fn map_segment(file: &ImageFile, size: usize, writable: bool) -> Result<Segment, MemoryError> {
    let mut options = MmapOptions::new();
    options.len(size);
    let map = if writable { options.map_raw(&file.file) } else { options.map_raw_read_only(&file.file) };
    let map = map.map_err(|error| file.failed("map", error))?;
    let found = map.len() as u64;
    Segment::mapped(map, size, writable).ok_or_else(|| MemoryError::TooShort {
        path: file.path.clone(),
        size: found,
        expected: size as u32,
    })
}

impl Attached {
    /// Maps the first `size` bytes. The caller has compared the length of the file with the header page, because bytes
    /// of a map after the end of its file cannot be accessed.
    fn map(file: ImageFile, writable: bool, size: usize, header: &Header) -> Result<Attached, MemoryError> {
        let segment = map_segment(&file, size, writable)?;
        let generation = header.generation.load();
        let header = if writable { Some(segment.header()?) } else { None };
        Ok(Attached { file, segment, header, generation })
    }

    /// Replaces the map by one of the header page only, for clients that do not access registers.
    ///
    /// # Errors
    /// The operating system refuses the operation.
    #[cfg(feature = "channel")]
    pub(crate) fn only_header(self) -> Result<Attached, MemoryError> {
        let Attached { file, segment, generation, .. } = self;
        let writable = segment.is_writable();
        drop(segment);
        let segment = map_segment(&file, super::HEADER_SIZE, writable)?;
        let header = if writable { Some(segment.header()?) } else { None };
        Ok(Attached { file, segment, header, generation })
    }

    /// Returns the emulated RAM.
    pub fn segment(&self) -> &Segment {
        &self.segment
    }

    /// Returns the header page.
    ///
    /// # Errors
    /// The image is attached read-only: use [`Attached::header_snapshot`] instead.
    pub fn header(&self) -> Result<&View<Header>, MemoryError> {
        self.header.as_ref().ok_or(MemoryError::ReadOnly { offset: 0 })
    }

    /// Returns a private copy of the header page.
    pub fn header_snapshot(&self) -> Box<Header> {
        self.segment.header_snapshot()
    }

    /// Returns the image file.
    pub fn path(&self) -> &Path {
        &self.file.path
    }

    /// Returns the emulator's generation at the time of attaching.
    pub fn generation(&self) -> u32 {
        self.generation
    }

    /// True if an emulator serves the image: the emulator to which this client attached, or a later one that has taken
    /// the image over.
    pub fn is_alive(&self) -> bool {
        self.file.is_alive(&self.header_snapshot())
    }

    /// True if the emulator to which this client attached has ended, or another one has taken the image over. Needs no system
    /// call, and so does not notice a killed emulator. The image must be attached for writing.
    #[cfg(feature = "channel")]
    pub(crate) fn has_ended(&self) -> bool {
        self.header.as_ref().is_some_and(|header| {
            header.generation.load() != self.generation
                || State::from_code(header.state.load()).is_some_and(State::is_over)
        })
    }

    /// Checks that the emulator to which this client attached still serves the image.
    ///
    /// # Errors
    /// The emulator has stopped, died, or been replaced by another one. In each case the registers have lost their
    /// settings, and the client must attach again.
    pub fn check(&self) -> Result<(), MemoryError> {
        let header = self.header_snapshot();
        self.check_page(&header)?;
        if self.file.is_alive(&header) { Ok(()) } else { Err(dead(&self.file, &header)) }
    }

    /// The part of [`Attached::check`] that needs no system call: it does not notice a killed emulator, except if another
    /// emulator has taken the image over. A program can call it before every access.
    ///
    /// # Errors
    /// The emulator has stopped, or been replaced by another one.
    pub fn check_header(&self) -> Result<(), MemoryError> {
        match &self.header {
            Some(header) => self.check_page(header),
            None => self.check_page(&self.header_snapshot()),
        }
    }

    /// Checks the words `generation` and `state` of the header page.
    fn check_page(&self, header: &Header) -> Result<(), MemoryError> {
        let found = header.generation.load();
        if found != self.generation {
            let path = self.file.path.clone();
            return Err(MemoryError::EmulatorRestarted { path, attached: self.generation, found });
        }
        match State::from_code(header.state.load()) {
            Some(state) if state.is_ending() => {
                Err(MemoryError::EmulatorStopped { path: self.file.path.clone() })
            }
            _ => Ok(()),
        }
    }

    /// Rings the doorbell, so that the firmware reads the registers now instead of at the next processor
    /// cycle. Makes a system call only if the firmware sleeps.
    ///
    /// # Errors
    /// The image is attached read-only.
    pub fn ring(&self) -> Result<(), MemoryError> {
        self.header()?.doorbell.ring();
        Ok(())
    }

    /// Stores to the register at `%MB3.offset` and rings.
    ///
    /// # Errors
    /// Returns the errors of [`Segment::store`].
    pub fn post(&self, offset: u32, width: Width, value: u32) -> Result<(), MemoryError> {
        self.segment.store(offset, width, value)?;
        self.ring()
    }

    /// Waits until the register at `%MB3.offset` satisfies `wanted`, and returns its value. `timeout` is
    /// real time, independent of the emulated time.
    ///
    /// # Errors
    /// Returns the errors of [`Segment::load`] and [`Attached::check`], or [`MemoryError::RegisterTimeout`]. A killed
    /// emulator is noticed within 100 ms.
    pub fn wait_register(
        &self,
        offset: u32,
        width: Width,
        timeout: Duration,
        wanted: impl Fn(u32) -> bool,
    ) -> Result<u32, MemoryError> {
        // The first load reports a bad address, so the later loads cannot fail.
        let mut last = self.segment.load(offset, width)?;
        let found = self.wait_on(self.answer(), timeout, || {
            last = self.segment.load(offset, width).unwrap_or(last);
            wanted(last).then_some(last)
        })?;
        found.ok_or(MemoryError::RegisterTimeout { address: width.at(offset), last, timeout })
    }

    /// Waits until `condition` returns a value. The function calls it again whenever the firmware has
    /// changed registers. `what` names the awaited condition in the message of a timeout; `timeout` is
    /// real time.
    ///
    /// # Errors
    /// Returns the errors of [`Attached::check`], or [`MemoryError::Timeout`]. A killed emulator is noticed within
    /// 100 ms.
    pub fn wait_until<R>(
        &self,
        what: &str,
        timeout: Duration,
        mut condition: impl FnMut(&Segment) -> Option<R>,
    ) -> Result<R, MemoryError> {
        let found = self.wait_on(self.answer(), timeout, || condition(&self.segment))?;
        found.ok_or_else(|| MemoryError::Timeout { what: what.to_owned(), timeout })
    }

    /// Waits until event `number` (0 to 15) has occurred more than `seen` times since the start. Returns the number of
    /// occurrences. `timeout` is real time.
    ///
    /// # Errors
    /// Returns the errors of [`Attached::check`], [`MemoryError::NoSuchEvent`], or [`MemoryError::Timeout`].
    pub fn wait_event(&self, number: usize, seen: u32, timeout: Duration) -> Result<u32, MemoryError> {
        let bell = self.header.as_ref().and_then(|header| header.events.get(number)).map(|event| &event.bell);
        if number >= super::header::EVENT_SLOTS {
            return Err(MemoryError::NoSuchEvent { number });
        }
        let found = self.wait_on(bell, timeout, || {
            let rings = match bell {
                Some(bell) => bell.rings(),
                None => self.header_snapshot().events.get(number)?.bell.rings(),
            };
            (rings != seen).then_some(rings)
        })?;
        found.ok_or_else(|| MemoryError::Timeout { what: format!("event {number}"), timeout })
    }

    fn answer(&self) -> Option<&Bell> {
        self.header.as_ref().map(|header| &header.answer)
    }

    /// Waits on `bell` (`None`: polls once per millisecond) until the condition returns a value; `None`
    /// on a timeout.
    fn wait_on<R>(
        &self,
        bell: Option<&Bell>,
        timeout: Duration,
        mut condition: impl FnMut() -> Option<R>,
    ) -> Result<Option<R>, MemoryError> {
        let start = Instant::now();
        let mut checked = start;
        loop {
            let seen = bell.map(Bell::rings);
            if let Some(found) = condition() {
                return Ok(Some(found));
            }
            let left = timeout.saturating_sub(start.elapsed());
            if left.is_zero() || checked.elapsed() >= LIVENESS {
                self.check()?;
                checked = Instant::now();
            } else {
                self.check_header()?;
            }
            if left.is_zero() {
                return Ok(None);
            }
            let nap = left.min(LIVENESS.saturating_sub(checked.elapsed()));
            match bell.zip(seen) {
                Some((bell, seen)) => drop(bell.wait(seen, Some(nap))),
                None => std::thread::sleep(nap.min(READ_ONLY_POLL)),
            }
        }
    }
}

/// Returns the reason why no emulator serves a dead image.
fn dead(file: &ImageFile, header: &Header) -> MemoryError {
    let path = file.path.clone();
    match State::from_code(header.state.load()) {
        Some(State::Stopped) => MemoryError::EmulatorStopped { path },
        _ => MemoryError::EmulatorDied { path, pid: file::emulator(header).pid },
    }
}

#[cfg(test)]
mod tests;
