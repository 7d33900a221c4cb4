//! Errors on the wire: a code and four numbers.

use super::{width_code, width_from_code};
use crate::channel::error::{ChannelError, Field};
use crate::fault::{self, Refusal};
use crate::memory::Address;

/// The fields of an error, in the order of its definition.
pub(super) type Numbers = [u64; 4];

/// Code and fields of an error.
pub(super) fn encode(error: &ChannelError) -> (u16, Numbers) {
    use ChannelError as E;
    match *error {
        E::Unmapped { address } => (1, [pack(address), 0, 0, 0]),
        E::RangeUnmapped { offset, len, hole } => (2, [offset.into(), len.into(), hole.into(), 0]),
        E::Misaligned { address } => (3, [pack(address), 0, 0, 0]),
        E::RangeTooLong { offset, len } => (4, [offset.into(), len.into(), 0, 0]),
        E::ReplyTooLong => (5, [0; 4]),
        E::ValueTooWide { address, value } => (6, [pack(address), value.into(), 0, 0]),
        E::NeverMatches { address, mask, value } => (7, [pack(address), mask.into(), value.into(), 0]),
        E::UnknownPlc { plc, count } => (8, [plc.into(), count.into(), 0, 0]),
        E::ClockIsRealTime => (9, [0; 4]),
        E::WaitTimedOut { address, last, time_us } => (10, [pack(address), last.into(), time_us, 0]),
        E::NoSync { plc, node } => (11, [plc.into(), node.into(), 0, 0]),
        E::TooManyOperations { count } => (12, [count.into(), 0, 0, 0]),
        E::Malformed { index, field, value } => (13, [index.into(), field_code(field), value.into(), 0]),
        E::AdvanceTooLong { us } => (14, [us, 0, 0, 0]),
        E::ShuttingDown => (15, [0; 4]),
        E::NotWhole { asked, right } => (30, [pack(asked), pack(right), 0, 0]),
        E::TooManyForces { count } => (31, [count.into(), 0, 0, 0]),
        E::NotForced { address } => (32, [pack(address), 0, 0, 0]),
        E::StartRefused { plc } => (33, [plc.into(), 0, 0, 0]),
        E::Fault(refusal) => encode_refusal(refusal),
    }
}

/// The way back; `None` for what [`encode`] cannot have made.
pub(super) fn decode(code: u16, numbers: Numbers) -> Option<ChannelError> {
    use ChannelError as E;
    let [a, b, c, _] = numbers;
    Some(match code {
        1 => E::Unmapped { address: unpack(a)? },
        2 => E::RangeUnmapped { offset: to(a)?, len: to(b)?, hole: to(c)? },
        3 => E::Misaligned { address: unpack(a)? },
        4 => E::RangeTooLong { offset: to(a)?, len: to(b)? },
        5 => E::ReplyTooLong,
        6 => E::ValueTooWide { address: unpack(a)?, value: to(b)? },
        7 => E::NeverMatches { address: unpack(a)?, mask: to(b)?, value: to(c)? },
        8 => E::UnknownPlc { plc: to(a)?, count: to(b)? },
        9 => E::ClockIsRealTime,
        10 => E::WaitTimedOut { address: unpack(a)?, last: to(b)?, time_us: c },
        11 => E::NoSync { plc: to(a)?, node: to(b)? },
        12 => E::TooManyOperations { count: to(a)? },
        13 => E::Malformed { index: to(a)?, field: field_from_code(b)?, value: to(c)? },
        14 => E::AdvanceTooLong { us: a },
        15 => E::ShuttingDown,
        30 => E::NotWhole { asked: unpack(a)?, right: unpack(b)? },
        31 => E::TooManyForces { count: to(a)? },
        32 => E::NotForced { address: unpack(a)? },
        33 => E::StartRefused { plc: to(a)? },
        _ => E::Fault(decode_refusal(code, numbers)?),
    })
}

fn encode_refusal(refusal: Refusal) -> (u16, Numbers) {
    use Refusal as R;
    match refusal {
        R::Range { field, value, least, most } => (20, [field as u64, value, least, most]),
        R::NeverMatches { id, mask } => (21, [id.into(), mask.into(), 0, 0]),
        R::NotCounted => (22, [0; 4]),
        R::UnknownBus { bus, count } => (23, [bus.into(), count.into(), 0, 0]),
        R::UnknownPlc { plc, count } => (24, [plc.into(), count.into(), 0, 0]),
        R::NoSlave { bus, slave, present } => (25, [bus.into(), slave.into(), present.into(), 0]),
        R::NoNode { plc, node } => (26, [plc.into(), node.into(), 0, 0]),
        R::TooMany => (27, [0; 4]),
        R::UnknownFault { id } => (28, [id.into(), 0, 0, 0]),
    }
}

fn decode_refusal(code: u16, [a, b, c, d]: Numbers) -> Option<Refusal> {
    use Refusal as R;
    Some(match code {
        20 => R::Range { field: fault::Field::from_code(to(a)?)?, value: b, least: c, most: d },
        21 => R::NeverMatches { id: to(a)?, mask: to(b)? },
        22 => R::NotCounted,
        23 => R::UnknownBus { bus: to(a)?, count: to(b)? },
        24 => R::UnknownPlc { plc: to(a)?, count: to(b)? },
        25 => R::NoSlave { bus: to(a)?, slave: to(b)?, present: to(c)? },
        26 => R::NoNode { plc: to(a)?, node: to(b)? },
        27 => R::TooMany,
        28 => R::UnknownFault { id: to(a)? },
        _ => return None,
    })
}

fn to<T: TryFrom<u64>>(number: u64) -> Option<T> {
    number.try_into().ok()
}

/// Width above, offset below.
fn pack(address: Address) -> u64 {
    u64::from(width_code(address.width())) << 32 | u64::from(address.offset())
}

fn unpack(number: u64) -> Option<Address> {
    let width = width_from_code(to(number >> 32)?)?;
    Some(width.at(number as u32))
}

fn field_code(field: Field) -> u64 {
    match field {
        Field::Kind => 1,
        Field::Width => 2,
        Field::Node => 3,
        Field::Unused => 4,
        Field::Fault => 5,
        Field::Board => 6,
    }
}

fn field_from_code(code: u64) -> Option<Field> {
    Some(match code {
        1 => Field::Kind,
        2 => Field::Width,
        3 => Field::Node,
        4 => Field::Unused,
        5 => Field::Fault,
        6 => Field::Board,
        _ => return None,
    })
}
