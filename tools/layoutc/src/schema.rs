//! The JSON schema of layout files.

/// One schema for all files of a layout, draft 7, for editors and validators. It describes their shape; only the
/// compiler checks references.
pub const SCHEMA: &str = include_str!("layout.schema.json");

#[cfg(test)]
mod tests {
    use super::SCHEMA;
    use crate::{gsd, objects, parameters, raw};
    use serde::de::DeserializeOwned;
    use serde_json::Value;
    use std::collections::BTreeSet;

    /// Returns the keys that the parser's error message about an unknown key lists.
    fn keys<T: DeserializeOwned>() -> BTreeSet<String> {
        let error = toml::from_str::<T>("no_such_key = 1").err().unwrap();
        let (_, known) = error.message().split_once("`no_such_key`, expected ").unwrap();
        known.split('`').skip(1).step_by(2).map(str::to_owned).collect()
    }

    #[test]
    fn the_schema_has_the_keys_of_the_parser() {
        let schema: Value = serde_json::from_str(SCHEMA).unwrap();
        let tables = [
            ("area", keys::<raw::Area>()),
            ("baud_rate", keys::<raw::BaudRate>()),
            ("bit", keys::<raw::Bit>()),
            ("deadline", keys::<raw::Deadline>()),
            ("device", keys::<raw::Device>()),
            ("entry", keys::<raw::Entry>()),
            ("family", keys::<raw::Family>()),
            ("front", keys::<raw::Front>()),
            ("gsd", keys::<gsd::File>()),
            ("gsd_diagnosis", keys::<gsd::RawDiagnosis>()),
            ("gsd_key", keys::<gsd::RawKey>()),
            ("gsd_module", keys::<gsd::RawModule>()),
            ("gsd_parameter", keys::<gsd::RawParameter>()),
            ("gsd_parameters", keys::<gsd::RawParameters>()),
            ("handshake", keys::<raw::Handshake>()),
            ("meaning", keys::<raw::Meaning>()),
            ("object", keys::<objects::Row>()),
            ("objects", keys::<objects::File>()),
            ("parameter", keys::<parameters::Row>()),
            ("parameters", keys::<parameters::Table>()),
            ("parts", keys::<raw::Parts>()),
            ("phase", keys::<raw::Phase>()),
            ("phases", keys::<raw::Phases>()),
            ("placed", keys::<raw::AreaStructure>()),
            ("port", keys::<raw::Port>()),
            ("range", keys::<raw::Range>()),
            ("reserved", keys::<raw::Reserved>()),
            ("space", keys::<raw::Space>()),
            ("structure", keys::<raw::Structure>()),
            ("value", keys::<raw::Value>()),
        ];
        let definitions = schema["definitions"].as_object().unwrap();
        assert_eq!(definitions.len(), tables.len() + 1, "and `provenance`, which is a text");
        for (name, expected) in tables {
            let properties = definitions[name]["properties"].as_object().unwrap();
            assert_eq!(properties.keys().cloned().collect::<BTreeSet<_>>(), expected, "{name}");
        }
    }
}
