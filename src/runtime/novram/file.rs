//! The NOVRAM file: magic, version, length, content, checksum.

use super::{Directory, Found, NovramError};
use crate::layout::omega_drive_line_2::ETHERNET_CONFIG_BYTES;
use crate::memory::header::RETAIN_SIZE;

const MAGIC: [u8; 8] = *b"commramN";
const VERSION: u32 = 2;
/// Magic, version, length of the content.
const HEAD: usize = 16;
const CHECKSUM: usize = 4;
/// Bytes of the Ethernet configuration; the retain flags follow.
pub(super) const ETHERNET_SIZE: usize = ETHERNET_CONFIG_BYTES;
const SIZE: usize = ETHERNET_SIZE + RETAIN_SIZE;
/// Length of the file.
const LENGTH: usize = HEAD + SIZE + CHECKSUM;

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

/// Reads the file of this name. One that cannot be used is set aside; one that could not be written is an error.
pub(super) fn load(directory: &Directory, name: &str) -> Result<(Content, Found), NovramError> {
    let (content, found) = match directory.read(name, LENGTH)? {
        None => (Content::empty(), Found::Nothing),
        Some(bytes) => match decode(&bytes) {
            Some(content) => {
                let retain = content.retain().iter().any(|flag| *flag != 0);
                (content, Found::Content { retain })
            }
            None => (Content::empty(), Found::SetAside(directory.set_aside(name)?)),
        },
    };
    directory.probe(name, &encode(&content))?;
    Ok((content, found))
}

/// Writes the file of this name.
pub(super) fn store(directory: &mut Directory, name: &str, content: &Content) -> Result<(), NovramError> {
    directory.replace(name, &encode(content))
}

pub(super) fn encode(content: &Content) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(LENGTH);
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
