//! Doors: entrances for foreign programs to the buses of a running plant.
//!
//! A door is an entrance over TCP or over a pseudo-terminal. A door to CAN uses SLCAN, the protocol of serial adapters.
//! A door to PROFIBUS uses telegrams, and a door to a serial line uses octets. A program that connects to a door is a guest. On the bus, a guest is a station
//! like any other station. This module does not depend on the plant: [`Doors`] delivers messages from guests and
//! accepts messages for guests. Both directions use bounded queues, so that a slow or dead guest delays no other
//! station. A separate thread does all work that could block. A guest that requests emulated time takes part in
//! lockstep ([`GuestTurn`]).

mod descriptors;
mod doors;
mod guest;
mod io;
mod log_limiter;
mod octets;
mod protocol;
mod pty;
mod seat;
mod serial;
mod slcan;
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

/// Maximum number of guests of an instance at a time.
pub const MAX_GUESTS: usize = 64;
/// Maximum number of guests in the list of an instance. The list includes disconnected guests, until the plant has
/// taken their last frames. With a stepped clock, the plant takes them as soon as the bus has room. In real time, if this maximum
/// is reached, the last frames of the guest that disconnected first are discarded.
pub const MAX_KNOWN_GUESTS: usize = 192;
/// Maximum number of frames or telegrams of a guest that wait until the plant takes them. A guest that sends more gets
/// an error answer, if the protocol has an error answer. The clock waits for a guest with a seat, so the further
/// telegrams of such a guest are refused and counted. All others are limited by [`OCTETS_TO_PLANT`].
pub const ROOM_TO_PLANT: usize = 1024;
/// If a guest has sent this number of octets, and the plant has not taken them, the doors read no more from the guest.
/// Its further octets wait in the buffers of the operating system, so that none is lost.
pub const OCTETS_TO_PLANT: usize = 1 << 16;
/// Maximum number of frames or telegrams that wait until a guest takes them. If there are more, they are dropped and
/// counted.
pub const ROOM_TO_GUEST: usize = 4096;
