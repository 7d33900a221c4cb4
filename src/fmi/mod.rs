//! A plant as a unit for co-simulation by FMI 3.0: its variables, its steps, and the archive (FMU) that other
//! simulators load.
//!
//! This module has no C interface: `tools/fmi` is the shared object in such an archive, and calls a [`Unit`].

#[cfg(feature = "studio")]
mod archive;
#[cfg(feature = "studio")]
mod description;
#[cfg(feature = "channel")]
mod named;
mod resources;
#[cfg(test)]
mod tests;
mod unit;
mod values;
mod variables;

#[cfg(feature = "studio")]
pub use archive::{ArchiveError, LIBRARY, archive, is_library};
#[cfg(feature = "studio")]
pub use description::description;
#[cfg(feature = "channel")]
pub(crate) use named::VariableFinder;
pub use resources::{Resources, ResourcesError};
pub use unit::{Unit, UnitError, UnitState};
#[cfg(feature = "channel")]
pub(crate) use values::Shafts;
pub use values::Value;
pub use variables::{Causality, Variable, VariableType, VariablesError};
#[cfg(feature = "channel")]
pub(crate) use variables::{Quantity, ShaftValue};

/// Mark in the shared object. A program checks it to find out if the shared object is of the same version.
pub const MARK: &str = concat!("commram-fmi unit ", env!("CARGO_PKG_VERSION"), ";");
