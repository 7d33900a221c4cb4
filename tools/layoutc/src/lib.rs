//! Compiles register layouts: reads the TOML files of one device, checks them, and emits Rust.
//!
//! `build.rs` of commram is the only user. A wrong layout stops the build with file, line, column and
//! reason. The format of the files is described in `docs/reference/layouts.md`.

mod check;
#[cfg(feature = "import")]
pub mod declaration;
mod emit;
mod error;
mod gsd;
mod hash;
#[cfg(feature = "import")]
pub mod import;
mod model;
mod objects;
pub mod parameters;
mod raw;
mod schema;
mod source;

pub use error::{Error, Location, Reason};
pub use schema::SCHEMA;

use std::path::{Path, PathBuf};

/// Result of [`compile`] for one device.
#[derive(Debug)]
pub struct Compiled {
    /// Rust source of the device's module.
    pub rust: String,
    /// Hash over everything that affects addresses or widths, the module's `LAYOUT_HASH`.
    pub layout_hash: u64,
    /// Every file that was read.
    pub inputs: Vec<PathBuf>,
}

/// Compiles the common part of a family's devices, in `dir`, starting at its `family.toml`.
///
/// # Errors
/// Returns the first error, with its place.
pub fn compile_family(dir: &Path) -> Result<String, Error> {
    let family = check::load_family(&mut source::Sources::new(dir))?;
    Ok(emit::family(&family))
}

/// Compiles the layout in `dir`, starting at its `device.toml`.
///
/// # Errors
/// Returns the first error, with its place.
pub fn compile(dir: &Path) -> Result<Compiled, Error> {
    let mut sources = source::Sources::new(dir);
    let device = check::load(&mut sources)?;
    let layout_hash = hash::layout_hash(&device);
    Ok(Compiled { rust: emit::module(&device, layout_hash), layout_hash, inputs: sources.paths() })
}
