//! The Rust part of the Python package `commram`: `commram._native`.
//!
//! This crate adds no behaviour: plants and instances are [`commram::script::Bench`], images
//! [`commram::memory::Attached`], tables come from [`commram::layout`]. `python/commram` builds the public interface on it.

mod bench;
mod errors;
mod given;
mod handle;
mod image;
mod instance;
mod lock;
mod records;
mod register;
mod snapshot;
mod tables;

use pyo3::prelude::*;

#[pymodule]
mod _native {
    #[pymodule_export]
    use super::bench::PyBench;
    #[pymodule_export]
    use super::handle::Handle;
    #[pymodule_export]
    use super::image::PyImage;
    #[pymodule_export]
    use super::records::{Change, Fault, Finding, Frame, Record};
    #[pymodule_export]
    use super::register::Register;
    #[pymodule_export]
    use super::snapshot::Snapshot;
    #[pymodule_export]
    use super::tables::{Memory, codes, default_device, enumerations, header, microseconds, names, register};
}
