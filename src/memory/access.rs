//! The one way to the emulated RAM: loads, stores and exchanges of 8, 16, 32 and 64 bits, opaque to the language.
//!
//! The RAM is shared with processes that are written in anything, and is looked at in more than one width: a register at
//! its own, by the access checker and bulk copies in words of 64 or 32 bits, and safe code may lay views over each other as
//! it likes. Rust has no meaning for atomic accesses of different sizes to the same bytes. The processor has: an aligned
//! access of up to 64 bits is one access to memory, whatever others there are. So the RAM is treated like the registers of
//! a device: every access is an instruction that the compiler cannot look into, and no Rust atomic or plain access ever
//! meets a byte of it. Nothing that safe code does with views, snapshots and raw accesses can be undefined then; at worst
//! it is not what somebody wanted, which is why a register is *written* at its own width only.
//!
//! The access checker reads 128 bytes in a row, thirty-two at a time. The processor takes those as one access or as several of
//! 64 bits and more, so no register comes apart; it never writes like that. Copies of many words are made by one instruction,
//! which moves them in the same way.
//!
//! On processors other than x86-64, and in Miri, the same functions are Rust's atomics, which on every platform of Linux
//! compile to the instructions meant.
//!
//! Order: a load is `Acquire`, a store `Release`, an exchange both. On x86-64 all plain accesses of the processor are;
//! the compiler is held back by the assembler blocks and, at loads, a compiler fence.

#[cfg(feature = "emulator")]
mod blocks;

#[cfg(feature = "emulator")]
pub(crate) use blocks::Block;

/// A value that the RAM can be accessed as: 8, 16, 32 or 64 bits, in the host's byte order.
pub(super) trait Value: Copy + Eq {
    /// Loads (Acquire). The memory may be read-only.
    ///
    /// # Safety
    /// `at` is aligned and valid for reads, and nothing but the functions of this module accesses what it points to.
    unsafe fn load(at: *const Self) -> Self;

    /// Stores (Release).
    ///
    /// # Safety
    /// As [`Value::load`], and valid for writes.
    unsafe fn store(at: *mut Self, value: Self);

    /// Stores `new` if `current` is there (Acquire and Release); returns what was there, as an error if it was not.
    ///
    /// # Safety
    /// As [`Value::store`].
    unsafe fn compare_exchange(at: *mut Self, current: Self, new: Self) -> Result<Self, Self>;
}

/// Loads 32-bit words into memory of one's own, each as by a load of its own, in the order of their addresses.
///
/// # Safety
/// As [`Value::load`], for all of them.
#[cfg(feature = "emulator")]
pub(super) unsafe fn load_words(from: *const u32, into: &mut [u32]) {
    // SAFETY: the caller vouches for the pointer.
    unsafe { machine::load_words(from, into) }
}

#[cfg(all(target_arch = "x86_64", not(miri)))]
mod machine {
    use super::Value;
    use core::arch::asm;
    use core::sync::atomic::{Ordering, compiler_fence};

    macro_rules! value {
        ($value:ty, $size:literal, $load:literal as $wide:ty, $class:ident $operand:literal, $accumulator:tt) => {
            impl Value for $value {
                #[inline(always)]
                unsafe fn load(at: *const Self) -> Self {
                    let value: $wide;
                    // SAFETY: the caller vouches for the pointer; the instruction reads it and writes a register.
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
                    // SAFETY: the caller vouches for the pointer; the instruction writes nothing else.
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
                    // SAFETY: the caller vouches for the pointer; the instruction writes it, its accumulator and flags.
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
        // SAFETY: the caller vouches for the pointer; as many words are written as the slice has. The direction is upwards by
        // convention.
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

    // Narrow values are loaded into whole registers, which spares the processor the wait for the rest of an old one.
    value!(u8, "byte", "movzx {value:e}" as u32, reg_byte "{value}", "al");
    value!(u16, "word", "movzx {value:e}" as u32, reg "{value:x}", "ax");
    value!(u32, "dword", "mov {value:e}" as u32, reg "{value:e}", "eax");
    value!(u64, "qword", "mov {value:r}" as u64, reg "{value:r}", "rax");
}

#[cfg(any(not(target_arch = "x86_64"), miri))]
mod machine {
    use super::Value;
    use core::sync::atomic::{AtomicU8, AtomicU16, AtomicU32, AtomicU64, Ordering, fence};

    macro_rules! value {
        ($value:ty, $atomic:ty) => {
            impl Value for $value {
                #[inline(always)]
                unsafe fn load(at: *const Self) -> Self {
                    // SAFETY: the caller vouches for the pointer.
                    let value = unsafe { <$atomic>::from_ptr(at.cast_mut()) }.load(Ordering::Relaxed);
                    // Not an Acquire load: of those only Relaxed ones are guaranteed to work on read-only memory.
                    fence(Ordering::Acquire);
                    value
                }

                #[inline(always)]
                unsafe fn store(at: *mut Self, value: Self) {
                    // SAFETY: the caller vouches for the pointer.
                    unsafe { <$atomic>::from_ptr(at) }.store(value, Ordering::Release);
                }

                #[inline(always)]
                unsafe fn compare_exchange(at: *mut Self, current: Self, new: Self) -> Result<Self, Self> {
                    // SAFETY: the caller vouches for the pointer.
                    let there = unsafe { <$atomic>::from_ptr(at) };
                    there.compare_exchange(current, new, Ordering::AcqRel, Ordering::Acquire)
                }
            }
        };
    }

    #[cfg(feature = "emulator")]
    pub(crate) unsafe fn load_words(from: *const u32, into: &mut [u32]) {
        for (n, word) in into.iter_mut().enumerate() {
            // SAFETY: the caller vouches for the pointer.
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
    use super::Value;
    use core::fmt::Debug;

    /// A word in the middle of others, which must not be touched.
    fn there_and_back<T: Value + Debug + Default>(one: T, other: T) {
        let mut memory = [T::default(); 3];
        let at = &raw mut memory[1];
        // SAFETY: aligned, valid, and nothing else accesses it meanwhile.
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

    /// What is here would be in vain if somebody accessed the RAM in another way. No other source of the program has
    /// atomics of these widths; the cell's is for calls of the kernel.
    #[test]
    #[cfg_attr(miri, ignore = "reads all sources, which takes Miri for ever")]
    fn nothing_else_could_access_the_ram() {
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
        // SAFETY: aligned, valid, and nothing else accesses it meanwhile.
        unsafe { super::load_words(from.as_ptr(), &mut into) };
        assert_eq!(into, from[..4]);
    }

    #[test]
    fn each_width_is_itself_alone() {
        there_and_back(0x81_u8, 0xFE);
        there_and_back(0x8081_u16, 0xFEDC);
        there_and_back(0x8081_8283_u32, 0xFEDC_BA98);
        there_and_back(0x8081_8283_8485_8687_u64, 0xFEDC_BA98_7654_3210);
    }
}
