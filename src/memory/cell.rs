//! Register cells: all code of this project accesses the emulated RAM through them.
//!
//! Every register is a cell of its natural width (BYTE 8, WORD 16, DWORD 32 bits). Firmware and clients write it at
//! that width only, so a write never tears a register or changes its neighbour. Cells of different widths may overlap,
//! because all their accesses go through the module `access`. A cell holds its value in little-endian byte order
//! (decision D-01) on every host.
//!
//! Loads are `Acquire` and stores are `Release`, so "data first, then the control register" needs no further fences: a
//! reader that sees the control register also sees the data written before it.

use super::access::{self, MemoryValue};
use core::cell::UnsafeCell;
use core::sync::atomic::AtomicU32;
use zerocopy::{FromBytes, IntoBytes, KnownLayout};

/// Marker of types that consist of cells only.
///
/// # Safety
/// Every byte of the type must lie in a cell of this module, any bit pattern must be valid, and the type must contain
/// no padding.
pub unsafe trait SharedRegs: FromBytes + IntoBytes + KnownLayout + Sync {}

// SAFETY: an array of cells consists of cells only.
unsafe impl<T: SharedRegs, const N: usize> SharedRegs for [T; N] where
    [T; N]: FromBytes + IntoBytes + KnownLayout
{
}

macro_rules! cell {
    ($(#[$doc:meta])* $name:ident, $align:literal, $value:ty) => {
        $(#[$doc])*
        #[derive(FromBytes, IntoBytes, KnownLayout)]
        #[repr(C, align($align))]
        pub struct $name(UnsafeCell<$value>);

        // SAFETY: every access to the value is one of the functions of `access`, which threads may mix.
        unsafe impl Sync for $name {}

        // SAFETY: the type is a cell of this module.
        unsafe impl SharedRegs for $name {}

        impl $name {
            /// Returns the register's value.
            #[inline]
            pub fn load(&self) -> $value {
                // SAFETY: the cell is valid and aligned, and is only accessed by these instructions.
                <$value>::from_le(unsafe { MemoryValue::load(self.0.get()) })
            }

            /// Writes the value into the register, in one atomic access.
            #[inline]
            pub fn store(&self, value: $value) {
                // SAFETY: as in `load`. Only `segment` has references to cells in read-only memory, and it does not
                // store to them.
                unsafe { access::store(self.0.get(), value.to_le()) }
            }

            /// Writes `new` if the register still holds `current`.
            ///
            /// # Errors
            /// The value of the register, if it is not `current`. The register is then unchanged.
            #[inline]
            pub fn compare_exchange(&self, current: $value, new: $value) -> Result<$value, $value> {
                // SAFETY: as in `store`.
                let found = unsafe { access::compare_exchange(self.0.get(), current.to_le(), new.to_le()) };
                found.map(<$value>::from_le).map_err(<$value>::from_le)
            }

            /// Replaces the value by `f(value)` without losing a concurrent write, and returns the old value.
            #[inline]
            pub fn update(&self, mut f: impl FnMut($value) -> $value) -> $value {
                let mut seen = self.load();
                loop {
                    match self.compare_exchange(seen, f(seen)) {
                        Ok(old) => return old,
                        Err(now) => seen = now,
                    }
                }
            }
        }

        impl core::fmt::Debug for $name {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                write!(f, "16#{:0width$X}", self.load(), width = size_of::<$value>() * 2)
            }
        }
    };
}

cell!(
    /// An 8-bit register (BYTE, SINT, USINT).
    Cell8, 1, u8
);
cell!(
    /// A 16-bit register (WORD, INT, UINT).
    Cell16, 2, u16
);
cell!(
    /// A 32-bit register (DWORD, DINT, UDINT).
    Cell32, 4, u32
);
cell!(
    /// A 64-bit word of the header page; the device itself has no register that wide.
    Cell64, 8, u64
);

impl Cell32 {
    /// Returns the address of the cell, for calls of the kernel.
    #[inline]
    pub fn as_ptr(&self) -> *mut u32 {
        self.0.get()
    }

    /// Returns the cell as an argument of futex calls, for words of the header page only. No code accesses the atomic
    /// itself, because that would bypass `access`.
    #[inline]
    pub(super) fn as_futex(&self) -> &AtomicU32 {
        // SAFETY: valid and aligned, and only the kernel accesses it.
        unsafe { AtomicU32::from_ptr(self.as_ptr()) }
    }

    /// Adds, wrapping, and returns the new value.
    #[inline]
    pub fn add(&self, amount: u32) -> u32 {
        self.update(|value| value.wrapping_add(amount)).wrapping_add(amount)
    }

    /// Adds one, wrapping, and returns the new value.
    #[inline]
    pub fn increment(&self) -> u32 {
        self.add(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use zerocopy::FromZeros;

    #[test]
    fn values_are_little_endian() {
        let mut bytes = [0x44, 0x33, 0x22, 0x11];
        let cell = Cell32::mut_from_bytes(&mut bytes);
        // The buffer may be misaligned for a u32; only an aligned one gives a view.
        if let Ok(cell) = cell {
            assert_eq!(cell.load(), 0x1122_3344);
        }
        let cell = Cell16::new_zeroed();
        cell.store(0x1234);
        assert_eq!(cell.as_bytes_le(), [0x34, 0x12]);
    }

    impl Cell16 {
        fn as_bytes_le(&self) -> [u8; 2] {
            self.load().to_le_bytes()
        }
    }

    #[test]
    fn compare_exchange_leaves_a_foreign_value_alone() {
        let cell = Cell8::new_zeroed();
        cell.store(0x05);
        assert_eq!(cell.compare_exchange(0x05, 0x04), Ok(0x05));
        assert_eq!(cell.compare_exchange(0x05, 0x04), Err(0x04));
        assert_eq!(cell.load(), 0x04);
    }

    #[test]
    fn adding_wraps() {
        let cell = Cell32::new_zeroed();
        assert_eq!(cell.add(u32::MAX), u32::MAX);
        assert_eq!(cell.increment(), 0);
    }

    #[test]
    fn update_returns_the_old_value() {
        let cell = Cell16::new_zeroed();
        cell.store(0x00C0);
        assert_eq!(cell.update(|v| v & !0x0080), 0x00C0);
        assert_eq!(cell.load(), 0x0040);
    }
}
