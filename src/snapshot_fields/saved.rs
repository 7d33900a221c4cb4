//! Writes and reads the bytes of a state.

use postcard::ser_flavors::Flavor;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Bytes that are not a state of the structure to be restored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is no {what} at byte {at} of the state")]
pub struct Damaged {
    /// Description of the content that should be at this position.
    pub what: &'static str,
    /// Position, counted from the beginning of the state.
    pub at: usize,
}

/// Writer of a state for a snapshot.
#[derive(Debug, Default)]
pub struct Saving {
    bytes: Vec<u8>,
}

/// Appends the output of postcard to bytes.
struct ByteAppender<'a>(&'a mut Vec<u8>);

impl Flavor for ByteAppender<'_> {
    type Output = ();

    #[inline]
    fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
        self.0.push(byte);
        Ok(())
    }

    #[inline]
    fn try_extend(&mut self, bytes: &[u8]) -> postcard::Result<()> {
        self.0.extend_from_slice(bytes);
        Ok(())
    }

    fn finalize(self) -> postcard::Result<()> {
        Ok(())
    }
}

impl Saving {
    /// Creates an empty state. Reuses the memory of `bytes`, and drops their content.
    #[must_use]
    pub fn reusing(mut bytes: Vec<u8>) -> Self {
        bytes.clear();
        Saving { bytes }
    }

    /// Appends a value. The length of each sequence in the value must be known before it is written; serde cannot
    /// determine the length of some iterators.
    #[inline]
    pub fn value<T: Serialize + ?Sized>(&mut self, value: &T) {
        let written = postcard::serialize_with_flavor(value, ByteAppender(&mut self.bytes));
        debug_assert!(written.is_ok(), "{written:?}");
    }

    /// Appends bytes, but not their number. The reader must know the number from another source.
    pub fn raw(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// Appends words that are mostly 0.
    pub fn sparse(&mut self, words: impl Iterator<Item = u64>) {
        let words: Vec<(usize, u64)> = words.enumerate().filter(|(_, word)| *word != 0).collect();
        self.value(&words);
    }

    /// Returns bytes written so far.
    #[must_use]
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Returns bytes written so far.
    #[must_use]
    pub fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }
}

/// Reader of a state from a snapshot.
#[derive(Debug)]
pub struct Saved<'a> {
    all: &'a [u8],
    rest: &'a [u8],
}

impl<'a> Saved<'a> {
    /// Reads the bytes that [`Saving`] has written.
    #[must_use]
    pub fn new(bytes: &'a [u8]) -> Self {
        Saved { all: bytes, rest: bytes }
    }

    /// Returns the next value.
    ///
    /// # Errors
    /// [`Damaged`]: there is no valid value.
    #[inline]
    pub fn value<T: DeserializeOwned>(&mut self) -> Result<T, Damaged> {
        match postcard::take_from_bytes(self.rest) {
            Ok((value, rest)) => {
                self.rest = rest;
                Ok(value)
            }
            Err(_) => Err(self.no("readable value")),
        }
    }

    /// Returns the next `count` bytes.
    ///
    /// # Errors
    /// [`Damaged`]: fewer than `count` bytes remain.
    pub fn raw(&mut self, count: usize) -> Result<&'a [u8], Damaged> {
        let (bytes, rest) = self.rest.split_at_checked(count).ok_or_else(|| self.no("byte"))?;
        self.rest = rest;
        Ok(bytes)
    }

    /// Returns words that [`Saving::sparse`] has written.
    ///
    /// # Errors
    /// [`Damaged`]: there are no valid words.
    pub fn sparse<const N: usize>(&mut self) -> Result<Box<[u64; N]>, Damaged> {
        let mut words = Box::new([0; N]);
        for (index, word) in self.value::<Vec<(usize, u64)>>()? {
            *words.get_mut(index).ok_or_else(|| self.no("word"))? = word;
        }
        Ok(words)
    }

    /// Reads a value that must be equal to `right`.
    ///
    /// # Errors
    /// [`Damaged`]: the value differs.
    pub fn expect(&mut self, right: usize, what: &'static str) -> Result<(), Damaged> {
        if self.value::<usize>()? == right { Ok(()) } else { Err(self.no(what)) }
    }

    /// Checks a value.
    ///
    /// # Errors
    /// [`Damaged`] unless `holds`.
    pub fn check(&self, holds: bool, what: &'static str) -> Result<(), Damaged> {
        if holds { Ok(()) } else { Err(self.no(what)) }
    }

    /// Creates the error that the bytes at the present position are not a valid `what`.
    #[must_use]
    pub fn no(&self, what: &'static str) -> Damaged {
        Damaged { what, at: self.all.len() - self.rest.len() }
    }

    /// Checks that all bytes were read.
    ///
    /// # Errors
    /// [`Damaged`]: bytes remain.
    pub fn end(&self) -> Result<(), Damaged> {
        self.check(self.rest.is_empty(), "end")
    }
}
