//! Types that only this program can decode (`docs/reference/channel.md` calls them the program's own types). serde
//! encodes them in the format of postcard.

use serde::Serialize;
use serde::de::DeserializeOwned;

/// Encodes a value as bytes of a request or reply.
pub(super) fn encode<T: Serialize>(what: &T) -> Vec<u8> {
    // Writing into a vector cannot fail.
    postcard::to_allocvec(what).unwrap_or_default()
}

/// Decodes the `T` at the beginning; `None` if the bytes do not begin with a `T`.
pub(super) fn decode_first<T: DeserializeOwned>(bytes: &[u8]) -> Option<T> {
    postcard::take_from_bytes(bytes).ok().map(|(what, _)| what)
}

/// Appends the encoding of `what` to `bytes`.
pub(super) fn append<T: Serialize>(what: &T, bytes: &mut Vec<u8>) {
    bytes.extend_from_slice(&encode(what));
}

/// Decodes the `T` at the beginning, and removes its bytes; `None` if the bytes do not begin with a `T`.
pub(super) fn take<T: DeserializeOwned>(bytes: &mut &[u8]) -> Option<T> {
    let (what, rest) = postcard::take_from_bytes(bytes).ok()?;
    *bytes = rest;
    Some(what)
}

/// Decodes one `T`; `None` if the bytes are not exactly one `T`.
#[cfg(test)]
pub(super) fn decode<T: DeserializeOwned>(mut bytes: &[u8]) -> Option<T> {
    take(&mut bytes).filter(|_| bytes.is_empty())
}
