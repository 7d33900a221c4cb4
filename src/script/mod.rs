//! Scenarios: actions on a plant and expectations, as Rust tests or as scripts.
//!
//! [`Bench`] is a plant with verbs: poke, step, wait, expect, and so on. Tests in Rust use it directly. Scripts in Rhai
//! get the same verbs from [`run_file`] (`commram test`, reference in `docs/reference/scenarios.md`). The plant is
//! either a new plant on heap memory with a stepped clock, or a running instance, reached through its channel. The
//! verbs execute the same operations ([`crate::request`]) on both.

mod bench;
mod carrier;
mod caught;
#[cfg(feature = "cli")]
pub(crate) mod check;
mod complaint;
#[cfg(feature = "cli")]
pub(crate) mod debug;
mod engine;
mod error;
mod failure;
#[cfg(all(test, feature = "channel"))]
mod federated;
mod fields;
mod imports;
mod junit;
mod lines;
mod local;
mod part;
mod printed;
#[cfg(feature = "channel")]
mod remote;
mod report;
mod run;
#[cfg(feature = "cli")]
pub(crate) mod soak;
mod spelling;
mod value;
mod verb;

pub use bench::{Bench, Change, MemoryCopy, PastChange, Register, SeenFrame};
pub use error::ScenarioError;
pub use failure::{ExchangeKind, ExchangeStep, Failure, FailureKind, JournalLine, Numbers, ScriptLocation};
pub use fields::{Field, Fields};
#[cfg(feature = "cli")]
pub(crate) use imports::without_dots;
#[cfg(feature = "cli")]
pub(crate) use junit::{SKIP, junit_input, junit_text, junit_value, shard_of_junit};
pub use junit::{junit, junit_of_shard};
pub use lines::Lines;
pub use part::{is_part, needs};
pub use report::{FoundLine, Mistake, Outcome, PlotFile, Report, Step};
pub use run::{Limits, run_file};
#[cfg(feature = "cli")]
pub(crate) use run::{UnnamedPlant, run_debugged, run_observed, spawn_with_stack, with_stack};
pub use value::{Span, Value};
#[cfg(feature = "cli")]
pub(crate) use verb::defined;
pub use verb::{DEFINITIONS, Verb, verbs};
