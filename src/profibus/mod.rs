//! PROFIBUS (IEC 61158 type 3), data link layer: telegrams, function codes, bit times, one line that all stations
//! hear.
//!
//! The module knows no device and no application; its users define the meaning of octets after the head of a
//! telegram. Everything here is pure: no I/O, no clock. Times are counted in bits, as in the standard, and converted
//! to microseconds at the edge of a plant.

mod frame;
mod function;
mod line;
mod rate;
mod responder;

pub use frame::{Burst, Frame, MAX_DATA, MAX_OCTETS, Telegram, TelegramError, octets_of_first};
pub use function::{Answer, FunctionCode, Request};
pub use line::{Line, Passage, Sending};
pub use rate::BusRate;
pub use responder::{Reaction, Responder};

/// The address that every station listens to.
pub const BROADCAST: u8 = 127;

/// Idle time before a request, T_SYN, in bit times.
pub const SYN_BITS: u64 = 33;

/// The least time between a request and its answer, in bit times.
pub const MIN_TSDR_BITS: u64 = 11;

/// Bits of an octet on the line: start, eight of data, parity, stop.
pub const OCTET_BITS: u64 = 11;
