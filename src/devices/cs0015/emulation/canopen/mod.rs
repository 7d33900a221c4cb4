//! The CANopen side of a CS0015: slave, network master, I/O modules, SDOs and their object dictionary.

pub(super) mod can_errors;
pub(super) mod communication;
pub(super) mod diagnosis;
pub(super) mod dictionary;
pub(super) mod direct;
pub(super) mod io_slaves;
pub(super) mod master;
pub(super) mod messages;
pub(super) mod nmt;
pub(super) mod node;
pub(super) mod sdo_client;
