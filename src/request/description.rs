//! Description of all operations and replies for programs: names, classes, fields, types and ranges, from the tables.

mod schema;

use super::op::Class;
use super::ops::ops;
use super::replies::replies;
use super::*;
use crate::can::Frame;
use crate::devices::DriveDetails;
use crate::door::DoorSpec;
use crate::fault::{Fault, FaultStatus};
use crate::identity::{BusIndex, DeviceIndex, PortNumber};
use crate::journal::{Change, Entry, HistoryId, Keep, Record};
use crate::layout::Test;
use crate::memory::Width;
use crate::memory::header::{BoardSetting, BoardState};
use crate::plant::Forced;
use core::num::NonZeroU16;
use schema::Described;
use serde::Serialize;
use serde_json::Value;

#[derive(Serialize)]
struct Description {
    operations: Vec<Operation>,
    replies: Vec<Answer>,
}

/// An operation of the table.
#[derive(Serialize)]
pub(crate) struct Operation {
    pub name: &'static str,
    /// Number in the wire format.
    number: u16,
    pub class: Class,
    pub text: String,
    pub fields: Vec<Field>,
    /// Name of the reply.
    pub reply: String,
}

/// A reply of the table.
#[derive(Serialize)]
pub(crate) struct Answer {
    pub name: &'static str,
    /// Number in the wire format.
    number: u16,
    pub text: String,
    /// The schema of the value, if the reply is a single value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<Value>,
    /// The fields of the reply, if it is not a single value.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub fields: Vec<Field>,
}

/// A field of an operation or a reply.
#[derive(Serialize)]
pub(crate) struct Field {
    pub name: &'static str,
    pub text: String,
    /// JSON schema of the field.
    pub schema: Value,
}

/// Returns the lines of a documentation as one text.
fn joined(lines: &[&str]) -> String {
    lines.iter().map(|line| line.trim()).collect::<Vec<_>>().join(" ")
}

/// Returns the name of the reply with this variant.
fn reply_name(variant: &str) -> String {
    let replies = replies().into_iter();
    replies.filter(|(known, _)| *known == variant).map(|(_, reply)| reply.name.to_owned()).collect()
}

macro_rules! operations {
    ($(
        $(#[doc = $doc:literal])*
        $op:ident = $number:literal, $name:ident, $class:ident -> $reply:ident
        $({$(
            $(#[doc = $field_doc:literal])*
            $(#[serde($($form:tt)*)])?
            $field:ident: $type:ty $([..=$most:ident, $code:ident])? => $($column:ident)+
        ),+ $(,)?})?
    ),+ $(,)?) => {
        /// Returns all operations, in the order of the table.
        pub(crate) fn operations() -> Vec<Operation> {
            vec![$(Operation {
                name: stringify!($name),
                number: $number,
                class: Class::$class,
                text: joined(&[$($doc),*]),
                fields: vec![$($(Field {
                    name: stringify!($field),
                    text: joined(&[$($field_doc),*]),
                    schema: schema::limited(<$type>::schema(), [$($most.into())?]),
                }),+)?],
                reply: reply_name(stringify!($reply)),
            }),+]
        }
    };
}

ops!(operations);

macro_rules! answers {
    ($(
        $(#[doc = $doc:literal])*
        $reply:ident = $number:literal, $name:ident
        $(($one:ident: $type:ty))?
        $({$(
            $(#[doc = $field_doc:literal])*
            $field:ident: $field_type:ty
        ),+ $(,)?})?
    ),+ $(,)?) => {
        /// Returns the replies with their variants.
        fn replies() -> Vec<(&'static str, Answer)> {
            vec![$((stringify!($reply), Answer {
                name: stringify!($name),
                number: $number,
                text: joined(&[$($doc),*]),
                value: [$(<$type>::schema())?].into_iter().next(),
                fields: vec![$($(Field {
                    name: stringify!($field),
                    text: joined(&[$($field_doc),*]),
                    schema: <$field_type>::schema(),
                }),+)?],
            })),+]
        }
    };
}

replies!(answers);

/// Describes all operations and replies, for example for an OpenAPI document: their names and numbers, the class of an
/// operation, and a JSON Schema of each field. `docs/reference/operations.json` is made from it.
pub fn describe() -> impl Serialize {
    Description { operations: operations(), replies: answers() }
}

/// Returns all replies, in the order of the table.
pub(crate) fn answers() -> Vec<Answer> {
    replies().into_iter().map(|(_, reply)| reply).collect()
}
