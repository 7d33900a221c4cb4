//! Forced registers on the wire.

use super::{width_code, width_from_code};
use crate::identity::DeviceIndex;
use crate::plant::Forced;
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

#[derive(Clone, Copy, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
struct WireForced {
    plc: u16,
    width: u16,
    offset: u32,
    value: u32,
}

pub(super) fn append(forces: &[Forced], bytes: &mut Vec<u8>) {
    let wire = |&Forced { plc, offset, width, value }: &Forced| WireForced {
        plc: plc.0,
        width: width_code(width),
        offset,
        value,
    };
    forces.iter().map(wire).for_each(|forced| bytes.extend_from_slice(forced.as_bytes()))
}

/// Decodes the list; `None` if [`append`] cannot have produced it.
pub(super) fn decode(bytes: &[u8]) -> Option<Vec<Forced>> {
    let forced = |bytes: &[u8]| {
        let WireForced { plc, width, offset, value } = WireForced::read_from_bytes(bytes).ok()?;
        Some(Forced { plc: DeviceIndex(plc), offset, width: width_from_code(width)?, value })
    };
    bytes.chunks(size_of::<WireForced>()).map(forced).collect()
}
