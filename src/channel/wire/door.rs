//! A door as the columns of an operation: its kind, then its numbers.

use super::BadField;
use crate::door::{Carrier, DoorSpec};
use std::net::{Ipv4Addr, SocketAddrV4};

/// Kind that means "no door".
const NONE: u16 = 0;

/// The kind of door, its port, and its address or number.
pub(super) type Columns = (u16, u16, u32);

/// Encodes the specification of a door as columns; `None` becomes the kind "no door".
pub(super) fn encode(door: Option<DoorSpec>) -> Columns {
    let Some(door) = door else { return (NONE, 0, 0) };
    match door.carrier() {
        Carrier::Tcp(at) => (door.number(), at.port(), at.ip().to_bits()),
        Carrier::Pty(number) => (door.number(), number.is_some().into(), number.unwrap_or(0)),
    }
}

/// Decodes the door.
///
/// # Errors
/// The kind of door is unknown.
pub(super) fn decode((kind, port, value): Columns) -> Result<Option<DoorSpec>, BadField> {
    if kind == NONE {
        return Ok(None);
    }
    let at = SocketAddrV4::new(Ipv4Addr::from_bits(value), port);
    let door = DoorSpec::of_number(kind, at, (port != 0).then_some(value));
    door.map(Some).ok_or_else(|| BadField::new("the door", kind))
}
