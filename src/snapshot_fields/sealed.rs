//! The frame of files and states: a header with a format number at their beginning, a checksum at their end.

use super::{Damaged, Saved, Saving};
use twox_hash::XxHash3_64;

/// Number of bytes of the checksum.
const CHECKSUM: usize = size_of::<u64>();

/// Appends the header: `magic`, the number of the format, the version of commram.
pub(crate) fn save_header(to: &mut Saving, magic: &[u8], format: u16, version: &str) {
    to.raw(magic);
    to.raw(&format.to_le_bytes());
    to.value(version);
}

/// Reads the number of the format and the version of commram, which follow the magic.
///
/// # Errors
/// The bytes end too early, or the version is not text.
pub(crate) fn read_format(from: &mut Saved<'_>) -> Result<(u16, String), Damaged> {
    let format = from.raw(size_of::<u16>())?.try_into().map_or(0, u16::from_le_bytes);
    Ok((format, from.value()?))
}

/// Appends the checksum of `bytes`.
#[must_use]
pub fn seal(mut bytes: Vec<u8>) -> Vec<u8> {
    let sum = XxHash3_64::oneshot(&bytes);
    bytes.extend_from_slice(&sum.to_le_bytes());
    bytes
}

/// Returns the bytes before the checksum; `None` if the checksum is wrong.
#[must_use]
pub fn unseal(sealed: &[u8]) -> Option<&[u8]> {
    let (bytes, sum) = sealed.split_at_checked(sealed.len().checked_sub(CHECKSUM)?)?;
    (*sum == XxHash3_64::oneshot(bytes).to_le_bytes()).then_some(bytes)
}
