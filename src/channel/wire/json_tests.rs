//! Compares `docs/reference/operations.json`, the description of operations and replies as JSON, with a
//! sample of each operation and reply.

use super::format_tests::{ops, replies};
use crate::journal::Names;
use crate::request::describe;
use serde::Serialize;
use serde_json::{Value, json};

const UPDATE: &str = "COMMRAM_UPDATE_OPERATIONS";
const PAGE: &str = "docs/reference/operations.json";

#[derive(Serialize)]
struct Page<D> {
    #[serde(flatten)]
    description: D,
    /// Replies as they are sent.
    examples: Vec<Value>,
}

fn answers() -> Vec<Value> {
    let names =
        Names { plcs: vec!["saw".into(), "line".into()], buses: vec!["can1".into()], devices: Vec::new() };
    replies().iter().map(|(_, reply)| serde_json::to_value(reply.json(&names)).unwrap()).collect()
}

#[test]
fn the_file_of_operations_and_replies_is_up_to_date() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(PAGE);
    let page = Page { description: describe(), examples: answers() };
    let now = serde_json::to_string_pretty(&page).unwrap() + "\n";
    if std::env::var_os(UPDATE).is_some() {
        std::fs::write(&path, &now).unwrap();
    } else {
        assert!(std::fs::read_to_string(&path).unwrap_or_default() == now, "run this test with {UPDATE}=1");
    }
}

fn has_type(value: &Value, name: &str) -> bool {
    match name {
        "integer" => value.is_u64() || value.is_i64(),
        "string" => value.is_string(),
        "boolean" => value.is_boolean(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        "null" => value.is_null(),
        other => panic!("{other}"),
    }
}

fn wide(value: &Value) -> Option<i128> {
    value.as_i64().map(i128::from).or_else(|| value.as_u64().map(i128::from))
}

/// Checks the value against the parts of JSON Schema that the description uses.
fn check(schema: &Value, value: &Value, place: &str) {
    let names: Vec<&str> = match &schema["type"] {
        Value::Array(names) => names.iter().filter_map(Value::as_str).collect(),
        name => name.as_str().into_iter().collect(),
    };
    assert!(names.is_empty() || names.iter().any(|name| has_type(value, name)), "{place}: {value} {schema}");
    if let Some(known) = schema["enum"].as_array() {
        assert!(known.contains(value), "{place}: {value} {schema}");
    }
    if let Some(number) = wide(value) {
        assert!(wide(&schema["minimum"]).is_none_or(|least| number >= least), "{place}: {value} {schema}");
        assert!(wide(&schema["maximum"]).is_none_or(|most| number <= most), "{place}: {value} {schema}");
    }
    for (name, property) in schema["properties"].as_object().into_iter().flatten() {
        check(property, &value[name], &format!("{place}.{name}"));
    }
    if let (Some(items), Some(values)) = (schema.get("items"), value.as_array()) {
        values.iter().for_each(|value| check(items, value, place));
    }
}

/// Checks a name, or an object with one name, against the entries of a table.
fn check_entry(entries: &Value, sent: &Value) {
    let (name, content) = match sent {
        Value::Object(one) => one.iter().next().unwrap(),
        name => (&name.as_str().unwrap().to_owned(), &Value::Null),
    };
    let entries = entries.as_array().unwrap();
    let entry = entries.iter().find(|entry| entry["name"] == **name).unwrap_or_else(|| panic!("{name}"));
    if let Some(schema) = entry.get("value") {
        return check(schema, content, name);
    }
    let fields = entry["fields"].as_array().cloned().unwrap_or_default();
    assert_eq!(content.as_object().map_or(0, serde_json::Map::len), fields.len(), "{name}: {content}");
    for field in &fields {
        let field_name = field["name"].as_str().unwrap();
        check(&field["schema"], &content[field_name], &format!("{name}.{field_name}"));
    }
}

#[test]
fn samples_of_operations_and_replies_match_the_description() {
    let description = serde_json::to_value(describe()).unwrap();
    for (_, op) in ops() {
        check_entry(&description["operations"], &json!(op));
    }
    for reply in answers() {
        check_entry(&description["replies"], &reply);
    }
}

/// Each operation names its reply, and each reply has an example.
#[test]
fn the_description_is_complete() {
    let description = serde_json::to_value(describe()).unwrap();
    let names: Vec<_> = description["replies"].as_array().unwrap().iter().map(|it| &it["name"]).collect();
    let operations = description["operations"].as_array().unwrap();
    assert!(operations.iter().all(|operation| names.contains(&&operation["reply"])));
    let answers = answers();
    let has_example = |name: &str| answers.iter().any(|it| it == name || it.get(name).is_some());
    names.iter().for_each(|name| assert!(has_example(name.as_str().unwrap()), "{name}"));
}
