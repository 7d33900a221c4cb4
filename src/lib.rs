//! commram: the communication RAM of the Omega Drive-Line II, emulated register by register.

pub mod bus;
#[cfg(feature = "channel")]
pub mod channel;
pub mod drive;
pub mod firmware;
pub mod journal;
pub mod layout;
pub mod memory;
pub mod plant;
pub mod runtime;
