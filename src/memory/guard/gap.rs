//! Replaces a missing page of the channel by zeros.
//!
//! iceoryx2 does not report where it maps its memory, so the handler finds the map in the process's list of maps.
//! iceoryx2 may then behave in any way, which is acceptable: The emulator gives up the channel as soon as iceoryx2
//! returns ([`channel_has_gaps`]). A client of several instances gives up the connection that the thread uses
//! ([`take_gap_of_thread`]).

#[cfg(any(test, feature = "web"))]
use crate::memory::names::PREFIX;
use crate::memory::names::{CHANNEL_PREFIX, IMAGE_DIRECTORY};
use core::cell::Cell;
use core::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use rustix::fs::{Mode, OFlags};
use rustix::mm::{MapFlags, ProtFlags};

/// Number of bytes of a line that are parsed: range, rights, offset, device, inode, and the beginning of the path.
const LINE: usize = 160;

static PAGE: AtomicUsize = AtomicUsize::new(0);
static GAPS: AtomicBool = AtomicBool::new(false);

thread_local! {
    /// True if this thread has accessed a missing part of a channel. A signal handler may set it, because it needs no
    /// allocation and no destructor.
    static GAP_OF_THREAD: Cell<bool> = const { Cell::new(false) };
}

/// Reads the values that the signal handler needs but cannot read itself.
pub(super) fn prepare() {
    PAGE.store(page_size(), Ordering::Relaxed);
}

/// Returns the size of a page of memory, in bytes; 0 if it is unknown.
pub(crate) fn page_size() -> usize {
    // SAFETY: a question without side effects.
    let page = unsafe { libc::sysconf(libc::_SC_PAGESIZE) };
    usize::try_from(page).unwrap_or(0)
}

/// True if this thread has accessed a missing part of a channel since the last call.
#[cfg(feature = "web")]
pub(crate) fn take_gap_of_thread() -> bool {
    GAP_OF_THREAD.replace(false)
}

/// True if a part of the channel was missing when this process accessed it.
#[cfg(feature = "channel")]
#[inline]
pub(crate) fn channel_has_gaps() -> bool {
    GAPS.load(Ordering::Acquire)
}

/// Maps zeros at `address` if it belongs to a map of the channel; returns whether the access can be repeated. A signal
/// handler may call it.
pub(super) fn close(address: usize) -> bool {
    let is_closed = is_in(address, names_the_channel) && fill(address);
    if is_closed {
        GAPS.store(true, Ordering::Release);
        GAP_OF_THREAD.set(true);
    }
    is_closed
}

/// Does the same as [`close`] for the map of an image. The client no longer needs the contents of such an image.
#[cfg(feature = "web")]
pub(super) fn close_image(address: usize) -> bool {
    is_in(address, names_an_image) && fill(address)
}

/// Maps zeros over the page at `address`, which belongs to a map of shared memory; returns whether it could.
fn fill(address: usize) -> bool {
    let page = PAGE.load(Ordering::Relaxed);
    if page == 0 {
        return false;
    }
    let start = core::ptr::without_provenance_mut(address - address % page);
    let rights = ProtFlags::READ | ProtFlags::WRITE;
    // SAFETY: the page belongs to a map of shared memory. Rust has no references into it, because other processes write
    // to it, too. Those processes could have written zeros, so zeros are valid contents.
    unsafe { rustix::mm::mmap_anonymous(start, page, rights, MapFlags::PRIVATE | MapFlags::FIXED) }.is_ok()
}

/// Searches the process's list of maps for the map at `address`, and returns the result of `names` for its line.
/// Allocates no memory, because a signal handler calls it.
fn is_in(address: usize, names: fn(&[u8]) -> bool) -> bool {
    let Ok(maps) = rustix::fs::open(c"/proc/self/maps", OFlags::RDONLY | OFlags::CLOEXEC, Mode::empty())
    else {
        return false;
    };
    let (mut line, mut length) = ([0; LINE], 0);
    // Signal stacks are small.
    let mut chunk = [0; 256];
    while let Ok(count @ 1..) = rustix::io::read(&maps, &mut chunk) {
        for &byte in chunk.get(..count).unwrap_or_default() {
            if byte != b'\n' {
                if let Some(place) = line.get_mut(length) {
                    *place = byte;
                    length += 1;
                }
            } else if covers(line.get(..length).unwrap_or_default(), address) {
                return names(line.get(..length).unwrap_or_default());
            } else {
                length = 0;
            }
        }
    }
    false
}

/// True if `address` is in the range at the beginning of the line.
fn covers(line: &[u8], address: usize) -> bool {
    let mut numbers = line.split(|byte| matches!(byte, b'-' | b' '));
    let mut number = || {
        numbers.next()?.iter().try_fold(0usize, |number, digit| {
            let digit = char::from(*digit).to_digit(16)?;
            number.checked_mul(16)?.checked_add(digit as usize)
        })
    };
    number().zip(number()).is_some_and(|(first, end)| (first..end).contains(&address))
}

/// True if the line ends with the path of a part of a channel.
fn names_the_channel(line: &[u8]) -> bool {
    has_name(line, CHANNEL_PREFIX)
}

/// True if the line ends with the path of an image.
#[cfg(any(test, feature = "web"))]
fn names_an_image(line: &[u8]) -> bool {
    has_name(line, PREFIX)
}

/// True if the line ends with the path of a file in the directory of images, and the file's name begins with `prefix`.
fn has_name(line: &[u8], prefix: &str) -> bool {
    let path = line.iter().position(|&byte| byte == b'/').and_then(|at| line.get(at..));
    let rest = path.and_then(|path| path.strip_prefix(IMAGE_DIRECTORY.as_bytes()));
    rest.and_then(|rest| rest.strip_prefix(b"/")).is_some_and(|name| name.starts_with(prefix.as_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_read_as_the_kernel_writes_them() {
        let line = b"7f0a4000-7f0a6000 rw-s 00001000 00:1a 4711                  /dev/shm/commram_12ab_3.data (deleted)";
        for (address, is_in) in
            [(0x7f0a_3fff, false), (0x7f0a_4000, true), (0x7f0a_5fff, true), (0x7f0a_6000, false)]
        {
            assert_eq!(covers(line, address), is_in, "{address:x}");
        }
        assert!(names_the_channel(line));
        for other in [
            &b"7f0a4000-7f0a6000 rw-s 00001000 00:1a 4711                  /dev/shm/commram.default.line"[..],
            b"7f0a4000-7f0a6000 rw-p 00000000 00:00 0",
            b"7f0a4000-7f0a6000 r-xp 00000000 08:01 12   /usr/bin/commram_x",
            b"",
        ] {
            assert!(!names_the_channel(other));
            assert_eq!(names_an_image(other), other.ends_with(b".line"));
        }
        assert!(!covers(b"", 0) && !covers(b"zz-7f rw", 1));
    }

    #[test]
    fn this_process_has_maps_and_none_of_a_channel() {
        let local = 0;
        assert!(!is_in((&raw const local).addr(), names_the_channel));
        assert!(!is_in(0, names_the_channel));
    }
}
