//! Operations of the table by HTTP. This module does not depend on any particular operation.

use super::hub::InstanceLinks;
use super::link::Connection;
use super::problem::Problem;
use super::router::repeated;
use super::uploads::Uploads;
use crate::channel::ClientError;
use crate::cli::error::CliError;
use crate::request::{Class, Code, MAX_OPS, Op, Operation, Refused, Reply, WrongReply, operations};
use axum::http::{Method, StatusCode};
use serde_json::{Map, Value, json};
use std::sync::{Arc, LazyLock};

static TABLE: LazyLock<Vec<Operation>> = LazyLock::new(operations);

/// Returns the operation of this name.
pub(super) fn find(name: &str) -> Option<&'static Operation> {
    TABLE.iter().find(|operation| operation.name == name)
}

/// Returns the HTTP method of an operation: GET if the operation changes nothing, otherwise POST.
pub(super) fn method(operation: &Operation) -> Method {
    if operation.class == Class::Looks { Method::GET } else { Method::POST }
}

/// Builds the operation from its fields.
///
/// # Errors
/// A field is missing, unknown or out of its range.
pub(super) fn with_fields(operation: &Operation, fields: Map<String, Value>) -> Result<Op, Problem> {
    if let Some(unknown) = fields.keys().find(|name| operation.fields.iter().all(|field| field.name != *name))
    {
        return Err(Problem::wrong_use(format!("{}: {}", operation.name, unknown_field(operation, unknown))));
    }
    for field in &operation.fields {
        if let Some(value) = fields.get(field.name) {
            check(&field.schema, value).map_err(|right| {
                Problem::wrong_use(format!("{}: field `{}` is {value}, {right}", operation.name, field.name))
                    .with("field", field.name)
            })?;
        }
    }
    let name = operation.name;
    let form =
        if operation.fields.is_empty() && fields.is_empty() { json!(name) } else { json!({ name: fields }) };
    serde_json::from_value(form).map_err(|reason| Problem::wrong_use(format!("{name}: {reason}")))
}

/// Builds an operation from its form in a list of operations: its name, or an object with its name and its fields.
///
/// # Errors
/// The form is not one of these, there is no such operation, or a field is missing, unknown or out of its range.
pub(super) fn of_form(form: Value) -> Result<Op, Problem> {
    let wrong = |form: &Value| {
        Problem::wrong_use(format!(
            "{form} is no operation: write its name, \"time\", or an object with its name and its fields, \
             {{\"advance\":{{\"us\":1000}}}}"
        ))
    };
    let (name, fields) = match form {
        Value::String(name) => (name, Value::Null),
        Value::Object(form) if form.len() == 1 => form.into_iter().next().unwrap_or_default(),
        other => return Err(wrong(&other)),
    };
    let Some(operation) = find(&name) else {
        return Err(Problem::wrong_use(format!("there is no operation `{name}`")));
    };
    match fields {
        Value::Null => with_fields(operation, Map::new()),
        Value::Object(fields) => with_fields(operation, fields),
        other => Err(wrong(&json!({ name: other }))),
    }
}

fn unknown_field(operation: &Operation, name: &str) -> String {
    let known: Vec<_> = operation.fields.iter().map(|field| format!("`{}`", field.name)).collect();
    match &known[..] {
        [] => format!("it has no fields, so no `{name}`"),
        known => format!("it has no field `{name}`, only {}", known.join(", ")),
    }
}

/// Checks a value against the type and range in its schema. Only checks cases in which the message of serde would not
/// name the field.
fn check(schema: &Value, value: &Value) -> Result<(), String> {
    if let Some(known) = schema["enum"].as_array() {
        return match known.contains(value) {
            true => Ok(()),
            false => Err(format!("not one of {}", schema["enum"])),
        };
    }
    let is_right = match schema["type"].as_str() {
        Some("integer") => is_within(schema, value),
        Some("boolean") => value.is_boolean(),
        Some("object") => value.is_object(),
        Some("array") => value.is_array(),
        Some("string") => value.is_string(),
        _ => true,
    };
    match (is_right, schema["type"].as_str()) {
        (true, _) => Ok(()),
        (false, Some("integer")) => {
            Err(format!("not an integer from {} to {}", schema["minimum"], schema["maximum"]))
        }
        (false, Some("boolean")) => Err("not true or false".to_owned()),
        (false, Some("string")) => Err("not a string; GET /api/v1/openapi.json describes it".to_owned()),
        (false, kind) => {
            Err(format!("not an {}; GET /api/v1/openapi.json describes it", kind.unwrap_or("object")))
        }
    }
}

/// True if an integer is in the range of its schema.
fn is_within(schema: &Value, value: &Value) -> bool {
    let number = |value: &Value| value.as_i64().map(i128::from).or(value.as_u64().map(i128::from));
    let (least, most) = (number(&schema["minimum"]), number(&schema["maximum"]));
    number(value)
        .is_some_and(|it| least.is_none_or(|least| it >= least) && most.is_none_or(|most| it <= most))
}

/// Parses the fields of a query string. The table decides whether a text becomes a number or a boolean.
///
/// # Errors
/// A field occurs twice.
pub(super) fn fields_of_query(
    operation: &Operation,
    query: Vec<(String, String)>,
) -> Result<Map<String, Value>, Problem> {
    if let Some(name) = repeated(query.iter().map(|(name, _)| name.as_str())) {
        let detail = format!("{}: the field `{name}` occurs twice", operation.name);
        return Err(Problem::wrong_use(detail).with("field", name));
    }
    let typed = |name: &str, text: String| {
        let field = operation.fields.iter().find(|field| field.name == name);
        let is_text =
            field.is_some_and(|field| field.schema["enum"].is_array() || field.schema["type"] == "string");
        match serde_json::from_str(&text) {
            Ok(value) if !is_text => value,
            _ => Value::from(text),
        }
    };
    Ok(query.into_iter().map(|(name, text)| (name.clone(), typed(&name, text))).collect())
}

/// Refuses an operation that changes something on a read-only server.
///
/// # Errors
/// The operation changes something.
pub(super) fn check_reads_only(op: &Op) -> Result<(), Problem> {
    if op.class() == Class::Looks {
        return Ok(());
    }
    let detail = "this server was started with --read-only: it refuses operations that change something";
    Err(Problem::new(StatusCode::FORBIDDEN, "read-only", detail))
}

/// Executes an operation of a session and returns the JSON form of its reply.
///
/// # Errors
/// The emulator refused the operation, or cannot be reached.
pub(super) async fn execute(links: &InstanceLinks, session: String, op: Op) -> Result<Value, Problem> {
    let replies = execute_all(links, session, vec![op]).await?;
    replies.into_iter().next().ok_or_else(|| CliError::from(WrongReply).into())
}

/// Executes operations of a session as one request, and returns the JSON forms of their replies.
///
/// # Errors
/// The emulator refused an operation: the problem contains its `index`, and the `replies` to the operations before it.
/// Or the emulator cannot be reached.
pub(super) async fn execute_all(
    links: &InstanceLinks,
    session: String,
    ops: Vec<Op>,
) -> Result<Vec<Value>, Problem> {
    let link = if ops.iter().all(|op| op.class() == Class::Looks) { &links.looks } else { &links.acts };
    let uploads = Arc::clone(&links.uploads);
    link.run(move |connection| request(connection, &ops, (&uploads, &session))).await
}

fn request(connection: &mut Connection, ops: &[Op], files: (&Uploads, &str)) -> Result<Vec<Value>, Problem> {
    if ops.len() > MAX_OPS {
        return Err(CliError::Client(ClientError::TooManyOperations { count: ops.len() }).into());
    }
    connection.session.expect_to_wait(ops.iter().map(Op::advances_us).sum());
    let replies = replies(connection, ops, files)?;
    let mut forms = Vec::with_capacity(replies.len());
    for (index, reply) in replies.iter().enumerate() {
        if let Reply::Error(refused) = reply {
            let problem = Problem::refused(refused);
            return Err(match ops.len() {
                1 => problem,
                _ => problem.with("index", index).with("replies", forms),
            });
        }
        let form = serde_json::to_value(reply.json(&connection.names));
        forms.push(form.map_err(|reason| Problem::wrong_use(reason.to_string()))?);
    }
    Ok(forms)
}

/// Executes operations and returns their replies. Parts of a snapshot file stay in this process until their session
/// restores the snapshot.
fn replies(
    connection: &Connection,
    ops: &[Op],
    (uploads, session): (&Uploads, &str),
) -> Result<Vec<Reply>, Problem> {
    let has_file = |op: &Op| matches!(op, Op::BringSaved { .. } | Op::Restore { .. });
    if !ops.iter().any(has_file) {
        return Ok(connection.session.replies(ops)?);
    }
    let mut all: Vec<Reply> = Vec::with_capacity(ops.len());
    for op in ops {
        let reply = match op {
            _ if all.iter().any(|reply| matches!(reply, Reply::Error(_))) => Reply::NotExecuted,
            Op::BringSaved { at, part } => match uploads.append(session, *at, part.bytes()) {
                Ok(()) => Reply::Written,
                Err(end) => {
                    let text = format!("byte {at} of a snapshot does not come next, byte {end} does");
                    Reply::Error(Refused::new(Code::SNAPSHOT, text))
                }
            },
            op => {
                let file = if has_file(op) { uploads.take(session) } else { Vec::new() };
                let parts: Vec<_> = Op::bring(&file).collect();
                let written = connection.session.request_in_parts(&parts)?;
                written.into_iter().try_for_each(|reply| reply.written()).map_err(CliError::from)?;
                connection
                    .session
                    .replies(core::slice::from_ref(op))?
                    .pop()
                    .ok_or(CliError::from(WrongReply))?
            }
        };
        all.push(reply);
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(name: &str, fields: Value) -> Result<Op, String> {
        let Value::Object(fields) = fields else { panic!("not an object") };
        with_fields(find(name).unwrap(), fields).map_err(|problem| problem.detail().to_owned())
    }

    #[test]
    fn an_operation_is_its_name_and_its_fields() {
        assert_eq!(parsed("advance", json!({"us": 5})), Ok(Op::Advance { us: 5 }));
        assert_eq!(parsed("forces", json!({})), Ok(Op::Forces));
        let missing = parsed("advance", json!({})).unwrap_err();
        assert!(missing.contains("missing field `us`"), "{missing}");
        let unknown = parsed("advance", json!({"us": 5, "ms": 1})).unwrap_err();
        assert_eq!(unknown, "advance: it has no field `ms`, only `us`");
        assert!(parsed("forces", json!({"us": 5})).is_err());
    }

    #[test]
    fn a_list_has_names_and_objects_with_names_and_fields() {
        let parsed = |form| of_form(form).map_err(|problem| problem.detail().to_owned());
        let is_optional = |schema: &Value| schema["type"][1] == "null";
        let need_none = |it: &&Operation| it.fields.iter().all(|field| is_optional(&field.schema));
        for operation in TABLE.iter().filter(need_none) {
            let op = parsed(json!(operation.name)).unwrap();
            assert_eq!(parsed(json!({ operation.name: {} })), Ok(op), "{}", operation.name);
            assert_eq!(parsed(json!({ operation.name: null })), Ok(op), "{}", operation.name);
        }
        assert_eq!(parsed(json!({"advance": {"us": 5}})), Ok(Op::Advance { us: 5 }));
        for (form, message) in [
            (json!({"time": {"us": 5}}), "time: it has no fields, so no `us`"),
            (json!("advance"), "missing field `us`"),
            (json!({"advance": {"us": -5}}), "advance: field `us` is -5, not an integer from 0"),
            (json!("none"), "there is no operation `none`"),
            (json!({"time": 5}), r#"{"time":5} is no operation: write its name, "time", or an object"#),
            (json!({}), "{} is no operation"),
            (json!({"time": {}, "info": {}}), "is no operation"),
            (json!(["time"]), r#"["time"] is no operation"#),
        ] {
            let refused = parsed(form).unwrap_err();
            assert!(refused.contains(message), "{refused}");
        }
    }

    #[test]
    fn a_wrong_value_is_named_with_its_field_and_range() {
        let text = parsed("advance", json!({"us": "5"})).unwrap_err();
        assert_eq!(text, "advance: field `us` is \"5\", not an integer from 0 to 86400000000");
        let wide = parsed("peek", json!({"plc": 0, "offset": 0, "width": "Qword"})).unwrap_err();
        assert!(wide.contains("`width`") && wide.contains("Dword"), "{wide}");
        let flag = parsed("wait_for", json!({"any": 1, "within_us": 5})).unwrap_err();
        assert!(flag.contains("`any`") && flag.contains("true or false"), "{flag}");
        assert!(parsed("set_parameter", json!({"drive": 0, "number": 1, "value": -5})).is_ok());
    }

    #[test]
    fn a_query_gets_its_types_from_the_table() {
        let peek = find("peek").unwrap();
        let query = [("plc", "0"), ("offset", "12"), ("width", "Word")];
        let query = query.map(|(name, text)| (name.to_owned(), text.to_owned())).to_vec();
        let fields = fields_of_query(peek, query.clone()).unwrap();
        assert!(with_fields(peek, fields).is_ok());
        assert!(fields_of_query(peek, [query.clone(), query].concat()).is_err());
    }

    #[test]
    fn only_operations_that_change_nothing_are_requested_by_get() {
        let by_get: Vec<_> = TABLE.iter().filter(|it| method(it) == Method::GET).map(|it| it.name).collect();
        assert!(by_get.contains(&"peek") && by_get.contains(&"info"), "{by_get:?}");
        for name in ["stop", "poke", "follow", "advance", "back", "save", "wait"] {
            assert!(!by_get.contains(&name), "{name}");
        }
    }
}
