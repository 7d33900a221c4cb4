//! Scenarios: what to do with a plant and what to expect of it, as Rust tests or as scripts.
//!
//! [`Bench`] is a plant with verbs: poke, step, wait, expect, and so on. Tests in Rust use it directly; scripts
//! in Rhai get the same verbs from [`run_file`] (`commram test`, reference in `docs/scenarios.md`). The plant
//! is one of its own, on heap memory with a stepped clock, or a running instance behind its channel: the verbs ask
//! both for the same operations ([`crate::request`]).

mod bench;
mod carrier;
mod engine;
mod error;
mod imports;
mod junit;
mod local;
mod printed;
#[cfg(feature = "channel")]
mod remote;
mod run;
mod value;

pub use bench::{Bench, Change, MemoryCopy, SeenFrame};
pub use engine::verbs;
pub use error::{Failure, ScenarioError};
pub use junit::junit;
pub use run::{Limits, Outcome, Report, run_file};
pub use value::{Span, Value};
