//! The part of the RAM that survives power-off, kept in a file.
//!
//! On the device the Ethernet configuration lies in NOVRAM (manual 5.00005.03a p. 61). commram keeps it in
//! `<plc>.novram` in a directory of the user's choice and writes it whenever it has changed: a new file
//! beside it, synced, then renamed over it, so that whenever the emulator is killed the file holds either
//! the old or the new content. A file that is not ours or is damaged is set aside, never overwritten.

use crate::layout::omega_drive_line_2::{ETHERNET_CONFIG, ETHERNET_CONFIG_BYTES};
use crate::memory::{MemoryError, Segment, Width};
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use thiserror::Error;

const MAGIC: [u8; 8] = *b"commramN";
const VERSION: u32 = 1;
/// Magic, version, length of the content.
const HEAD: usize = 16;
const CHECKSUM: usize = 4;
const FILE_SIZE: usize = HEAD + ETHERNET_CONFIG_BYTES + CHECKSUM;

type Content = [u8; ETHERNET_CONFIG_BYTES];

/// Trouble with a NOVRAM file.
#[derive(Debug, Error)]
pub enum NovramError {
    /// The system refuses.
    #[error("NOVRAM file {}: cannot {doing}: {source}; --novram needs a writable directory", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What was tried.
        doing: &'static str,
        /// Why not.
        source: io::Error,
    },
    /// The RAM refuses.
    #[error(transparent)]
    Memory(#[from] MemoryError),
}

/// What was found at power-on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Found {
    /// No file yet: delivery state.
    Nothing,
    /// The content was restored.
    Content,
    /// The file was damaged or foreign; it now has this name, and the device is in delivery state.
    SetAside(PathBuf),
}

/// The NOVRAM of one PLC.
#[derive(Debug)]
pub struct Novram {
    path: PathBuf,
    segment: Segment,
    saved: Content,
    /// Content that could not be written; not tried again before it changes.
    refused: Option<Content>,
}

impl Novram {
    /// Restores the NOVRAM of PLC `plc` from `directory`, which is made if missing.
    ///
    /// # Errors
    /// [`NovramError`] if directory or file cannot be used. A damaged file is no error, see [`Found`].
    pub fn power_on(directory: &Path, plc: &str, segment: &Segment) -> Result<(Self, Found), NovramError> {
        let path = directory.join(format!("{plc}.novram"));
        fs::create_dir_all(directory).map_err(failed(&path, "make its directory"))?;
        let (content, found) = match fs::read(&path) {
            Ok(bytes) => match decode(&bytes) {
                Some(content) => (content, Found::Content),
                None => (Content::default(), Found::SetAside(set_aside(&path)?)),
            },
            Err(error) if error.kind() == io::ErrorKind::NotFound => (Content::default(), Found::Nothing),
            Err(error) => return Err(failed(&path, "read it")(error)),
        };
        let novram = Novram { path, segment: segment.clone(), saved: content, refused: None };
        for (offset, width, range) in registers() {
            let mut bytes = [0; 4];
            bytes[..range.len()].copy_from_slice(&content[range]);
            novram.segment.store(offset, width, u32::from_le_bytes(bytes))?;
        }
        Ok((novram, found))
    }

    /// Writes the file if the registers have changed since it was last written; tells whether it did.
    ///
    /// # Errors
    /// [`NovramError::Io`]; the old file is untouched then, and the next change tries again.
    pub fn save_if_changed(&mut self) -> Result<bool, NovramError> {
        let mut content = Content::default();
        for (offset, width, range) in registers() {
            let bytes = self.segment.load(offset, width)?.to_le_bytes();
            let len = range.len();
            content[range].copy_from_slice(&bytes[..len]);
        }
        if content == self.saved || self.refused == Some(content) {
            return Ok(false);
        }
        match replace(&self.path, &encode(&content)) {
            Ok(()) => {
                self.saved = content;
                self.refused = None;
                Ok(true)
            }
            Err(error) => {
                self.refused = Some(content);
                Err(failed(&self.path, "write it")(error))
            }
        }
    }
}

/// The registers of `ETHERNET_CONFIG_BMSTRUCT`, each with its place in the content: two DWORDs with two
/// USINT arrays between them (manual p. 76).
fn registers() -> impl Iterator<Item = (u32, Width, core::ops::Range<usize>)> {
    let dword = |at: usize| (ETHERNET_CONFIG as u32 + at as u32, Width::Dword, at..at + 4);
    let bytes = (4..12).map(|at: usize| (ETHERNET_CONFIG as u32 + at as u32, Width::Byte, at..at + 1));
    [dword(0)].into_iter().chain(bytes).chain([dword(12)])
}

fn encode(content: &Content) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(FILE_SIZE);
    bytes.extend(MAGIC);
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend((ETHERNET_CONFIG_BYTES as u32).to_le_bytes());
    bytes.extend(content);
    bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
    bytes
}

fn decode(bytes: &[u8]) -> Option<Content> {
    let (body, checksum) = bytes.split_last_chunk::<CHECKSUM>()?;
    let content = body.get(HEAD..)?.try_into().ok()?;
    (crc32fast::hash(body) == u32::from_le_bytes(*checksum) && encode(&content) == bytes).then_some(content)
}

/// New file, synced, renamed over the old one, directory synced.
fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let directory = path.parent().unwrap_or(Path::new("."));
    let mut file = tempfile::NamedTempFile::new_in(directory)?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    file.persist(path)?;
    fs::File::open(directory)?.sync_all()
}

/// Renames a file that cannot be used to the first free `<name>.bad-<n>`.
fn set_aside(path: &Path) -> Result<PathBuf, NovramError> {
    for n in 1u32.. {
        let mut name = path.as_os_str().to_owned();
        name.push(format!(".bad-{n}"));
        let aside = PathBuf::from(name);
        // A hard link fails if the name is taken, a rename would replace it.
        match fs::hard_link(path, &aside) {
            Ok(()) => {
                fs::remove_file(path).map_err(failed(path, "set it aside"))?;
                return Ok(aside);
            }
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(failed(path, "set it aside")(error)),
        }
    }
    unreachable!("a directory does not hold 2^32 files")
}

fn failed(path: &Path, doing: &'static str) -> impl Fn(io::Error) -> NovramError {
    let path = path.to_owned();
    move |source| NovramError::Io { path: path.clone(), doing, source }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROUTER: u32 = ETHERNET_CONFIG as u32 + 12;
    const ADDRESS: u32 = ETHERNET_CONFIG as u32 + 4;

    #[test]
    fn content_survives_power_off() {
        let directory = tempfile::tempdir().unwrap();
        let first = Segment::heap();
        let (mut novram, found) = Novram::power_on(directory.path(), "line", &first).unwrap();
        assert_eq!(found, Found::Nothing);
        assert!(!novram.save_if_changed().unwrap(), "nothing to save");
        first.store(ROUTER, Width::Dword, 0x4E6F_5F52).unwrap();
        first.store(ADDRESS, Width::Byte, 192).unwrap();
        assert!(novram.save_if_changed().unwrap());
        assert!(!novram.save_if_changed().unwrap(), "saved already");

        let second = Segment::heap();
        let (_, found) = Novram::power_on(directory.path(), "line", &second).unwrap();
        assert_eq!(found, Found::Content);
        assert_eq!(second.load(ROUTER, Width::Dword).unwrap(), 0x4E6F_5F52);
        assert_eq!(second.load(ADDRESS, Width::Byte).unwrap(), 192);
        let left: Vec<_> = fs::read_dir(directory.path()).unwrap().collect();
        assert_eq!(left.len(), 1, "no temporary file stays: {left:?}");
    }

    #[test]
    fn a_failure_to_write_is_reported_once_per_change() {
        let directory = tempfile::tempdir().unwrap();
        let segment = Segment::heap();
        let (mut novram, _) = Novram::power_on(directory.path(), "line", &segment).unwrap();
        directory.close().unwrap();
        for router in [1, 2] {
            segment.store(ROUTER, Width::Dword, router).unwrap();
            assert!(novram.save_if_changed().is_err());
            assert!(!novram.save_if_changed().unwrap());
        }
    }

    #[test]
    fn a_damaged_or_foreign_file_is_set_aside() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("line.novram");
        let mut flipped = encode(&[7; ETHERNET_CONFIG_BYTES]);
        flipped[HEAD] ^= 1;
        let truncated = encode(&[7; ETHERNET_CONFIG_BYTES])[..FILE_SIZE - 1].to_vec();
        for (n, bytes) in [flipped, truncated, b"something else".to_vec(), Vec::new()].into_iter().enumerate()
        {
            fs::write(&path, &bytes).unwrap();
            let segment = Segment::heap();
            let (_, found) = Novram::power_on(directory.path(), "line", &segment).unwrap();
            let aside = directory.path().join(format!("line.novram.bad-{}", n + 1));
            assert_eq!(found, Found::SetAside(aside.clone()));
            assert_eq!(fs::read(aside).unwrap(), bytes, "kept as it was");
            assert_eq!(segment.load(ROUTER, Width::Dword).unwrap(), 0);
        }
    }

    #[test]
    fn a_directory_that_cannot_be_used_is_named() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let error = Novram::power_on(file.path(), "line", &Segment::heap()).unwrap_err().to_string();
        assert!(error.contains("line.novram") && error.contains("--novram needs"), "{error}");
    }
}
