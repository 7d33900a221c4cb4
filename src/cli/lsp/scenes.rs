//! The plants that scenarios name. A plant is built in the same way as for a scenario, and kept until one of its files
//! changes.

use crate::cli::complete::PlcScope;
use crate::devices::folder;
use crate::input_file;
use crate::plant::PlantConfig;
use crate::script::Bench;
use core::hash::{Hash, Hasher};
use std::collections::BTreeMap;
use std::hash::DefaultHasher;
use std::path::{Path, PathBuf};

/// Maximum number of plants that are kept.
const MOST: usize = 16;

/// The plant of a scenario.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum PlantName {
    /// The scenario names no plant.
    BuiltIn,
    /// The plant of the plant file at this path.
    File(PathBuf),
    /// The text of a plant file, in a scenario in this directory.
    Text { text: String, directory: PathBuf },
    /// A plant that contains only the device in this folder.
    Device(PathBuf),
}

/// A plant on which the server looks up names and tries arguments. No scenario runs on it.
pub(super) struct Scene {
    pub(super) bench: Bench,
    pub(super) scope: PlcScope,
    /// The folders of the devices in the plant, by the names of the devices.
    pub(super) folders: BTreeMap<String, PathBuf>,
    /// The drives with their descriptions.
    pub(super) drives: Vec<String>,
}

/// A plant, or the reason why it could not be built. The number changes when the files of the plant change.
struct Known {
    stamp: u64,
    scene: Result<Scene, String>,
}

/// All plants that scripts have named.
#[derive(Default)]
pub(super) struct Scenes {
    known: BTreeMap<PlantName, Known>,
}

impl Scenes {
    /// Returns the plant of this name. `open` returns the text of a file that the editor has open.
    ///
    /// # Errors
    /// The plant is refused; the error is the message.
    pub(super) fn get(
        &mut self,
        name: &PlantName,
        open: impl Fn(&Path) -> Option<String>,
    ) -> Result<&mut Scene, &str> {
        let text = match name {
            PlantName::File(path) => {
                open(path).map_or_else(|| input_file::read(path, input_file::LONGEST_PLANT), Ok)
            }
            PlantName::Text { text, .. } => Ok(text.clone()),
            PlantName::BuiltIn | PlantName::Device(_) => Ok(String::new()),
        };
        let folders = self.known.get(name).and_then(|known| known.scene.as_ref().ok());
        let folders: Vec<_> =
            folders.map(|scene| scene.folders.values().cloned().collect()).unwrap_or_default();
        let now = stamp(&text, &folders);
        // The files of a refused device are not known, so the stamp does not cover them. So a refused plant is built
        // again each time.
        let is_known = self.known.get(name).is_some_and(|known| known.stamp == now && known.scene.is_ok());
        if !is_known {
            if self.known.len() >= MOST {
                self.known.clear();
            }
            let scene =
                text.as_ref().map_err(|error| format!("{}: {error}", file_of(name))).map(String::as_str);
            let scene = scene.and_then(|text| build(name, text));
            let folders: Vec<_> =
                scene.as_ref().map(|scene| scene.folders.values().cloned().collect()).unwrap_or_default();
            self.known.insert(name.clone(), Known { stamp: stamp(&text, &folders), scene });
        }
        match self.known.get_mut(name) {
            Some(Known { scene: Ok(scene), .. }) => Ok(scene),
            Some(Known { scene: Err(message), .. }) => Err(message),
            None => Err(""),
        }
    }
}

fn file_of(name: &PlantName) -> String {
    match name {
        PlantName::File(path) | PlantName::Device(path) => path.display().to_string(),
        PlantName::BuiltIn | PlantName::Text { .. } => "plant".to_owned(),
    }
}

fn build(name: &PlantName, text: &str) -> Result<Scene, String> {
    let config = match name {
        PlantName::BuiltIn => PlantConfig::built_in(),
        PlantName::File(path) => {
            PlantConfig::parse_from(path.parent().unwrap_or(Path::new("")), &path.display().to_string(), text)
        }
        PlantName::Text { directory, .. } => PlantConfig::parse_from(directory, "plant", text),
        PlantName::Device(dir) => crate::cli::test::scenario::plant_of(dir)
            .map(|(_, plant)| Ok(plant))
            .map_err(|error| error.to_string())?,
    };
    let config = config.map_err(|error| error.to_string())?;
    let mut bench = Bench::new(&config).map_err(|error| error.to_string())?;
    let drives = bench.drive_names().unwrap_or_default();
    let folders = config
        .devices
        .iter()
        .filter_map(|device| Some((device.name().to_owned(), device.folder()?.to_owned())));
    Ok(Scene { scope: PlcScope::of(bench.names()), folders: folders.collect(), bench, drives })
}

/// Computes a number that changes when the text or the files in the folders change.
fn stamp(text: &std::io::Result<String>, folders: &[PathBuf]) -> u64 {
    let mut hasher = DefaultHasher::new();
    text.as_ref().ok().hash(&mut hasher);
    for folder in folders {
        let mut files: Vec<_> = std::fs::read_dir(folder).into_iter().flatten().flatten().collect();
        files.sort_by_key(std::fs::DirEntry::file_name);
        for file in files {
            let metadata = file.metadata().ok();
            (file.file_name(), metadata.map(|found| (found.len(), found.modified().ok()))).hash(&mut hasher);
        }
    }
    hasher.finish()
}

/// Returns the folder of the device that contains a file: the directory of the file, or the directory above `tests`.
pub(super) fn folder_of(file: &Path) -> Option<PathBuf> {
    let directory = file.parent()?;
    let is_device = |directory: &Path| directory.join("device.toml").is_file();
    let above = directory.parent().filter(|above| directory.ends_with("tests") && is_device(above));
    let found = if is_device(directory) { Some(directory) } else { above };
    found.and_then(|found| folder::find(Path::new(""), &found.display().to_string()).ok())
}
