//! Time in which `commram lsp` answers in a scenario of 2,000 lines: the mistakes after a typed character, a completion of
//! registers, and a description.
//!
//! Target: 50 ms each, from the request to the whole answer.

use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

const LINES: usize = 2000;
/// Number of measurements of each kind; the benchmark prints the median.
const ROUNDS: usize = 21;
const TARGET: Duration = Duration::from_millis(50);

struct Server {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
}

impl Server {
    fn start() -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_commram"));
        let mut child = command
            .arg("lsp")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the program of this build starts");
        let input = child.stdin.take().expect("a pipe");
        let output = BufReader::new(child.stdout.take().expect("a pipe"));
        Self { child, input, output }
    }

    fn send(&mut self, message: &Value) {
        let text = message.to_string();
        write!(self.input, "Content-Length: {}\r\n\r\n{text}", text.len()).expect("the server reads");
        self.input.flush().expect("the server reads");
    }

    fn note(&mut self, method: &str, params: Value) {
        self.send(&json!({ "jsonrpc": "2.0", "method": method, "params": params }));
    }

    fn ask(&mut self, method: &str, params: Value) -> Value {
        self.send(&json!({ "jsonrpc": "2.0", "id": 1, "method": method, "params": params }));
        loop {
            let message = self.receive();
            if message["id"] == 1 {
                return message["result"].clone();
            }
        }
    }

    /// Returns the next message.
    fn receive(&mut self) -> Value {
        let mut length = 0;
        loop {
            let mut line = String::new();
            self.output.read_line(&mut line).expect("the server answers");
            match line.trim().strip_prefix("Content-Length: ") {
                Some(number) => length = number.parse().expect("a number"),
                None if line == "\r\n" => break,
                None => {}
            }
        }
        let mut text = vec![0; length];
        self.output.read_exact(&mut text).expect("the whole message");
        serde_json::from_slice(&text).expect("a message in JSON")
    }

    /// Returns the number of mistakes in the next list of mistakes.
    fn mistakes(&mut self) -> usize {
        loop {
            let message = self.receive();
            if message["method"] == "textDocument/publishDiagnostics" {
                return message["params"]["diagnostics"].as_array().expect("a list").len();
            }
        }
    }
}

fn main() {
    let mut server = Server::start();
    server.ask("initialize", json!({ "capabilities": {} }));
    server.note("initialized", json!({}));
    let line = |n: usize| format!("peek(\"node2.w_{}\");\n", ["CPU_CONTROL", "OPTION_STATUS"][n % 2]);
    let text: String = (0..LINES).map(line).collect();
    let uri = "file:///nonexistent/long.rhai";
    let document = json!({ "uri": uri, "languageId": "rhai", "version": 1, "text": text });
    server.note("textDocument/didOpen", json!({ "textDocument": document }));
    assert_eq!(server.mistakes(), 0);

    let place = json!({ "textDocument": { "uri": uri }, "position": { "line": 1000, "character": 14 } });
    measure("completion of a register", || {
        let found = server.ask("textDocument/completion", place.clone());
        assert!(found["items"].as_array().is_some_and(|items| items.len() > 100));
    });
    measure("description of a register", || {
        assert!(server.ask("textDocument/hover", place.clone())["contents"]["value"].is_string());
    });
    let mut version = 1;
    let mut typed = |server: &mut Server| {
        version += 1;
        // Types a character that makes a name wrong, and deletes it.
        let text = if version % 2 == 0 { "X" } else { "" };
        let end = if version % 2 == 0 { 14 } else { 15 };
        let range =
            json!({ "start": { "line": 1000, "character": 14 }, "end": { "line": 1000, "character": end } });
        let document = json!({ "uri": uri, "version": version });
        let changes = json!([{ "range": range, "text": text }]);
        server.note("textDocument/didChange", json!({ "textDocument": document, "contentChanges": changes }));
        assert_eq!(server.mistakes(), 1 - version % 2);
    };
    measure("mistakes after a typed character", || typed(&mut server));
    server.ask("shutdown", Value::Null);
    server.note("exit", Value::Null);
    server.child.wait().expect("the server ends");
}

fn measure(what: &str, mut act: impl FnMut()) {
    let mut times: Vec<_> = (0..ROUNDS)
        .map(|_| {
            let start = Instant::now();
            act();
            start.elapsed()
        })
        .collect();
    times.sort_unstable();
    let (median, longest) = (times[ROUNDS / 2], times[ROUNDS - 1]);
    let verdict = if median <= TARGET { "met" } else { "MISSED" };
    println!("{what:<36} {median:>10.1?}, at most {longest:>10.1?}: {verdict}");
}
