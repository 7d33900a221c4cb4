//! The RAM of one device. A PLC addresses it as its segment 3: byte n is `%MB3.n`.
//!
//! Access rules, enforced here:
//!
//! 1. No code gets a `&T` of plain data. Only cells (see [`super::cell`]) cover the memory, and all accesses are
//!    functions of [`super::access`], which allows different widths.
//! 2. A register is written at its own width. The memory segment has no list of registers, so the caller of the raw accesses
//!    takes the width from the register map. To write a part of a register, use [`Segment::store_within`], which
//!    replaces the whole register by compare-exchange.
//! 3. Bulk copies and comparisons ([`Segment::read_range`], [`Segment::snapshot`], the access checker) load aligned
//!    32-bit or 64-bit words for registers of any width. Each register is within one word, so no register is torn. A
//!    copy of each register separately would take four times as long. These functions never write. Different words of a
//!    copy may be from different moments, so related values must be read under their handshake.
//! 4. The first [`HEADER_SIZE`] bytes are the header page. Raw accesses cannot reach them, except for the words of the
//!    device's front panel, [`Header::front`].

use super::header::FRONT;
#[cfg(feature = "emulator")]
use super::marks::{LINE, LineMarks, Slot};
#[cfg(feature = "emulator")]
use super::{Block, FirmwareHeader};
use super::{
    Cell8, Cell16, Cell32, Cell64, HEADER_SIZE, Header, MemoryError, View, Width, access::MemoryValue,
    cell::SharedRegs,
};
use crate::layout::DeviceLayout;
#[cfg(feature = "emulator")]
use core::ops::Range;
use core::{fmt, ptr::NonNull};
use memmap2::{MmapOptions, MmapRaw};
use std::sync::Arc;
use zerocopy::IntoBytes;

/// Memory of the segment. It is unmapped when the last [`Segment`] or [`View`] is dropped.
pub(super) struct Backing {
    base: NonNull<u8>,
    /// Number of accessible bytes, a multiple of 4 and at least [`HEADER_SIZE`].
    size: usize,
    writable: bool,
    /// Owner of the memory, unless it has marks of stores.
    _map: Option<MmapRaw>,
    /// Owner of memory with marks of stores.
    #[cfg(feature = "emulator")]
    slot: Option<Slot>,
}

// SAFETY: the pointer is used only for accesses that several threads may make at the same time, and the map to which it
// points is Send + Sync.
unsafe impl Send for Backing {}
// SAFETY: as above.
unsafe impl Sync for Backing {}

impl Backing {
    /// Takes ownership of the first `size` bytes of a map, if the map is long enough and they contain the header page.
    fn new(map: MmapRaw, size: usize, writable: bool) -> Option<Self> {
        let size = size & !3;
        let base = NonNull::new(map.as_mut_ptr()).filter(|_| size >= HEADER_SIZE && map.len() >= size)?;
        Some(Self {
            base,
            size,
            writable,
            _map: Some(map),
            #[cfg(feature = "emulator")]
            slot: None,
        })
    }

    /// Takes memory with marks of stores, if it is available.
    #[cfg(feature = "emulator")]
    fn marked(size: usize) -> Option<Self> {
        let slot = Slot::take(size)?;
        Some(Self { base: NonNull::new(slot.base())?, size, writable: true, _map: None, slot: Some(slot) })
    }

    /// Returns the slot of memory with marks of stores.
    #[cfg(feature = "emulator")]
    #[inline]
    pub(super) fn slot(&self) -> Option<&Slot> {
        self.slot.as_ref()
    }

    #[inline]
    pub(super) fn size(&self) -> usize {
        self.size
    }

    #[inline]
    pub(super) fn base(&self) -> NonNull<u8> {
        self.base
    }
}

/// The RAM of one device: segment 3 of a PLC. A clone is another handle on the same memory.
#[derive(Clone)]
pub struct Segment {
    pub(super) backing: Arc<Backing>,
    /// A separate page in which firmware reads requests. `None` in most plants: firmware reads requests in the page
    /// that programs write.
    #[cfg(feature = "emulator")]
    pub(super) asked: Option<Arc<Backing>>,
}

impl Segment {
    /// Returns a zeroed memory segment for a device, private to this process; its header page describes the device.
    pub fn of(device: &'static DeviceLayout) -> Segment {
        let segment = Segment::heap(device.segment_size());
        if let Ok(header) = segment.header() {
            header.describe(device);
        }
        segment
    }

    /// Returns a zeroed memory segment of `size` bytes, at least the header page, private to this process. The kernel
    /// allocates pages when they are first accessed.
    ///
    /// Uses an anonymous map, not a `Vec`, because the allocator would clear page-aligned memory itself, and so access
    /// all of its pages. Running out of address space is fatal, as for a `Vec`.
    pub(crate) fn heap(size: usize) -> Segment {
        let size = size.max(HEADER_SIZE).next_multiple_of(4);
        #[cfg(feature = "emulator")]
        if let Some(backing) = Backing::marked(size) {
            return Self::from_backing(Arc::new(backing));
        }
        let map = MmapOptions::new().len(size).map_anon().ok();
        match map.and_then(|map| Backing::new(MmapRaw::from(map), size, true)) {
            Some(backing) => Self::from_backing(Arc::new(backing)),
            None => std::alloc::handle_alloc_error(std::alloc::Layout::new::<Header>()),
        }
    }

    /// Returns the memory segment in the first `size` bytes of a mapped file; `None` if the map is shorter, or `size`
    /// is less than the header page.
    pub(super) fn mapped(map: MmapRaw, size: usize, writable: bool) -> Option<Segment> {
        Some(Self::from_backing(Arc::new(Backing::new(map, size, writable)?)))
    }

    /// Returns the length of the memory segment in bytes.
    pub fn size(&self) -> usize {
        self.backing.size
    }

    /// Returns the address of the memory in this process, for programs in other languages that access it directly. It
    /// is valid as long as a handle on the memory segment exists. Follow the rules of [`super::cell`]: access a
    /// register at its own width, expect its value to change at any time, and do not write a read-only memory segment.
    #[must_use]
    pub fn base(&self) -> *const u8 {
        #[cfg(feature = "emulator")]
        if let Some(slot) = self.backing.slot() {
            slot.expose();
        }
        self.first_byte()
    }

    /// Returns the address of the memory, for code of this module, which marks its stores.
    pub(super) fn first_byte(&self) -> *const u8 {
        self.backing.base.as_ptr()
    }

    /// Claims the marks of the stores to the lines of 64 bytes that these bytes touch. Returns `None` if the memory segment
    /// has no marks, or if the bytes share a line with another reader.
    #[cfg(feature = "emulator")]
    pub(crate) fn line_marks(&self, bytes: Range<usize>) -> Option<LineMarks> {
        LineMarks::claim(&self.backing, bytes.start / LINE..bytes.end.div_ceil(LINE))
    }

    pub(super) fn from_backing(backing: Arc<Backing>) -> Segment {
        Self {
            backing,
            #[cfg(feature = "emulator")]
            asked: None,
        }
    }

    /// True if this handle can write registers.
    pub fn is_writable(&self) -> bool {
        self.backing.writable
    }

    /// Returns a typed view of the registers that begin at `%MB3.offset`.
    ///
    /// # Errors
    /// The range is out of bounds or misaligned, or the memory segment is read-only. A read-only memory segment has no
    /// views, because the cells of a view can be written; use [`Segment::snapshot`] instead.
    pub fn view<T: SharedRegs>(&self, offset: u32) -> Result<View<T>, MemoryError> {
        self.need_writable(offset)?;
        if (offset as usize) < HEADER_SIZE && size_of::<T>() > 0 {
            return Err(MemoryError::InHeader { address: Width::Byte.at(offset) });
        }
        View::new(Arc::clone(&self.backing), offset)
    }

    /// Returns the header page.
    ///
    /// # Errors
    /// The memory segment is read-only; use [`Segment::header_snapshot`] instead.
    pub fn header(&self) -> Result<View<Header>, MemoryError> {
        self.need_writable(0)?;
        View::new(Arc::clone(&self.backing), 0)
    }

    /// Returns the header page for firmware.
    ///
    /// # Errors
    /// The memory segment is read-only.
    #[cfg(feature = "emulator")]
    pub fn firmware_header(&self) -> Result<FirmwareHeader, MemoryError> {
        let shown = self.header()?;
        let asked = match &self.asked {
            Some(page) => View::new(Arc::clone(page), 0)?,
            None => shown.clone(),
        };
        Ok(FirmwareHeader::new(shown, asked))
    }

    /// Returns a handle on the same memory, for firmware that reads requests in a separate page. At first, that page
    /// has no requests.
    #[cfg(feature = "emulator")]
    #[must_use]
    pub(crate) fn with_request_page(self) -> Segment {
        let page = Segment::heap(HEADER_SIZE);
        Segment { asked: Some(page.backing), ..self }
    }

    /// Returns the beginning of the header page in 64-bit words, for comparing it as a whole.
    ///
    /// # Errors
    /// The memory segment is read-only, or the words reach beyond the header page.
    #[cfg_attr(not(any(feature = "emulator", test)), expect(dead_code, reason = "for the access checker"))]
    pub(crate) fn header_words<const N: usize>(&self) -> Result<View<[Cell64; N]>, MemoryError> {
        self.need_writable(0)?;
        let size = N * size_of::<u64>();
        if size > HEADER_SIZE {
            return Err(MemoryError::BlockOutOfRange { offset: 0, size, end: HEADER_SIZE });
        }
        View::new(Arc::clone(&self.backing), 0)
    }

    /// Returns the words of a [`Block`] that contains the word at `offset`, and the offset of the first of them. The block
    /// may begin in the header page.
    ///
    /// # Errors
    /// The memory segment is read-only, or `offset` is out of bounds.
    #[cfg(feature = "emulator")]
    pub(crate) fn block(&self, offset: u32) -> Result<(u32, View<[Cell64; Block::WORDS]>), MemoryError> {
        const SIZE: usize = size_of::<Block>();
        self.need_writable(offset)?;
        let word = offset as usize / size_of::<u64>() * size_of::<u64>();
        // The last block of the memory segment ends with its last word. A word after it is in no block, so the view is an
        // error.
        let last = (self.size() - SIZE) / size_of::<u64>() * size_of::<u64>();
        let first = (word / SIZE * SIZE).min(last).max(word.saturating_sub(SIZE - size_of::<u64>()));
        Ok((first as u32, View::new(Arc::clone(&self.backing), first as u32)?))
    }

    /// Returns a private copy of the registers that begin at `%MB3.offset`, as a block of cells with named registers.
    /// Different registers may be from different moments.
    ///
    /// # Errors
    /// The range is out of bounds or in the header page.
    pub fn snapshot<T: SharedRegs>(&self, offset: u32) -> Result<Box<T>, MemoryError> {
        self.check_block(offset, size_of::<T>())?;
        let mut copy = new_box::<T>();
        self.copy_bytes(offset, copy.as_mut_bytes());
        Ok(copy)
    }

    /// Returns a private copy of the header page. No field is torn: the copy uses 64-bit words, the width of the widest
    /// fields.
    pub fn header_snapshot(&self) -> Box<Header> {
        let mut copy = new_box::<Header>();
        for (i, chunk) in copy.as_mut_bytes().chunks_exact_mut(8).enumerate() {
            // SAFETY: the memory segment is longer than the header page, and the base is page-aligned and mapped for as
            // long as `self` exists.
            let word = unsafe { u64::load(self.backing.base.as_ptr().cast::<u64>().add(i)) };
            chunk.copy_from_slice(&word.to_ne_bytes());
        }
        copy
    }

    /// Loads the register at `%MB3.offset` (Acquire).
    ///
    /// # Errors
    /// Misaligned, out of bounds or in the header page.
    pub fn load(&self, offset: u32, width: Width) -> Result<u32, MemoryError> {
        let register = self.register(offset, width)?;
        Ok(match register {
            Register::Byte(cell) => u32::from(cell.load()),
            Register::Word(cell) => u32::from(cell.load()),
            Register::Dword(cell) => cell.load(),
        })
    }

    /// Stores to the register at `%MB3.offset` (Release).
    ///
    /// # Errors
    /// Returns the errors of [`Segment::load`]. It is also an error if the value is wider than the register, or the
    /// memory segment is read-only.
    pub fn store(&self, offset: u32, width: Width, value: u32) -> Result<(), MemoryError> {
        let register = self.writable_register(offset, width, &[value])?;
        match register {
            Register::Byte(cell) => cell.store(value as u8),
            Register::Word(cell) => cell.store(value as u16),
            Register::Dword(cell) => cell.store(value),
        }
        Ok(())
    }

    /// Stores `new` to the register at `%MB3.offset` if it still holds `current`. The inner result is the replaced
    /// value as `Ok`, or the value of the register as `Err` if it was not `current`.
    ///
    /// # Errors
    /// Returns the errors of [`Segment::store`], for both values.
    pub fn compare_exchange(
        &self,
        offset: u32,
        width: Width,
        current: u32,
        new: u32,
    ) -> Result<Result<u32, u32>, MemoryError> {
        let register = self.writable_register(offset, width, &[current, new])?;
        Ok(match register {
            Register::Byte(cell) => {
                cell.compare_exchange(current as u8, new as u8).map(u32::from).map_err(u32::from)
            }
            Register::Word(cell) => {
                cell.compare_exchange(current as u16, new as u16).map(u32::from).map_err(u32::from)
            }
            Register::Dword(cell) => cell.compare_exchange(current, new),
        })
    }

    /// Replaces the register's value by `f(value)` without losing a concurrent write, and returns the
    /// old value.
    ///
    /// # Errors
    /// Returns the errors of [`Segment::store`], for the value that `f` returns.
    pub fn update(&self, offset: u32, width: Width, f: impl Fn(u32) -> u32) -> Result<u32, MemoryError> {
        let mut seen = self.load(offset, width)?;
        loop {
            match self.compare_exchange(offset, width, seen, f(seen))? {
                Ok(old) => return Ok(old),
                Err(now) => seen = now,
            }
        }
    }

    /// Loads the part of a register at `%MB3.offset`, by one load of the whole register.
    ///
    /// # Errors
    /// Returns the errors of [`Segment::load`] for the register. It is also an error if the part is not within the
    /// register.
    pub fn load_within(
        &self,
        register_offset: u32,
        register_width: Width,
        offset: u32,
        width: Width,
    ) -> Result<u32, MemoryError> {
        let shift = shift_within(register_offset, register_width, offset, width)?;
        Ok(self.load(register_offset, register_width)? >> shift & width.max_value())
    }

    /// Writes the part of a register at `%MB3.offset`, by compare-exchange of the whole register: its other bytes keep
    /// values that others write at the same time.
    ///
    /// # Errors
    /// Returns the errors of [`Segment::store`] for the register. It is also an error if the part is not within the
    /// register.
    pub fn store_within(
        &self,
        register_offset: u32,
        register_width: Width,
        offset: u32,
        width: Width,
        value: u32,
    ) -> Result<(), MemoryError> {
        let shift = shift_within(register_offset, register_width, offset, width)?;
        fits(offset, width, value)?;
        let mask = width.max_value() << shift;
        self.update(register_offset, register_width, |whole| whole & !mask | value << shift).map(drop)
    }

    /// Copies the bytes from `%MB3.offset` on, in the device's order (little endian). Different 32-bit words of the
    /// copy may be from different moments.
    ///
    /// # Errors
    /// The range is out of bounds or in the header page.
    pub fn read_range(&self, offset: u32, into: &mut [u8]) -> Result<(), MemoryError> {
        self.check_block(offset, into.len())?;
        self.copy_bytes(offset, into);
        Ok(())
    }

    /// Copies bytes without a check of the bounds, which the callers have made.
    pub(super) fn copy_bytes(&self, offset: u32, into: &mut [u8]) {
        let offset = offset as usize;
        let first_word = offset & !3;
        let skip = offset - first_word;
        let (head, rest) = into.split_at_mut(into.len().min((4 - skip) % 4));
        if !head.is_empty() {
            let bytes = self.word(first_word);
            head.copy_from_slice(&bytes[skip..skip + head.len()]);
        }
        let mut at = offset + head.len();
        for chunk in rest.chunks_mut(4) {
            let bytes = self.word(at);
            chunk.copy_from_slice(&bytes[..chunk.len()]);
            at += 4;
        }
    }

    /// Returns the bytes of the 32-bit word at `offset`, in memory order.
    #[inline]
    fn word(&self, offset: usize) -> [u8; 4] {
        debug_assert!(offset.is_multiple_of(4) && offset + 4 <= self.size());
        // SAFETY: all offsets are aligned and inside the memory segment, which has a length divisible by 4;
        // the memory is mapped for as long as `self` lives.
        unsafe { u32::load(self.backing.base.as_ptr().add(offset).cast::<u32>()) }.to_ne_bytes()
    }

    fn need_writable(&self, offset: u32) -> Result<(), MemoryError> {
        if self.backing.writable { Ok(()) } else { Err(MemoryError::ReadOnly { offset }) }
    }

    fn check_block(&self, offset: u32, size: usize) -> Result<(), MemoryError> {
        if (offset as usize).checked_add(size).is_none_or(|end| end > self.size()) {
            return Err(MemoryError::BlockOutOfRange { offset, size, end: self.size() });
        }
        if (offset as usize) < HEADER_SIZE && size > 0 && !is_front(offset, size) {
            return Err(MemoryError::InHeader { address: Width::Byte.at(offset) });
        }
        Ok(())
    }

    fn writable_register(
        &self,
        offset: u32,
        width: Width,
        values: &[u32],
    ) -> Result<Register<'_>, MemoryError> {
        let register = self.register(offset, width)?;
        for &value in values {
            fits(offset, width, value)?;
        }
        self.need_writable(offset)?;
        Ok(register)
    }

    fn register(&self, offset: u32, width: Width) -> Result<Register<'_>, MemoryError> {
        let address = width.at(offset);
        let start = offset as usize;
        if start > self.size() - width.bytes() as usize {
            return Err(MemoryError::OutOfRange { address, end: self.size() });
        }
        if !offset.is_multiple_of(width.bytes()) {
            return Err(MemoryError::Misaligned { address });
        }
        // The front panel consists of 32-bit words.
        if start < HEADER_SIZE && !(width == Width::Dword && is_front(offset, 4)) {
            return Err(MemoryError::InHeader { address });
        }
        // SAFETY: in bounds and aligned for the width (just checked, the base is page-aligned), mapped for as long as
        // `self` lives. Only `writable_register` returns a register that may be written.
        unsafe {
            let at = self.backing.base.as_ptr().add(start);
            Ok(match width {
                Width::Byte => Register::Byte(&*at.cast::<Cell8>()),
                Width::Word => Register::Word(&*at.cast::<Cell16>()),
                Width::Dword => Register::Dword(&*at.cast::<Cell32>()),
            })
        }
    }
}

/// True if all of these bytes are part of [`Header::front`].
fn is_front(offset: u32, size: usize) -> bool {
    let (first, offset) = (core::mem::offset_of!(Header, front), offset as usize);
    first <= offset && offset - first + size <= size_of::<[Cell32; FRONT]>()
}

impl fmt::Debug for Segment {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Segment").field("writable", &self.backing.writable).finish_non_exhaustive()
    }
}

enum Register<'a> {
    Byte(&'a Cell8),
    Word(&'a Cell16),
    Dword(&'a Cell32),
}

/// Zeroed cells, private to this process.
fn new_box<T: SharedRegs>() -> Box<T> {
    T::new_box_zeroed().unwrap_or_else(|_| std::alloc::handle_alloc_error(std::alloc::Layout::new::<T>()))
}

fn fits(offset: u32, width: Width, value: u32) -> Result<(), MemoryError> {
    if value > width.max_value() {
        return Err(MemoryError::ValueTooWide { address: width.at(offset), value });
    }
    Ok(())
}

/// Returns the number of bits by which the part is shifted inside its register.
fn shift_within(
    register_offset: u32,
    register_width: Width,
    offset: u32,
    width: Width,
) -> Result<u32, MemoryError> {
    let (register, part) = (register_width.at(register_offset), width.at(offset));
    if !offset.is_multiple_of(width.bytes()) {
        return Err(MemoryError::Misaligned { address: part });
    }
    match offset.checked_sub(register_offset) {
        Some(skipped) if width <= register_width && skipped <= register_width.bytes() - width.bytes() => {
            Ok(8 * skipped)
        }
        _ => Err(MemoryError::NotWithin { register, part }),
    }
}

#[cfg(test)]
mod tests;
