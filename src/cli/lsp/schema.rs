//! Keys and values of TOML files from their JSON schemas: completion and descriptions.

use super::complete::Proposal;
use super::table::{Slot, TablePlace};
use core::ops::Range;
use lsp_types::CompletionItemKind;
use serde_json::Value;
use std::sync::LazyLock;

/// Deepest chain of references in a schema.
const DEEPEST: usize = 16;

static OF_PLANTS: LazyLock<Value> = LazyLock::new(crate::plant::schema);
static OF_LAYOUTS: LazyLock<Value> =
    LazyLock::new(|| serde_json::from_str(commram_layoutc::SCHEMA).unwrap_or_default());

/// A schema, and the part of it that describes a file.
pub(super) struct Schema {
    root: &'static Value,
    /// Names of the definitions that together describe the file; empty for the root of the schema.
    parts: Vec<&'static str>,
}

impl Schema {
    pub(super) fn of_plants() -> Self {
        Self { root: &OF_PLANTS, parts: Vec::new() }
    }

    /// Returns the schema for a file of a layout.
    pub(super) fn of_layout(name: &str, text: &str) -> Self {
        let parts = match name {
            "device.toml" => vec!["device"],
            "family.toml" => vec!["family"],
            // A file of a structure contains the registers themselves.
            _ if text
                .lines()
                .any(|line| line.starts_with("register") || line.starts_with("[[register]]")) =>
            {
                vec!["structure"]
            }
            _ if text.lines().any(|line| line.starts_with("[[")) => vec!["parts"],
            _ => vec!["structure", "parts"],
        };
        Self { root: &OF_LAYOUTS, parts }
    }

    /// Returns the keys or values that fit at a position.
    pub(super) fn proposals(&self, place: &TablePlace) -> Vec<Proposal> {
        match place.slot {
            Slot::Nothing => Vec::new(),
            Slot::Header => self.headers(),
            Slot::Key => {
                let mut found: Vec<_> = self
                    .tables(place)
                    .into_iter()
                    .flat_map(|table| table["properties"].as_object().into_iter().flatten())
                    .filter(|(key, _)| !place.given.contains(key))
                    .map(|(key, schema)| {
                        let mut proposal =
                            Proposal::new(key, self.form(schema), CompletionItemKind::PROPERTY);
                        proposal.about = self.about(schema);
                        proposal
                    })
                    .collect();
                found.sort_by(|one, other| one.label.cmp(&other.label));
                found.dedup_by(|next, before| next.label == before.label);
                found
            }
            Slot::Value => {
                let found = self.tables(place).into_iter().flat_map(|schema| self.values(schema));
                let mut found: Vec<_> = found.collect();
                found.dedup();
                let proposal = |text| Proposal::new(text, "", CompletionItemKind::ENUM_MEMBER);
                found.into_iter().map(proposal).collect()
            }
        }
    }

    /// Returns the description of the key at a position.
    pub(super) fn description(&self, place: &TablePlace, text: &str) -> Option<(String, Range<usize>)> {
        let key = text.get(place.word.clone())?;
        if place.slot != Slot::Key || key.is_empty() {
            return None;
        }
        let found = self.tables(place).into_iter().find_map(|table| table["properties"].get(key))?;
        let (form, about) = (self.form(found), self.about(found));
        Some((format!("`{key}`: {form}  \n{about}"), place.word.clone()))
    }

    /// Returns the schemas of the table or value at the position. There are several if the section has several possible
    /// kinds and does not name its kind.
    fn tables(&self, place: &TablePlace) -> Vec<&Value> {
        let mut found: Vec<&Value> = match self.parts.as_slice() {
            [] => vec![self.root],
            parts => parts.iter().map(|part| &self.root["definitions"][*part]).collect(),
        };
        for (depth, key) in place.path.iter().enumerate() {
            let next = found.iter().flat_map(|table| self.alternatives(table, DEEPEST));
            found = next.filter_map(|table| table["properties"].get(key)).collect();
            if depth == 0 {
                found = found.into_iter().flat_map(|section| self.alternatives(section, DEEPEST)).collect();
                found = of_kind(found, place.kind.as_deref());
            }
        }
        found.into_iter().flat_map(|table| self.alternatives(table, DEEPEST)).collect()
    }

    /// Resolves references, arrays and alternatives around a schema.
    fn alternatives<'a>(&'a self, schema: &'a Value, depth: usize) -> Vec<&'a Value> {
        let Some(depth) = depth.checked_sub(1) else { return Vec::new() };
        if let Some(name) = schema["$ref"].as_str() {
            let name = name.trim_start_matches("#/definitions/");
            return self.alternatives(&self.root["definitions"][name], depth);
        }
        for several in ["anyOf", "allOf", "oneOf"] {
            if let Some(parts) = schema[several].as_array() {
                return parts.iter().flat_map(|part| self.alternatives(part, depth)).collect();
            }
        }
        match schema.get("items") {
            Some(items) if items.is_object() => self.alternatives(items, depth),
            _ => vec![schema],
        }
    }

    /// Proposes all headers: of sections, and of tables in sections.
    fn headers(&self) -> Vec<Proposal> {
        let place =
            TablePlace { slot: Slot::Key, path: Vec::new(), word: 0..0, given: Vec::new(), kind: None };
        let mut found = Vec::new();
        for table in self.tables(&place) {
            for (key, schema) in table["properties"].as_object().into_iter().flatten() {
                self.headers_in(key, schema, 3, &mut found);
            }
        }
        found.sort_by(|one: &Proposal, other| one.label.cmp(&other.label));
        found.dedup_by(|next, before| next.label == before.label);
        found
    }

    fn headers_in(&self, path: &str, schema: &Value, depth: usize, found: &mut Vec<Proposal>) {
        let Some(depth) = depth.checked_sub(1) else { return };
        let tables: Vec<_> = self
            .alternatives(schema, DEEPEST)
            .into_iter()
            .filter(|it| it.get("properties").is_some())
            .collect();
        if tables.is_empty() {
            return;
        }
        let is_array = schema["type"] == "array";
        let label = if is_array { format!("[[{path}]]") } else { format!("[{path}]") };
        let mut proposal = Proposal::new(label, "", CompletionItemKind::STRUCT);
        proposal.about = self.about(schema);
        found.push(proposal);
        for table in tables {
            for (key, inner) in table["properties"].as_object().into_iter().flatten() {
                self.headers_in(&format!("{path}.{key}"), inner, depth, found);
            }
        }
    }

    /// Returns the values that a schema lists, in TOML syntax.
    fn values(&self, schema: &Value) -> Vec<String> {
        if let Some(listed) = schema["enum"].as_array() {
            return listed.iter().map(Value::to_string).collect();
        }
        match (schema.get("const"), schema.get("default")) {
            (Some(only), _) => vec![only.to_string()],
            (None, Some(usual)) => vec![usual.to_string()],
            (None, None) if schema["type"] == "boolean" => vec!["true".to_owned(), "false".to_owned()],
            _ => Vec::new(),
        }
    }

    /// Formats the type of a value: `integer, 0 to 31, default 0`.
    fn form(&self, schema: &Value) -> String {
        let found = self.alternatives(schema, DEEPEST);
        let Some(schema) = found.first() else { return String::new() };
        let kind = match &schema["type"] {
            Value::String(kind) => kind.clone(),
            Value::Array(kinds) => kinds.iter().filter_map(Value::as_str).collect::<Vec<_>>().join(" or "),
            _ => self.values(schema).join(", "),
        };
        let range = match (schema.get("minimum"), schema.get("maximum")) {
            (Some(least), Some(most)) => format!(", {least} to {most}"),
            (Some(least), None) => format!(", {least} or more"),
            _ => String::new(),
        };
        let usual = schema.get("default").map(|usual| format!(", default {usual}")).unwrap_or_default();
        format!("{kind}{range}{usual}")
    }

    /// Returns the description of a schema. If it has none, returns the description of the definition to which it
    /// refers.
    fn about(&self, schema: &Value) -> String {
        let own = schema["description"].as_str();
        let of_definition =
            || self.alternatives(schema, DEEPEST).first().and_then(|it| it["description"].as_str());
        own.or_else(of_definition).unwrap_or_default().to_owned()
    }
}

/// Returns the alternatives of a section with this kind, if any has it; a path of a folder has no fixed kind.
fn of_kind<'a>(sections: Vec<&'a Value>, kind: Option<&str>) -> Vec<&'a Value> {
    let Some(kind) = kind else { return sections };
    let has = |section: &&&Value| section["properties"]["kind"]["const"] == kind;
    let fits: Vec<_> = sections.iter().filter(has).copied().collect();
    if fits.is_empty() { sections } else { fits }
}
