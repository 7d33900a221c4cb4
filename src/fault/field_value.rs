//! A fault as users write it: with names, in the fields of a plant file.

use core::fmt;
use serde::de::{Error, MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Key that marks a fault that must hit.
pub(super) const REQUIRED: &str = "required";

/// The kind and the fields of a fault, as in a `[[fault]]` of a plant file or in the arguments of `commram fault add`.
/// The fields have the names that the user has written. `docs/reference/faults.md` describes the fields of each kind.
#[derive(Clone, Debug, Default)]
pub struct FaultSpec {
    /// Name of the kind.
    pub kind: String,
    /// Names and values of the fields.
    pub fields: Vec<(String, FieldValue)>,
    /// True if a scenario fails when the fault has never hit. Only scenarios read this value.
    pub required: bool,
}

/// Value of a field.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FieldValue {
    /// The value is a number.
    Number(u64),
    /// The value is a text.
    Text(String),
}

/// Equal descriptions have the same fields, in any order.
impl PartialEq for FaultSpec {
    fn eq(&self, other: &Self) -> bool {
        self.kind == other.kind
            && self.required == other.required
            && self.fields.len() == other.fields.len()
            && self.fields.iter().all(|field| other.fields.contains(field))
    }
}

impl Eq for FaultSpec {}

impl fmt::Display for FieldValue {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            FieldValue::Number(number) => write!(f, "{number}"),
            FieldValue::Text(text) => write!(f, "\"{text}\""),
        }
    }
}

impl Serialize for FaultSpec {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(1 + self.fields.len() + usize::from(self.required)))?;
        map.serialize_entry("kind", &self.kind)?;
        for (name, given) in &self.fields {
            match given {
                FieldValue::Number(number) => map.serialize_entry(name, number)?,
                FieldValue::Text(text) => map.serialize_entry(name, text)?,
            }
        }
        if self.required {
            map.serialize_entry(REQUIRED, &true)?;
        }
        map.end()
    }
}

impl<'de> Deserialize<'de> for FaultSpec {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Fields;

        impl<'de> Visitor<'de> for Fields {
            type Value = FaultSpec;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a fault: its kind and its fields")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<FaultSpec, A::Error> {
                let (mut kind, mut fields, mut required) = (None, Vec::new(), false);
                while let Some(name) = map.next_key::<String>()? {
                    if name == "kind" {
                        kind = Some(map.next_value()?);
                    } else if name == REQUIRED {
                        required = map.next_value()?;
                    } else {
                        fields.push((name, map.next_value()?));
                    }
                }
                let kind = kind.ok_or_else(|| A::Error::missing_field("kind"))?;
                Ok(FaultSpec { kind, fields, required })
            }
        }

        deserializer.deserialize_map(Fields)
    }
}

impl<'de> Deserialize<'de> for FieldValue {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Value;

        impl Visitor<'_> for Value {
            type Value = FieldValue;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a text, or a whole number that is not negative")
            }

            fn visit_u64<E: Error>(self, number: u64) -> Result<FieldValue, E> {
                Ok(FieldValue::Number(number))
            }

            fn visit_i64<E: Error>(self, number: i64) -> Result<FieldValue, E> {
                let unsigned = u64::try_from(number).map(FieldValue::Number);
                unsigned.map_err(|_| E::invalid_value(serde::de::Unexpected::Signed(number), &self))
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<FieldValue, E> {
                Ok(FieldValue::Text(text.to_owned()))
            }
        }

        deserializer.deserialize_any(Value)
    }
}
