//! A running emulator: a plant on image files, with a clock, that clients reach through the channel.

mod clock;
#[cfg(feature = "channel")]
mod coupling;
mod emulator;
mod end;
mod error;
mod guests;
mod host;
mod lateness;
mod lockstep;
#[cfg(feature = "channel")]
mod membership;
mod needs;
mod novram;
mod slice;
mod turns;
mod watch;

pub use clock::Clock;
pub use emulator::{Emulator, Options, StopHandle};
pub use error::RuntimeError;
#[cfg(feature = "cli")]
pub(crate) use needs::MEMORY;
pub use novram::{Directory, Keeper, Novram, NovramError, RestoreOutcome};
