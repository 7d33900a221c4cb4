//! The NOVRAM file: magic, version, length, content, checksum.

use super::{Directory, Found, NovramError};
use crate::devices::omega_drive_line_2::registers::ETHERNET_CONFIG_BYTES;
use crate::layout::flags::MOST_RETAIN;

const MAGIC: [u8; 8] = *b"commramN";
const VERSION: u32 = 2;
/// Magic, version, length of the content.
const HEAD: usize = 16;
const CHECKSUM: usize = 4;
/// Bytes of the Ethernet configuration; the retain flags follow.
pub(super) const ETHERNET_SIZE: usize = ETHERNET_CONFIG_BYTES;
/// Most that a file keeps, and its length then.
const LONGEST: usize = ETHERNET_SIZE + MOST_RETAIN as usize;
const LONGEST_FILE: usize = HEAD + LONGEST + CHECKSUM;

/// What a file keeps: Ethernet configuration and retain flags, at least as many as the PLC has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Content(Vec<u8>);

impl Content {
    /// Delivery state, without any flag.
    pub(crate) fn empty() -> Self {
        Content(vec![0; ETHERNET_SIZE])
    }

    /// Ethernet configuration and retain flags.
    #[cfg(test)]
    pub(crate) fn new(ethernet: &[u8; ETHERNET_SIZE], retain: &[u8]) -> Self {
        Content([&ethernet[..], retain].concat())
    }

    /// The same with at least `flags` retain flags; those that are missing are 0.
    pub(crate) fn at_least(mut self, flags: usize) -> Self {
        let bytes = self.0.len().max(ETHERNET_SIZE + flags);
        self.0.resize(bytes, 0);
        self
    }

    /// Takes over the configuration and the first retain flags. Flags of a plant that had more stay, for it.
    pub(crate) fn replace(&mut self, ethernet: &[u8; ETHERNET_SIZE], retain: &[u8]) {
        for (to, from) in self.0.iter_mut().zip(ethernet.iter().chain(retain)) {
            *to = *from;
        }
    }

    pub(crate) fn ethernet(&self) -> &[u8] {
        &self.0[..ETHERNET_SIZE]
    }

    pub(crate) fn retain(&self) -> &[u8] {
        &self.0[ETHERNET_SIZE..]
    }
}

/// Reads the file of this name. One that cannot be used is set aside; one that could not be written is an error.
pub(super) fn load(directory: &Directory, name: &str) -> Result<(Content, Found), NovramError> {
    let (content, found) = match directory.read(name, LONGEST_FILE)? {
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
    let mut bytes = Vec::with_capacity(HEAD + content.0.len() + CHECKSUM);
    bytes.extend(MAGIC);
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend((content.0.len() as u32).to_le_bytes());
    bytes.extend(&content.0);
    bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
    bytes
}

pub(super) fn decode(bytes: &[u8]) -> Option<Content> {
    let (body, checksum) = bytes.split_last_chunk::<CHECKSUM>()?;
    let content = body.get(HEAD..).filter(|content| (ETHERNET_SIZE..=LONGEST).contains(&content.len()))?;
    let content = Content(content.to_vec());
    (crc32fast::hash(body) == u32::from_le_bytes(*checksum) && encode(&content) == bytes).then_some(content)
}
