//! Doors: how foreign programs take part in the buses of a running plant.
//!
//! A door is a way in: over TCP or over a pseudo-terminal, to CAN in the dialect of SLCAN that serial adapters speak, to
//! PROFIBUS in telegrams. Whoever comes in is a guest, a station on a bus like others. Nothing here knows a plant: [`Doors`]
//! hands over what guests send and takes what they are to hear, both by bounded queues, so that a slow or dead guest delays
//! nobody. A thread of its own does all that could block. A guest that asks for emulated time has a [`Seat`] in lockstep.

mod descriptors;
mod doors;
mod guest;
mod io;
mod pty;
mod seat;
mod slcan;
mod sparing;
mod spec;
mod telegrams;
mod wire;

pub(crate) use descriptors::RESERVED as RESERVED_DESCRIPTORS;
pub use doors::{DoorError, DoorState, Doors};
pub use guest::{Guest, GuestState, Wish};
pub use seat::Seat;
pub use slcan::Rate;
pub use spec::{BadDoor, DoorSpec, Speech};
pub use wire::BusMessage;

/// Most guests that an instance has at once.
pub const MAX_GUESTS: usize = 64;
/// Most guests that an instance knows: those that are there, and those that have left but whose frames are still to enter the
/// plant, which with a stepped clock happens at the next step.
pub const MAX_KNOWN_GUESTS: usize = 192;
/// Frames or telegrams of a guest that wait until the plant takes them. Who sends more gets the protocol's error answer, if there
/// is one.
pub const ROOM_TO_PLANT: usize = 1024;
/// Frames or telegrams that wait until a guest takes them. What does not fit is dropped, and counted.
pub const ROOM_TO_GUEST: usize = 4096;
