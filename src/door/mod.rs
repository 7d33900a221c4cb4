//! Doors: entrances for foreign programs to the buses of a running plant.
//!
//! A door is an entrance over TCP or over a pseudo-terminal: to CAN with SLCAN, the protocol of serial adapters, or to
//! PROFIBUS with telegrams. A program that connects is a guest, a station on a bus like others. This module does not
//! depend on the plant: [`Doors`] passes on the messages of guests and takes messages for them. Both directions use
//! bounded queues, so that a slow or dead guest delays no other station. A separate thread does all work that could
//! block. A guest that asks for emulated time has a [`GuestTurn`] in lockstep.

mod descriptors;
mod doors;
mod guest;
mod io;
mod protocol;
mod pty;
mod seat;
mod serial;
mod slcan;
mod sparing;
mod spec;
mod telegrams;
mod wire;

pub(crate) use descriptors::RESERVED as RESERVED_DESCRIPTORS;
pub use doors::{DoorError, DoorState, Doors};
pub use guest::{Guest, GuestRequests, GuestState};
pub use protocol::{TrafficKind, doors_of};
pub use seat::GuestTurn;
pub use slcan::Rate;
pub use spec::{BadDoor, Carrier, DoorSpec};
pub use wire::BusMessage;

/// Maximum count of guests of an instance at once.
pub const MAX_GUESTS: usize = 64;
/// Maximum count of guests that an instance knows. The count includes guests that have left but have frames that will
/// still enter the plant, which with a stepped clock happens at the next step. In real time the guest that left first loses
/// such frames if the count is reached.
pub const MAX_KNOWN_GUESTS: usize = 192;
/// Frames or telegrams of a guest that wait until the plant takes them. A guest that sends more gets the protocol's
/// error answer, if there is one.
pub const ROOM_TO_PLANT: usize = 1024;
/// Frames or telegrams that wait until a guest takes them. Others are dropped, and counted.
pub const ROOM_TO_GUEST: usize = 4096;
