//! Tests `commram lsp` as a process: its connection, its end, and a client by another author.

use crate::common::{commram, finish, python_for};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{ChildStdout, Command, Output, Stdio};

/// Sends the messages, closes the input, and returns the output of the server.
fn served(messages: &[Value]) -> (Vec<Value>, Output) {
    let texts = messages.iter().map(Value::to_string);
    served_text(
        &texts.map(|text| format!("Content-Length: {}\r\n\r\n{text}", text.len())).collect::<String>(),
    )
}

/// Sends a text, closes the input, and returns the output of the server.
fn served_text(text: &str) -> (Vec<Value>, Output) {
    let mut child = commram()
        .args(["lsp", "--stdio"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut input = child.stdin.take().unwrap();
    let output = BufReader::new(child.stdout.take().unwrap());
    let reader = std::thread::spawn(move || received(output));
    input.write_all(text.as_bytes()).unwrap();
    drop(input);
    let output = child.wait_with_output().unwrap();
    (reader.join().unwrap(), output)
}

fn received(mut output: BufReader<ChildStdout>) -> Vec<Value> {
    let mut found = Vec::new();
    let mut line = String::new();
    while output.read_line(&mut line).unwrap() > 0 {
        let length = line.trim().strip_prefix("Content-Length: ").and_then(|number| number.parse().ok());
        if let Some(length) = length {
            let mut text = vec![0_u8; length];
            line.clear();
            output.read_line(&mut line).unwrap();
            output.read_exact(&mut text).unwrap();
            found.push(serde_json::from_slice(&text).unwrap());
        }
        line.clear();
    }
    found
}

fn request(id: u32, method: &str, params: Value) -> Value {
    json!({ "jsonrpc": "2.0", "id": id, "method": method, "params": params })
}

fn note(method: &str, params: Value) -> Value {
    json!({ "jsonrpc": "2.0", "method": method, "params": params })
}

fn initialize() -> Value {
    request(1, "initialize", json!({ "capabilities": {} }))
}

#[test]
fn a_session_has_answers_and_a_good_end() {
    let text = "poke(\"node2.w_CPU_CONTRL\", 1);\n";
    let document =
        json!({ "uri": "file:///nonexistent/a.rhai", "languageId": "rhai", "version": 1, "text": text });
    let (found, output) = served(&[
        initialize(),
        note("initialized", json!({})),
        note("textDocument/didOpen", json!({ "textDocument": document })),
        request(2, "textDocument/none", json!({})),
        request(3, "shutdown", Value::Null),
        note("exit", Value::Null),
    ]);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(found[0]["result"]["serverInfo"]["name"], "commram");
    let of = |id: u32| found.iter().find(|message| message["id"] == id).unwrap();
    assert_eq!(of(2)["error"]["code"], -32601);
    assert!(of(3)["result"].is_null());
}

#[test]
fn the_exit_code_tells_how_the_editor_left() {
    let (_, output) = served(&[initialize(), note("exit", Value::Null)]);
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("`exit` without `shutdown`"));
    // An editor that dies closes the input.
    assert_eq!(served(&[initialize()]).1.status.code(), Some(0));
}

#[test]
fn a_wrong_message_is_answered_and_a_wrong_header_ends_the_server() {
    let (found, output) = served(&[json!("no message"), initialize()]);
    assert_eq!(output.status.code(), Some(0));
    assert_eq!((&found[0]["error"]["code"], &found[0]["id"]), (&json!(-32600), &Value::Null));
    assert_eq!(found[1]["result"]["serverInfo"]["name"], "commram");
    let (found, output) = served_text("Content-Length: 1\r\n\r\n{");
    assert_eq!((output.status.code(), &found[0]["error"]["code"]), (Some(0), &json!(-32700)));
    let (_, output) = served_text("Content-Length: 9000000000000000000\r\n\r\n{}");
    assert_eq!(output.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&output.stderr).contains("right is 0 to 8388608"));
}

#[test]
fn pytest_lsp_uses_the_server() {
    let Some(mut python) = python_for("pytest-lsp", &["pytest_lsp"]) else { return };
    let directory = tempfile::tempdir().unwrap();
    let tests = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/editors/test_lsp.py");
    let command: &mut Command = python
        .args([
            "-m",
            "pytest",
            "-q",
            "-p",
            "no:cacheprovider",
            "-o",
            "asyncio_default_fixture_loop_scope=function",
            tests,
        ])
        .env("COMMRAM", commram().get_program())
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .current_dir(directory.path());
    let outcome = finish(command);
    assert!(outcome.ok().contains("4 passed"), "{}", outcome.ok());
}
