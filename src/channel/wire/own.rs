//! What `docs/reference/channel.md` calls the program's own types: they travel by serde in the format of postcard, whole or not
//! at all.

use serde::Serialize;
use serde::de::DeserializeOwned;

/// The bytes of `what`.
pub(super) fn encode<T: Serialize>(what: &T) -> Vec<u8> {
    // Into a vector, writing cannot fail.
    postcard::to_allocvec(what).unwrap_or_default()
}

/// The way back of what stands first; `None` for bytes that are not those of a `T`.
pub(super) fn decode_first<T: DeserializeOwned>(bytes: &[u8]) -> Option<T> {
    postcard::take_from_bytes(bytes).ok().map(|(what, _)| what)
}

/// The way back; `None` for bytes that are not those of one `T`.
pub(super) fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Option<T> {
    let (what, rest) = postcard::take_from_bytes(bytes).ok()?;
    rest.is_empty().then_some(what)
}
