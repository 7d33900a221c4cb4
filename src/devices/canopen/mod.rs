//! The CANopen protocol of a device (CiA 301). The functions have no input or output: they get bytes and
//! times, and return bytes. A device connects these parts with its object dictionary, its registers and its
//! controller.

mod connection_set;
pub(crate) mod emergency;
pub(crate) mod guard;
pub(crate) mod messages;
pub(crate) mod network;
pub(crate) mod nmt;
pub(crate) mod pdo;
pub(crate) mod records;
pub(crate) mod sdo;
pub(crate) mod supervision;

pub use connection_set::node_sends;
