//! Rules for names of instances and PLCs, and the paths of their files.
//!
//! Names of instances and PLCs contain no dot, so `commram.<instance>.<plc>` can be split in only one way. The name of
//! an image has two dots. The names of other files of an instance have three dots.

use super::MemoryError;
use std::path::{Path, PathBuf};

/// Directory of the images: a file system in memory that every Linux has.
pub(crate) const IMAGE_DIRECTORY: &str = "/dev/shm";
/// Longest instance or PLC name in bytes.
pub(crate) const MAX_NAME: usize = 31;
pub(super) const PREFIX: &str = "commram.";
/// Ends the name of an instance's directory.
const DIRECTORY: &str = ".iox.d";
/// Prefix of the names of the shared memory objects of all channels.
pub(crate) const CHANNEL_PREFIX: &str = "commram_";

/// Checks the name of an instance.
///
/// # Errors
/// The name does not consist of 1 to 31 of the characters `A-Z a-z 0-9 _ -`.
pub fn check_instance(name: &str) -> Result<(), MemoryError> {
    check("instance", name)
}

/// Checks the name of a PLC.
///
/// # Errors
/// Returns the errors of [`check_instance`].
pub(crate) fn check_plc(name: &str) -> Result<(), MemoryError> {
    check("PLC", name)
}

/// Returns the image file of a PLC: `/dev/shm/commram.<instance>.<plc>`.
///
/// # Errors
/// One of the names breaks the rules.
pub(crate) fn image_path(instance: &str, plc: &str) -> Result<PathBuf, MemoryError> {
    check_instance(instance)?;
    check_plc(plc)?;
    Ok(Path::new(IMAGE_DIRECTORY).join(format!("{PREFIX}{instance}.{plc}")))
}

/// Returns the directory of the instance's iceoryx2 files: `/dev/shm/commram.<instance>.iox.d`. No image can
/// have this name, because it has a dot more.
///
/// # Errors
/// Returns the errors of [`check_instance`].
pub fn channel_root(instance: &str) -> Result<PathBuf, MemoryError> {
    check_instance(instance)?;
    Ok(Path::new(IMAGE_DIRECTORY).join(format!("{PREFIX}{instance}{DIRECTORY}")))
}

/// Instance and PLC of an image's file name; `None` if it is not the name of an image.
pub(super) fn parse_image_name(file_name: &str) -> Option<(&str, &str)> {
    let (instance, plc) = file_name.strip_prefix(PREFIX)?.split_once('.')?;
    (is_name(instance) && is_name(plc)).then_some((instance, plc))
}

/// Instance of a directory's name; `None` if it is not the name of an instance's directory.
pub(super) fn parse_directory_name(file_name: &str) -> Option<&str> {
    let instance = file_name.strip_prefix(PREFIX)?.strip_suffix(DIRECTORY)?;
    is_name(instance).then_some(instance)
}

fn check(what: &'static str, name: &str) -> Result<(), MemoryError> {
    if is_name(name) { Ok(()) } else { Err(MemoryError::BadName { what, name: name.to_owned() }) }
}

fn is_name(name: &str) -> bool {
    (1..=MAX_NAME).contains(&name.len())
        && name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_' || b == b'-')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths() {
        assert_eq!(image_path("line-1", "press_A").unwrap(), Path::new("/dev/shm/commram.line-1.press_A"));
        assert_eq!(channel_root("line-1").unwrap(), Path::new("/dev/shm/commram.line-1.iox.d"));
    }

    #[test]
    fn bad_names_are_refused_with_the_rule() {
        let long = "x".repeat(32);
        for name in ["", ".", "a.b", "a/b", "grün", "a b", "\0", long.as_str()] {
            assert!(image_path(name, "plc").is_err(), "{name:?}");
            assert!(image_path("instance", name).is_err(), "{name:?}");
            assert!(channel_root(name).is_err(), "{name:?}");
        }
        assert_eq!(
            image_path("a", "b.c").unwrap_err().to_string(),
            "PLC name \"b.c\": use 1 to 31 characters of A-Z a-z 0-9 _ -"
        );
        assert!(image_path(&long[1..], &long[1..]).is_ok());
    }

    #[test]
    fn image_names_split_back_and_nothing_else_does() {
        assert_eq!(parse_image_name("commram.line-1.press_A"), Some(("line-1", "press_A")));
        for other in
            ["commram.line-1.iox.d", "commram.a", "commram..b", "commram.a.", "commram.a.b.c", "a.b.c"]
        {
            assert_eq!(parse_image_name(other), None, "{other}");
        }
        assert_eq!(parse_directory_name("commram.line-1.iox.d"), Some("line-1"));
        for other in ["commram..iox.d", "commram.a.b.iox.d", "commram.a.b", "a.iox.d"] {
            assert_eq!(parse_directory_name(other), None, "{other}");
        }
    }
}
