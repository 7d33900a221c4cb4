//! A bare page of shared memory, in the form in which two processes without an emulator would use it.

use commram::memory::{Cell16, Cell32, SharedRegs};
use memmap2::MmapRaw;
use rustix::fs::MemfdFlags;
use rustix::thread::futex;
use std::fs::File;
use std::os::fd::AsRawFd;
use std::path::Path;
use std::sync::atomic::AtomicU32;
use zerocopy::{FromBytes, IntoBytes, KnownLayout};

/// Contents of the page: the two registers side by side and the two futex words in separate cache
/// lines, as in an image.
#[derive(FromBytes, IntoBytes, KnownLayout, Debug)]
#[repr(C)]
pub(crate) struct Registers {
    /// Word that the client rings.
    pub doorbell: Cell32,
    reserved_4: [Cell32; 15],
    /// Word that the server rings.
    pub answer: Cell32,
    reserved_68: [Cell32; 15],
    /// Register that the client writes.
    pub control: Cell16,
    /// Register that the server writes.
    pub status: Cell16,
}

// SAFETY: the structure consists of cells only, and IntoBytes proves that it has no padding.
unsafe impl SharedRegs for Registers {}

/// A page of memory that two processes map.
pub(crate) struct Page {
    map: MmapRaw,
    /// File that keeps the memory reachable for [`Page::open`]; the memory has no name.
    file: File,
}

impl Page {
    const SIZE: u64 = 4096;

    /// Makes a new page of zeros. It disappears with the last process that uses it.
    pub(crate) fn create() -> Self {
        let memory = rustix::fs::memfd_create("commram-bench", MemfdFlags::CLOEXEC);
        let file = File::from(memory.expect("memory can be shared"));
        file.set_len(Self::SIZE).expect("the page can be given its size");
        Self::map(file)
    }

    /// Maps the page that another process has created; see [`Page::path`].
    pub(crate) fn open(path: &str) -> Self {
        let file = File::options().read(true).write(true).open(Path::new(path));
        Self::map(file.expect("the parent's page can be opened"))
    }

    fn map(file: File) -> Self {
        let map = MmapRaw::map_raw(&file).expect("the page can be mapped");
        assert_eq!(map.len() as u64, Self::SIZE);
        Page { map, file }
    }

    /// Returns the path at which a child process finds the page while this process exists.
    pub(crate) fn path(&self) -> String {
        format!("/proc/{}/fd/{}", std::process::id(), self.file.as_raw_fd())
    }

    /// Returns the registers in the page.
    pub(crate) fn registers(&self) -> &Registers {
        // SAFETY: the map is page-aligned, longer than `Registers` and lives as long as `self`; all processes access it
        // through the same cells.
        unsafe { &*self.map.as_mut_ptr().cast::<Registers>() }
    }
}

/// Increments the word and wakes the threads that sleep on it, in as few steps as possible.
pub(crate) fn ring(word: &Cell32) {
    word.increment();
    futex::wake(futex_word(word), futex::Flags::empty(), 1).expect("a futex can be woken");
}

/// Sleeps until the word is no longer `seen`; wakes up periodically to check the other process.
pub(crate) fn sleep(word: &Cell32, seen: u32) {
    let timeout = futex::Timespec { tv_sec: 0, tv_nsec: 100_000_000 };
    // The caller polls the word after any result of this call, so an error has no effect.
    let _ = futex::wait(futex_word(word), futex::Flags::empty(), seen.to_le(), Some(&timeout));
}

/// Returns the word in the type that the futex calls require. Only these calls use this type.
fn futex_word(word: &Cell32) -> &AtomicU32 {
    // SAFETY: valid and aligned; only the kernel accesses it.
    unsafe { AtomicU32::from_ptr(word.as_ptr()) }
}
