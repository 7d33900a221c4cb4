//! Replaces the scripts of device folders in a library without the feature `script`: a folder with a script
//! is refused (D-800).

use super::FolderError;
use super::own_records::OwnRecord;
use super::part::Part;
use crate::devices::Exercise;
use crate::layout::DeviceLayout;
use std::path::Path;

/// Exercises are scenarios, which this library also does not have.
///
/// # Errors
/// Returns `None`, because exercises are not available.
pub(super) fn read_exercise(
    _: &Path,
    _: &'static DeviceLayout,
) -> Result<Option<&'static Exercise>, FolderError> {
    Ok(None)
}

/// A script, which this library does not have.
#[derive(Debug)]
pub(super) enum Script {}

impl Script {
    /// Returns `None` if the folder has no script.
    ///
    /// # Errors
    /// [`FolderError::NoScripts`]
    pub(super) fn read(dir: &Path) -> Result<Option<Self>, FolderError> {
        match commram_layoutc::read_file_of_folder(dir, super::SCRIPT)? {
            None => Ok(None),
            Some(_) => Err(FolderError::NoScripts { dir: dir.to_owned() }),
        }
    }

    pub(super) fn files(&self) -> &[(String, String)] {
        match *self {}
    }

    pub(super) fn check(
        &mut self,
        _: &Path,
        _: &'static DeviceLayout,
        _: &[OwnRecord],
    ) -> Result<Vec<String>, FolderError> {
        match *self {}
    }

    pub(super) fn hooks(&self) -> Vec<String> {
        match *self {}
    }

    pub(super) fn watches(&self) -> bool {
        match *self {}
    }

    pub(super) fn written(&self) -> Option<&[String]> {
        match *self {}
    }

    pub(super) fn firmware(&'static self, _: &'static DeviceLayout) -> Box<dyn Part> {
        match *self {}
    }
}
