//! The NOVRAM file: magic, version, length, content, checksum.

use super::{Directory, Found, NovramError};

const MAGIC: [u8; 8] = *b"commramN";
const VERSION: u32 = 2;
/// Magic, version, length of the content.
const HEAD: usize = 16;
const CHECKSUM: usize = 4;

/// What a device can have in NOVRAM, in bytes.
#[derive(Clone, Copy)]
pub(super) struct Size {
    /// Registers, always as many.
    pub registers: usize,
    /// Retain flags at most.
    pub flags: usize,
}

/// What a file keeps: registers, as many bytes as the device has in NOVRAM, and retain flags, at least as many as it has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Content {
    bytes: Vec<u8>,
    /// How many of them are registers.
    registers: usize,
}

impl Content {
    /// Delivery state with so many bytes of registers, without any flag.
    pub(crate) fn empty(registers: usize) -> Self {
        Content { bytes: vec![0; registers], registers }
    }

    /// Registers and retain flags.
    #[cfg(test)]
    pub(crate) fn new(registers: &[u8], retain: &[u8]) -> Self {
        Content { bytes: [registers, retain].concat(), registers: registers.len() }
    }

    /// The same with at least `flags` retain flags; those that are missing are 0.
    pub(crate) fn at_least(mut self, flags: usize) -> Self {
        let bytes = self.bytes.len().max(self.registers + flags);
        self.bytes.resize(bytes, 0);
        self
    }

    /// Takes over the registers, as many as it has, and the first retain flags. Flags of a plant that had more stay, for it.
    pub(crate) fn replace(&mut self, registers: &[u8], retain: &[u8]) {
        for (to, from) in self.bytes.iter_mut().zip(registers.iter().chain(retain)) {
            *to = *from;
        }
    }

    pub(crate) fn registers(&self) -> &[u8] {
        &self.bytes[..self.registers]
    }

    pub(crate) fn retain(&self) -> &[u8] {
        &self.bytes[self.registers..]
    }
}

/// Reads the file of this name. One that cannot be used is set
/// aside; one that could not be written is an error.
pub(super) fn load(directory: &Directory, name: &str, size: Size) -> Result<(Content, Found), NovramError> {
    let (content, found) = match directory.read(name, HEAD + size.registers + size.flags + CHECKSUM)? {
        None => (Content::empty(size.registers), Found::Nothing),
        Some(bytes) => match decode(&bytes, size) {
            Some(content) => {
                let retain = content.retain().iter().any(|flag| *flag != 0);
                (content, Found::Content { retain })
            }
            None => (Content::empty(size.registers), Found::SetAside(directory.set_aside(name)?)),
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
    let mut bytes = Vec::with_capacity(HEAD + content.bytes.len() + CHECKSUM);
    bytes.extend(MAGIC);
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend((content.bytes.len() as u32).to_le_bytes());
    bytes.extend(&content.bytes);
    bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
    bytes
}

pub(super) fn decode(bytes: &[u8], Size { registers, flags }: Size) -> Option<Content> {
    let (body, checksum) = bytes.split_last_chunk::<CHECKSUM>()?;
    let possible = registers..=registers + flags;
    let content = body.get(HEAD..).filter(|content| possible.contains(&content.len()))?;
    let content = Content { bytes: content.to_vec(), registers };
    (crc32fast::hash(body) == u32::from_le_bytes(*checksum) && encode(&content) == bytes).then_some(content)
}
