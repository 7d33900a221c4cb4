//! The only access to the emulated RAM: loads, stores and exchanges of 8, 16, 32 and 64 bits, opaque to the compiler.
//!
//! Processes in any language share the RAM, and it is read in several widths: a register at its own width, the access
//! checker and bulk copies in words of 64 or 32 bits. Safe code may also place overlapping views over it. Rust does not
//! define atomic accesses of different sizes to the same bytes, but the processor does: an aligned access of up to 64
//! bits is one access to memory. So the RAM is treated like the registers of a device. Every access is an instruction
//! that is opaque to the compiler, and no Rust atomic or plain access touches the RAM. Safe code with views, snapshots
//! and raw accesses therefore has no undefined behaviour. The worst result of an access at another width is a value
//! that mixes old and new bytes. To prevent this, a register is *written* at its own width only.
//!
//! The access checker reads 128 consecutive bytes with loads of 32 bytes. The processor may split such a load, but only
//! into accesses of 64 bits or more, so no register is torn. The checker never writes with such instructions. A copy of
//! many words is one instruction (`rep movsd`), which does not tear a register either.
//!
//! On processors other than x86-64, and in Miri, the same functions use Rust's atomics, which compile to these
//! instructions on every Linux platform.
//!
//! Memory order: a load is `Acquire`, a store is `Release`, an exchange is both. On x86-64 all plain accesses of the
//! processor have this order. The assembler blocks, and a compiler fence at loads, prevent reordering by the compiler.

#[cfg(feature = "emulator")]
mod blocks;

#[cfg(feature = "emulator")]
pub(crate) use blocks::Block;

/// A value that the RAM can be accessed as: 8, 16, 32 or 64 bits, in the host's byte order.
pub(super) trait MemoryValue: Copy + Eq {
    /// Loads (Acquire). The memory may be read-only.
    ///
    /// # Safety
    /// `at` is aligned and valid for reads, and only functions of this module access the memory at `at`.
    unsafe fn load(at: *const Self) -> Self;

    /// Stores (Release).
    ///
    /// # Safety
    /// The conditions of [`MemoryValue::load`]; the memory is also valid for writes.
    unsafe fn store(at: *mut Self, value: Self);

    /// Stores `new` if the memory holds `current` (Acquire and Release). Returns the old value: as `Ok` if `new` was
    /// stored, as `Err` if the memory held another value.
    ///
    /// # Safety
    /// See [`MemoryValue::store`].
    unsafe fn compare_exchange(at: *mut Self, current: Self, new: Self) -> Result<Self, Self>;
}

/// Stores (Release), and marks the line (see `marks`).
///
/// # Safety
/// See [`MemoryValue::store`].
#[inline(always)]
pub(super) unsafe fn store<T: MemoryValue>(at: *mut T, value: T) {
    // SAFETY: the caller guarantees that the pointer is valid.
    unsafe { T::store(at, value) };
    #[cfg(feature = "emulator")]
    super::marks::mark(at.addr());
}

/// Stores `new` if the memory holds `current`, like [`MemoryValue::compare_exchange`], and marks the line.
///
/// # Errors
/// The value of the memory, if it is not `current`.
///
/// # Safety
/// See [`MemoryValue::store`].
#[inline(always)]
pub(super) unsafe fn compare_exchange<T: MemoryValue>(at: *mut T, current: T, new: T) -> Result<T, T> {
    // SAFETY: the caller guarantees that the pointer is valid.
    let old = unsafe { T::compare_exchange(at, current, new) }?;
    #[cfg(feature = "emulator")]
    super::marks::mark(at.addr());
    Ok(old)
}

/// Loads consecutive 32-bit words into private memory, each with a separate load.
///
/// # Safety
/// The conditions of [`MemoryValue::load`] hold for all these words.
#[cfg(feature = "emulator")]
pub(super) unsafe fn load_words(from: *const u32, into: &mut [u32]) {
    // SAFETY: the caller guarantees that the pointer is valid.
    unsafe { machine::load_words(from, into) }
}

#[cfg(all(target_arch = "x86_64", not(miri)))]
mod machine {
    use super::MemoryValue;
    use core::arch::asm;
    use core::sync::atomic::{Ordering, compiler_fence};

    macro_rules! value {
        ($value:ty, $size:literal, $load:literal as $wide:ty, $class:ident $operand:literal, $accumulator:tt) => {
            impl MemoryValue for $value {
                #[inline(always)]
                unsafe fn load(at: *const Self) -> Self {
                    let value: $wide;
                    // SAFETY: the caller guarantees that the pointer is valid; the instruction reads it and writes a
                    // register.
                    unsafe {
                        asm!(
                            concat!($load, ", ", $size, " ptr [{at}]"),
                            value = lateout(reg) value,
                            at = in(reg) at,
                            options(nostack, preserves_flags, readonly)
                        );
                    }
                    compiler_fence(Ordering::Acquire);
                    value as $value
                }

                #[inline(always)]
                unsafe fn store(at: *mut Self, value: Self) {
                    // SAFETY: the caller guarantees that the pointer is valid; the instruction writes nothing else.
                    unsafe {
                        asm!(
                            concat!("mov ", $size, " ptr [{at}], ", $operand),
                            value = in($class) value,
                            at = in(reg) at,
                            options(nostack, preserves_flags)
                        );
                    }
                }

                #[inline(always)]
                unsafe fn compare_exchange(at: *mut Self, current: Self, new: Self) -> Result<Self, Self> {
                    let found: $value;
                    // SAFETY: the caller guarantees that the pointer is valid; the instruction writes it, its
                    // accumulator and flags.
                    unsafe {
                        asm!(
                            concat!("lock cmpxchg ", $size, " ptr [{at}], ", $operand),
                            value = in($class) new,
                            at = in(reg) at,
                            inout($accumulator) current => found,
                            options(nostack)
                        );
                    }
                    if found == current { Ok(found) } else { Err(found) }
                }
            }
        };
    }

    #[cfg(feature = "emulator")]
    pub(crate) unsafe fn load_words(from: *const u32, into: &mut [u32]) {
        // SAFETY: the caller guarantees that the pointer is valid, and the instruction writes as many words as the
        // slice has. The calling convention requires a clear direction flag, so the addresses ascend.
        unsafe {
            asm!(
                "rep movsd",
                inout("rcx") into.len() => _,
                inout("rsi") from => _,
                inout("rdi") into.as_mut_ptr() => _,
                options(nostack, preserves_flags)
            );
        }
        compiler_fence(Ordering::Acquire);
    }

    // Narrow values are loaded into whole registers, so the processor does not wait for the upper part of an old value.
    value!(u8, "byte", "movzx {value:e}" as u32, reg_byte "{value}", "al");
    value!(u16, "word", "movzx {value:e}" as u32, reg "{value:x}", "ax");
    value!(u32, "dword", "mov {value:e}" as u32, reg "{value:e}", "eax");
    value!(u64, "qword", "mov {value:r}" as u64, reg "{value:r}", "rax");
}

#[cfg(any(not(target_arch = "x86_64"), miri))]
mod machine {
    use super::MemoryValue;
    use core::sync::atomic::{AtomicU8, AtomicU16, AtomicU32, AtomicU64, Ordering, fence};

    macro_rules! value {
        ($value:ty, $atomic:ty) => {
            impl MemoryValue for $value {
                #[inline(always)]
                unsafe fn load(at: *const Self) -> Self {
                    // SAFETY: the caller guarantees that the pointer is valid.
                    let value = unsafe { <$atomic>::from_ptr(at.cast_mut()) }.load(Ordering::Relaxed);
                    // Rust guarantees only Relaxed loads on read-only memory. So the load above is Relaxed, and this
                    // fence makes it an Acquire load.
                    fence(Ordering::Acquire);
                    value
                }

                #[inline(always)]
                unsafe fn store(at: *mut Self, value: Self) {
                    // SAFETY: the caller guarantees that the pointer is valid.
                    unsafe { <$atomic>::from_ptr(at) }.store(value, Ordering::Release);
                }

                #[inline(always)]
                unsafe fn compare_exchange(at: *mut Self, current: Self, new: Self) -> Result<Self, Self> {
                    // SAFETY: the caller guarantees that the pointer is valid.
                    let there = unsafe { <$atomic>::from_ptr(at) };
                    there.compare_exchange(current, new, Ordering::AcqRel, Ordering::Acquire)
                }
            }
        };
    }

    #[cfg(feature = "emulator")]
    pub(crate) unsafe fn load_words(from: *const u32, into: &mut [u32]) {
        for (n, word) in into.iter_mut().enumerate() {
            // SAFETY: the caller guarantees that the pointer is valid.
            *word = unsafe { u32::load(from.add(n)) };
        }
    }

    value!(u8, AtomicU8);
    value!(u16, AtomicU16);
    value!(u32, AtomicU32);
    value!(u64, AtomicU64);
}

#[cfg(test)]
mod tests {
    use super::MemoryValue;
    use core::fmt::Debug;

    /// Writes and exchanges the middle one of three words. The other two words must not change.
    fn round_trip<T: MemoryValue + Debug + Default>(one: T, other: T) {
        let mut memory = [T::default(); 3];
        let at = &raw mut memory[1];
        // SAFETY: the pointer is aligned and valid, and no other code accesses the value at the same time.
        unsafe {
            T::store(at, one);
            assert_eq!(T::load(at), one);
            assert_eq!(T::compare_exchange(at, other, other), Err(one));
            assert_eq!(T::load(at), one);
            assert_eq!(T::compare_exchange(at, one, other), Ok(one));
            assert_eq!(T::load(at), other);
        }
        assert_eq!(memory, [T::default(), other, T::default()]);
    }

    /// Access to the RAM is safe only if all code uses this module. So no other source file may contain atomics of
    /// these widths. The only exception is the atomic of the cell, which is passed to system calls.
    #[test]
    #[cfg_attr(miri, ignore = "reads all sources, which takes too long under Miri")]
    fn no_other_code_accesses_the_ram() {
        fn look(directory: &std::path::Path, found: &mut Vec<String>) {
            for entry in directory.read_dir().unwrap() {
                let path = entry.unwrap().path();
                let name = path.file_name().unwrap().to_string_lossy().into_owned();
                if path.is_dir() && name != "tests" {
                    look(&path, found);
                } else if path.is_file() && !["tests.rs", "testing.rs", "model.rs"].contains(&name.as_str()) {
                    let text = std::fs::read_to_string(&path).unwrap();
                    let program = text.split("#[cfg(test)]\nmod tests {").next().unwrap();
                    if ["AtomicU8", "AtomicU16", "AtomicU32", "AtomicU64"]
                        .iter()
                        .any(|it| program.contains(it))
                    {
                        found.push(name);
                    }
                }
            }
        }
        let mut found = Vec::new();
        look(std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/src")), &mut found);
        found.sort();
        assert_eq!(found, ["access.rs", "cell.rs"]);
    }

    #[cfg(feature = "emulator")]
    #[test]
    fn many_words_are_loaded_in_their_order() {
        let (from, mut into) = ([1_u32, 2, 0x8000_0003, u32::MAX, 5], [0; 4]);
        // SAFETY: the pointer is aligned and valid, and no other code accesses the value at the same time.
        unsafe { super::load_words(from.as_ptr(), &mut into) };
        assert_eq!(into, from[..4]);
    }

    #[test]
    fn each_width_is_itself_alone() {
        round_trip(0x81_u8, 0xFE);
        round_trip(0x8081_u16, 0xFEDC);
        round_trip(0x8081_8283_u32, 0xFEDC_BA98);
        round_trip(0x8081_8283_8485_8687_u64, 0xFEDC_BA98_7654_3210);
    }
}
