//! Fields of operations in the columns of a [`WireOp`](super::WireOp).

use super::{BadField, door, fault, width_code, width_from_code};
use crate::can::Frame;
use crate::door::DoorSpec;
use crate::fault::Fault;
use crate::identity::{BusIndex, DeviceIndex, PortNumber};
use crate::journal::Keep;
use crate::layout::{Compare, Test};
use crate::memory::Width;
use crate::memory::header::BoardSetting;
use crate::request::FilePart;
use core::num::NonZeroU16;

/// The type of a field, stored in one or several columns. `Columns` has the types of these columns, in the order of the
/// table.
pub(super) trait InColumns<Columns>: Sized {
    /// Encodes the field as the columns that store it.
    fn columns(self) -> Columns;

    /// Decodes the field. The function may ignore unused bits of a column, because the caller encodes the result again
    /// and compares it with the columns.
    ///
    /// # Errors
    /// The columns are not the encoding of a valid field.
    fn of_columns(columns: Columns) -> Result<Self, BadField>;
}

/// A number in a column of its own width, or in a wider one.
macro_rules! numbers {
    ($($type:ty => $column:ty: $encode:expr, $decode:expr;)+) => {$(
        impl InColumns<($column,)> for $type {
            fn columns(self) -> ($column,) {
                ($encode(self),)
            }

            fn of_columns((column,): ($column,)) -> Result<Self, BadField> {
                $decode(column)
            }
        }
    )+};
}

numbers! {
    u16 => u16: core::convert::identity, Ok;
    DeviceIndex => u16: |device: DeviceIndex| device.0, |column| Ok(DeviceIndex(column));
    BusIndex => u16: BusIndex::number, |column| Ok(BusIndex::of_number(column));
    u32 => u32: core::convert::identity, Ok;
    u64 => u64: core::convert::identity, Ok;
    i64 => u64: |value| value as u64, |column| Ok(column as i64);
    PortNumber => u16: |port: PortNumber| port.0.into(), |column| {
        u8::try_from(column).map(PortNumber).map_err(|_| BadField::new("the node", column))
    };
    bool => u16: u16::from, |column| Ok(column != 0);
    bool => u32: u32::from, |column| Ok(column != 0);
    Width => u16: width_code, |column| width_from_code(column).ok_or(BadField::new("the width", column));
    Keep => u16: keep_code, keep_from_code;
    Option<NonZeroU16> => u32: id_code, id_from_code;
}

fn keep_code(keep: Keep) -> u16 {
    match keep {
        Keep::InJournal => 0,
        Keep::ForOnlookers => 1,
    }
}

fn keep_from_code(column: u16) -> Result<Keep, BadField> {
    match column {
        0 => Ok(Keep::InJournal),
        1 => Ok(Keep::ForOnlookers),
        other => Err(BadField::new("the node", other)),
    }
}

fn id_code(id: Option<NonZeroU16>) -> u32 {
    id.map_or(0, |id| id.get().into())
}

fn id_from_code(column: u32) -> Result<Option<NonZeroU16>, BadField> {
    let id = u16::try_from(column).map_err(|_| BadField::new("the fault", column))?;
    Ok(NonZeroU16::new(id))
}

/// This flag is added to the number of a comparison of signed values.
const SIGNED: u16 = 256;

/// The columns contain the comparison, its mask, and its value.
impl InColumns<(u16, u32, u32)> for Test {
    fn columns(self) -> (u16, u32, u32) {
        let number = Compare::ALL.iter().position(|compare| *compare == self.compare).unwrap_or_default();
        let sign = if self.is_signed { SIGNED } else { 0 };
        (number as u16 + sign, self.mask, self.value)
    }

    fn of_columns((compare, mask, value): (u16, u32, u32)) -> Result<Self, BadField> {
        let is_signed = compare >= SIGNED;
        let known = Compare::ALL.get(usize::from(compare % SIGNED)).copied();
        let compare = known.ok_or(BadField::new("the comparison", compare))?;
        Ok(Test { mask, compare, is_signed, value })
    }
}

impl InColumns<(u32, u32)> for BoardSetting {
    fn columns(self) -> (u32, u32) {
        self.numbers()
    }

    fn of_columns((which, value): (u32, u32)) -> Result<Self, BadField> {
        BoardSetting::from_numbers(which, value).ok_or(BadField::new("the setting", which))
    }
}

impl InColumns<door::Columns> for Option<DoorSpec> {
    fn columns(self) -> door::Columns {
        door::encode(self)
    }

    fn of_columns(columns: door::Columns) -> Result<Self, BadField> {
        door::decode(columns)
    }
}

impl InColumns<door::Columns> for DoorSpec {
    fn columns(self) -> door::Columns {
        door::encode(Some(self))
    }

    fn of_columns(columns: door::Columns) -> Result<Self, BadField> {
        door::decode(columns)?.ok_or(BadField::new("the door", columns.0))
    }
}

/// The columns contain a number that is 0 if there is no frame, then the length, the identifier and the data
/// of the frame.
impl InColumns<(u16, u16, u32, u64)> for Option<Frame> {
    fn columns(self) -> (u16, u16, u32, u64) {
        let (id, length, data) = self.map_or((0, 0, 0), |frame| frame.numbers());
        (self.is_some().into(), length.into(), id, data)
    }

    fn of_columns((is_given, length, id, data): (u16, u16, u32, u64)) -> Result<Self, BadField> {
        let frame = u8::try_from(length).ok().and_then(|length| Frame::of_numbers(id, length, data));
        let frame = frame.ok_or(BadField::new("the length", length))?;
        Ok((is_given != 0).then_some(frame))
    }
}

/// The columns contain the number of bytes, and then 16 bytes.
impl InColumns<(u16, u32, u32, u64)> for FilePart {
    fn columns(self) -> (u16, u32, u32, u64) {
        let part = self.bytes();
        let mut bytes = [0; FilePart::MAX];
        bytes.iter_mut().zip(part).for_each(|(to, from)| *to = *from);
        let [value, second] = [0, 4].map(|at| bytes[at..at + 4].try_into().map_or(0, u32::from_ne_bytes));
        (part.len() as u16, value, second, bytes[8..].try_into().map_or(0, u64::from_ne_bytes))
    }

    fn of_columns((count, value, second, time_us): (u16, u32, u32, u64)) -> Result<Self, BadField> {
        let mut bytes = [0; FilePart::MAX];
        bytes[..4].copy_from_slice(&value.to_ne_bytes());
        bytes[4..8].copy_from_slice(&second.to_ne_bytes());
        bytes[8..].copy_from_slice(&time_us.to_ne_bytes());
        let part = bytes.get(..count.into()).and_then(FilePart::new);
        part.ok_or(BadField::new("the node", count))
    }
}

impl InColumns<fault::Columns> for Fault {
    fn columns(self) -> fault::Columns {
        fault::encode(&self)
    }

    fn of_columns(columns: fault::Columns) -> Result<Self, BadField> {
        fault::decode(columns).map_err(|kind| BadField::new("the fault", kind))
    }
}
