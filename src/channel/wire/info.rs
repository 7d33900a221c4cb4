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
    plcs: u16,
    buses: u16,
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
        plcs: count(&info.plcs),
        buses: count(&info.buses),
    };
    bytes.extend_from_slice(head.as_bytes());
    let plcs = info.plcs.iter().take(head.plcs.into());
    let buses = info.buses.iter().take(head.buses.into());
    for text in [&info.name, &info.version].into_iter().chain(plcs).chain(buses) {
        let text = &text[..text.floor_char_boundary(u16::MAX.into())];
        bytes.extend_from_slice((text.len() as u16).as_bytes());
        bytes.extend_from_slice(text.as_bytes());
    }
}

/// As many names as the number in the head can say.
fn count(names: &[String]) -> u16 {
    u16::try_from(names.len()).unwrap_or(u16::MAX)
}

/// The way back; `None` for what [`encode`] cannot have made.
pub(super) fn decode(bytes: &[u8]) -> Option<InstanceInfo> {
    let (head, mut rest) = Head::read_from_prefix(bytes).ok()?;
    let name = text(&mut rest)?;
    let version = text(&mut rest)?;
    let mut texts = |count| (0..count).map(|_| text(&mut rest)).collect::<Option<Vec<_>>>();
    let (plcs, buses) = (texts(head.plcs)?, texts(head.buses)?);
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
        buses,
    })
}

fn text(rest: &mut &[u8]) -> Option<String> {
    let (len, tail) = u16::read_from_prefix(rest).ok()?;
    let (text, tail) = tail.split_at_checked(len.into())?;
    *rest = tail;
    Some(str::from_utf8(text).ok()?.to_owned())
}
