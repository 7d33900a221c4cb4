//! The CANopen protocol of a device (CiA 301), without input or output: the functions get bytes and times, and return
//! bytes. A device connects these parts with its object dictionary, its registers and its controller.

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
