//! CANopen as a device speaks it (CiA 301), without input or output: bytes and times go in, bytes come out. A device
//! with an object dictionary, registers and a controller connects these parts.

mod connection_set;
pub mod emergency;
pub mod guard;
pub mod messages;
pub mod network;
pub mod nmt;
pub mod pdo;
pub mod records;
pub mod sdo;
pub mod supervision;

pub use connection_set::node_sends;
