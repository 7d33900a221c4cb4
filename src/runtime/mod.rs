//! A running emulator: a plant on image files, driven by a clock, reachable through the channel.

mod clock;
mod emulator;
#[cfg(feature = "channel")]
mod machine;
mod novram;

pub use clock::Clock;
pub use emulator::{Emulator, Options, RuntimeError, StopHandle};
pub use novram::{Found, Novram, NovramError};
