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
//! The access checker reads 128 bytes in a row, sixteen at a time. The processor takes those as one access or as two of 64
//! bits, so no register comes apart; it never writes like that.
//!
//! On processors other than x86-64, and in Miri, the same functions are Rust's atomics, which on every platform of Linux
//! compile to the instructions meant.
//!
//! Order: a load is `Acquire`, a store `Release`, an exchange both. On x86-64 all plain accesses of the processor are;
//! the compiler is held back by the assembler blocks and, at loads, a compiler fence.

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

/// Loads four words in a row (Acquire), each of them whole. Comparisons of whole structures take 0.7 times as long with it
/// as with loads one by one, which the compiler must keep one by one.
///
/// # Safety
/// As [`Value::load`], for all four.
#[inline(always)]
pub(super) unsafe fn load_four(at: *const [u64; 4]) -> [u64; 4] {
    // SAFETY: the caller vouches for the pointer.
    unsafe { machine::load_four(at) }
}

/// Words of a [`Block`].
pub(super) const BLOCK: usize = 16;

/// Sixteen words of memory of one's own, to hold words of the RAM against. They have the order of the registers, as cells'
/// values do.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(16))]
pub(super) struct Block(pub(super) [u64; BLOCK]);

/// Loads sixteen words in a row (Acquire).
///
/// # Safety
/// As [`Value::load`], for all sixteen.
#[inline(always)]
pub(super) unsafe fn load_block(at: *const [u64; BLOCK], to: &mut Block) {
    // SAFETY: the caller vouches for the pointer.
    unsafe { machine::load_block(at, to) }
}

/// Whether any of sixteen words in a row (Acquire) differs from `other` in bits of `watched`; `None`: in any bit.
///
/// # Safety
/// As [`load_block`].
#[inline(always)]
pub(super) unsafe fn block_differs(at: *const [u64; BLOCK], other: &Block, watched: Option<&Block>) -> bool {
    // SAFETY: the caller vouches for the pointer.
    unsafe {
        match watched {
            Some(watched) => machine::block_differs_in(at, other, watched),
            None => machine::block_differs(at, other),
        }
    }
}

#[cfg(all(target_arch = "x86_64", not(miri)))]
mod machine {
    use super::{BLOCK, Block, Value};
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

    #[inline(always)]
    pub(crate) unsafe fn load_four(at: *const [u64; 4]) -> [u64; 4] {
        let (first, second, third, fourth);
        // SAFETY: the caller vouches for the pointer; the instructions read it and write registers.
        unsafe {
            asm!(
                "mov {first}, qword ptr [{at}]",
                "mov {second}, qword ptr [{at} + 8]",
                "mov {third}, qword ptr [{at} + 16]",
                "mov {fourth}, qword ptr [{at} + 24]",
                first = out(reg) first,
                second = out(reg) second,
                third = out(reg) third,
                fourth = lateout(reg) fourth,
                at = in(reg) at,
                options(nostack, preserves_flags, readonly)
            );
        }
        compiler_fence(Ordering::Acquire);
        [first, second, third, fourth]
    }

    #[inline(always)]
    pub(crate) unsafe fn load_block(at: *const [u64; BLOCK], to: &mut Block) {
        // SAFETY: the caller vouches for the pointer; the instructions write `to`, which is aligned to 16, and registers.
        unsafe {
            asm!(
                "movdqu {first}, xmmword ptr [{at}]",
                "movdqu {second}, xmmword ptr [{at} + 16]",
                "movdqu {third}, xmmword ptr [{at} + 32]",
                "movdqu {fourth}, xmmword ptr [{at} + 48]",
                "movdqa xmmword ptr [{to}], {first}",
                "movdqa xmmword ptr [{to} + 16], {second}",
                "movdqa xmmword ptr [{to} + 32], {third}",
                "movdqa xmmword ptr [{to} + 48], {fourth}",
                "movdqu {first}, xmmword ptr [{at} + 64]",
                "movdqu {second}, xmmword ptr [{at} + 80]",
                "movdqu {third}, xmmword ptr [{at} + 96]",
                "movdqu {fourth}, xmmword ptr [{at} + 112]",
                "movdqa xmmword ptr [{to} + 64], {first}",
                "movdqa xmmword ptr [{to} + 80], {second}",
                "movdqa xmmword ptr [{to} + 96], {third}",
                "movdqa xmmword ptr [{to} + 112], {fourth}",
                at = in(reg) at,
                to = in(reg) to,
                first = out(xmm_reg) _,
                second = out(xmm_reg) _,
                third = out(xmm_reg) _,
                fourth = out(xmm_reg) _,
                options(nostack, preserves_flags)
            );
        }
        compiler_fence(Ordering::Acquire);
    }

    /// The difference of sixteen bytes, in the bits of `watched` if there is such a block.
    macro_rules! difference {
        ($into:literal, $offset:literal) => {
            concat!(
                "movdqu ",
                $into,
                ", xmmword ptr [{at} + ",
                $offset,
                "]\n",
                "pxor ",
                $into,
                ", xmmword ptr [{other} + ",
                $offset,
                "]\n",
            )
        };
        ($into:literal, $offset:literal, $watched:ident) => {
            concat!(
                difference!($into, $offset),
                "pand ",
                $into,
                ", xmmword ptr [{",
                stringify!($watched),
                "} + ",
                $offset,
                "]\n",
            )
        };
    }

    macro_rules! block_differs {
        ($name:ident $(, $watched:ident)?) => {
            #[inline(always)]
            pub(crate) unsafe fn $name(at: *const [u64; BLOCK], other: &Block $(, $watched: &Block)?) -> bool {
                let equal: u32;
                // SAFETY: the caller vouches for the pointer, blocks are aligned to 16; the instructions read memory and write registers.
                unsafe {
                    asm!(
                        difference!("{first}", 0 $(, $watched)?),
                        difference!("{more}", 16 $(, $watched)?),
                        "por {first}, {more}",
                        difference!("{more}", 32 $(, $watched)?),
                        "por {first}, {more}",
                        difference!("{more}", 48 $(, $watched)?),
                        "por {first}, {more}",
                        difference!("{more}", 64 $(, $watched)?),
                        "por {first}, {more}",
                        difference!("{more}", 80 $(, $watched)?),
                        "por {first}, {more}",
                        difference!("{more}", 96 $(, $watched)?),
                        "por {first}, {more}",
                        difference!("{more}", 112 $(, $watched)?),
                        "por {first}, {more}",
                        "pxor {more}, {more}",
                        "pcmpeqb {first}, {more}",
                        "pmovmskb {equal:e}, {first}",
                        at = in(reg) at,
                        other = in(reg) other,
                        $($watched = in(reg) $watched,)?
                        first = out(xmm_reg) _,
                        more = out(xmm_reg) _,
                        equal = lateout(reg) equal,
                        options(nostack, preserves_flags, readonly)
                    );
                }
                compiler_fence(Ordering::Acquire);
                // A bit for each byte.
                equal != 0xFFFF
            }
        };
    }

    block_differs!(block_differs);
    block_differs!(block_differs_in, watched);

    // Narrow values are loaded into whole registers, which spares the processor the wait for the rest of an old one.
    value!(u8, "byte", "movzx {value:e}" as u32, reg_byte "{value}", "al");
    value!(u16, "word", "movzx {value:e}" as u32, reg "{value:x}", "ax");
    value!(u32, "dword", "mov {value:e}" as u32, reg "{value:e}", "eax");
    value!(u64, "qword", "mov {value:r}" as u64, reg "{value:r}", "rax");
}

#[cfg(any(not(target_arch = "x86_64"), miri))]
mod machine {
    use super::{BLOCK, Block, Value};
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

    #[inline(always)]
    pub(crate) unsafe fn load_four(at: *const [u64; 4]) -> [u64; 4] {
        // SAFETY: the caller vouches for the pointer.
        core::array::from_fn(|n| unsafe { u64::load(at.cast::<u64>().add(n)) })
    }

    #[inline(always)]
    pub(crate) unsafe fn load_block(at: *const [u64; BLOCK], to: &mut Block) {
        // SAFETY: the caller vouches for the pointer.
        *to = Block(core::array::from_fn(|n| u64::from_le(unsafe { u64::load(at.cast::<u64>().add(n)) })));
    }

    #[inline(always)]
    pub(crate) unsafe fn block_differs(at: *const [u64; BLOCK], other: &Block) -> bool {
        // SAFETY: the caller vouches for the pointer.
        unsafe { block_differs_in(at, other, &Block([u64::MAX; BLOCK])) }
    }

    #[inline(always)]
    pub(crate) unsafe fn block_differs_in(at: *const [u64; BLOCK], other: &Block, watched: &Block) -> bool {
        let mut now = Block([0; BLOCK]);
        // SAFETY: the caller vouches for the pointer.
        unsafe { load_block(at, &mut now) };
        now.0.iter().zip(&other.0).zip(&watched.0).any(|((now, other), watched)| (now ^ other) & watched != 0)
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

    #[test]
    fn four_words_are_loaded_in_their_order() {
        let words = [1_u64, 2, 0x8000_0000_0000_0003, u64::MAX];
        // SAFETY: aligned, valid, and nothing else accesses it meanwhile.
        assert_eq!(unsafe { super::load_four(&raw const words) }, words);
    }

    #[test]
    fn a_block_is_held_against_sixteen_words() {
        let mut words = [0_u64; 18];
        let mut block = super::Block([u64::MAX; super::BLOCK]);
        for place in 0..super::BLOCK {
            for bit in [0, 31, 63] {
                words[1 + place] = 1 << bit;
                words[0] = !words[0];
                let at = words[1..].as_ptr().cast();
                // SAFETY: aligned, valid, and nothing else accesses it meanwhile.
                unsafe {
                    super::load_block(at, &mut block);
                    assert_eq!(block.0, words[1..17]);
                    assert!(!super::block_differs(at, &block, None));
                    block.0[place] = 0;
                    assert!(super::block_differs(at, &block, None));
                    let mut watched = super::Block([u64::MAX; super::BLOCK]);
                    assert!(super::block_differs(at, &block, Some(&watched)));
                    watched.0[place] = !(1 << bit);
                    assert!(!super::block_differs(at, &block, Some(&watched)));
                }
                words[1 + place] = 0;
            }
        }
    }

    #[test]
    fn each_width_is_itself_alone() {
        there_and_back(0x81_u8, 0xFE);
        there_and_back(0x8081_u16, 0xFEDC);
        there_and_back(0x8081_8283_u32, 0xFEDC_BA98);
        there_and_back(0x8081_8283_8485_8687_u64, 0xFEDC_BA98_7654_3210);
    }
}
