//! [`InstanceInfo`] on the wire: a head of fixed size, then its texts, each with a length before it.

use crate::channel::op::InstanceInfo;
use crate::memory::ClockMode;
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

#[derive(Clone, Copy, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
struct Head {
    time_us: u64,
    layout_hash: u64,
    clock_mode: u32,
    speed: u32,
    generation: u32,
    pid: u32,
    abi_version: u32,
    plcs: u32,
}

/// Appends the information to `bytes`. A text too long for its length field is cut.
pub(super) fn encode(info: &InstanceInfo, bytes: &mut Vec<u8>) {
    let head = Head {
        time_us: info.time_us,
        layout_hash: info.layout_hash,
        clock_mode: info.clock_mode.code(),
        speed: info.speed,
        generation: info.generation,
        pid: info.pid,
        abi_version: info.abi_version,
        plcs: u32::try_from(info.plcs.len()).unwrap_or(u32::MAX),
    };
    bytes.extend_from_slice(head.as_bytes());
    for text in [&info.name, &info.version].into_iter().chain(&info.plcs) {
        let text = &text[..text.floor_char_boundary(u16::MAX.into())];
        bytes.extend_from_slice((text.len() as u16).as_bytes());
        bytes.extend_from_slice(text.as_bytes());
    }
}

/// The way back; `None` for what [`encode`] cannot have made.
pub(super) fn decode(bytes: &[u8]) -> Option<InstanceInfo> {
    let (head, mut rest) = Head::read_from_prefix(bytes).ok()?;
    let name = text(&mut rest)?;
    let version = text(&mut rest)?;
    let mut plcs = Vec::new();
    for _ in 0..head.plcs {
        plcs.push(text(&mut rest)?);
    }
    rest.is_empty().then_some(InstanceInfo {
        name,
        clock_mode: ClockMode::from_code(head.clock_mode)?,
        speed: head.speed,
        time_us: head.time_us,
        generation: head.generation,
        pid: head.pid,
        layout_hash: head.layout_hash,
        abi_version: head.abi_version,
        version,
        plcs,
    })
}

fn text(rest: &mut &[u8]) -> Option<String> {
    let (len, tail) = u16::read_from_prefix(rest).ok()?;
    let (text, tail) = tail.split_at_checked(len.into())?;
    *rest = tail;
    Some(str::from_utf8(text).ok()?.to_owned())
}
