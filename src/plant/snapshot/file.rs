//! A snapshot as a file. The file also contains the text of the plant file, so that an emulator can start from it.

use super::Snapshot;
use crate::plant::{PlantConfig, PlantError};
use crate::snapshot_fields::{Damaged, Saved, Saving, read_format, save_header, seal, unseal};

/// First bytes of a snapshot file.
const MAGIC: [u8; 8] = *b"cmrmsnap";
/// Number of the format. It is incremented when the contents of a snapshot change. Every format begins with
/// the magic, this number and the version of commram, and ends with the checksum of [`seal`].
pub(super) const FORMAT: u16 = 8;

/// A snapshot with its plant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SnapshotFile {
    /// The text of the plant file.
    pub plant: String,
    /// The snapshot in the file.
    pub snapshot: Snapshot,
}

/// The reason why bytes are not a usable snapshot.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SnapshotFileError {
    /// The bytes are not a snapshot.
    #[error("it is not a snapshot of commram; `commram snapshot FILE` writes one")]
    NoSnapshot,
    /// Another version has written the snapshot.
    #[error(
        "it was made by commram {found} (format {format}), this is commram {ours} (format {FORMAT}); use that version, or take \
         the snapshot again with this one",
        ours = env!("CARGO_PKG_VERSION")
    )]
    OtherVersion {
        /// Version that has written the snapshot.
        found: String,
        /// The format of the file.
        format: u16,
    },
    /// Bytes are missing or damaged.
    #[error("it is damaged: its checksum is wrong, or its end is missing")]
    Checksum,
    /// The content is invalid.
    #[error("it is damaged: {0}")]
    Damaged(#[from] Damaged),
}

impl SnapshotFile {
    /// Maximum length of a file, in bytes.
    pub const LONGEST: u64 = 64 << 20;

    /// True if these bytes begin like a snapshot file.
    #[must_use]
    pub fn is_one(bytes: &[u8]) -> bool {
        bytes.starts_with(&MAGIC)
    }

    /// Returns the content of the file.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut to = Saving::default();
        save_header(&mut to, &MAGIC, FORMAT, env!("CARGO_PKG_VERSION"));
        to.value(&self.plant);
        self.snapshot.save(&mut to);
        seal(to.into_bytes())
    }

    /// Reads a snapshot from the content of a file.
    ///
    /// # Errors
    /// [`SnapshotFileError`].
    pub fn of_bytes(bytes: &[u8]) -> Result<Self, SnapshotFileError> {
        if !Self::is_one(bytes) {
            return Err(SnapshotFileError::NoSnapshot);
        }
        // The checksum is checked first, because a damaged header could look like the header of another version. All
        // formats have this checksum.
        let written = unseal(bytes).ok_or(SnapshotFileError::Checksum)?;
        let mut from = Saved::new(written);
        let _magic = from.raw(MAGIC.len())?;
        let (format, found) = read_format(&mut from)?;
        if (format, found.as_str()) != (FORMAT, env!("CARGO_PKG_VERSION")) {
            return Err(SnapshotFileError::OtherVersion { found, format });
        }
        let (plant, snapshot) = (from.value()?, Snapshot::of_saved(&mut from)?);
        from.end()?;
        Ok(SnapshotFile { plant, snapshot })
    }

    /// Returns the plant of the snapshot. `file` is its name in messages.
    ///
    /// # Errors
    /// The text is not a plant file.
    pub fn config(&self, file: &str) -> Result<PlantConfig, PlantError> {
        PlantConfig::parse(file, &self.plant)
    }
}
