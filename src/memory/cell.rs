//! Register cells: the only way anything in this project touches the emulated RAM.
//!
//! Every register is a cell of its natural width (BYTE 8, WORD 16, DWORD 32 bits) and is accessed at
//! that width only, by firmware and clients alike: conflicting atomic accesses of different sizes are
//! not defined by the language. A cell holds its value in little-endian byte order (decision D-01),
//! whatever the host's order is.
//!
//! Loads are `Acquire` and stores are `Release`, so "data first, then the control register" needs no
//! further fences: whoever sees the control register sees the data written before it.

use core::sync::atomic::{AtomicU8, AtomicU16, AtomicU32, AtomicU64, Ordering};
use zerocopy::{FromBytes, IntoBytes, KnownLayout};

/// Marker of types that consist of cells only.
///
/// # Safety
/// Every byte of the type must lie in an atomic that is only accessed atomically, any bit pattern must
/// be valid, and the type must contain no padding.
pub unsafe trait SharedRegs: FromBytes + IntoBytes + KnownLayout + Sync {}

// SAFETY: an array of cells is nothing but cells.
unsafe impl<T: SharedRegs, const N: usize> SharedRegs for [T; N] where
    [T; N]: FromBytes + IntoBytes + KnownLayout
{
}

macro_rules! cell {
    ($(#[$doc:meta])* $name:ident, $atomic:ty, $value:ty) => {
        $(#[$doc])*
        #[derive(FromBytes, IntoBytes, KnownLayout)]
        #[repr(transparent)]
        pub struct $name($atomic);

        // SAFETY: the one field is an atomic, and every access below goes through it.
        unsafe impl SharedRegs for $name {}

        impl $name {
            /// The register's value.
            #[inline]
            pub fn load(&self) -> $value {
                <$value>::from_le(self.0.load(Ordering::Acquire))
            }

            /// Writes the register.
            #[inline]
            pub fn store(&self, value: $value) {
                self.0.store(value.to_le(), Ordering::Release);
            }

            /// Writes `new` if the register still holds `current`.
            ///
            /// # Errors
            /// The value found instead of `current`; the register is then untouched.
            #[inline]
            pub fn compare_exchange(&self, current: $value, new: $value) -> Result<$value, $value> {
                self.0
                    .compare_exchange(current.to_le(), new.to_le(), Ordering::AcqRel, Ordering::Acquire)
                    .map(<$value>::from_le)
                    .map_err(<$value>::from_le)
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
    Cell8, AtomicU8, u8
);
cell!(
    /// A 16-bit register (WORD, INT, UINT).
    Cell16, AtomicU16, u16
);
cell!(
    /// A 32-bit register (DWORD, DINT, UDINT).
    Cell32, AtomicU32, u32
);
cell!(
    /// A 64-bit word of the header page; the device itself has no register that wide.
    Cell64, AtomicU64, u64
);

impl Cell32 {
    /// The atomic behind the cell, for futex waits on header words (never for registers).
    #[inline]
    pub fn as_atomic(&self) -> &AtomicU32 {
        &self.0
    }

    /// Adds, wrapping, and returns the new value.
    #[inline]
    pub fn add(&self, amount: u32) -> u32 {
        let old = if cfg!(target_endian = "little") {
            self.0.fetch_add(amount, Ordering::AcqRel)
        } else {
            self.update(|value| value.wrapping_add(amount))
        };
        old.wrapping_add(amount)
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
    fn values_lie_in_little_endian_order() {
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
