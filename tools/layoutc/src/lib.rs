//! Compiles register layouts: reads the TOML files of one device, checks them, and emits Rust.
//!
//! `build.rs` of commram compiles layouts with [`compile`]. A wrong layout stops the build with file, line, column and
//! reason. The emulator reads devices of users with [`read_folder`]. The format of the files is described in
//! `docs/reference/layouts.md`.

mod check;
#[cfg(feature = "import")]
pub mod declaration;
mod emit;
mod error;
pub mod front;
mod gsd;
mod hash;
#[cfg(feature = "import")]
pub mod import;
pub mod model;
mod objects;
pub mod parameters;
mod raw;
mod schema;
mod source;

pub use error::{Error, Location, Reason};
pub use schema::SCHEMA;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Result of [`compile`] for one device.
#[derive(Debug)]
pub struct Compiled {
    /// Rust source of the device's module.
    pub rust: String,
    /// Hash over all properties that affect addresses or widths. It is the `LAYOUT_HASH` of the module.
    pub layout_hash: u64,
    /// Every file that was read.
    pub inputs: Vec<PathBuf>,
}

/// Compiles the common part of a family's devices, in `dir`, starting at its `family.toml`.
///
/// # Errors
/// The error with its place, if the layout has one.
pub fn compile_family(dir: &Path) -> Result<String, Error> {
    let family = check::load_family(&mut source::Sources::new(dir))?;
    Ok(emit::family(&family))
}

/// Compiles the layout in `dir`, starting at its `device.toml`.
///
/// # Errors
/// The error with its place, if the layout has one.
pub fn compile(dir: &Path) -> Result<Compiled, Error> {
    let Layout { device, layout_hash, inputs } = read(dir)?;
    let inputs = inputs.into_iter().map(|(path, _)| path).collect();
    Ok(Compiled { rust: emit::module(&device, layout_hash), layout_hash, inputs })
}

/// A layout that was read and checked.
pub struct Layout {
    /// The layout of the device, after all checks.
    pub device: model::Device,
    /// Hash over all properties that affect addresses or widths.
    pub layout_hash: u64,
    /// Every file that was read, with its text.
    pub inputs: Vec<(PathBuf, String)>,
}

/// Reads the layout in `dir`, starting at its `device.toml`, and checks it like [`compile`].
///
/// # Errors
/// The error with its place, if the layout has one.
pub fn read(dir: &Path) -> Result<Layout, Error> {
    read_from(source::Sources::new(dir))
}

/// Reads the layout in the folder `dir`. The author of the folder may be unknown, so all files must be in the folder
/// itself and must not be links.
///
/// # Errors
/// The error with its place, if the layout has one.
pub fn read_folder(dir: &Path) -> Result<Layout, Error> {
    read_from(source::Sources::of_folder(dir))
}

/// Does the same as [`read_folder`], with texts that replace the contents of some files, by their paths.
///
/// # Errors
/// The error with its place, if the layout has one.
pub fn read_edited_folder(dir: &Path, edits: BTreeMap<PathBuf, String>) -> Result<Layout, Error> {
    read_from(source::Sources::of_folder(dir).edited(edits))
}

fn read_from(mut sources: source::Sources) -> Result<Layout, Error> {
    let device = check::load(&mut sources)?;
    let layout_hash = hash::layout_hash(&device);
    Ok(Layout { device, layout_hash, inputs: sources.into_files() })
}

/// Reads another file of the folder `dir` as text, with the rules of [`read_folder`]. Returns `None` if the file does
/// not exist.
///
/// # Errors
/// The file is a link, not a regular file, too long, or not a text.
pub fn read_file_of_folder(dir: &Path, name: &str) -> Result<Option<String>, Error> {
    source::Sources::of_folder(dir).read_text(name)
}
