//! Declarations of the register map and the header page in other languages, and machine-readable forms of it.
//!
//! All data are from the descriptors of [`crate::layout`] and from the structs of the header page
//! ([`crate::memory::contract`]). No generator depends on a particular register. `docs/reference/export.md` describes
//! the use of the results.

mod c;
mod constants;
mod csv;
#[cfg(feature = "emulator")]
mod dbc;
mod eds;
mod gsd;
mod json;
mod markdown;
mod matiec;
mod md;
mod members;
mod names;
mod openplc;
mod python;
mod rows;
mod runner;
mod scope;
mod st;
mod strucpp;
mod svd;
mod systemrdl;
mod text;
#[cfg(feature = "emulator")]
mod wireshark;
mod xml;

use crate::layout::{DeviceLayout, LayoutError};
use std::fmt;
use thiserror::Error;

#[cfg(feature = "cli")]
pub(crate) use c::register_expression;
pub use constants::{Enumeration, enumerations};
pub use csv::line as csv_line;
#[cfg(feature = "emulator")]
pub use dbc::dbc;
#[cfg(feature = "cli")]
pub(crate) use markdown::text as markdown_text;
pub use md::table as md_table;
pub use scope::Scope;
pub use st::{StCompiler, StForm};
#[cfg(feature = "emulator")]
pub use wireshark::{DissectedBus, wireshark};

/// Output formats of the register map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// One C header, also for C++.
    C,
    /// The C header with glue for programs compiled by matiec.
    Matiec,
    /// The C program that runs a program compiled by matiec.
    MatiecMain,
    /// The header for access to an image by programs of OpenPLC.
    OpenPlc,
    /// The hardware layer of OpenPLC.
    OpenPlcLayer,
    /// The header that binds located variables of programs compiled by STruC++.
    StruCpp,
    /// The C++ program that runs a program compiled by STruC++.
    StruCppMain,
    /// Declarations in IEC 61131-3 Structured Text.
    St(StForm),
    /// A Python module without dependencies.
    Python,
    /// A CMSIS-SVD file.
    Svd,
    /// A SystemRDL 2.0 file.
    SystemRdl,
    /// A JSON document with a versioned schema.
    Json,
    /// Comma-separated values, one line per register.
    Csv,
    /// An electronic data sheet of the object dictionary.
    Eds,
    /// A device description file of a PROFIBUS-DP slave.
    Gsd,
    /// The register reference in Markdown.
    Md,
}

impl Format {
    /// All formats, each name once.
    pub const ALL: [Self; 13] = [
        Self::C,
        Self::Matiec,
        Self::OpenPlc,
        Self::StruCpp,
        Self::St(StForm { elementary: false, compiler: StCompiler::Any }),
        Self::Python,
        Self::Svd,
        Self::SystemRdl,
        Self::Json,
        Self::Csv,
        Self::Eds,
        Self::Gsd,
        Self::Md,
    ];

    /// Returns the name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::C => "c",
            Self::Matiec | Self::MatiecMain => "matiec",
            Self::OpenPlc | Self::OpenPlcLayer => "openplc",
            Self::StruCpp | Self::StruCppMain => "strucpp",
            Self::St(_) => "st",
            Self::Python => "python",
            Self::Svd => "svd",
            Self::SystemRdl => "systemrdl",
            Self::Json => "json",
            Self::Csv => "csv",
            Self::Eds => "eds",
            Self::Gsd => "gsd",
            Self::Md => "md",
        }
    }

    /// Short description of the format.
    #[must_use]
    pub const fn about(self) -> &'static str {
        match self {
            Self::C => "C header with structures, constants and functions to attach; also for C++",
            Self::Matiec => "C header that binds located variables of programs compiled by matiec",
            Self::MatiecMain => "C program that runs a program compiled by matiec",
            Self::OpenPlc => "C++ header that binds located variables of OpenPLC's programs",
            Self::OpenPlcLayer => "hardware layer for OpenPLC",
            Self::StruCpp => "C++ header that binds located variables of programs compiled by STruC++",
            Self::StruCppMain => "C++ program that runs a program compiled by STruC++",
            Self::St(_) => "IEC 61131-3 types and variables, as in the manual",
            Self::Python => "Python module without dependencies",
            Self::Svd => "CMSIS-SVD for debuggers and viewers",
            Self::SystemRdl => "SystemRDL 2.0 for PeakRDL and hardware tools",
            Self::Json => "everything known about the registers, for programs",
            Self::Csv => "one line per register, for spreadsheets",
            Self::Eds => {
                "electronic data sheet of the object dictionary, for masters and configuration tools"
            }
            Self::Gsd => {
                "device description file of a PROFIBUS-DP slave, for masters and configuration tools"
            }
            Self::Md => "register reference for people",
        }
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// Reason for which an export is impossible.
#[derive(Debug, PartialEq, Eq, Error)]
pub enum ExportError {
    /// There is no area of that name.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// The front panel of a device was requested in a format for programs or the processor of the device, which cannot
    /// access the front panel.
    #[error(
        "`{block}` of {device} is in the header page, for which {format} has no addresses; take c, python or a table"
    )]
    NoAddresses {
        /// Name of the device with the area.
        device: &'static str,
        /// Name of the area in the header page.
        block: &'static str,
        /// Format of the export that cannot express the area.
        format: Format,
    },
}

/// Generates the register map of `device` in `format`. With `block`, it has only this area.
///
/// # Errors
/// [`ExportError`], if there is no area of this name, if the format has no addresses for the area, or if the format
/// describes an object dictionary or a PROFIBUS-DP slave and the device has none.
pub fn export(
    device: &'static DeviceLayout,
    format: Format,
    block: Option<&str>,
) -> Result<String, ExportError> {
    export_scope(Scope::new(device, block)?, format)
}

/// Returns the registers of `scope` in `format`.
///
/// # Errors
/// Like [`export()`].
pub(crate) fn export_scope(scope: Scope, format: Format) -> Result<String, ExportError> {
    let device = scope.device;
    let is_without_front =
        matches!(format, Format::Matiec | Format::OpenPlc | Format::StruCpp | Format::St(_) | Format::Svd);
    let scope = if is_without_front { scope.without_front() } else { scope };
    if let (true, true, Some(block)) = (is_without_front, scope.areas.is_empty(), scope.block) {
        return Err(ExportError::NoAddresses { device: device.name, block, format });
    }
    if format == Format::Eds && device.objects.is_empty() {
        return Err(LayoutError::NoObjects { title: device.title }.into());
    }
    Ok(match format {
        Format::C => c::generate(&scope),
        Format::Matiec => matiec::generate(&scope),
        Format::MatiecMain => matiec::main(&scope),
        Format::OpenPlc => openplc::generate(&scope),
        Format::OpenPlcLayer => openplc::hardware_layer(&scope),
        Format::StruCpp => strucpp::generate(&scope),
        Format::StruCppMain => strucpp::main(&scope),
        Format::St(form) => st::generate(&scope, form, None),
        Format::Python => python::generate(&scope),
        Format::Svd => svd::generate(&scope),
        Format::SystemRdl => systemrdl::generate(&scope),
        Format::Json => json::generate(&scope),
        Format::Csv => csv::generate(&scope),
        Format::Eds => eds::generate(&scope),
        Format::Gsd => {
            let gsd = device.gsd.ok_or(LayoutError::NoGsd { title: device.title })?;
            gsd::generate(&scope, gsd)
        }
        Format::Md => md::generate(&scope),
    })
}

/// Generates a complete file for matiec, see [`StCompiler::Matiec`]. `blocks` are function blocks in Structured Text.
/// In the file they follow the types and precede the program.
#[must_use]
pub fn st_with_blocks(device: &'static DeviceLayout, blocks: &str) -> String {
    let areas = device.named_areas().collect();
    let scope = Scope { device, areas, block: None, folder: None }.without_front();
    st::generate(&scope, StForm { elementary: false, compiler: StCompiler::Matiec }, Some(blocks))
}
