//! A running emulator: a plant on image files, driven by a clock, reachable through the channel.

mod clock;
mod emulator;
#[cfg_attr(not(feature = "channel"), allow(dead_code, reason = "without it stepped time never passes"))]
mod lockstep;
#[cfg(feature = "channel")]
mod machine;
mod novram;
mod watch;

pub use clock::Clock;
pub use emulator::{Emulator, Options, RuntimeError, StopHandle};
pub use novram::{Directory, Found, Keeper, Novram, NovramError};
