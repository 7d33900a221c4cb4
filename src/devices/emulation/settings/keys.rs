//! Declares the keys of a section of the plant file in one table.

use serde_json::{Map, Value, json};

/// Declares a section of the plant file. The macro makes the structure that serde reads, its JSON Schema
/// (`schema`), and its lines in `docs/reference/plant.md` (`lines`).
///
/// The table has the description of the section, the name of the structure, and the text of the error for a section
/// that is not a table. Each key has a description, a type, a schema without the description, an example, and a note
/// for the page. A key is optional if its type is an `Option`. Every section also has the key `name`.
macro_rules! plant_keys {
    (
        #[doc = $about:literal]
        $section:ident, $expecting:literal {
            $(
                #[doc = $text:literal]
                $key:ident: $type:ty = $schema:tt, $example:literal, $note:expr;
            )+
        }
    ) => {
        #[doc = $about]
        #[derive(serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        #[serde(expecting = $expecting)]
        struct $section {
            name: String,
            $(
                #[doc = $text]
                $key: $type,
            )+
        }

        impl $section {
            /// Returns the JSON Schema of the section.
            fn schema() -> serde_json::Value {
                $crate::devices::emulation::settings::keys::section(
                    $about,
                    [$((stringify!($key), stringify!($type), $text, serde_json::json!($schema))),+],
                )
            }

            /// Returns the lines of the keys in the page of plant files.
            #[cfg(test)]
            fn lines() -> String {
                [$($crate::devices::emulation::settings::keys::line(stringify!($key), $example, &$note)),+].concat()
            }
        }
    };
}

pub(crate) use plant_keys;

/// Returns the schema of a section with these keys. Each key has a name, a type in Rust, a description, and a
/// schema without the description.
pub(crate) fn section<const N: usize>(about: &str, keys: [(&str, &str, &str, Value); N]) -> Value {
    let mut properties = Map::new();
    properties.insert("name".to_owned(), json!({ "$ref": "#/definitions/name" }));
    let mut required = vec!["name"];
    for (key, ty, text, mut schema) in keys {
        schema["description"] = text.trim().into();
        properties.insert(key.to_owned(), schema);
        if !ty.starts_with("Option") {
            required.push(key);
        }
    }
    json!({
        "type": "object",
        "description": about.trim(),
        "additionalProperties": false,
        "required": required,
        "properties": properties,
    })
}

/// Returns the line of an example: a key with its value and a note.
#[cfg(test)]
pub(crate) fn line(key: &str, example: &str, note: &str) -> String {
    let text = format!("{key} = {example}");
    if text.len() > 30 { format!("{text}   # {note}\n") } else { format!("{text:<30} # {note}\n") }
}
