//! A PLC program's view of the board: the RAM and, in the header page, the clock.

use crate::memory::header::PortEntry;
use crate::memory::{Header, MemoryError, Segment, SharedRegs, View};
use core::ops::Deref;
use core::time::Duration;

/// The RAM of one PLC: a memory segment of this process or of an attached image.
#[derive(Clone, Debug)]
pub struct Ram {
    segment: Segment,
    header: View<Header>,
}

impl Ram {
    /// Returns the RAM in a memory segment.
    ///
    /// # Errors
    /// The memory segment is read-only.
    pub fn of(segment: &Segment) -> Result<Self, MemoryError> {
        Ok(Ram { segment: segment.clone(), header: segment.header()? })
    }

    /// Returns a structure at byte `offset` of the image, as `_NAME AT %MB3.offset : T` declares it in an IEC program.
    /// `T` is a cell, or a structure from the module `registers` of the device.
    ///
    /// ```
    /// use commram::memory::{Cell16, Segment};
    /// use commram::plc::Ram;
    ///
    /// let ram = Ram::of(&Segment::of(commram::devices::default().layout))?;
    /// let words = ram.at::<[Cell16; 2]>(200_000)?;
    /// words[0].store(0x0001);
    /// assert_eq!(words[1].load(), 0);
    /// # Ok::<(), commram::memory::MemoryError>(())
    /// ```
    ///
    /// # Errors
    /// The offset is misaligned for the structure, or the structure extends beyond the memory in which it begins:
    /// beyond the image, or into another area of the device, such as its flags.
    pub fn at<T: SharedRegs>(&self, offset: u32) -> Result<Base<T>, MemoryError> {
        let registers = self.segment.view(offset)?;
        let size = size_of::<T>();
        // The view was created, so the structure ends within the image.
        let inside = offset + 1..offset + size as u32;
        let begins = self.header.areas.iter().map(|area| area.file_offset.load());
        match begins.filter(|begin| inside.contains(begin)).min() {
            Some(end) => Err(MemoryError::BlockOutOfRange { offset, size, end: end as usize }),
            None => Ok(Base { registers, offset, ram: self.clone() }),
        }
    }

    /// Returns the memory segment of the PLC.
    pub(crate) fn segment(&self) -> &Segment {
        &self.segment
    }

    /// Returns the header page.
    pub fn header(&self) -> &View<Header> {
        &self.header
    }

    /// Emulated time in microseconds, at the last action of the firmware.
    pub fn now_us(&self) -> u64 {
        self.header.virtual_time_us.load()
    }

    /// Returns a monitoring time that begins now.
    pub(crate) fn watch(&self, time: Duration) -> Watch {
        let time_us = u64::try_from(time.as_micros()).unwrap_or(u64::MAX);
        Watch { ends_us: self.now_us().saturating_add(time_us) }
    }

    /// Emulated time in microseconds at this very moment: in real time the clock also advances between two actions of
    /// the firmware.
    pub(crate) fn exact_us(&self) -> u64 {
        self.header.exact_us()
    }
}

/// A structure of registers with the board's clock, for the pin `_BASE` of a function block.
#[derive(Clone, Debug)]
pub struct Base<T: SharedRegs> {
    registers: View<T>,
    offset: u32,
    ram: Ram,
}

impl<T: SharedRegs> Base<T> {
    /// Returns the RAM that contains the structure.
    pub(crate) fn ram(&self) -> &Ram {
        &self.ram
    }

    /// Returns the structure as another type with the same layout.
    pub(crate) fn viewed<V>(&self) -> Viewed<'_, V>
    where
        T: Like<V>,
    {
        Viewed { registers: (*self.registers).as_ref(), offset: self.offset, ram: &self.ram }
    }
}

impl<T: SharedRegs> Deref for Base<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.registers
    }
}

/// A structure of registers with the same layout as `V`: `V` itself, and structures of other devices that differ only
/// in their names.
pub trait Like<V>: SharedRegs + AsRef<V> {}

impl<V, T: SharedRegs + AsRef<V>> Like<V> for T {}

/// The structure at a `_BASE` as another type with the same layout, for one call of a block.
pub(crate) struct Viewed<'a, V> {
    registers: &'a V,
    offset: u32,
    ram: &'a Ram,
}

impl<V> Viewed<'_, V> {
    /// Returns the RAM that contains the structure.
    pub(crate) fn ram(&self) -> &Ram {
        self.ram
    }

    /// Notifies the firmware that a restart was written to the control register of the port with this structure. The
    /// firmware cannot see the write in the RAM if the register already had this value (decision D-29).
    pub(crate) fn notify_restart(&self) {
        let is_here = |port: &&PortEntry| port.file_offset.load() == self.offset;
        if let Some(port) = self.ram.header.ports.iter().find(is_here) {
            port.restarts_written.increment();
        }
    }
}

impl<V> Deref for Viewed<'_, V> {
    type Target = V;

    fn deref(&self) -> &V {
        self.registers
    }
}

/// A running monitoring time, in emulated time.
#[derive(Clone, Copy, Debug)]
pub struct Watch {
    ends_us: u64,
}

impl Watch {
    /// True if the time is over.
    pub(crate) fn is_over(self, ram: &Ram) -> bool {
        ram.now_us() >= self.ends_us
    }
}
