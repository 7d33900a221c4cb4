//! A door in an operation: its kind, followed by its numbers.

use super::BadField;
use crate::door::DoorSpec;
use std::net::{Ipv4Addr, SocketAddrV4};

const NONE: u16 = 0;
const SLCAN_TCP: u16 = 1;
const SLCAN_PTY: u16 = 2;
const PROFIBUS_TCP: u16 = 3;

/// The kind of door, its port, and its address or number.
pub(super) type Columns = (u16, u16, u32);

/// Encodes the door.
pub(super) fn encode(door: Option<DoorSpec>) -> Columns {
    let tcp = |kind, at: SocketAddrV4| (kind, at.port(), at.ip().to_bits());
    match door {
        None => (NONE, 0, 0),
        Some(DoorSpec::SlcanTcp { at }) => tcp(SLCAN_TCP, at),
        Some(DoorSpec::ProfibusTcp { at }) => tcp(PROFIBUS_TCP, at),
        Some(DoorSpec::SlcanPty { number }) => (SLCAN_PTY, number.is_some().into(), number.unwrap_or(0)),
    }
}

/// Decodes the door.
///
/// # Errors
/// The kind of door is unknown.
pub(super) fn decode((kind, port, value): Columns) -> Result<Option<DoorSpec>, BadField> {
    let at = SocketAddrV4::new(Ipv4Addr::from_bits(value), port);
    Ok(match kind {
        NONE => None,
        SLCAN_TCP => Some(DoorSpec::SlcanTcp { at }),
        PROFIBUS_TCP => Some(DoorSpec::ProfibusTcp { at }),
        SLCAN_PTY => Some(DoorSpec::SlcanPty { number: (port != 0).then_some(value) }),
        _ => return Err(BadField::new("the door", kind)),
    })
}
