//! The OpenAPI description, made from the tables of operations and replies.

use super::router::json_response;
use super::{events, operations, show};
use crate::request::{Answer, MAX_OPS, Operation, answers, operations as table};
use axum::response::Response;
use serde_json::{Map, Value, json};
use std::sync::LazyLock;

static DOCUMENT: LazyLock<Value> = LazyLock::new(document);

/// Returns the OpenAPI description as a response.
pub(super) async fn answer() -> Response {
    json_response(&*DOCUMENT)
}

fn document() -> Value {
    let mut paths = fixed_paths();
    for operation in table() {
        let method = operations::method(&operation).as_str().to_lowercase();
        let path = format!("/api/v1/instances/{{instance}}/{}", operation.name);
        paths.insert(path, json!({ method: path_item(&operation) }));
    }
    json!({
        "openapi": "3.1.0",
        "info": {
            "title": "commram",
            "version": env!("CARGO_PKG_VERSION"),
            "description": "Operations on running emulators. `commram web` serves them.",
            "license": {"name": "MIT OR Apache-2.0", "identifier": "MIT OR Apache-2.0"},
        },
        "servers": [{"url": "http://127.0.0.1:8080"}],
        "security": [{"token": []}],
        "paths": paths,
        "components": {
            "securitySchemes": {"token": {"type": "http", "scheme": "bearer"}},
            "schemas": schemas(),
        },
    })
}

/// Describes an operation of the table.
fn path_item(operation: &Operation) -> Value {
    let is_get = operations::method(operation) == "GET";
    let mut parameters = vec![instance()];
    if is_get {
        parameters.extend(operation.fields.iter().map(|field| {
            json!({"name": field.name, "in": "query", "required": true, "description": field.text, "schema": field.schema})
        }));
    }
    let mut item = json!({
        "operationId": operation.name,
        "summary": summary(&operation.text),
        "description": operation.text,
        "tags": [operation.class],
        "parameters": parameters,
        "responses": responses(json!({"$ref": format!("#/components/schemas/{}", reply_name(&operation.reply))})),
    });
    if !is_get {
        item["requestBody"] = json_body(fields_of(operation));
    }
    item
}

/// Returns the schema of an object with the fields of an operation.
fn fields_of(operation: &Operation) -> Value {
    let fields: Map<String, Value> = operation
        .fields
        .iter()
        .map(|field| (field.name.to_owned(), described(&field.schema, &field.text)))
        .collect();
    json!({
        "type": "object", "properties": fields, "required": required(operation), "additionalProperties": false,
    })
}

/// Returns the names of the fields that a request must have.
fn required(operation: &Operation) -> Vec<&'static str> {
    operation.fields.iter().filter(|field| !is_optional(&field.schema)).map(|it| it.name).collect()
}

/// Returns the schema of an operation in a list.
fn operation_in_list() -> Value {
    let table = table();
    let without_fields: Vec<_> =
        table.iter().filter(|it| required(it).is_empty()).map(|it| it.name).collect();
    let all: Map<String, Value> = table.iter().map(|it| (it.name.to_owned(), fields_of(it))).collect();
    json!({
        "description": "An operation: its name, if it needs no fields, or an object with its name and its fields.",
        "anyOf": [
            {"type": "string", "enum": without_fields},
            {"type": "object", "properties": all, "minProperties": 1, "maxProperties": 1, "additionalProperties": false},
        ],
    })
}

/// Returns the first sentence of a text.
fn summary(text: &str) -> &str {
    text.split_once(". ").map_or(text, |(first, _)| first).trim_end_matches('.')
}

fn described(schema: &Value, text: &str) -> Value {
    let mut schema = schema.clone();
    schema["description"] = text.into();
    schema
}

/// True if the field may be null, so that a request may omit it.
fn is_optional(schema: &Value) -> bool {
    schema["type"].as_array().is_some_and(|types| types.contains(&json!("null")))
}

fn instance() -> Value {
    json!({
        "name": "instance", "in": "path", "required": true, "description": "Name of the instance.",
        "schema": {"type": "string"},
    })
}

fn json_body(schema: Value) -> Value {
    json!({"required": true, "content": {"application/json": {"schema": schema}}})
}

fn responses(schema: Value) -> Value {
    responses_of("application/json", schema)
}

fn responses_of(media_type: &str, schema: Value) -> Value {
    json!({
        "200": {"description": "The operation is done.", "content": {media_type: {"schema": schema}}},
        "default": {
            "description": "The operation was refused.",
            "content": {"application/problem+json": {"schema": {"$ref": "#/components/schemas/Problem"}}},
        },
    })
}

/// Returns the paths that do not belong to operations of the table.
fn fixed_paths() -> Map<String, Value> {
    let of_instance = |rest: &str| format!("/api/v1/instances/{{instance}}/{rest}");
    let mut paths = Map::new();
    paths.insert(
        "/api/v1/instances".to_owned(),
        json!({"get": {
            "operationId": "instances", "summary": "Lists the instances", "tags": ["server"],
            "responses": responses(json!({"type": "object"})),
        }}),
    );
    paths.insert(of_instance("request"), json!({ "post": request() }));
    paths.insert(of_instance("scenario"), json!({ "post": scenario() }));
    paths.insert(of_instance("events"), json!({"get": {
        "operationId": "events", "summary": "Streams events", "tags": ["server"],
        "parameters": std::iter::once(instance()).chain(events::FIELDS.map(event_field)).collect::<Vec<_>>(),
        "responses": {"200": {"description": "Server-sent events.", "content": {"text/event-stream": {}}}},
    }}));
    for (name, fields, text) in show::described() {
        let id = format!("show_{}", name.replace(['-', '.'], "_"));
        let fields = fields.iter().map(|field| query_field(field));
        let media = if name.ends_with(".svg") { "image/svg+xml" } else { "application/json" };
        let item = json!({"get": {
            "operationId": id, "summary": summary(text), "description": text, "tags": ["show"],
            "parameters": std::iter::once(instance()).chain(fields).collect::<Vec<_>>(),
            "responses": responses_of(media, if media == "application/json" { json!({"type": "object"}) } else { json!({}) }),
        }});
        paths.insert(of_instance(&format!("show/{name}")), item);
    }
    paths
}

/// Returns a field of a query. It may be omitted or repeated.
fn query_field(name: &str) -> Value {
    json!({"name": name, "in": "query", "schema": {"type": "array", "items": {"type": "string"}}})
}

/// Returns a field of the query for events.
fn event_field((name, description): (&str, &str)) -> Value {
    let mut field = query_field(name);
    field["description"] = json!(description);
    field
}

fn request() -> Value {
    json!({
        "operationId": "request",
        "summary": "Executes several operations as one request, at one moment",
        "tags": ["server"],
        "parameters": [instance()],
        "requestBody": json_body(json!({
            "type": "object",
            "properties": {"operations": {
                "type": "array",
                "maxItems": MAX_OPS,
                "items": {"$ref": "#/components/schemas/Operation"},
            }},
            "required": ["operations"],
        })),
        "responses": responses(json!({
            "type": "object", "properties": {"replies": {"type": "array", "items": {}}}, "required": ["replies"],
        })),
    })
}

fn scenario() -> Value {
    let action = json!({
        "type": "object",
        "properties": {
            "time_us": {"type": "integer", "description": "Emulated time of its begin."},
            "end_us": {"type": "integer", "description": "Emulated time of its end, if it moved the clock."},
            "operation": {"$ref": "#/components/schemas/Operation"},
            "register": {"type": "string", "description": "Name of the operation's register."},
            "expect": {"type": "object", "description": "`register` and `value`, or `no_findings`."},
            "section": {"type": "string"},
        },
        "required": ["time_us"],
    });
    json!({
        "operationId": "scenario",
        "summary": "Turns recorded actions into a scenario for `commram test`",
        "tags": ["server"],
        "parameters": [instance()],
        "requestBody": json_body(json!({
            "type": "object",
            "properties": {
                "name": {"type": "string"},
                "plant": {"type": "string", "description": "Plant file that the scenario names."},
                "actions": {"type": "array", "items": action},
            },
            "required": ["actions"],
        })),
        "responses": responses(json!({
            "type": "object", "properties": {"scenario": {"type": "string"}}, "required": ["scenario"],
        })),
    })
}

/// Returns the name of the schema of a reply.
fn reply_name(reply: &str) -> String {
    let words = reply.split('_').map(|word| {
        let (first, rest) = word.split_at_checked(1).unwrap_or((word, ""));
        first.to_uppercase() + rest
    });
    words.collect::<String>() + "Reply"
}

fn schemas() -> Map<String, Value> {
    let mut schemas: Map<String, Value> = answers()
        .iter()
        .map(|answer| (reply_name(answer.name), described(&reply(answer), &answer.text)))
        .collect();
    schemas.insert("Operation".to_owned(), operation_in_list());
    schemas.insert("Problem".to_owned(), problem());
    schemas
}

/// Returns the JSON form of a reply: only its name, or an object with its name and its content.
fn reply(answer: &Answer) -> Value {
    let content = match &answer.value {
        Some(value) => value.clone(),
        None if answer.fields.is_empty() => return json!({"type": "string", "enum": [answer.name]}),
        None => {
            let fields: Map<String, Value> = answer
                .fields
                .iter()
                .map(|field| (field.name.to_owned(), described(&field.schema, &field.text)))
                .collect();
            let required: Vec<_> = answer.fields.iter().map(|field| field.name).collect();
            json!({"type": "object", "properties": fields, "required": required})
        }
    };
    json!({"type": "object", "properties": {answer.name: content}, "required": [answer.name]})
}

fn problem() -> Value {
    json!({
        "type": "object",
        "description": "A problem document (RFC 9457).",
        "properties": {
            "type": {"type": "string", "format": "uri"},
            "title": {"type": "string"},
            "status": {"type": "integer"},
            "detail": {"type": "string", "description": "The reason, with the thing that it concerns."},
            "exit_code": {"type": "integer", "description": "Exit code of a command for the same error."},
            "code": {"type": "integer", "description": "Code of the refusal, if the emulator has refused the operation."},
        },
        "required": ["type", "title", "status", "detail"],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_operation_of_the_table_is_described() {
        let paths = DOCUMENT["paths"].as_object().unwrap();
        let in_list = &DOCUMENT["components"]["schemas"]["Operation"]["anyOf"];
        for operation in table() {
            let item = &paths[&format!("/api/v1/instances/{{instance}}/{}", operation.name)];
            let by = operations::method(&operation).as_str().to_lowercase();
            let reply = item[&by]["responses"]["200"]["content"]["application/json"]["schema"]["$ref"]
                .as_str()
                .unwrap();
            let name = reply.rsplit('/').next().unwrap();
            assert!(DOCUMENT["components"]["schemas"][name].is_object(), "{reply}");
            assert!(in_list[1]["properties"][operation.name].is_object(), "{}", operation.name);
            let is_name = in_list[0]["enum"].as_array().unwrap().contains(&json!(operation.name));
            assert_eq!(is_name, operations::of_form(json!(operation.name)).is_ok(), "{}", operation.name);
        }
    }
}
