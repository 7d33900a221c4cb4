//! Operations on consecutive registers.

use crate::identity::DeviceIndex;
use crate::layout::Width;
use crate::memory::Unmapped;
use crate::plant::FollowError;
use crate::request::register::{device_of, known_plc};
use crate::request::{Code, Host, Refused};

pub(super) fn read_range(
    host: &dyn Host,
    plc: DeviceIndex,
    offset: u32,
    len: u32,
) -> Result<Vec<u8>, Refused> {
    let plc = known_plc(host, plc)?;
    let mut bytes = vec![0; len as usize];
    let read = host.plant().read_range(plc, offset, &mut bytes);
    read.map_err(|hole| hole_in_range(host, plc, offset, len, hole))?;
    Ok(bytes)
}

fn hole_in_range(host: &dyn Host, plc: DeviceIndex, offset: u32, len: u32, hole: Unmapped) -> Refused {
    let byte = |offset| device_of(host, plc).at(Width::Byte, offset);
    let (begin, hole) = (byte(offset), byte(hole.offset));
    let text =
        format_args!("{begin}, {len} bytes: no register area covers {hole}; read each area for itself");
    Refused::new(Code::RANGE_UNMAPPED, text)
}

pub(super) fn not_followed(
    host: &dyn Host,
    plc: DeviceIndex,
    offset: u32,
    len: u32,
    error: FollowError,
) -> Refused {
    match error {
        FollowError::Unmapped(hole) => hole_in_range(host, plc, offset, len, hole),
        FollowError::TooMany => Refused::new(Code::TOO_MANY_FOLLOWED, format_args!("{error}")),
    }
}
