//! Typed views of register blocks.

use super::{MemoryError, Segment, cell::SharedRegs, segment::Backing};
use core::{fmt, ops::Deref, ptr::NonNull};
use std::sync::Arc;

/// A block of register cells in a memory segment, checked once for bounds and alignment.
///
/// Dereferencing is one pointer load. The view keeps the memory mapped for its own lifetime, even after
/// the [`Segment`] it came from is dropped.
pub struct View<T: SharedRegs> {
    cells: NonNull<T>,
    keep: Arc<Backing>,
}

// SAFETY: the view only returns `&T`, `T: SharedRegs` is Sync, and the backing is Send + Sync.
unsafe impl<T: SharedRegs> Send for View<T> {}
// SAFETY: as above.
unsafe impl<T: SharedRegs> Sync for View<T> {}

impl<T: SharedRegs> View<T> {
    /// Returns the view of `T` at `offset`. The caller has checked that the backing is writable.
    pub(super) fn new(keep: Arc<Backing>, offset: u32) -> Result<Self, MemoryError> {
        let (size, align, first) = (size_of::<T>(), align_of::<T>(), offset as usize);
        if first.checked_add(size).is_none_or(|end| end > keep.size()) {
            return Err(MemoryError::BlockOutOfRange { offset, size, end: keep.size() });
        }
        if !first.is_multiple_of(align) {
            return Err(MemoryError::BlockMisaligned {
                offset,
                align,
                type_name: core::any::type_name::<T>(),
            });
        }
        // SAFETY: the backing is `size` bytes long and `first` was just checked to lie inside.
        let cells = unsafe { keep.base().add(first) }.cast::<T>();
        debug_assert!(cells.is_aligned(), "the backing is page-aligned");
        Ok(Self { cells, keep })
    }

    /// Returns a view of a part of the block: a field or an array element.
    ///
    /// ```
    /// # use commram::memory::{Cell16, Segment};
    /// let pair = Segment::of(commram::devices::default().layout).view::<[Cell16; 2]>(200_000)?;
    /// let second = pair.project(|pair| &pair[1]);
    /// second.store(0x0043);
    /// assert_eq!(pair[1].load(), 0x0043);
    /// # Ok::<(), commram::memory::MemoryError>(())
    /// ```
    pub fn project<U: SharedRegs>(&self, part: impl for<'a> FnOnce(&'a T) -> &'a U) -> View<U> {
        View { cells: NonNull::from(part(self)), keep: Arc::clone(&self.keep) }
    }

    /// Returns the memory segment of this view.
    pub fn segment(&self) -> Segment {
        Segment::from_backing(Arc::clone(&self.keep))
    }
}

impl<T: SharedRegs> Deref for View<T> {
    type Target = T;

    #[inline]
    fn deref(&self) -> &T {
        // SAFETY: in bounds and aligned (checked in `new`, or derived from such a reference), mapped for
        // as long as `keep` lives; `SharedRegs` allows any bit pattern and shared mutation.
        unsafe { self.cells.as_ref() }
    }
}

impl<T: SharedRegs> Clone for View<T> {
    fn clone(&self) -> Self {
        Self { cells: self.cells, keep: Arc::clone(&self.keep) }
    }
}

impl<T: SharedRegs + fmt::Debug> fmt::Debug for View<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        (**self).fmt(f)
    }
}
