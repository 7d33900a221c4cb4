//! Faults on the wire: in an operation, and with their status in a list.

use super::{WireOp, serde_types};
use crate::devices;
use crate::fault::{
    DECLARED_BITS, Draft, Fault, FaultKind, FaultStatus, Limit, MAX_BITS, MAX_FIELDS, Target, Values,
    is_declared,
};
use serde::{Deserialize, Serialize};
use zerocopy::{FromBytes, IntoBytes};

/// Number of bytes for the values of a fault.
const BYTES: usize = MAX_BITS as usize / 8;

/// Returns the values of a fault of the given kind, packed without gaps.
fn packed(kind: &FaultKind, values: Values) -> [u8; BYTES] {
    let (mut bits, mut place) = (0, 0);
    for (field, value) in kind.fields().iter().zip(values) {
        bits |= u128::from(value.unwrap_or(0)) << place;
        place += field.bits();
    }
    if let Some(declaration) = kind.declaration() {
        bits |= u128::from(declaration.id) << DECLARED_BITS;
    }
    let mut packed = [0; BYTES];
    packed.iter_mut().zip(bits.to_le_bytes()).for_each(|(to, from)| *to = from);
    packed
}

fn bits_of(packed: [u8; BYTES]) -> u128 {
    packed.iter().rev().fold(0, |bits, byte| bits << 8 | u128::from(*byte))
}

/// Returns the kind of a fault with this number and these packed values. A device folder can declare kinds of
/// faults. This process knows such a kind only if it has read the folder.
fn kind_of(number: u8, packed: [u8; BYTES]) -> Option<&'static FaultKind> {
    if !is_declared(number) {
        return devices::fault_kinds().iter().copied().find(|kind| kind.number() == number);
    }
    let id = (bits_of(packed) >> DECLARED_BITS) as u32;
    let is_it = |kind: &&FaultKind| {
        kind.number() == number && kind.declaration().is_some_and(|declaration| declaration.id == id)
    };
    devices::emulation::catalogue::declared_fault_kinds().into_iter().find(is_it)
}

/// Inverse of [`packed`].
fn unpacked(kind: &FaultKind, packed: [u8; BYTES]) -> [u64; MAX_FIELDS] {
    let mut bits = bits_of(packed);
    let mut values = [0; MAX_FIELDS];
    for (value, field) in values.iter_mut().zip(kind.fields()) {
        *value = (bits & ((1 << field.bits()) - 1)) as u64;
        bits >>= field.bits();
    }
    values
}

/// A fault in the columns of an operation. Its longest form fits into the columns after `kind`, because the kinds of
/// faults limit their fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct WireFault {
    kind: u8,
    index: u16,
    number: u8,
    /// Bit n is set if value n is given.
    given: u8,
    /// Values of the fault, packed. Each value has the number of bits of its field, and the first value is in the
    /// lowest bits. Values that are not given are 0.
    values: [u8; BYTES],
    at_us: u64,
    limit: Limit,
}

impl From<&Fault> for WireFault {
    fn from(fault: &Fault) -> Self {
        let (index, number) = fault.target().numbers();
        let values = fault.values();
        let given = (0..).zip(values).filter(|(_, value)| value.is_some());
        WireFault {
            kind: fault.kind().number(),
            index,
            number,
            given: given.fold(0, |given, (bit, _)| given | 1 << bit),
            values: packed(fault.kind(), values),
            at_us: fault.at_us(),
            limit: fault.limit(),
        }
    }
}

impl WireFault {
    /// Decodes the fault; `None` if no kind allows it.
    fn fault(&self) -> Option<Fault> {
        let kind = kind_of(self.kind, self.values)?;
        let mut draft = Draft::new(kind, Target::of_numbers(kind.place(), self.index, self.number));
        for (bit, (value, sent)) in draft.values.iter_mut().zip(unpacked(kind, self.values)).enumerate() {
            *value = (self.given >> bit & 1 != 0).then_some(sent);
        }
        draft.at_us = self.at_us;
        match self.limit {
            Limit::UntilCleared => {}
            Limit::Count(hits) => draft.count = Some(hits.into()),
            Limit::Duration(us) => draft.duration_us = Some(us.into()),
        }
        draft.check().ok().filter(|fault| WireFault::from(fault) == *self)
    }
}

/// All columns of an operation after the kind.
pub(super) type Columns = (u16, u16, u16, u32, u32, u32, u32, u64);

/// Encodes the fault in the bytes of the columns.
pub(super) fn encode(fault: &Fault) -> Columns {
    let mut op = WireOp::default();
    let bytes = serde_types::encode(&WireFault::from(fault));
    if let Some(room) = op.as_mut_bytes().get_mut(size_of::<u16>()..).and_then(|it| it.get_mut(..bytes.len()))
    {
        room.copy_from_slice(&bytes);
    }
    let WireOp { kind: _, plc, width, node, offset, value, second, reserved, time_us } = op;
    (plc, width, node, offset, value, second, reserved, time_us)
}

/// Decodes the fault. The caller checks that no bytes follow it.
///
/// # Errors
/// Returns the number of the kind if the kind is unknown, or if it does not allow these values.
pub(super) fn decode(columns: Columns) -> Result<Fault, u8> {
    let (plc, width, node, offset, value, second, reserved, time_us) = columns;
    let wire = WireOp { kind: 0, plc, width, node, offset, value, second, reserved, time_us };
    let bytes = wire.as_bytes().get(size_of::<u16>()..).unwrap_or_default();
    let number = u8::read_from_prefix(bytes).map_or(0, |(number, _)| number);
    serde_types::decode_first::<WireFault>(bytes).and_then(|fault| fault.fault()).ok_or(number)
}

/// A fault in a list.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct WireStatus {
    fault: WireFault,
    id: u16,
    acting: bool,
    hits: u32,
}

impl From<&FaultStatus> for WireStatus {
    fn from(status: &FaultStatus) -> Self {
        let FaultStatus { id, fault, acting, hits } = *status;
        WireStatus { fault: WireFault::from(&fault), id, acting, hits }
    }
}

impl WireStatus {
    /// Decodes the status; `None` if no server of this version can have sent it.
    pub(crate) fn status(&self) -> Option<FaultStatus> {
        let WireStatus { fault, id, acting, hits } = *self;
        Some(FaultStatus { id, fault: fault.fault()?, acting, hits })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::channel::wire::BadField;
    use crate::fault::MAX_AT_US;
    use crate::identity::BusIndex;
    use crate::request::Op;

    /// The longest fault of every kind fits into an operation: all values are given, and each value is the end of its
    /// range.
    #[test]
    fn the_longest_fault_of_every_kind_comes_back_from_an_operation() {
        for kind in devices::fault_kinds() {
            let mut draft = Draft::new(kind, Target::of_numbers(kind.place(), u16::MAX, 31));
            for (value, field) in draft.values.iter_mut().zip(kind.fields()) {
                *value = Some(field.range().1);
            }
            draft.at_us = MAX_AT_US;
            draft.duration_us = Some(crate::fault::MAX_DURATION_US.into());
            let fault = draft.check().unwrap();
            assert_eq!(decode(encode(&fault)), Ok(fault));
        }
    }

    /// Changes each single byte of an encoded fault. The result is another valid fault, or an error.
    #[test]
    fn hostile_bytes_are_refused_with_the_kind() {
        let kind = devices::fault_kinds()[0];
        let fault = Draft::new(kind, Target::Bus(BusIndex(0))).check().unwrap();
        let op = WireOp::from(&Op::FaultAdd { fault });
        for (at, byte) in (2..32).flat_map(|at| (0..=u8::MAX).map(move |byte| (at, byte))) {
            let mut wire = op;
            wire.as_mut_bytes()[at] = byte;
            let first = wire.as_bytes()[2].into();
            match Op::try_from(wire) {
                Ok(Op::FaultAdd { fault }) => {
                    let sent = serde_types::decode_first(&wire.as_bytes()[2..]).unwrap();
                    assert_eq!(WireFault::from(&fault), sent);
                }
                Ok(other) => panic!("{other:?}"),
                Err(BadField { field: "an unused field", .. }) => {}
                Err(error) => assert_eq!(error, BadField { field: "the fault", value: first }),
            }
        }
    }
}
