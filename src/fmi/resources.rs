//! The files in the `resources` of an archive, which describe the plant.

use super::variables::VariablesError;
use crate::input_file;
use crate::memory::MemoryError;
use crate::plant::{PlantConfig, PlantError, Snapshot, SnapshotError, SnapshotFile, SnapshotFileError};
use std::io;
use std::path::{Path, PathBuf};

/// Name of the plant file in the resources of the unit.
const PLANT: &str = "plant.toml";
/// The snapshot from which the plant starts. It replaces the plant file.
const SNAPSHOT: &str = "start.snap";
/// Patterns of the registers that become variables, one in each line. Without this file, all registers become
/// variables.
const REGISTERS: &str = "registers.txt";

/// The plant of a unit.
#[derive(Clone, Debug)]
pub struct Resources {
    /// The text of the plant file, or the content of the snapshot.
    content: Content,
    config: PlantConfig,
    registers: Vec<String>,
}

#[derive(Clone, Debug)]
enum Content {
    Plant(String),
    Snapshot(Vec<u8>, Box<Snapshot>),
}

/// Reason for which a plant cannot become a unit.
#[derive(Debug, thiserror::Error)]
pub enum ResourcesError {
    /// A file cannot be read.
    #[error("{}: {reason}", .path.display())]
    Read {
        /// Path of the file that cannot be read.
        path: PathBuf,
        /// The error of the operating system.
        reason: io::Error,
    },
    /// The plant file is refused.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// An invalid snapshot file.
    #[error("{}: {reason}", .path.display())]
    SnapshotFile {
        /// Path of the snapshot file.
        path: PathBuf,
        /// Reason why the snapshot cannot be used.
        reason: SnapshotFileError,
    },
    /// The plant cannot start from the snapshot.
    #[error("the snapshot cannot be started from: {0}")]
    Snapshot(#[from] SnapshotError),
    /// The plant cannot be built.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// The requested registers do not exist.
    #[error(transparent)]
    Variables(#[from] VariablesError),
}

impl Resources {
    /// Reads the resources from a plant file or a snapshot. `registers` are names and patterns of the registers that
    /// become variables; if it is empty, all registers become variables.
    ///
    /// # Errors
    /// [`ResourcesError`].
    pub fn of_file(path: &Path, registers: Vec<String>) -> Result<Self, ResourcesError> {
        let read = || input_file::read_bytes(path, SnapshotFile::LONGEST);
        let failed = |reason| ResourcesError::Read { path: path.to_owned(), reason };
        let bytes = read().map_err(failed)?;
        let content = if SnapshotFile::is_one(&bytes) {
            let file = SnapshotFile::of_bytes(&bytes);
            let file =
                file.map_err(|reason| ResourcesError::SnapshotFile { path: path.to_owned(), reason })?;
            let config = file.config(&path.display().to_string())?;
            (Content::Snapshot(bytes, Box::new(file.snapshot)), config)
        } else {
            let text = input_file::text(bytes).map_err(failed)?;
            let base = path.parent().unwrap_or(Path::new(""));
            let config = PlantConfig::parse_from(base, &path.display().to_string(), &text)?;
            // The paths of folders in it are absolute: an unpacked unit is in another directory.
            (Content::Plant(config.source().to_owned()), config)
        };
        let (content, config) = content;
        Ok(Self { content, config, registers })
    }

    /// Returns the resources for the built-in plant.
    ///
    /// # Errors
    /// Returns the errors of [`Resources::of_file`].
    pub fn built_in(registers: Vec<String>) -> Result<Self, ResourcesError> {
        let config = PlantConfig::built_in()?;
        Ok(Self { content: Content::Plant(config.source().to_owned()), config, registers })
    }

    /// Reads the resources from the directory `resources` of an unpacked archive.
    ///
    /// # Errors
    /// Returns the errors of [`Resources::of_file`].
    pub fn of_directory(directory: &Path) -> Result<Self, ResourcesError> {
        let list = directory.join(REGISTERS);
        let registers = match input_file::read(&list, input_file::LONGEST_SCRIPT) {
            Ok(text) => text.lines().map(str::to_owned).collect(),
            Err(reason) if reason.kind() == io::ErrorKind::NotFound => Vec::new(),
            Err(reason) => return Err(ResourcesError::Read { path: list, reason }),
        };
        let snapshot = directory.join(SNAPSHOT);
        let path = if snapshot.exists() { snapshot } else { directory.join(PLANT) };
        Self::of_file(&path, registers)
    }

    /// Returns names and contents of the files.
    #[must_use]
    pub fn files(&self) -> Vec<(&'static str, Vec<u8>)> {
        let mut files = vec![match &self.content {
            Content::Plant(text) => (PLANT, text.clone().into_bytes()),
            Content::Snapshot(bytes, _) => (SNAPSHOT, bytes.clone()),
        }];
        if !self.registers.is_empty() {
            let lines: String = self.registers.iter().map(|pattern| format!("{pattern}\n")).collect();
            files.push((REGISTERS, lines.into_bytes()));
        }
        files
    }

    /// Returns the configuration of the plant.
    #[must_use]
    pub fn config(&self) -> &PlantConfig {
        &self.config
    }

    /// Returns the snapshot from which the plant starts; `None` if it starts at power-on.
    #[must_use]
    pub fn snapshot(&self) -> Option<&Snapshot> {
        match &self.content {
            Content::Plant(_) => None,
            Content::Snapshot(_, snapshot) => Some(snapshot),
        }
    }

    /// Returns names and patterns of the registers that become variables; empty for all registers.
    #[must_use]
    pub fn registers(&self) -> &[String] {
        &self.registers
    }
}
