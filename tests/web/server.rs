//! A server, and requests to it.

use crate::common::{Emulator, commram, wait_for};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, ExitStatus, Stdio};
use std::time::Duration;

/// Longest wait for any byte.
const PATIENCE: Duration = Duration::from_secs(60);

/// A running `commram web`; it is killed when this value is dropped.
pub(crate) struct Server {
    pub child: Child,
    pub address: SocketAddr,
    pub token: String,
    /// The instance of the paths.
    pub instance: String,
    /// Directory for the token's file.
    runtime: tempfile::TempDir,
}

/// An answer of the web server.
#[derive(Debug)]
pub(crate) struct Answer {
    pub status: u16,
    pub headers: Vec<(String, String)>,
    pub body: String,
}

impl Answer {
    fn parse(text: &str) -> Self {
        let (head, body) = text.split_once("\r\n\r\n").unwrap_or((text, ""));
        let mut lines = head.lines();
        let status = lines.next().and_then(|line| line.split(' ').nth(1)).and_then(|code| code.parse().ok());
        let headers = lines.filter_map(|line| line.split_once(": "));
        let headers = headers.map(|(name, value)| (name.to_lowercase(), value.to_owned())).collect();
        Self { status: status.unwrap_or(0), headers, body: body.to_owned() }
    }

    /// Returns the value of a header; empty if there is none.
    pub(crate) fn header(&self, name: &str) -> &str {
        self.headers.iter().find(|(known, _)| known == name).map_or("", |(_, value)| value)
    }

    /// Returns the JSON of a successful answer.
    #[track_caller]
    pub(crate) fn ok(&self) -> Value {
        assert_eq!((self.status, self.header("content-type")), (200, "application/json"), "{}", self.body);
        serde_json::from_str(&self.body).unwrap()
    }

    /// Returns the problem document of an answer with this status.
    #[track_caller]
    pub(crate) fn problem(&self, status: u16) -> Value {
        assert_eq!(
            (self.status, self.header("content-type")),
            (status, "application/problem+json"),
            "{}",
            self.body
        );
        let problem: Value = serde_json::from_str(&self.body).unwrap();
        assert_eq!(problem["status"], status);
        assert!(problem["type"].as_str().unwrap().starts_with("urn:commram:problem:"), "{problem}");
        assert!(!problem["detail"].as_str().unwrap().is_empty() && problem["title"].is_string(), "{problem}");
        problem
    }
}

impl Server {
    /// Starts a server for an emulator.
    pub(crate) fn of(emulator: &Emulator, args: &[&str]) -> Self {
        Self::start(&emulator.name, &[&["-i", &emulator.name], args].concat())
    }

    pub(crate) fn start(instance: &str, args: &[&str]) -> Self {
        Self::start_by(commram(), instance, args)
    }

    /// Starts a server that may have at most `files` open files, by the hard (`-H`) or soft limit (`-S`), or both.
    pub(crate) fn with_files(emulator: &Emulator, limit: &str, files: u32) -> Self {
        let mut shell = std::process::Command::new("sh");
        let program = commram();
        shell
            .args(["-c", &format!("ulimit {limit} -n {files}; exec \"$0\" \"$@\"")])
            .arg(program.get_program());
        Self::start_by(shell, &emulator.name, &["-i", &emulator.name])
    }

    fn start_by(mut command: std::process::Command, instance: &str, args: &[&str]) -> Self {
        let runtime = tempfile::tempdir().unwrap();
        command.args(["web", "--listen", "127.0.0.1:0"]).args(args).env("XDG_RUNTIME_DIR", runtime.path());
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let Some((front, token)) = line.trim_end().split_once("/#token=") else {
            let mut reason = String::new();
            child.stderr.take().unwrap().read_to_string(&mut reason).unwrap();
            panic!("no address: {line}{reason}");
        };
        let address = front.rsplit_once("http://").unwrap().1.parse().unwrap();
        Self { child, address, token: token.to_owned(), instance: instance.to_owned(), runtime }
    }

    /// Returns the file with the token.
    pub(crate) fn token_file(&self) -> PathBuf {
        let entries = std::fs::read_dir(self.runtime_directory()).unwrap();
        entries.map(|entry| entry.unwrap().path()).next().unwrap()
    }

    pub(crate) fn runtime_directory(&self) -> PathBuf {
        self.runtime.path().join("commram")
    }

    pub(crate) fn runtime(&self) -> &Path {
        self.runtime.path()
    }

    /// Returns a path of the instance.
    pub(crate) fn path(&self, rest: &str) -> String {
        format!("/api/v1/instances/{}/{rest}", self.instance)
    }

    pub(crate) fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.address).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream
    }

    /// Sends bytes and returns what the server answers until it closes the connection.
    pub(crate) fn raw(&self, bytes: &[u8]) -> Answer {
        let mut stream = self.connect();
        // An error is ignored: the server may answer and close the connection before it has read all bytes.
        let _ = stream.write_all(bytes);
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        Answer::parse(&String::from_utf8_lossy(&answer))
    }

    /// Sends a request with these headers, in addition to those for host and length.
    pub(crate) fn request(&self, method: &str, path: &str, headers: &[(&str, &str)], body: &str) -> Answer {
        self.raw(request_text(self.address, method, path, headers, body).as_bytes())
    }

    /// Sends a GET with the token.
    pub(crate) fn get(&self, path: &str) -> Answer {
        self.request("GET", path, &[("authorization", &self.bearer())], "")
    }

    /// Sends a POST with the token.
    pub(crate) fn post(&self, path: &str, body: &Value) -> Answer {
        let headers = [("authorization", self.bearer()), ("content-type", "application/json".to_owned())];
        let headers = headers.each_ref().map(|(name, value)| (*name, value.as_str()));
        self.request("POST", path, &headers, &body.to_string())
    }

    pub(crate) fn bearer(&self) -> String {
        format!("Bearer {}", self.token)
    }

    /// Starts a stream of events.
    pub(crate) fn events(&self, query: &str) -> EventStream {
        self.events_at(self.connect(), query, &self.bearer())
    }

    /// Starts a stream of events with a key.
    pub(crate) fn events_of_key(&self, key: &str, query: &str) -> EventStream {
        self.events_at(self.connect(), query, &format!("Bearer {key}"))
    }

    /// Signs in, and returns the key.
    pub(crate) fn sign_in(&self) -> String {
        self.post("/api/v1/session", &json!({ "token": self.token })).ok()["key"].as_str().unwrap().to_owned()
    }

    /// Starts a stream of events for a reader with a small receive buffer.
    pub(crate) fn events_for_a_small_buffer(&self, query: &str) -> EventStream {
        use rustix::net::{AddressFamily, SocketType, sockopt};
        let socket = rustix::net::socket(AddressFamily::INET, SocketType::STREAM, None).unwrap();
        sockopt::set_socket_recv_buffer_size(&socket, 64 << 10).unwrap();
        rustix::net::connect(&socket, &self.address).unwrap();
        let stream = TcpStream::from(socket);
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        self.events_at(stream, query, &self.bearer())
    }

    fn events_at(&self, mut stream: TcpStream, query: &str, bearer: &str) -> EventStream {
        let path = self.path(&format!("events?{query}"));
        let headers = [("authorization", bearer)];
        stream.write_all(request_text(self.address, "GET", &path, &headers, "").as_bytes()).unwrap();
        EventStream { lines: BufReader::new(stream) }
    }

    /// Waits for the end of the process.
    pub(crate) fn wait(&mut self) -> ExitStatus {
        wait_for(&mut self.child, "the server")
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn request_text(
    address: SocketAddr,
    method: &str,
    path: &str,
    headers: &[(&str, &str)],
    body: &str,
) -> String {
    let mut text = format!("{method} {path} HTTP/1.1\r\n");
    if headers.iter().all(|(name, _)| *name != "host") {
        text += &format!("host: {address}\r\n");
    }
    for (name, value) in headers {
        text += &format!("{name}: {value}\r\n");
    }
    text + &format!("content-length: {}\r\nconnection: close\r\n\r\n{body}", body.len())
}

/// A stream of server-sent events.
pub(crate) struct EventStream {
    lines: BufReader<TcpStream>,
}

impl EventStream {
    /// Returns the status line of the answer.
    pub(crate) fn status(&mut self) -> u16 {
        let mut line = String::new();
        self.lines.read_line(&mut line).unwrap();
        line.split(' ').nth(1).and_then(|code| code.parse().ok()).unwrap_or(0)
    }

    /// Returns the next event: its name and its data; `None` at the end of the stream.
    pub(crate) fn next(&mut self) -> Option<(String, Value)> {
        let mut event = None;
        loop {
            let mut line = String::new();
            if self.lines.read_line(&mut line).ok()? == 0 {
                return None;
            }
            // Ignores other lines: headers, sizes of chunks and comments.
            if let Some(name) = line.strip_prefix("event: ") {
                event = Some(name.trim_end().to_owned());
            } else if let Some((data, name)) = line.strip_prefix("data: ").zip(event.take()) {
                return Some((name, serde_json::from_str(data.trim_end()).unwrap()));
            }
        }
    }

    /// Returns the data of the next event of this name that fulfils the condition.
    #[track_caller]
    pub(crate) fn until(&mut self, name: &str, condition: impl Fn(&Value) -> bool) -> Value {
        loop {
            let (event, data) = self.next().unwrap_or_else(|| panic!("the stream ended before {name}"));
            if event == name && condition(&data) {
                return data;
            }
        }
    }
}
