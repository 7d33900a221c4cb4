//! Bytes with a checksum over all of them at their end.

use twox_hash::XxHash3_64;

/// Bytes of the checksum.
const CHECKSUM: usize = size_of::<u64>();

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
