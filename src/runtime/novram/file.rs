//! The NOVRAM file: magic, version, length, content, checksum.

use super::Found;
use crate::layout::omega_drive_line_2::ETHERNET_CONFIG_BYTES;
use crate::memory::MemoryError;
use crate::memory::header::RETAIN_SIZE;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use thiserror::Error;

const MAGIC: [u8; 8] = *b"commramN";
const VERSION: u32 = 2;
/// Magic, version, length of the content.
const HEAD: usize = 16;
const CHECKSUM: usize = 4;
/// Bytes of the Ethernet configuration; the retain flags follow.
pub(super) const ETHERNET_SIZE: usize = ETHERNET_CONFIG_BYTES;
const SIZE: usize = ETHERNET_SIZE + RETAIN_SIZE;

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

/// What a file keeps.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Content(Vec<u8>);

impl Content {
    /// Delivery state.
    pub fn empty() -> Self {
        Content(vec![0; SIZE])
    }

    /// Ethernet configuration and retain flags; flags that are missing are 0.
    pub fn new(ethernet: &[u8; ETHERNET_SIZE], retain: &[u8]) -> Self {
        let mut bytes = Vec::with_capacity(SIZE);
        bytes.extend(ethernet);
        bytes.extend(retain);
        bytes.resize(SIZE, 0);
        Content(bytes)
    }

    pub fn ethernet(&self) -> &[u8] {
        &self.0[..ETHERNET_SIZE]
    }

    pub fn retain(&self) -> &[u8] {
        &self.0[ETHERNET_SIZE..]
    }
}

/// Reads a file, whose directory is made if missing. One that cannot be used is set aside.
pub(super) fn load(path: &Path) -> Result<(Content, Found), NovramError> {
    fs::create_dir_all(directory(path)).map_err(failed(path, "make its directory"))?;
    match fs::read(path) {
        Ok(bytes) => match decode(&bytes) {
            Some(content) => {
                let retain = content.retain().iter().any(|flag| *flag != 0);
                Ok((content, Found::Content { retain }))
            }
            None => Ok((Content::empty(), Found::SetAside(set_aside(path)?))),
        },
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok((Content::empty(), Found::Nothing)),
        Err(error) => Err(failed(path, "read it")(error)),
    }
}

/// New file, synced, renamed over the old one, directory synced.
pub(super) fn store(path: &Path, content: &Content) -> Result<(), NovramError> {
    replace(path, &encode(content)).map_err(failed(path, "write it"))
}

fn replace(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let directory = directory(path);
    // One fixed name: what a killed emulator has left is overwritten by the next one, which holds the lock of the
    // PLC's image.
    let mut name = path.as_os_str().to_owned();
    name.push(".new");
    let new = PathBuf::from(name);
    let mut file = fs::File::create(&new)?;
    file.write_all(bytes)?;
    file.sync_all()?;
    fs::rename(&new, path)?;
    fs::File::open(directory)?.sync_all()
}

fn directory(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

pub(super) fn encode(content: &Content) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEAD + SIZE + CHECKSUM);
    bytes.extend(MAGIC);
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend((SIZE as u32).to_le_bytes());
    bytes.extend(&content.0);
    bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
    bytes
}

pub(super) fn decode(bytes: &[u8]) -> Option<Content> {
    let (body, checksum) = bytes.split_last_chunk::<CHECKSUM>()?;
    let content = body.get(HEAD..).filter(|content| content.len() == SIZE)?;
    let content = Content(content.to_vec());
    (crc32fast::hash(body) == u32::from_le_bytes(*checksum) && encode(&content) == bytes).then_some(content)
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
