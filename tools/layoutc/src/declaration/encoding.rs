//! The character encodings of exported files.

use std::iter;

/// Returns the text of a file: UTF-8, UTF-16 with or without a byte order mark, otherwise the Latin encoding of older
/// Windows programs. In that encoding, non-ASCII characters can only occur in comments and texts.
pub(crate) fn decode(bytes: Vec<u8>) -> String {
    let text = match bytes[..] {
        [0xFF, 0xFE, ..] => utf_16(&bytes, u16::from_le_bytes),
        [0xFE, 0xFF, ..] => utf_16(&bytes, u16::from_be_bytes),
        // The first character of a declaration is an ASCII character.
        [first, 0, ..] if first != 0 => utf_16(&bytes, u16::from_le_bytes),
        [0, second, ..] if second != 0 => utf_16(&bytes, u16::from_be_bytes),
        _ => String::from_utf8(bytes)
            .unwrap_or_else(|error| error.into_bytes().into_iter().map(char::from).collect()),
    };
    text.strip_prefix('\u{FEFF}').map(str::to_owned).unwrap_or(text)
}

fn utf_16(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> String {
    let (pairs, rest) = bytes.as_chunks();
    let units = pairs.iter().map(|pair| unit(*pair));
    // UTF-16 has two bytes for each unit. A single byte at the end of the file counts as an invalid character.
    let end = iter::repeat_n(0xDFFF, rest.len());
    char::decode_utf16(units.chain(end)).map(|found| found.unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
}
