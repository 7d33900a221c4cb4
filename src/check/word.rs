//! Registers as bits of the 64-bit words in which the checker reads the RAM.

/// Size of a word in bytes.
pub(crate) const WORD: usize = size_of::<u64>();

/// Returns the bits of a register of `width` bytes at `offset` in the word that contains it.
pub(crate) fn mask(offset: u32, width: u32) -> u64 {
    u64::MAX >> (64 - 8 * width) << shift(offset)
}

/// Returns the value of the register of `width` bytes at `offset`, taken from the word that contains it.
pub(crate) fn value(word: u64, offset: u32, width: u32) -> u32 {
    ((word & mask(offset, width)) >> shift(offset)) as u32
}

fn shift(offset: u32) -> u32 {
    8 * (offset % WORD as u32)
}
