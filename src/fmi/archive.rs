//! The archive of a unit, an FMU: description, plant and shared object.

use super::MARK;
use super::description::description;
use super::resources::{Resources, ResourcesError};
use super::unit::Unit;
use std::io::{Cursor, Write};
use zip::result::ZipError;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

/// Name of the shared object in the archive, without its ending.
pub const LIBRARY: &str = "commram_fmi";

/// Directory for shared objects of this kind of machine.
const PLATFORM: &str = if cfg!(target_arch = "aarch64") { "aarch64-linux" } else { "x86_64-linux" };

/// Number of bytes that are searched together for the mark of the shared object.
const PART: usize = 1 << 16;

/// Reason for which no archive can be made.
#[derive(Debug, thiserror::Error)]
pub enum ArchiveError {
    /// The plant cannot become a unit.
    #[error(transparent)]
    Resources(#[from] ResourcesError),
    /// The archive cannot be packed.
    #[error("cannot pack the archive: {0}")]
    Zip(#[from] ZipError),
    /// The archive cannot be written.
    #[error("cannot pack the archive: {0}")]
    Write(#[from] std::io::Error),
}

/// True if these bytes are the shared object of this version of commram.
#[must_use]
pub fn is_library(bytes: &[u8]) -> bool {
    let part =
        |begin: usize| bytes.get(begin..bytes.len().min(begin + PART + MARK.len())).unwrap_or_default();
    // The search in a text of the standard library is fast also in a program without optimization.
    let mut parts = (0..bytes.len()).step_by(PART).map(|begin| String::from_utf8_lossy(part(begin)));
    bytes.starts_with(b"\x7FELF") && parts.any(|part| part.contains(MARK))
}

/// Makes the archive. `name` is the name under which tools show the model, and `library` is the shared object. Equal
/// plants, registers and shared objects give equal bytes.
///
/// # Errors
/// [`ArchiveError`].
pub fn archive(resources: &Resources, name: &str, library: &[u8]) -> Result<Vec<u8>, ArchiveError> {
    let unit = Unit::new(resources)?;
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    // The files have no time stamps, so that the archive does not depend on the present time.
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
    let mut file = |name: &str, content: &[u8], mode: u32| -> Result<(), ArchiveError> {
        zip.start_file(name, options.unix_permissions(mode))?;
        zip.write_all(content)?;
        Ok(())
    };
    file("modelDescription.xml", description(&unit, name).as_bytes(), 0o644)?;
    file(&format!("binaries/{PLATFORM}/{LIBRARY}.so"), library, 0o755)?;
    for (name, content) in resources.files() {
        file(&format!("resources/{name}"), &content, 0o644)?;
    }
    Ok(zip.finish()?.into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_library_is_known_by_its_mark() {
        let other = [b"\x7FELF commram-fmi unit 0.0.1;".as_slice(), b"text"].concat();
        assert!(!is_library(&other) && !is_library(MARK.as_bytes()) && !is_library(b""));
        assert!(is_library(&[b"\x7FELF", MARK.as_bytes(), b"text"].concat()));
        // The mark is found at each place, also between two parts.
        for place in [PART - MARK.len(), PART - 1, PART, 2 * PART - 5] {
            let file = [b"\x7FELF", vec![0xE2; place - 4].as_slice(), MARK.as_bytes()].concat();
            assert!(is_library(&file) && !is_library(&file[..file.len() - 1]), "{place}");
        }
    }

    #[test]
    fn the_archive_has_all_files_and_the_same_plant_gives_the_same_bytes() {
        let resources = Resources::built_in(vec!["node2.w_*".to_owned()]).unwrap();
        let bytes = archive(&resources, "built-in", b"library").unwrap();
        assert_eq!(bytes, archive(&resources, "built-in", b"library").unwrap());
        let mut zip = zip::ZipArchive::new(Cursor::new(bytes)).unwrap();
        let names: Vec<_> = zip.file_names().map(|name| name.unwrap().into_owned()).collect();
        let library = format!("binaries/{PLATFORM}/commram_fmi.so");
        assert_eq!(
            names,
            ["modelDescription.xml", &library, "resources/plant.toml", "resources/registers.txt"]
        );
        let list = std::io::read_to_string(zip.by_name("resources/registers.txt").unwrap()).unwrap();
        assert_eq!(list, "node2.w_*\n");
    }
}
