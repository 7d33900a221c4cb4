//! Names of files in the protocol, `file:///a/b%20c`, and as paths.

use lsp_types::Uri;
use std::os::unix::ffi::{OsStrExt, OsStringExt};
use std::path::{Path, PathBuf};

/// Returns the path of a file URI. Any other URI is returned as a relative path.
pub(super) fn path_of(uri: &Uri) -> PathBuf {
    let text = uri.as_str();
    let path = match text.strip_prefix("file://") {
        // The URI may have a host before the path.
        Some(rest) => rest.find('/').map_or(rest, |start| &rest[start..]),
        None => text,
    };
    PathBuf::from(std::ffi::OsString::from_vec(decoded(path)))
}

/// Returns the URI of a file; `None` for a path that is not absolute.
pub(super) fn uri_of(path: &Path) -> Option<Uri> {
    if !path.is_absolute() {
        return None;
    }
    let mut text = "file://".to_owned();
    for byte in path.as_os_str().as_bytes() {
        match byte {
            b'A'..=b'Z' | b'a'..=b'z' | b'0'..=b'9' | b'/' | b'-' | b'_' | b'.' | b'~' => {
                text.push(char::from(*byte))
            }
            other => text.push_str(&format!("%{other:02X}")),
        }
    }
    text.parse().ok()
}

/// Decodes each percent-encoded byte, such as `%41`.
fn decoded(text: &str) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let Some((first, after)) = rest.split_first() {
        let code = (*first == b'%').then(|| after.get(..2)).flatten();
        let code = code.and_then(|code| u8::from_str_radix(core::str::from_utf8(code).ok()?, 16).ok());
        match code {
            Some(byte) => {
                bytes.push(byte);
                rest = &after[2..];
            }
            None => {
                bytes.push(*first);
                rest = after;
            }
        }
    }
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files_are_paths_and_back() {
        for (uri, path) in
            [("file:///a/b%20c%C3%BC.rhai", "/a/b cü.rhai"), ("file:///a/%25.toml", "/a/%.toml")]
        {
            assert_eq!(path_of(&uri.parse().unwrap()), Path::new(path));
            assert_eq!(uri_of(Path::new(path)).unwrap().as_str(), uri);
        }
        assert_eq!(path_of(&"file://host/a".parse().unwrap()), Path::new("/a"));
        assert_eq!(path_of(&"untitled:Untitled-1".parse().unwrap()), Path::new("untitled:Untitled-1"));
        assert!(uri_of(Path::new("relative")).is_none());
    }
}
