//! The NOVRAM file: magic, version, length, content, checksum.

use super::{Directory, NovramError, RestoreOutcome};

const MAGIC: [u8; 8] = *b"commramN";
const VERSION: u32 = 2;
/// Magic, version, length of the content.
const HEAD: usize = 16;
const CHECKSUM: usize = 4;

/// Largest NOVRAM content of a device, in bytes.
#[derive(Clone, Copy)]
pub(super) struct Size {
    /// Length of the registers, which is fixed.
    pub registers: usize,
    /// Largest length of the retain flags.
    pub flags: usize,
}

/// Content of a file: the registers of the device's NOVRAM, and at least as many retain flags as the device has.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Content {
    bytes: Vec<u8>,
    /// Length of the registers.
    registers: usize,
}

impl Content {
    /// Delivery state with this length of registers and no flags.
    pub(crate) fn empty(registers: usize) -> Self {
        Content { bytes: vec![0; registers], registers }
    }

    /// Registers and retain flags.
    #[cfg(test)]
    pub(crate) fn new(registers: &[u8], retain: &[u8]) -> Self {
        Content { bytes: [registers, retain].concat(), registers: registers.len() }
    }

    /// The same content with at least `flags` retain flags; added flags are 0.
    pub(crate) fn at_least(mut self, flags: usize) -> Self {
        let bytes = self.bytes.len().max(self.registers + flags);
        self.bytes.resize(bytes, 0);
        self
    }

    /// Replaces the registers and the first retain flags. Further flags, of a plant with more of them, are unchanged.
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

/// Reads the file of this name. An unusable file is set aside; a file that cannot be written is an error.
pub(super) fn load(
    directory: &Directory,
    name: &str,
    size: Size,
) -> Result<(Content, RestoreOutcome), NovramError> {
    let (content, found) = match directory.read(name, HEAD + size.registers + size.flags + CHECKSUM)? {
        None => (Content::empty(size.registers), RestoreOutcome::Nothing),
        Some(bytes) => match decode(&bytes, size) {
            Some(content) => {
                let retain = content.retain().iter().any(|flag| *flag != 0);
                (content, RestoreOutcome::Content { retain })
            }
            None => (Content::empty(size.registers), RestoreOutcome::SetAside(directory.set_aside(name)?)),
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
