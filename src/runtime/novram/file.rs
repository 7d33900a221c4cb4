//! The NOVRAM file: magic, version, length, content, checksum. Every version begins with magic and version, and ends with the
//! CRC-32 of all that comes before.

use super::{Directory, NovramError, RestoreOutcome};

const MAGIC: [u8; 8] = *b"commramN";
/// Version of the format. A change of the format increments it.
pub(super) const VERSION: u32 = 2;
/// Longest file of any version in bytes.
const LONGEST: usize = 1 << 20;
/// Length of the header in bytes: magic, version, length of the content.
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

    /// Returns registers and retain flags.
    #[cfg(test)]
    pub(crate) fn new(registers: &[u8], retain: &[u8]) -> Self {
        Content { bytes: [registers, retain].concat(), registers: registers.len() }
    }

    /// Returns the same content with at least `flags` retain flags. Added flags are 0.
    pub(crate) fn at_least(mut self, flags: usize) -> Self {
        let bytes = self.bytes.len().max(self.registers + flags);
        self.bytes.resize(bytes, 0);
        self
    }

    /// Replaces the registers and the first retain flags. A plant with more flags may have stored further flags; they
    /// are unchanged.
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

/// The reason why the bytes of a file cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unusable {
    /// The file is damaged, or is not a NOVRAM file.
    Damaged,
    /// The file is an undamaged NOVRAM file of another version.
    OtherVersion {
        /// Version of the file.
        found: u32,
    },
}

/// Reads the file of this name. A damaged file is set aside. A file of another version is an error, and so is a file that could
/// not be written.
pub(super) fn load(
    directory: &Directory,
    name: &str,
    size: Size,
) -> Result<(Content, RestoreOutcome), NovramError> {
    let longest = LONGEST.max(HEAD + size.registers + size.flags + CHECKSUM);
    let (content, found) = match directory.read(name, longest)? {
        None => (Content::empty(size.registers), RestoreOutcome::Nothing),
        Some(bytes) => match decode(&bytes, size) {
            Ok(content) => {
                let retain = content.retain().iter().any(|flag| *flag != 0);
                (content, RestoreOutcome::Content { retain })
            }
            Err(Unusable::Damaged) => {
                let (path, removed) = directory.set_aside(name)?;
                (Content::empty(size.registers), RestoreOutcome::SetAside { path, removed })
            }
            // The file is not set aside, because the version of commram that has written it can still use it.
            Err(Unusable::OtherVersion { found }) => {
                let path = directory.path_of(name);
                return Err(NovramError::OtherVersion { path, found, read: VERSION });
            }
        },
    };
    directory.probe(name, &encode(&content))?;
    Ok((content, found))
}

/// Writes the file of this name.
pub(super) fn store(directory: &mut Directory, name: &str, content: &Content) -> Result<(), NovramError> {
    directory.replace(name, &encode(content))
}

/// True if the file of this name has this content. A missing file counts as a file with the delivery state.
pub(super) fn holds(directory: &Directory, name: &str, content: &Content) -> bool {
    let size = Size { registers: content.registers, flags: content.retain().len() };
    match directory.read(name, HEAD + content.bytes.len() + CHECKSUM) {
        Ok(None) => content.bytes.iter().all(|byte| *byte == 0),
        Ok(Some(bytes)) => decode(&bytes, size).is_ok_and(|held| held.at_least(size.flags) == *content),
        Err(_) => false,
    }
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

pub(super) fn decode(bytes: &[u8], Size { registers, flags }: Size) -> Result<Content, Unusable> {
    let (body, checksum) = bytes.split_last_chunk::<CHECKSUM>().ok_or(Unusable::Damaged)?;
    // The checksum is checked first: a file with a damaged version number must not be reported as a file of another
    // version.
    if crc32fast::hash(body) != u32::from_le_bytes(*checksum) {
        return Err(Unusable::Damaged);
    }
    let version = body.strip_prefix(&MAGIC).and_then(|rest| rest.first_chunk());
    match version.map(|version| u32::from_le_bytes(*version)).ok_or(Unusable::Damaged)? {
        VERSION => {}
        found => return Err(Unusable::OtherVersion { found }),
    }
    let possible = registers..=registers + flags;
    let content = body.get(HEAD..).filter(|content| possible.contains(&content.len()));
    let content = Content { bytes: content.ok_or(Unusable::Damaged)?.to_vec(), registers };
    if encode(&content) == bytes { Ok(content) } else { Err(Unusable::Damaged) }
}
