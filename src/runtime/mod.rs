//! A running emulator: a plant on image files, with a clock, and reachable through the channel.

mod clock;
#[cfg(feature = "channel")]
mod coupled;
mod emulator;
mod error;
#[cfg(feature = "channel")]
mod federated;
mod guests;
mod host;
mod lockstep;
mod novram;
mod open_files;
mod turns;
mod watch;

pub use clock::Clock;
pub use emulator::{Emulator, Options, StopHandle};
pub use error::RuntimeError;
pub use novram::{Directory, Found, Keeper, Novram, NovramError};
