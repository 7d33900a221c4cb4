//! JSON form of replies: `{"value":5}`, `{"exchanged":{"ok":true,"found":5}}`, `"written"`.
//!
//! The names are those of the table in `replies.rs`. Where the program prints the same content with `--format json` or
//! `--format jsonl`, it uses the same structures. `docs/reference/operations.json` has an example of each reply.

pub(crate) mod buses;
pub(crate) mod drives;
pub(crate) mod faults;
pub(crate) mod findings;
mod instance;

use super::replies::replies;
use super::{BusScene, Refused, Reply, Waited};
use crate::devices;
use crate::door::DoorSpec;
use crate::journal::jsonl::Jsonl;
use crate::journal::{Change, HistoryId, Names, Record};
use crate::memory::header::BoardState;
use crate::plant::Forced;
use serde::ser::SerializeStructVariant;
use serde::{Serialize, Serializer};

/// The type of a field of a reply.
trait InJson {
    /// Returns the field as a value for serde, with these names of PLCs and buses.
    fn form(&self, names: &Names) -> impl Serialize;
}

/// Implements [`InJson`] for types that contain no indices of PLCs or buses.
macro_rules! as_they_are {
    ($($type:ty)+) => {$(
        impl InJson for $type {
            fn form(&self, _: &Names) -> impl Serialize {
                self
            }
        }
    )+};
}

as_they_are! { bool u16 u32 u64 Vec<u8> Waited HistoryId BoardState Vec<Forced> Vec<BusScene> DoorSpec Refused }

/// Records as in JSON Lines.
impl InJson for Vec<Record> {
    fn form(&self, names: &Names) -> impl Serialize {
        let mut lines = Jsonl::new(names.clone(), devices::catalogue());
        self.iter().map(|record| lines.line(record)).collect::<Vec<_>>()
    }
}

/// Changes as their records in JSON Lines.
impl InJson for Vec<Change> {
    fn form(&self, names: &Names) -> impl Serialize {
        let mut lines = Jsonl::new(names.clone(), devices::catalogue());
        let record =
            |&Change { seq, time_us, what }: &Change| Record { seq, ..Record::single(time_us, what.into()) };
        self.iter().map(|change| lines.line(&record(change))).collect::<Vec<_>>()
    }
}

struct ReplyJson<'a> {
    reply: &'a Reply,
    names: &'a Names,
}

/// Serializes a reply: without content, with one value, or with fields.
macro_rules! variant {
    ($to:ident, $names:expr, $number:literal, $name:ident) => {
        $to.serialize_unit_variant("Reply", $number, stringify!($name))
    };
    ($to:ident, $names:expr, $number:literal, $name:ident, ($one:ident)) => {
        $to.serialize_newtype_variant("Reply", $number, stringify!($name), &$one.form($names))
    };
    ($to:ident, $names:expr, $number:literal, $name:ident, { $($field:ident)+ }) => {{
        let count = [$(stringify!($field)),+].len();
        let mut fields = $to.serialize_struct_variant("Reply", $number, stringify!($name), count)?;
        $(fields.serialize_field(stringify!($field), &$field.form($names))?;)+
        fields.end()
    }};
}

/// Declares the serialization of all replies.
macro_rules! json {
    ($(
        $(#[$doc:meta])*
        $reply:ident = $number:literal, $name:ident
        $(($one:ident: $type:ty))?
        $({$(
            $(#[$field_doc:meta])*
            $field:ident: $field_type:ty
        ),+ $(,)?})?
    ),+ $(,)?) => {
        impl Serialize for ReplyJson<'_> {
            fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
                match self.reply {
                    $(Reply::$reply $(($one))? $({ $($field),+ })? => {
                        variant!(to, self.names, $number, $name $(, ($one))? $(, { $($field)+ })?)
                    })+
                    Reply::NotExecuted => to.serialize_unit_variant("Reply", 0, "not_executed"),
                }
            }
        }
    };
}

replies!(json);

impl Reply {
    /// Returns the reply for serde, with these names of PLCs and buses
    /// ([`InstanceInfo::names`](super::InstanceInfo::names)).
    ///
    /// ```
    /// use commram::{journal::Names, request::Reply};
    ///
    /// let reply = Reply::Exchanged { ok: true, found: 5 };
    /// let json = serde_json::to_string(&reply.json(&Names::default())).unwrap();
    /// assert_eq!(json, r#"{"exchanged":{"ok":true,"found":5}}"#);
    /// ```
    pub fn json<'a>(&'a self, names: &'a Names) -> impl Serialize + 'a {
        ReplyJson { reply: self, names }
    }
}
