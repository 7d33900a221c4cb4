//! The fields of a record in JSON Lines that depend on its kind, in order.

use serde::{Serialize, Serializer};
use serde_json::Value;

/// Octets as pairs of hexadecimal digits, each with the prefix `before`.
pub(crate) fn hex(octets: &[u8], before: &str) -> String {
    octets.iter().map(|octet| format!("{before}{octet:02X}")).collect()
}

/// Names and values of the fields of an event.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fields(Vec<(&'static str, Value)>);

impl Fields {
    /// Creates an empty list.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a field with its value.
    #[must_use]
    pub fn with(mut self, name: &'static str, value: impl Into<Value>) -> Self {
        self.0.push((name, value.into()));
        self
    }

    /// Adds a field if there is a value.
    #[must_use]
    pub fn with_any(self, name: &'static str, value: Option<impl Into<Value>>) -> Self {
        match value {
            Some(value) => self.with(name, value),
            None => self,
        }
    }
}

impl Serialize for Fields {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(self.0.iter().map(|(name, value)| (name, value)))
    }
}
