//! Lists the images of this machine.

use super::{
    ClockMode, Header, MemoryError, State,
    file::ImageFile,
    header,
    names::{IMAGE_DIRECTORY, parse_directory_name, parse_image_name},
};
use std::{collections::BTreeSet, fs, path::PathBuf};

/// An image file, or another kind of entry with the name of an image.
#[derive(Debug)]
pub struct ImageInfo {
    /// Name of the instance.
    pub instance: String,
    /// Name of the PLC.
    pub plc: String,
    /// Path of the image file.
    pub path: PathBuf,
    /// Condition of the file.
    pub condition: Condition,
}

/// The condition of an image file.
#[derive(Debug)]
pub enum Condition {
    /// An emulator serves it.
    Alive(ImageSummary),
    /// The emulator of the image was killed. The next emulator of this name takes over the file.
    Dead(ImageSummary),
    /// This program cannot attach to the image; the error is the reason.
    Unusable(MemoryError),
}

/// Summary of an image's header.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ImageSummary {
    /// Process id of the emulator.
    pub pid: u32,
    /// Number of emulators that have used the file, from 1.
    pub generation: u32,
    /// Last state of the emulator; `None` for a number without meaning.
    pub state: Option<State>,
    /// Source of the emulated time; `None` for an unknown number.
    pub clock_mode: Option<ClockMode>,
    /// Emulated time per real time x 1000.
    pub speed: u32,
    /// Emulated time in microseconds.
    pub virtual_time_us: u64,
    /// Name of the emulated device.
    pub device: String,
    /// Hash of the register map.
    pub layout_hash: u64,
}

impl From<&Header> for ImageSummary {
    fn from(header: &Header) -> Self {
        Self {
            pid: header.firmware_pid.load(),
            generation: header.generation.load(),
            state: State::from_code(header.state.load()),
            clock_mode: ClockMode::from_code(header.clock_mode.load()),
            speed: header.speed.load(),
            virtual_time_us: header.virtual_time_us.load(),
            device: header::name(&header.device),
            layout_hash: header.layout_hash.load(),
        }
    }
}

/// Returns all images, sorted by instance and PLC.
///
/// # Errors
/// `/dev/shm` cannot be read. A single unreadable file is reported in its entry.
pub fn list() -> Result<Vec<ImageInfo>, MemoryError> {
    let mut images = Vec::new();
    for_each_name(|instance, plc| images.extend(look_at(instance, plc)))?;
    images.sort_by(|a, b| (&a.instance, &a.plc).cmp(&(&b.instance, &b.plc)));
    Ok(images)
}

/// Returns names of all instances with an image or a directory, in any condition.
///
/// # Errors
/// `/dev/shm` cannot be read.
pub fn instances() -> Result<BTreeSet<String>, MemoryError> {
    let mut instances = BTreeSet::new();
    for_each_file(|name| {
        let of_image = || parse_image_name(name).map(|(instance, _)| instance);
        instances.extend(parse_directory_name(name).or_else(of_image).map(str::to_owned));
    })?;
    Ok(instances)
}

/// Returns the PLCs of all entries with the name of an image of `instance`, except those that belong to another user.
pub(super) fn named(instance: &str) -> Result<Vec<String>, MemoryError> {
    let mut plcs = Vec::new();
    for_each_name(|of, plc| {
        if of == instance && !is_foreign(instance, plc) {
            plcs.push(plc.to_owned());
        }
    })?;
    Ok(plcs)
}

/// Calls `found` with instance and PLC of every entry with the name of an image.
fn for_each_name(mut found: impl FnMut(&str, &str)) -> Result<(), MemoryError> {
    for_each_file(|name| {
        if let Some((instance, plc)) = parse_image_name(name) {
            found(instance, plc);
        }
    })
}

/// Calls `found` with the name of every entry of [`IMAGE_DIRECTORY`].
fn for_each_file(mut found: impl FnMut(&str)) -> Result<(), MemoryError> {
    let failed = |reason| MemoryError::System { path: PathBuf::from(IMAGE_DIRECTORY), doing: "list", reason };
    for entry in fs::read_dir(IMAGE_DIRECTORY).map_err(failed)? {
        if let Some(name) = entry.map_err(failed)?.file_name().to_str() {
            found(name);
        }
    }
    Ok(())
}

fn is_foreign(instance: &str, plc: &str) -> bool {
    matches!(ImageFile::open(instance, plc, false), Err(MemoryError::ForeignOwner { .. }))
}

/// Reads the state of an image. Returns `None` if the file has disappeared in the meantime.
fn look_at(instance: &str, plc: &str) -> Option<ImageInfo> {
    let condition = match judge(instance, plc) {
        Ok(condition) => condition?,
        Err(reason) => Condition::Unusable(reason),
    };
    let path = super::names::image_path(instance, plc).ok()?;
    Some(ImageInfo { instance: instance.to_owned(), plc: plc.to_owned(), path, condition })
}

fn judge(instance: &str, plc: &str) -> Result<Option<Condition>, MemoryError> {
    let Some(file) = ImageFile::open(instance, plc, false)? else { return Ok(None) };
    let header = file.own_header()?;
    file.check_shape(&header)?;
    file.check_instance(&header)?;
    let summary = ImageSummary::from(&*header);
    Ok(Some(if file.is_alive(&header) { Condition::Alive(summary) } else { Condition::Dead(summary) }))
}
