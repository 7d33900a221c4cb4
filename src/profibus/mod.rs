//! The data link layer of PROFIBUS (IEC 61158 type 3): telegrams, function codes, bit times, and a line on which all
//! stations receive everything.
//!
//! The module depends on no device and no application. Its users define the meaning of octets after the head of a
//! telegram. It uses no I/O and no clock. Times are in bit times, as in the standard. The plant uses microseconds, so
//! times are converted at its interface.

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

/// The address for requests to all stations.
pub const BROADCAST: u8 = 127;

/// Idle time before a request, T_SYN, in bit times.
pub const SYN_BITS: u64 = 33;

/// Shortest time between a request and its answer, in bit times.
pub const MIN_TSDR_BITS: u64 = 11;

/// Number of bits of an octet on the line: start bit, eight data bits, parity bit, stop bit.
pub const OCTET_BITS: u64 = 11;
