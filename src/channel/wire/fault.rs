//! Faults on the wire: in the fields of an operation, and with their state in a list.

use super::{Op, WireOp, kind};
use crate::fault::{
    Effect, Fault, FaultStatus, FrameEffect, FrameSlot, Frames, Kind, Limit, NodeEffect, OffsetAt,
    SlaveEffect, SyncEffect,
};
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

/// Kinds of limits.
mod limit {
    pub(crate) const UNTIL_CLEARED: u8 = 0;
    pub(crate) const COUNT: u8 = 1;
    pub(crate) const DURATION: u8 = 2;
}

/// What a kind of fault has besides its place.
#[derive(Default)]
struct Details {
    /// 0: none; else one more than the index in [`FrameSlot::ALL`].
    slot: u8,
    id: u16,
    mask: u16,
    /// A time, a number, or one more than an offset.
    value: u32,
}

fn slot_code(slot: Option<FrameSlot>) -> u8 {
    slot.map_or(0, |slot| slot as u8 + 1)
}

fn slot_from_code(code: u8) -> Option<FrameSlot> {
    FrameSlot::ALL.get(usize::from(code).checked_sub(1)?).copied()
}

impl Details {
    fn of(effect: &Effect) -> Self {
        let value = |value| Details { value, ..Details::default() };
        match *effect {
            Effect::Frame { frames: Frames { id, mask, slot }, what, .. } => {
                let value = match what {
                    FrameEffect::Lose => 0,
                    FrameEffect::Delay(us) | FrameEffect::Duplicate(us) => us,
                };
                Details { slot: slot_code(slot), id, mask, value }
            }
            Effect::Sync { what: SyncEffect::Jitter(us), .. } => value(us),
            Effect::Slave { what: SlaveEffect::Late(us), .. }
            | Effect::Node { what: NodeEffect::Slow(us), .. } => value(us),
            Effect::Slave { what: SlaveEffect::Error(number) | SlaveEffect::Trip(number), .. }
            | Effect::Node { what: NodeEffect::Trip(number), .. } => value(number.into()),
            Effect::Slave { what: SlaveEffect::WrongOffset { at, offset }, .. } => {
                let slot = match at {
                    OffsetAt::Job => FrameSlot::Cc,
                    OffsetAt::Answer => FrameSlot::Rc,
                };
                Details {
                    slot: slot_code(Some(slot)),
                    ..value(offset.map_or(0, |offset| u32::from(offset) + 1))
                }
            }
            Effect::Sync { what: SyncEffect::Lose, .. }
            | Effect::Slave { what: SlaveEffect::Off | SlaveEffect::Busy, .. }
            | Effect::Node { what: NodeEffect::BusOff | NodeEffect::Overrun | NodeEffect::Silent, .. } => {
                Details::default()
            }
        }
    }

    fn effect(&self, kind: Kind, index: u16, number: u8) -> Option<Effect> {
        let &Details { slot, id, mask, value } = self;
        let frame = |what| Effect::Frame {
            bus: index,
            frames: Frames { id, mask, slot: slot_from_code(slot) },
            what,
        };
        let sync = |what| Effect::Sync { bus: index, what };
        let slave = |what| Effect::Slave { bus: index, slave: number, what };
        let node = |what| Effect::Node { plc: index, node: number, what };
        Some(match kind {
            Kind::LoseFrame => frame(FrameEffect::Lose),
            Kind::DelayFrame => frame(FrameEffect::Delay(value)),
            Kind::DuplicateFrame => frame(FrameEffect::Duplicate(value)),
            Kind::LoseSync => sync(SyncEffect::Lose),
            Kind::JitterSync => sync(SyncEffect::Jitter(value)),
            Kind::SlaveOff => slave(SlaveEffect::Off),
            Kind::SlaveLate => slave(SlaveEffect::Late(value)),
            Kind::SlaveBusy => slave(SlaveEffect::Busy),
            Kind::SlaveError => slave(SlaveEffect::Error(u16::try_from(value).ok()?)),
            Kind::WrongOffset => {
                let at = match slot_from_code(slot)? {
                    FrameSlot::Cc => OffsetAt::Job,
                    _ => OffsetAt::Answer,
                };
                let offset = value.checked_sub(1).map(u16::try_from).transpose().ok()?;
                slave(SlaveEffect::WrongOffset { at, offset })
            }
            Kind::BusOff => node(NodeEffect::BusOff),
            Kind::Overrun => node(NodeEffect::Overrun),
            Kind::DriveFault => slave(SlaveEffect::Trip(u16::try_from(value).ok()?)),
            Kind::BapsDriveFault => node(NodeEffect::Trip(u16::try_from(value).ok()?)),
            Kind::BapsSilent => node(NodeEffect::Silent),
            Kind::BapsSlow => node(NodeEffect::Slow(value)),
        })
    }
}

/// The operation that adds `fault`.
pub(super) fn encode(fault: &Fault) -> WireOp {
    let details = Details::of(&fault.effect);
    let (index, number) = fault.target().numbers();
    let (limit, amount) = match fault.limit {
        Limit::UntilCleared => (limit::UNTIL_CLEARED, 0),
        Limit::Count(count) => (limit::COUNT, count),
        Limit::Duration(us) => (limit::DURATION, us),
    };
    WireOp {
        kind: kind::FAULT_ADD,
        plc: index,
        width: u16::from_le_bytes([fault.kind() as u8, details.slot]),
        node: u16::from_le_bytes([number, limit]),
        offset: u32::from(details.mask) << 16 | u32::from(details.id),
        value: details.value,
        second: amount,
        reserved: 0,
        time_us: fault.at_us,
    }
}

/// The way back. What is in fields that the kind does not use is not looked at here.
pub(super) fn decode(wire: &WireOp) -> Option<Fault> {
    let [kind, slot] = wire.width.to_le_bytes();
    let [number, limit] = wire.node.to_le_bytes();
    let details =
        Details { slot, id: wire.offset as u16, mask: (wire.offset >> 16) as u16, value: wire.value };
    Some(Fault {
        effect: details.effect(Kind::from_code(kind)?, wire.plc, number)?,
        at_us: wire.time_us,
        limit: match limit {
            limit::UNTIL_CLEARED => Limit::UntilCleared,
            limit::COUNT => Limit::Count(wire.second),
            limit::DURATION => Limit::Duration(wire.second),
            _ => return None,
        },
    })
}

/// A fault of a list: 40 bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
pub(super) struct WireFault {
    /// The operation that adds it.
    fault: WireOp,
    id: u16,
    /// 1 if it has begun, else 0.
    acting: u16,
    hits: u32,
}

const _: () = assert!(size_of::<WireFault>() == 40);

impl From<&FaultStatus> for WireFault {
    fn from(status: &FaultStatus) -> Self {
        let FaultStatus { id, fault, acting, hits } = *status;
        WireFault { fault: encode(&fault), id, acting: acting.into(), hits }
    }
}

impl WireFault {
    /// The way back; `None` for what no server of this version can have sent.
    pub(crate) fn status(&self) -> Option<FaultStatus> {
        let acting = match self.acting {
            0 => false,
            1 => true,
            _ => return None,
        };
        let Ok(Op::FaultAdd { fault }) = Op::try_from(self.fault) else { return None };
        Some(FaultStatus { id: self.id, fault, acting, hits: self.hits })
    }
}
