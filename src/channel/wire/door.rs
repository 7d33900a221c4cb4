//! A door in an operation: its kind in the field of the width, followed by its numbers.

use super::{BadField, WireOp};
use crate::door::DoorSpec;
use std::net::{Ipv4Addr, SocketAddrV4};

const NONE: u16 = 0;
const SLCAN_TCP: u16 = 1;
const SLCAN_PTY: u16 = 2;
const PROFIBUS_TCP: u16 = 3;

/// Encodes the door in its fields.
pub(super) fn encode(door: Option<DoorSpec>) -> WireOp {
    let rest = WireOp::default();
    let tcp = |kind, at: SocketAddrV4| WireOp {
        width: kind,
        node: at.port(),
        value: at.ip().to_bits(),
        ..WireOp::default()
    };
    match door {
        None => WireOp { width: NONE, ..rest },
        Some(DoorSpec::SlcanTcp { at }) => tcp(SLCAN_TCP, at),
        Some(DoorSpec::ProfibusTcp { at }) => tcp(PROFIBUS_TCP, at),
        Some(DoorSpec::SlcanPty { number }) => {
            let (node, value) = (u16::from(number.is_some()), number.unwrap_or(0));
            WireOp { width: SLCAN_PTY, node, value, ..rest }
        }
    }
}

/// Decodes the door.
///
/// # Errors
/// The kind of door is unknown.
pub(super) fn decode(wire: &WireOp) -> Result<Option<DoorSpec>, BadField> {
    let WireOp { width, node, value, .. } = *wire;
    let at = SocketAddrV4::new(Ipv4Addr::from_bits(value), node);
    Ok(match width {
        NONE => None,
        SLCAN_TCP => Some(DoorSpec::SlcanTcp { at }),
        PROFIBUS_TCP => Some(DoorSpec::ProfibusTcp { at }),
        SLCAN_PTY => Some(DoorSpec::SlcanPty { number: (node != 0).then_some(value) }),
        _ => return Err(BadField::new("the door", width)),
    })
}
