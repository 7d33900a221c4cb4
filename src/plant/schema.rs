//! The JSON schema of plant files, assembled from the schemas of devices and buses and the table of faults.

use crate::devices::{self, BUS_KINDS};
use crate::fault::{FaultKind, Field, Form};
use serde_json::{Map, Value, json};

/// Returns the schema, draft 7, for editors and validators. It accepts any keys in the sections of devices of
/// other crates.
///
/// # Panics
/// The schema texts of this crate are valid JSON, as a test checks.
#[must_use]
pub fn schema() -> Value {
    let mut definitions = Map::new();
    definitions.insert("name".to_owned(), name());
    let mut first = None;
    let devices: Vec<_> = devices::all()
        .iter()
        .filter(|device| device.emulation.read.is_some())
        .map(|device| {
            let section =
                device.emulation.schema.map_or_else(open, |schema| section(read(schema), &mut definitions));
            let has_slots = !device.emulation.option_interfaces.is_empty();
            let section = if has_slots { with_cards(section) } else { section };
            first.get_or_insert_with(|| section.clone());
            of_kind(section, device.layout.name, true)
        })
        .chain([of_folder()])
        .collect();
    let buses: Vec<_> = BUS_KINDS
        .iter()
        .enumerate()
        .map(|(index, bus)| of_kind(section((bus.schema)(), &mut definitions), bus.name, index > 0))
        .collect();
    let faults: Vec<_> =
        devices::fault_kinds().iter().map(|kind| fault(kind)).chain([declared_fault()]).collect();
    let sections =
        |about: &str, items: Value| json!({ "type": "array", "description": about, "items": items });
    json!({
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "Plant file of commram",
        "type": "object",
        "additionalProperties": false,
        "properties": {
            "processor_cycle_us": {
                "type": "integer", "minimum": 10, "maximum": 10_000, "default": 500,
                "description": "Interval at which the firmware polls registers without a doorbell, in emulated us (D-22)",
            },
            "plc": sections("PLCs", first.unwrap_or_else(open)),
            "device": sections("Devices", json!({ "anyOf": devices })),
            "bus": sections("Buses", json!({ "anyOf": buses })),
            "fault": sections("Faults from power-on or a time on", json!({ "anyOf": faults })),
        },
        "definitions": definitions,
    })
}

/// Returns names of devices, buses and drives.
fn name() -> Value {
    json!({
        "type": "string",
        "pattern": "^[A-Za-z0-9_-]{1,31}$",
        "description": "Its name, unique in the plant: 1 to 31 characters of A-Z a-z 0-9 _ -",
    })
}

/// Schema of a section with any keys.
fn open() -> Value {
    json!({ "type": "object", "required": ["name"], "properties": { "name": name() } })
}

/// Schema of a section that names the folder of a device.
fn of_folder() -> Value {
    let path = json!({
        "type": "string", "pattern": "/",
        "description": "Path of a folder with a device.toml, from the directory of the plant file",
    });
    let profibus =
        json!({ "type": "string", "description": "Name of the PROFIBUS segment at the port of the device" });
    let octets = |about: &str, least: u8| {
        let octet = json!({ "type": "integer", "minimum": 0, "maximum": 255 });
        json!({ "type": "array", "items": octet, "minItems": least, "maxItems": 244, "description": about })
    };
    let number = |about: &str, most: u8| json!({ "type": "integer", "minimum": 0, "maximum": most, "description": about });
    let slave = json!({
        "type": "object",
        "additionalProperties": false,
        "required": ["address", "parameters", "configuration"],
        "properties": {
            "address": number("Address of the slave", 125),
            "parameters": octets("Data of the telegram Set_Prm", 7),
            "configuration": octets("Data of the telegram Chk_Cfg", 1),
            "outputs": number("Number of output bytes", 244),
            "inputs": number("Number of input bytes", 244),
        },
    });
    let slaves = json!({ "type": "array", "description": "DP slaves of the device", "items": slave });
    json!({
        "type": "object",
        "additionalProperties": false,
        "required": ["name", "kind"],
        "properties": { "name": name(), "kind": path, "bus": bus(), "profibus": profibus, "slave": slaves },
    })
}

/// Adds the option cards to the schema of a device with slots.
fn with_cards(mut section: Value) -> Value {
    section["properties"]["option"] =
        json!({ "type": "array", "description": "Its option cards", "items": card() });
    section
}

/// Schema of the bus at the port of a device in a folder.
fn bus() -> Value {
    json!({ "type": "string", "description": "Name of the CAN bus at the port of the device" })
}

/// Schema of an option card.
fn card() -> Value {
    let number = |about: &str| json!({ "enum": [1, 2], "description": about });
    let path = json!({
        "type": "string",
        "description": "Path of a folder with a device.toml, from the directory of the plant file; or its name in the search path",
    });
    let mut named = name();
    named["description"] = "Its name, unique in the plant; left out: a name such as line-option1".into();
    json!({
        "type": "object",
        "description": "An option card of the PLC: a device in a folder",
        "additionalProperties": false,
        "required": ["slot", "card"],
        "properties": {
            "slot": number("Number of the slot"),
            "card": path,
            "name": named,
            "bus": bus(),
            "interface": {
                "enum": [1, 2, 3],
                "description": "Option interface with the registers of the card: 1 in slot 1; 2 (if left out) or 3 in slot 2",
            },
            "trigger": number("Trigger that is connected to the card, 1 if left out"),
        },
    })
}

/// Reads the schema of a device.
fn read(text: &str) -> Value {
    serde_json::from_str(text).expect("our own schemas are JSON")
}

/// Returns the schema of a section; its definitions are added to the common definitions.
fn section(mut schema: Value, definitions: &mut Map<String, Value>) -> Value {
    if let Some(Value::Object(own)) = schema.as_object_mut().and_then(|schema| schema.remove("definitions")) {
        definitions.extend(own);
    }
    schema
}

/// Adds the property `kind` to the schema of a section.
fn of_kind(mut section: Value, kind: &str, needed: bool) -> Value {
    section["properties"]["kind"] = json!({ "const": kind });
    if needed && let Some(required) = section["required"].as_array_mut() {
        required.push("kind".into());
    }
    section
}

/// Schema of a `[[fault]]` of this kind.
fn fault(kind: &'static FaultKind) -> Value {
    let mut properties = Map::new();
    for field in kind.usable_fields() {
        for name in [Some(field.name()), field.other_name()].into_iter().flatten() {
            properties.insert(name.to_owned(), value_of(field));
        }
    }
    properties.insert("kind".to_owned(), json!({ "const": kind.name() }));
    let about = "Of a scenario: it fails unless this fault strikes";
    properties.insert("required".to_owned(), json!({ "type": "boolean", "description": about }));
    json!({
        "type": "object",
        "description": kind.about(),
        "additionalProperties": false,
        "required": ["kind"],
        "properties": properties,
    })
}

/// Schema of a `[[fault]]` of a kind that a device in a folder declares.
fn declared_fault() -> Value {
    let names: Vec<_> = devices::fault_kinds().iter().map(|kind| kind.name()).collect();
    let number = json!({ "type": ["integer", "string"] });
    json!({
        "type": "object",
        "description": "A fault that a device in a folder declares",
        "additionalProperties": { "type": ["integer", "string", "boolean"] },
        "required": ["kind"],
        "properties": {
            "kind": { "type": "string", "pattern": "^[a-z][a-z0-9_]*$", "not": { "enum": names } },
            "plc": { "type": "string" }, "device": { "type": "string" },
            "at_us": number, "duration_us": number, "for_us": number,
        },
    })
}

/// Schema of the values of a fault's field; numbers and times may be texts as on the command line.
fn value_of(field: &Field) -> Value {
    let (least, most) = field.range();
    let about = format!("{}: {}", field.about(), field.range_text());
    match field.form() {
        Form::Name => json!({ "type": "string", "description": about }),
        Form::Port => json!({ "type": ["string", "integer"], "description": about }),
        Form::Word(words) => json!({ "enum": words, "description": about }),
        Form::Number { .. } | Form::Hex { .. } | Form::Time { .. } => json!({
            "type": ["integer", "string"], "minimum": least, "maximum": most, "description": about,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::PlantConfig;
    use std::collections::BTreeSet;

    /// Returns the schema itself, or the schema that it refers to.
    fn resolved<'a>(root: &'a Value, schema: &'a Value) -> &'a Value {
        let reference = schema.get("$ref").or_else(|| schema["allOf"][0].get("$ref"));
        match reference.and_then(Value::as_str) {
            Some(reference) => &root["definitions"][reference.trim_start_matches("#/definitions/")],
            None => schema,
        }
    }

    /// Returns the keys that the parser lists in its error for an unknown key, in a plant made by `plant`.
    fn keys_of_the_parser(plant: &dyn Fn(&str) -> String) -> BTreeSet<String> {
        let text = plant("{ no_such_key = 1 }");
        let refusal = PlantConfig::parse("plant", &text).unwrap_err().to_string();
        let (_, known) = refusal.split_once(" are: ").unwrap_or_else(|| panic!("{text}: {refusal}"));
        known.split(", ").map(str::to_owned).collect()
    }

    /// Compares the keys that the schema has for a table, and for tables in it, with the keys that the parser accepts.
    /// Returns the number of tables.
    fn compare(root: &Value, schema: &Value, plant: &dyn Fn(&str) -> String, added: &[&str]) -> usize {
        let properties = schema["properties"].as_object().unwrap();
        let keys = properties.keys().filter(|key| !added.contains(&key.as_str()));
        let known: BTreeSet<_> =
            keys_of_the_parser(plant).into_iter().filter(|key| !added.contains(&key.as_str())).collect();
        assert_eq!(keys.cloned().collect::<BTreeSet<_>>(), known, "{}", plant("..."));
        assert_eq!(schema["additionalProperties"], false);
        let mut tables = 1;
        for (key, property) in properties {
            let property = resolved(root, property);
            let items = property.get("items").map(|items| resolved(root, items));
            if property.get("properties").is_some() {
                tables += compare(root, property, &|inner| plant(&format!("{{ {key} = {inner} }}")), &[]);
            } else if let Some(items) = items.filter(|items| items.get("properties").is_some()) {
                tables += compare(root, items, &|inner| plant(&format!("{{ {key} = [{inner}] }}")), &[]);
            }
        }
        tables
    }

    /// A device in a folder, which has no fixed kind.
    const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tools/devices/digital-io");

    #[test]
    fn the_schema_has_the_keys_of_the_parser() {
        let root = schema();
        let mut tables = 0;
        for (array, with_kind) in [("plc", false), ("device", true), ("bus", true)] {
            let items = &root["properties"][array]["items"];
            let sections = items["anyOf"].as_array().cloned().unwrap_or_else(|| vec![items.clone()]);
            assert!(!sections.is_empty());
            for section in sections {
                let kind = section["properties"]["kind"]["const"].as_str().unwrap_or(FOLDER).to_owned();
                let plant = |inner: &str| match with_kind {
                    true => format!("{array} = [{{ kind = '{kind}', {}]\n", inner.trim_start_matches('{')),
                    false => format!("{array} = [{inner}]\n"),
                };
                tables += compare(&root, &section, &plant, &["kind"]);
            }
        }
        assert!(tables > 25, "{tables}");
        let top = keys_of_the_parser(&|_| "no_such_key = 1".to_owned());
        let keys: BTreeSet<_> = root["properties"].as_object().unwrap().keys().cloned().collect();
        assert_eq!(keys, top);
    }

    #[test]
    fn templates_are_plants_that_show_every_key_of_their_device() {
        let root = schema();
        for device in devices::all().iter().filter(|device| device.emulation.read.is_some()) {
            let template =
                device.emulation.template.unwrap_or_else(|| panic!("{} has no template", device.layout.name));
            let plant = PlantConfig::parse("template", template).unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(plant.devices[0].layout().name, device.layout.name);
            let sections = root["properties"]["device"]["items"]["anyOf"].as_array().unwrap();
            let kind = json!(device.layout.name);
            let section = sections.iter().find(|section| section["properties"]["kind"]["const"] == kind);
            for key in section.unwrap()["properties"].as_object().unwrap().keys().filter(|key| *key != "kind")
            {
                // The key is set, or is a separate table.
                let shows = |line: &str| {
                    line.trim_start_matches("# ").starts_with(&format!("{key} = "))
                        || line.contains(&format!(".{key}]"))
                };
                assert!(template.lines().any(shows), "{}: {key}", device.layout.name);
            }
        }
    }
}
