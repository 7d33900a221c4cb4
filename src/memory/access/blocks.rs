//! Reads the RAM in blocks of sixteen words, with the processor's widest loads. The access checker compares all of the
//! RAM with its content after the last run of the firmware, before the firmware runs again.

use super::MemoryValue;
use crate::memory::cell::Cell64;

/// Number of words of a [`Block`].
const BLOCK: usize = 16;

/// A private copy of sixteen words, in the order and byte order of the registers, to be compared with the present
/// values.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(32))]
pub(crate) struct Block([u64; BLOCK]);

impl Block {
    /// Number of words in a block.
    pub(crate) const WORDS: usize = BLOCK;

    pub(crate) const fn new(words: [u64; BLOCK]) -> Self {
        Block(words)
    }

    /// Returns the words of the block.
    #[inline]
    pub(crate) fn words(&self) -> &[u64; BLOCK] {
        &self.0
    }

    /// Returns the words, for changes.
    #[inline]
    pub(crate) fn words_mut(&mut self) -> &mut [u64; BLOCK] {
        &mut self.0
    }

    /// Returns the words of all these blocks.
    #[inline]
    pub(crate) fn words_of(blocks: &[Block]) -> &[u64] {
        bytemuck::cast_slice(blocks)
    }

    /// Returns the words of all these blocks, for changes.
    #[inline]
    pub(crate) fn words_of_mut(blocks: &mut [Block]) -> &mut [u64] {
        bytemuck::cast_slice_mut(blocks)
    }

    /// Loads the values of the cells into the blocks, until the shorter slice ends.
    #[inline]
    pub(crate) fn load(blocks: &mut [Block], cells: &[[Cell64; BLOCK]]) {
        let count = blocks.len().min(cells.len());
        // SAFETY: cells have size and alignment of their values, are valid, and are only accessed by these
        // instructions.
        unsafe { load(cells.as_ptr().cast(), &mut blocks[..count]) }
    }

    /// Returns the index of the first block, at or after `from`, with a changed cell. The comparison ends with the
    /// shorter slice.
    #[inline]
    pub(crate) fn first_unlike(blocks: &[Block], cells: &[[Cell64; BLOCK]], from: usize) -> Option<usize> {
        let count = blocks.len().min(cells.len());
        let blocks = blocks.get(from..count)?;
        // SAFETY: as in `load`.
        let first = unsafe { first_unlike(cells[from..].as_ptr().cast(), blocks) };
        first.map(|first| from + first)
    }

    /// True if a cell has changed in a bit of `watched`. The comparison ends with the shortest slice.
    #[inline]
    pub(crate) fn differ_in(blocks: &[Block], cells: &[[Cell64; BLOCK]], watched: &[Block]) -> bool {
        let count = blocks.len().min(cells.len());
        // SAFETY: as in `load`.
        unsafe { first_unlike_in(cells.as_ptr().cast(), &blocks[..count], watched) }.is_some()
    }
}

/// Loads sixteen consecutive words for each of the blocks (Acquire).
///
/// # Safety
/// The conditions of [`MemoryValue::load`] hold for all these words.
#[inline]
unsafe fn load(at: *const [u64; BLOCK], to: &mut [Block]) {
    #[cfg(all(target_arch = "x86_64", not(miri)))]
    if wide::is_there() {
        // SAFETY: the caller guarantees a valid pointer, and the processor has the instructions.
        return unsafe { wide::load(at, to) };
    }
    for (index, block) in to.iter_mut().enumerate() {
        for (place, word) in block.0.iter_mut().enumerate() {
            // SAFETY: the caller guarantees that the pointer is valid.
            *word = u64::from_le(unsafe { u64::load(at.add(index).cast::<u64>().add(place)) });
        }
    }
}

/// Returns the index of the first block that differs from the memory, where the blocks begin at `at` and follow each
/// other (Acquire).
///
/// # Safety
/// See [`load`].
#[inline]
unsafe fn first_unlike(at: *const [u64; BLOCK], blocks: &[Block]) -> Option<usize> {
    #[cfg(all(target_arch = "x86_64", not(miri)))]
    if wide::is_there() {
        // SAFETY: the caller guarantees a valid pointer, and the processor has the instructions.
        return unsafe { wide::first_unlike(at, blocks) };
    }
    // SAFETY: the caller guarantees that the pointer is valid.
    unsafe { first_unlike_by_words(at, blocks, |_| u64::MAX) }
}

/// Does the same as [`first_unlike`], but compares only the bits that are set in `watched`. `watched` has the same
/// number of blocks.
///
/// # Safety
/// See [`load`].
#[inline]
unsafe fn first_unlike_in(at: *const [u64; BLOCK], blocks: &[Block], watched: &[Block]) -> Option<usize> {
    let blocks = &blocks[..blocks.len().min(watched.len())];
    #[cfg(all(target_arch = "x86_64", not(miri)))]
    if wide::is_there() {
        // SAFETY: the caller guarantees a valid pointer, and the processor has the instructions.
        return unsafe { wide::first_unlike_in(at, blocks, watched) };
    }
    // SAFETY: the caller guarantees that the pointer is valid.
    unsafe { first_unlike_by_words(at, blocks, |place| watched[place / BLOCK].0[place % BLOCK]) }
}

unsafe fn first_unlike_by_words(
    at: *const [u64; BLOCK],
    blocks: &[Block],
    watched: impl Fn(usize) -> u64,
) -> Option<usize> {
    let words = blocks.iter().flat_map(|block| block.0).enumerate();
    for (place, left) in words {
        // SAFETY: the caller guarantees that the pointer is valid.
        let now = u64::from_le(unsafe { u64::load(at.cast::<u64>().add(place)) });
        if (now ^ left) & watched(place) != 0 {
            return Some(place / BLOCK);
        }
    }
    None
}

#[cfg(all(target_arch = "x86_64", not(miri)))]
mod wide {
    use super::{BLOCK, Block};
    use core::arch::asm;
    use core::sync::atomic::{Ordering, compiler_fence};

    /// True if the processor has AVX2.
    #[inline]
    pub(super) fn is_there() -> bool {
        std::arch::is_x86_feature_detected!("avx2")
    }

    // The instructions use the full processor registers (ymm). At the end, `vzeroupper` clears the upper halves of all
    // of them.
    macro_rules! with_registers {
        ($($line:expr,)* ; $($operand:tt)*) => {
            asm!(
                $($line,)*
                "vzeroupper",
                $($operand)*
                out("xmm0") _, out("xmm1") _, out("xmm2") _, out("xmm3") _,
                out("xmm4") _, out("xmm5") _, out("xmm6") _, out("xmm7") _,
                out("xmm8") _, out("xmm9") _, out("xmm10") _, out("xmm11") _,
                out("xmm12") _, out("xmm13") _, out("xmm14") _, out("xmm15") _,
                options(nostack)
            )
        };
    }

    pub(super) unsafe fn load(at: *const [u64; BLOCK], to: &mut [Block]) {
        if to.is_empty() {
            return;
        }
        // SAFETY: the caller guarantees a valid pointer and AVX2; the instructions write `to` and registers.
        unsafe {
            with_registers!(
                "2:",
                "vmovdqu ymm0, ymmword ptr [{at}]",
                "vmovdqu ymm1, ymmword ptr [{at} + 32]",
                "vmovdqu ymm2, ymmword ptr [{at} + 64]",
                "vmovdqu ymm3, ymmword ptr [{at} + 96]",
                "vmovdqa ymmword ptr [{to}], ymm0",
                "vmovdqa ymmword ptr [{to} + 32], ymm1",
                "vmovdqa ymmword ptr [{to} + 64], ymm2",
                "vmovdqa ymmword ptr [{to} + 96], ymm3",
                "add {at}, 128",
                "add {to}, 128",
                "dec {rest}",
                "jnz 2b",
                ;
                at = inout(reg) at => _,
                to = inout(reg) to.as_mut_ptr() => _,
                rest = inout(reg) to.len() => _,
            );
        }
        compiler_fence(Ordering::Acquire);
    }

    macro_rules! first_unlike {
        ($name:ident, $mask:ident $(, $watched:ident)?) => {
            pub(super) unsafe fn $name(
                at: *const [u64; BLOCK],
                blocks: &[Block],
                $($watched: &[Block],)?
            ) -> Option<usize> {
                if blocks.is_empty() {
                    return None;
                }
                let rest: usize;
                // SAFETY: the caller guarantees a valid pointer, AVX2 and as many watched blocks; the instructions read
                // memory and write registers.
                unsafe {
                    with_registers!(
                        "2:",
                        "vmovdqu ymm0, ymmword ptr [{at}]",
                        "vmovdqu ymm1, ymmword ptr [{at} + 32]",
                        "vmovdqu ymm2, ymmword ptr [{at} + 64]",
                        "vmovdqu ymm3, ymmword ptr [{at} + 96]",
                        "vpxor ymm0, ymm0, ymmword ptr [{blocks}]",
                        "vpxor ymm1, ymm1, ymmword ptr [{blocks} + 32]",
                        "vpxor ymm2, ymm2, ymmword ptr [{blocks} + 64]",
                        "vpxor ymm3, ymm3, ymmword ptr [{blocks} + 96]",
                        $mask!(),
                        "vpor ymm0, ymm0, ymm1",
                        "vpor ymm2, ymm2, ymm3",
                        "vpor ymm0, ymm0, ymm2",
                        "vptest ymm0, ymm0",
                        "jnz 3f",
                        "add {at}, 128",
                        "add {blocks}, 128",
                        "dec {rest}",
                        "jnz 2b",
                        "3:",
                        ;
                        at = inout(reg) at => _,
                        blocks = inout(reg) blocks.as_ptr() => _,
                        $($watched = inout(reg) $watched.as_ptr() => _,)?
                        rest = inout(reg) blocks.len() => rest,
                    );
                }
                compiler_fence(Ordering::Acquire);
                (rest > 0).then(|| blocks.len() - rest)
            }
        };
    }

    macro_rules! all_bits {
        () => {
            ""
        };
    }

    macro_rules! watched_bits {
        () => {
            "vpand ymm0, ymm0, ymmword ptr [{watched}]
            vpand ymm1, ymm1, ymmword ptr [{watched} + 32]
            vpand ymm2, ymm2, ymmword ptr [{watched} + 64]
            vpand ymm3, ymm3, ymmword ptr [{watched} + 96]
            add {watched}, 128"
        };
    }

    first_unlike!(first_unlike, all_bits);
    first_unlike!(first_unlike_in, watched_bits, watched);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_compared_with_words() {
        const BLOCKS: usize = 3;
        // The tested words begin at an address that is not a multiple of the size of a block.
        let mut words = [0_u64; BLOCKS * BLOCK + 2];
        let mut blocks = [Block([u64::MAX; BLOCK]); BLOCKS];
        for place in 0..BLOCKS * BLOCK {
            for bit in [0, 31, 63] {
                words[1 + place] = 1 << bit;
                words[0] = !words[0];
                let at = words[1..].as_ptr().cast();
                // SAFETY: aligned, valid, and nothing else accesses it at the same time.
                unsafe {
                    load(at, &mut blocks);
                    assert!(
                        blocks.iter().flat_map(|block| block.0).eq(words[1..=BLOCKS * BLOCK].iter().copied())
                    );
                    assert_eq!(first_unlike(at, &blocks), None);
                    let mut watched = [Block([u64::MAX; BLOCK]); BLOCKS];
                    assert_eq!(first_unlike_in(at, &blocks, &watched), None);
                    blocks[place / BLOCK].0[place % BLOCK] = 0;
                    assert_eq!(first_unlike(at, &blocks), Some(place / BLOCK));
                    assert_eq!(first_unlike_by_words(at, &blocks, |_| u64::MAX), Some(place / BLOCK));
                    assert_eq!(first_unlike_in(at, &blocks, &watched), Some(place / BLOCK));
                    watched[place / BLOCK].0[place % BLOCK] = !(1 << bit);
                    assert_eq!(first_unlike_in(at, &blocks, &watched), None);
                    let by_words = first_unlike_by_words(at, &blocks, |at| watched[at / BLOCK].0[at % BLOCK]);
                    assert_eq!(by_words, None);
                    assert_eq!(first_unlike_in(at, &blocks, &watched[..0]), None);
                }
                words[1 + place] = 0;
            }
        }
    }
}
