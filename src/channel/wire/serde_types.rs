//! The program's own types, as `docs/reference/channel.md` calls them: serde encodes them in the format of postcard,
//! complete or not at all.

use serde::Serialize;
use serde::de::DeserializeOwned;

/// Encodes `what`.
pub(super) fn encode<T: Serialize>(what: &T) -> Vec<u8> {
    // Writing into a vector cannot fail.
    postcard::to_allocvec(what).unwrap_or_default()
}

/// Decodes the `T` at the beginning; `None` if the bytes do not begin with a `T`.
pub(super) fn decode_first<T: DeserializeOwned>(bytes: &[u8]) -> Option<T> {
    postcard::take_from_bytes(bytes).ok().map(|(what, _)| what)
}

/// Decodes one `T`; `None` if the bytes are not exactly one `T`.
pub(super) fn decode<T: DeserializeOwned>(bytes: &[u8]) -> Option<T> {
    let (what, rest) = postcard::take_from_bytes(bytes).ok()?;
    rest.is_empty().then_some(what)
}
