//! Keeps a process alive when an image, or a part of the channel, is shortened while it is mapped.
//!
//! An access to a mapped page after the end of the file raises SIGBUS, which ends the process without a message. The
//! handler here restores the length of the file with zeros and records the loss, so that the emulator can report the
//! fault and end normally. The contents of the registers are lost. A missing part of the channel is replaced by private
//! zeros ([`gap`]).

mod gap;

#[cfg(feature = "channel")]
pub(crate) use gap::channel_has_gaps;
#[cfg(feature = "web")]
pub(crate) use gap::{page_size, take_gap_of_thread};

use core::sync::atomic::{AtomicBool, AtomicI32, AtomicUsize, Ordering};
use rustix::fs::FallocateFlags;
use std::io;
use std::os::fd::{BorrowedFd, RawFd};

/// Bytes of a block, the unit in which the kernel counts the memory of a file.
const BLOCK: usize = 512;
/// Images of one process that can be guarded at the same time.
const MAX_GUARDED: usize = 256;
/// If a fault (SIGBUS) is in a file that has its full length, another thread may have just repaired it, so the access
/// is tried again. After this number of consecutive faults memory must be missing, and the handler gives up.
const MAX_TRIES: usize = 16;
/// Message of an emulator when it cannot continue.
const LAST_WORDS: &[u8] =
    b"commram: error: SIGBUS: /dev/shm is full, or another program has shortened a file there that is in use\n";
/// Message of a client when it cannot continue.
const CLIENTS_WORDS: &[u8] =
    b"commram: another program has shortened an image or a part of the channel while it was in use, or /dev/shm \
        is full; `commram stop` ends the emulator, and `commram stop --clean` removes the files of a killed one\n";

/// An entry of the handler's list of maps. It has only atomics, because the handler may interrupt any code.
struct Slot {
    /// Address of the map; 0 if the entry is free, 1 while it is being filled.
    base: AtomicUsize,
    /// Length of the map in bytes.
    size: AtomicUsize,
    file: AtomicI32,
    /// [Blocks](BLOCK) that the file had at first, as far as its length needs them. If another process shortens the file
    /// and restores its length, the file has fewer blocks.
    blocks: AtomicUsize,
    mended: AtomicBool,
    tries: AtomicUsize,
}

static SLOTS: [Slot; MAX_GUARDED] = [const {
    Slot {
        base: AtomicUsize::new(0),
        size: AtomicUsize::new(0),
        file: AtomicI32::new(-1),
        blocks: AtomicUsize::new(0),
        mended: AtomicBool::new(false),
        tries: AtomicUsize::new(0),
    }
}; MAX_GUARDED];

impl Slot {
    fn covers(&self, address: usize) -> bool {
        let base = self.base.load(Ordering::Acquire);
        base > 1 && address.checked_sub(base).is_some_and(|offset| offset < self.size.load(Ordering::Acquire))
    }

    /// Restores the length of the file, and returns true if there was memory for it. `None` if the file has its full
    /// length and all its memory.
    fn grow_back(&self) -> Option<bool> {
        // SAFETY: the file is open for as long as the slot is taken.
        let file = unsafe { BorrowedFd::borrow_raw(self.file.load(Ordering::Acquire)) };
        let stat = rustix::fs::fstat(file).ok()?;
        let size = self.size.load(Ordering::Acquire) as u64;
        if stat.st_size >= size as i64 && stat.st_blocks >= self.blocks.load(Ordering::Acquire) as i64 {
            return None;
        }
        self.mended.store(true, Ordering::Release);
        Some(rustix::fs::fallocate(file, FallocateFlags::empty(), 0, size).is_ok())
    }

    /// Repairs the map after a fault. Returns true if the access can be repeated.
    fn mend(&self) -> bool {
        self.grow_back().unwrap_or_else(|| self.tries.fetch_add(1, Ordering::Relaxed) < MAX_TRIES)
    }
}

/// Guards a map until it is dropped, which must be before the file is closed.
#[derive(Debug)]
pub(super) struct Guard(Option<usize>);

impl Guard {
    /// Guards the map of `size` bytes at `base`, if a slot is free.
    pub(crate) fn new(base: *const u8, size: usize, file: RawFd) -> Self {
        let take =
            |slot: &Slot| slot.base.compare_exchange(0, 1, Ordering::AcqRel, Ordering::Relaxed).is_ok();
        let place = SLOTS.iter().position(take);
        if let Some(slot) = place.and_then(|place| SLOTS.get(place)) {
            slot.file.store(file, Ordering::Release);
            slot.size.store(size, Ordering::Release);
            // SAFETY: the caller has opened the file.
            let stat = rustix::fs::fstat(unsafe { BorrowedFd::borrow_raw(file) });
            let blocks = stat.map_or(0, |stat| usize::try_from(stat.st_blocks).unwrap_or(0));
            // The kernel can give back memory after the end of the file, if its last page is a huge one.
            slot.blocks.store(blocks.min(size / BLOCK), Ordering::Release);
            slot.mended.store(false, Ordering::Release);
            slot.tries.store(0, Ordering::Release);
            slot.base.store(base.addr(), Ordering::Release);
        }
        Self(place)
    }

    fn slot(&self) -> Option<&'static Slot> {
        SLOTS.get(self.0?)
    }

    /// True if the file was shorter than its map.
    #[inline]
    pub(crate) fn has_mended(&self) -> bool {
        self.slot().is_some_and(|slot| slot.mended.load(Ordering::Acquire))
    }

    /// Restores the length of a shortened file now, before an access to the map raises SIGBUS.
    pub(crate) fn look(&self) {
        if let Some(slot) = self.slot() {
            // The result is ignored: if there is no memory, the next access to the map ends the process.
            let _ = slot.grow_back();
        }
    }
}

impl Drop for Guard {
    fn drop(&mut self) {
        if let Some(slot) = self.slot() {
            slot.base.store(0, Ordering::Release);
        }
    }
}

/// Handles SIGBUS in this process from now on. For emulators; a library must not change signal handlers.
///
/// # Errors
/// The operating system refuses the operation.
pub fn survive_shortened_files() -> io::Result<()> {
    gap::prepare();
    handle(emulator_lives_on)
}

/// From now on SIGBUS ends this process with a message and this exit code. Meant for client programs, because a library
/// must not change signal handlers.
///
/// # Errors
/// The operating system refuses the operation.
pub fn end_on_shortened_files(exit_code: u8) -> io::Result<()> {
    EXIT_CODE.store(exit_code.into(), Ordering::Relaxed);
    handle(client_ends)
}

/// From now on missing pages of images and channels read as zeros in this process, and a flag of the reading thread
/// shows that the channel is damaged ([`take_gap_of_thread`]). Meant for a client program of several instances.
///
/// # Errors
/// The operating system refuses the operation.
#[cfg(feature = "web")]
pub(crate) fn survive_lost_channels() -> io::Result<()> {
    gap::prepare();
    handle(client_lives_on)
}

static EXIT_CODE: AtomicI32 = AtomicI32::new(1);

type Handler = extern "C" fn(libc::c_int, *mut libc::siginfo_t, *mut libc::c_void);

fn handle(handler: Handler) -> io::Result<()> {
    // SAFETY: all zeros is a valid sigaction: no flags, nothing blocked.
    let mut action: libc::sigaction = unsafe { core::mem::zeroed() };
    action.sa_sigaction = handler as *const () as usize;
    action.sa_flags = libc::SA_SIGINFO | libc::SA_ONSTACK;
    // SAFETY: the handler has the signature that SA_SIGINFO asks for and does only what a handler may: atomics and
    // plain system calls.
    match unsafe { libc::sigaction(libc::SIGBUS, &raw const action, core::ptr::null_mut()) } {
        0 => Ok(()),
        _ => Err(io::Error::last_os_error()),
    }
}

extern "C" fn emulator_lives_on(
    _signal: libc::c_int,
    info: *mut libc::siginfo_t,
    _context: *mut libc::c_void,
) {
    // SAFETY: the kernel passes the description of a SIGBUS, which has an address.
    let address = unsafe { (*info).si_addr() }.addr();
    let image = SLOTS.iter().find(|slot| slot.covers(address));
    if image.map_or_else(|| gap::close(address), Slot::mend) {
        return;
    }
    write_words(LAST_WORDS);
    // SAFETY: a plain system call. The processor then repeats the access, which ends the process.
    unsafe { libc::signal(libc::SIGBUS, libc::SIG_DFL) };
}

#[cfg(feature = "web")]
extern "C" fn client_lives_on(signal: libc::c_int, info: *mut libc::siginfo_t, context: *mut libc::c_void) {
    // SAFETY: the kernel passes the description of a SIGBUS, which has an address.
    let address = unsafe { (*info).si_addr() }.addr();
    if !gap::close(address) && !gap::close_image(address) {
        client_ends(signal, info, context);
    }
}

extern "C" fn client_ends(_signal: libc::c_int, _info: *mut libc::siginfo_t, _context: *mut libc::c_void) {
    write_words(CLIENTS_WORDS);
    // SAFETY: a plain system call, without the usual exit handlers of a process.
    unsafe { libc::_exit(EXIT_CODE.load(Ordering::Relaxed)) };
}

fn write_words(words: &[u8]) {
    // SAFETY: no code here closes descriptor 2; if it is closed, the write fails.
    let _ = rustix::io::write(unsafe { BorrowedFd::borrow_raw(2) }, words);
}
