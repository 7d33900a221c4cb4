//! Words of the RAM by sixteen, for the access checker.

use super::access::{self, BLOCK};
use super::cell::Cell64;

/// What sixteen words held when they were last looked at, to be compared with what they hold now. Both are faster than
/// word by word.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Block(access::Block);

impl Block {
    /// How many words it holds.
    pub(crate) const WORDS: usize = BLOCK;

    /// These words.
    pub(crate) const fn new(words: [u64; BLOCK]) -> Self {
        Block(access::Block(words))
    }

    /// The words.
    #[inline]
    pub(crate) fn words(&self) -> &[u64; BLOCK] {
        &self.0.0
    }

    /// The words, to change them.
    #[inline]
    pub(crate) fn words_mut(&mut self) -> &mut [u64; BLOCK] {
        &mut self.0.0
    }

    /// Takes over what the cells hold now.
    #[inline]
    pub(crate) fn load(&mut self, cells: &[Cell64; BLOCK]) {
        // SAFETY: cells have size and alignment of their values, are valid, and are accessed in this way only.
        unsafe { access::load_block(core::ptr::from_ref(cells).cast(), &mut self.0) }
    }

    /// Whether the cells hold something else now.
    #[inline]
    pub(crate) fn differs(&self, cells: &[Cell64; BLOCK]) -> bool {
        // SAFETY: as in `load`.
        unsafe { access::block_differs(core::ptr::from_ref(cells).cast(), &self.0, None) }
    }

    /// The same for the bits of `watched` alone.
    #[inline]
    pub(crate) fn differs_in(&self, cells: &[Cell64; BLOCK], watched: &Block) -> bool {
        // SAFETY: as in `load`.
        unsafe { access::block_differs(core::ptr::from_ref(cells).cast(), &self.0, Some(&watched.0)) }
    }
}
