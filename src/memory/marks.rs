//! Marks of stores: which lines of a private memory segment have been written since a reader last cleared the marks.
//!
//! The access checker compares registers with a copy. A memory segment that no other process can map is written only by
//! the functions of [`access`](super::access), so these functions can mark each line of 64 bytes that they write, and
//! the checker reads only the marked lines and their copies (D-839). Mapped image files have no marks.
//!
//! Private memory segments lie in slots of one reserved range of addresses. So a store finds its mark by the address
//! alone: the marks of all slots follow the last slot, with one byte for each line. A segment has no marks if the range
//! cannot be reserved, if no slot is free, or if it is larger than a slot.

use super::access::MemoryValue;
use super::segment::Backing;
use core::ops::Range;
use core::ptr;
use core::sync::atomic::{AtomicBool, AtomicUsize, Ordering, fence};
use rustix::mm::{MapFlags, MprotectFlags, ProtFlags, mmap_anonymous, mprotect};
use rustix::process::{Resource, getrlimit};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

/// Number of bytes of a line.
pub(crate) const LINE: usize = 64;
/// Number of bytes of a slot.
const SLOT: usize = 4 << 20;
/// Number of slots: twice the PLCs of the largest cluster.
const SLOTS: usize = 4096;
/// Number of bytes of all slots.
const SIZE: usize = SLOT * SLOTS;

/// Address of the first slot. Before the range is reserved, all addresses of a process are far from this value.
static FIRST: AtomicUsize = AtomicUsize::new(isize::MIN as usize);

/// Returns the address of the mark of the byte `place` bytes after the first slot.
#[inline(always)]
fn mark_of(first: usize, place: usize) -> *mut u8 {
    ptr::with_exposed_provenance_mut(first + SIZE + place / LINE)
}

/// Marks the line at this address, if the address is in a slot. Called after each store, so that a reader that clears the
/// mark afterwards sees the stored value.
#[inline(always)]
pub(super) fn mark(address: usize) {
    let first = FIRST.load(Ordering::Relaxed);
    let place = address.wrapping_sub(first);
    if place < SIZE {
        // SAFETY: a store to a slot happens only while the slot is in use, and its marks are writable as long.
        unsafe { u8::store(mark_of(first, place), 1) }
    }
}

/// Memory for one memory segment, zeroed, with marks. Dropping it releases the memory.
pub(super) struct Slot {
    index: usize,
    /// Number of bytes of the memory.
    size: usize,
    /// True if other code may write the memory without marks.
    is_exposed: AtomicBool,
    /// Ranges of lines with a reader that clears their marks.
    claims: Mutex<Vec<Range<usize>>>,
}

/// Numbers of the slots that are not in use.
struct Indices {
    free: Vec<usize>,
    /// Number of slots that were used at least once.
    used: usize,
}

static INDICES: Mutex<Indices> = Mutex::new(Indices { free: Vec::new(), used: 0 });

impl Slot {
    /// Returns memory for `size` bytes; `None` if no slot is available.
    pub(super) fn take(size: usize) -> Option<Self> {
        if size > SLOT || !is_reserved() {
            return None;
        }
        let index = {
            let mut indices = lock(&INDICES);
            let fresh = (indices.used < SLOTS).then_some(indices.used);
            let index = indices.free.pop().or(fresh)?;
            indices.used = indices.used.max(index + 1);
            index
        };
        // If the rights cannot be set, dropping the slot makes it free again.
        let slot = Slot { index, size, is_exposed: AtomicBool::new(false), claims: Mutex::default() };
        slot.parts().into_iter().all(|(at, size)| allow(at, size)).then_some(slot)
    }

    /// Returns the first byte of the memory.
    pub(super) fn base(&self) -> *mut u8 {
        ptr::with_exposed_provenance_mut(self.parts()[0].0)
    }

    /// Called when code gets the address of the memory and may write it without marks.
    pub(super) fn expose(&self) {
        self.is_exposed.store(true, Ordering::Relaxed);
    }

    /// Returns the addresses and the lengths of the memory and of its marks.
    fn parts(&self) -> [(usize, usize); 2] {
        let first = FIRST.load(Ordering::Relaxed);
        let place = self.index * SLOT;
        [(first + place, self.size), (mark_of(first, place).addr(), self.size.div_ceil(LINE))]
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        // The slot stays unused if the kernel has no memory for the change of its maps.
        if self.parts().into_iter().all(|(at, size)| reserve(Some(at), size).is_some()) {
            lock(&INDICES).free.push(self.index);
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Makes reserved pages readable and writable.
fn allow(at: usize, size: usize) -> bool {
    let rights = MprotectFlags::READ | MprotectFlags::WRITE;
    // SAFETY: the pages belong to a slot that no other code uses, or to its marks.
    unsafe { mprotect(ptr::with_exposed_provenance_mut(at), size, rights) }.is_ok()
}

/// Reserves addresses without memory, at the address `at` or anywhere. Returns the first address.
fn reserve(at: Option<usize>, size: usize) -> Option<usize> {
    let fixed = if at.is_some() { MapFlags::FIXED } else { MapFlags::empty() };
    let flags = MapFlags::PRIVATE | MapFlags::NORESERVE | fixed;
    let at = at.map_or(ptr::null_mut(), ptr::with_exposed_provenance_mut);
    // SAFETY: a fixed address is that of a slot that no code uses any more, or of its marks.
    let map = unsafe { mmap_anonymous(at, size, ProtFlags::empty(), flags) }.ok()?;
    Some(map.expose_provenance())
}

/// Reserves the addresses of all slots at the first call. Returns false if this process cannot have them: with a limit of
/// the address space they would use up the limit, and Miri knows no access rights of pages.
fn is_reserved() -> bool {
    static IS_RESERVED: OnceLock<bool> = OnceLock::new();
    *IS_RESERVED.get_or_init(|| {
        if cfg!(miri) || getrlimit(Resource::As).current.is_some() {
            return false;
        }
        let Some(first) = reserve(None, SIZE + SIZE / LINE) else { return false };
        FIRST.store(first, Ordering::Relaxed);
        true
    })
}

/// Number of marks that are read at once.
const WORD: usize = size_of::<u64>();
/// Number of words whose marks are cleared together.
const GROUP: usize = 8;

/// The marks of consecutive lines of a memory segment. Only the owner clears them.
pub(crate) struct LineMarks {
    backing: Arc<Backing>,
    lines: Range<usize>,
    /// Address of the word that contains the first mark.
    first: usize,
    /// Number of marks in this word before the first one.
    skipped: usize,
}

impl LineMarks {
    /// Claims the marks of these lines. Returns `None` if the memory segment has no marks, if it is shorter, or if another
    /// reader has claimed one of the lines.
    pub(super) fn claim(backing: &Arc<Backing>, lines: Range<usize>) -> Option<Self> {
        let slot = backing.slot()?;
        let mut claims = lock(&slot.claims);
        let is_claimed = |it: &Range<usize>| it.start < lines.end && lines.start < it.end;
        if lines.is_empty() || lines.end > slot.size / LINE || claims.iter().any(is_claimed) {
            return None;
        }
        claims.push(lines.clone());
        let at = slot.parts()[1].0 + lines.start;
        Some(Self { backing: Arc::clone(backing), lines, first: at / WORD * WORD, skipped: at % WORD })
    }

    /// Returns the marks, if there are any and every store to their lines is marked.
    #[inline]
    pub(crate) fn complete(marks: &Option<Self>) -> Option<&Self> {
        let is_complete = |slot: &Slot| !slot.is_exposed.load(Ordering::Relaxed);
        marks.as_ref().filter(|marks| marks.backing.slot().is_some_and(is_complete))
    }

    /// Calls `read` for each word that contains a mark of the first `count` lines, with its distance from the first word in
    /// marks. The word has only these marks.
    #[inline]
    fn each_word(&self, count: usize, mut read: impl FnMut(usize, u64)) {
        let end = self.skipped + count.min(self.lines.len());
        let mut read_word = |first: usize, wanted: u64| {
            // SAFETY: the word contains a mark of this slot, which `backing` keeps, and marks of slots begin and end with a
            // page.
            let word = u64::from_le(unsafe { u64::load(ptr::with_exposed_provenance(self.first + first)) });
            if word & wanted != 0 {
                read(first, word & wanted);
            }
        };
        let mut wanted = u64::MAX << (8 * self.skipped);
        let whole = end / WORD * WORD;
        for first in (0..end / WORD).map(|word| word * WORD) {
            read_word(first, wanted);
            wanted = u64::MAX;
        }
        if whole < end {
            read_word(whole, wanted & !(u64::MAX << (8 * (end - whole))));
        }
    }

    /// Calls `read` for the marked ones of the first `count` lines. Line 0 is the first claimed line.
    #[inline]
    pub(crate) fn each_marked(&self, count: usize, mut read: impl FnMut(usize)) {
        self.each_word(count, |first, word| each_mark(word, |mark| read(first + mark - self.skipped)));
    }

    /// Clears the marks of the first `count` lines, and calls `read` for each line that was marked. A store at the same
    /// time leaves a mark, or `read` sees it.
    #[inline]
    pub(crate) fn take(&self, count: usize, mut read: impl FnMut(usize)) {
        let mut taken = [(0, 0); GROUP];
        let mut len = 0;
        let mut read_all = |taken: &[(usize, u64)]| {
            // Otherwise the processor could read a line before the mark is cleared for all others, so that a store between
            // loses its mark.
            fence(Ordering::SeqCst);
            for &(first, word) in taken {
                each_mark(word, |mark| read(first + mark - self.skipped));
            }
        };
        self.each_word(count, |first, word| {
            each_mark(word, |mark| {
                let at = ptr::with_exposed_provenance_mut(self.first + first + mark);
                // SAFETY: the mark belongs to this slot, which `backing` keeps.
                unsafe { u8::store(at, 0) }
            });
            taken[len] = (first, word);
            len += 1;
            if len == GROUP {
                read_all(&taken);
                len = 0;
            }
        });
        if len > 0 {
            read_all(&taken[..len]);
        }
    }

    /// Marks all lines.
    pub(crate) fn mark_all(&self) {
        for line in 0..self.lines.len() {
            // SAFETY: as in `take`.
            unsafe { u8::store(ptr::with_exposed_provenance_mut(self.first + self.skipped + line), 1) }
        }
    }
}

/// Calls `read` for each mark of a word.
#[inline]
fn each_mark(mut word: u64, mut read: impl FnMut(usize)) {
    while word != 0 {
        read((word.trailing_zeros() / u8::BITS) as usize);
        word &= word - 1;
    }
}

impl Drop for LineMarks {
    fn drop(&mut self) {
        if let Some(slot) = self.backing.slot() {
            lock(&slot.claims).retain(|lines| *lines != self.lines);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::LineMarks;
    use crate::memory::{Cell8, Cell16, Cell32, HEADER_SIZE, Segment, Width};

    const AT: u32 = HEADER_SIZE as u32;

    fn marked(marks: &LineMarks) -> Vec<usize> {
        first_marked(marks, usize::MAX)
    }

    fn first_marked(marks: &LineMarks, count: usize) -> Vec<usize> {
        let mut lines = Vec::new();
        marks.each_marked(count, |line| lines.push(line));
        lines
    }

    #[test]
    #[cfg_attr(miri, ignore = "Miri has no marks")]
    fn each_store_marks_its_line_and_no_other() {
        let (segment, other) = (Segment::heap(2 * HEADER_SIZE), Segment::heap(2 * HEADER_SIZE));
        // The first mark is not the first one of its word.
        let first = HEADER_SIZE + 3 * 64;
        let marks = segment.line_marks(first..2 * HEADER_SIZE).unwrap();
        assert!(marked(&marks).is_empty());
        segment.store(AT, Width::Byte, 1).unwrap();
        other.store(first as u32, Width::Byte, 1).unwrap();
        assert!(marked(&marks).is_empty(), "stores before the lines and to another segment");
        segment.view::<Cell8>(first as u32 + 63).unwrap().store(7);
        segment.view::<Cell16>(first as u32 + 256).unwrap().update(|value| value + 1);
        let cell = segment.view::<Cell32>(first as u32 + 700).unwrap();
        assert_eq!(cell.compare_exchange(1, 2), Err(0));
        assert_eq!(marked(&marks), [0, 4], "an exchange that fails stores nothing");
        assert_eq!(cell.compare_exchange(0, 2), Ok(0));
        segment.store(2 * AT - 4, Width::Dword, 5).unwrap();
        let last = (HEADER_SIZE - 3 * 64) / 64 - 1;
        assert_eq!(marked(&marks), [0, 4, 10, last]);
        assert_eq!(first_marked(&marks, 4), [0], "of the first four lines");
        let mut taken = Vec::new();
        marks.take(11, |line| taken.push(line));
        assert_eq!((taken, marked(&marks)), (vec![0, 4, 10], vec![last]));
        marks.mark_all();
        assert_eq!(marked(&marks).len(), last + 1);
    }

    #[test]
    #[cfg_attr(miri, ignore = "Miri has no marks")]
    fn a_line_has_one_reader() {
        let segment = Segment::heap(2 * HEADER_SIZE);
        let claim = |bytes| segment.line_marks(bytes);
        let first = claim(64..256).unwrap();
        assert!(claim(0..65).is_none() && claim(255..300).is_none() && claim(100..101).is_none());
        assert!(claim(2 * HEADER_SIZE - 64..2 * HEADER_SIZE + 1).is_none(), "beyond the end");
        assert!(claim(64..64).is_none());
        let _second = claim(256..320).unwrap();
        drop(first);
        assert!(claim(0..256).is_some());
    }

    /// Code that gets the address may store without marks.
    #[test]
    #[cfg_attr(miri, ignore = "Miri has no marks")]
    fn marks_are_incomplete_once_code_has_the_address() {
        let segment = Segment::heap(HEADER_SIZE);
        let marks = segment.line_marks(0..64);
        assert!(LineMarks::complete(&marks).is_some());
        let _ = segment.base();
        assert!(marks.is_some() && LineMarks::complete(&marks).is_none());
    }

    #[test]
    #[cfg_attr(miri, ignore = "Miri has no marks")]
    fn a_slot_that_is_used_again_is_zero() {
        let size = 2 * HEADER_SIZE;
        // Other tests take slots at the same time.
        for _ in 0..100 {
            let segment = Segment::heap(size);
            let marks = segment.line_marks(0..size).unwrap();
            assert!(marked(&marks).is_empty());
            let cells = segment.view::<[Cell32; HEADER_SIZE / 4]>(AT).unwrap();
            assert!(cells.iter().all(|cell| cell.load() == 0));
            cells.iter().for_each(|cell| cell.store(u32::MAX));
        }
    }

    #[test]
    fn a_segment_that_is_larger_than_a_slot_has_no_marks() {
        let segment = Segment::heap(super::SLOT + 4);
        assert!(segment.line_marks(0..64).is_none());
        segment.store(super::SLOT as u32, Width::Dword, 3).unwrap();
    }

    /// A reader that takes marks while another thread stores sees the last value at the latest when the thread has ended.
    #[test]
    #[cfg_attr(miri, ignore = "Miri has no marks")]
    fn no_store_of_another_thread_is_lost() {
        let segment = Segment::heap(2 * HEADER_SIZE);
        let marks = segment.line_marks(HEADER_SIZE..2 * HEADER_SIZE).unwrap();
        let cells = segment.view::<[Cell32; HEADER_SIZE / 4]>(AT).unwrap();
        let mut copy = vec![0; cells.len()];
        let mut read = |line: usize| (line * 16..line * 16 + 16).for_each(|at| copy[at] = cells[at].load());
        std::thread::scope(|scope| {
            let writer = scope.spawn(|| {
                for turn in 1..200_u32 {
                    cells.iter().enumerate().for_each(|(at, cell)| cell.store(turn * 1024 + at as u32));
                }
            });
            while !writer.is_finished() {
                marks.take(usize::MAX, &mut read);
            }
        });
        marks.take(usize::MAX, read);
        assert!(copy.iter().zip(cells.iter()).all(|(copy, cell)| *copy == cell.load()));
    }
}
