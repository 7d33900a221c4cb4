//! CANopen as a device speaks it (CiA 301), without input or output: bytes and times go in, bytes come out. A device
//! with an object dictionary, registers and a controller connects these parts.

pub mod emergency;
pub mod guard;
pub mod messages;
pub mod network;
pub mod nmt;
pub mod pdo;
pub mod records;
pub mod sdo;
pub mod supervision;
