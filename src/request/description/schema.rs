//! JSON Schemas of the types in the tables of operations and replies.

use super::*;
use crate::identity::PortNumber;
use serde_json::json;

/// A type with a JSON form in operations or replies.
pub(super) trait Described {
    /// JSON Schema of the type.
    fn schema() -> Value;
}

/// Adds the maximum to a schema, if the table limits the field.
pub(super) fn limited<const N: usize>(mut schema: Value, most: [u64; N]) -> Value {
    if let Some(most) = most.first() {
        schema["maximum"] = json!(most);
    }
    schema
}

macro_rules! schemas {
    ($($type:ty => $schema:expr;)+) => {$(
        impl Described for $type {
            fn schema() -> Value {
                $schema
            }
        }
    )+};
}

fn integer(least: i64, most: u64) -> Value {
    json!({"type": "integer", "minimum": least, "maximum": most})
}

/// Returns the schema of an object with these properties, which are all required.
fn object(properties: &[(&str, Value)]) -> Value {
    let required: Vec<_> = properties.iter().map(|(name, _)| *name).collect();
    let properties: serde_json::Map<_, _> =
        properties.iter().map(|(name, schema)| ((*name).to_owned(), schema.clone())).collect();
    json!({"type": "object", "properties": properties, "required": required})
}

/// Schema of an object with content that depends on the plant.
fn described(text: &str) -> Value {
    json!({"type": "object", "description": text})
}

fn list(items: Value) -> Value {
    json!({"type": "array", "items": items})
}

schemas! {
    bool => json!({"type": "boolean"});
    u8 => integer(0, u8::MAX.into());
    u16 => integer(0, u16::MAX.into());
    DeviceIndex => u16::schema();
    PortNumber => u8::schema();
    BusIndex => u16::schema();
    u32 => integer(0, u32::MAX.into());
    u64 => integer(0, u64::MAX);
    i64 => integer(i64::MIN, i64::MAX as u64);
    Option<NonZeroU16> => json!({"type": ["integer", "null"], "minimum": 1, "maximum": u16::MAX});
    Width => json!({"enum": ["Byte", "Word", "Dword"]});
    Keep => json!({"enum": ["in_journal", "for_onlookers"]});
    Test => object(&[
        ("mask", u32::schema()),
        ("compare", json!({"enum": ["equal", "not_equal", "less", "less_or_equal", "greater", "greater_or_equal"]})),
        ("is_signed", bool::schema()),
        ("value", u32::schema()),
    ]);
    BoardSetting => object(&[("which", u32::schema()), ("value", u32::schema())]);
    DoorSpec => json!({"type": "string", "description": "A door, for example slcan-tcp:127.0.0.1:0"});
    Option<DoorSpec> => json!({"type": ["string", "null"], "description": "A door, for example slcan-tcp:127.0.0.1:0"});
    FilePart => json!({"type": "array", "items": integer(0, 255), "maxItems": FilePart::MAX});
    Option<Frame> => json!({
        "type": ["array", "null"],
        "description": "The identifier with the marks of SocketCAN, the length, the data with the first byte lowest",
        "prefixItems": [u32::schema(), integer(0, 8), u64::schema()],
    });
    Fault => object(&[
        ("kind", json!({"type": "string"})),
        ("index", u16::schema()),
        ("number", u8::schema()),
        ("values", described("Values of the fields of the kind, by their names")),
        ("at_us", u64::schema()),
        ("limit", json!({"description": "\"UntilCleared\", {\"Count\": hits} or {\"Duration\": us}"})),
    ]);
    Vec<u8> => list(u8::schema());
    Waited => object(&[("time_us", u64::schema()), ("value", u32::schema())]);
    HistoryId => object(&[("number", u16::schema()), ("begin", u64::schema())]);
    Vec<Record> => list(described("A record as in journal.md, JSON Lines"));
    Vec<Change> => list(described("A record of the kind `changed` as in journal.md, JSON Lines"));
    Vec<Forced> => list(object(&[
        ("plc", u16::schema()),
        ("offset", u32::schema()),
        ("width", Width::schema()),
        ("value", u32::schema()),
    ]));
    Vec<FaultStatus> => list(described("A fault as in `commram fault list --format json`"));
    BoardState => described("Numbers of the board as in the header page");
    Vec<Entry> => list(described("A finding as in `commram check --format json`"));
    Vec<BusState> => list(described("A bus as in `commram bus list --format json`, with its load and ports"));
    Vec<DriveEntry> => list(described("A drive as in `commram drive list --format json`"));
    Box<DriveDetails> => described("A drive as in `commram drive show --format json`, without its name and bus");
    Vec<BusScene> => list(described("A bus with its interval and ports"));
    Box<InstanceInfo> => described("The instance, its clock, PLCs and buses");
    Refused => object(&[
        ("code", u16::schema()),
        ("text", json!({"type": "string"})),
        ("waited", json!({"type": ["object", "null"]})),
    ]);
}
