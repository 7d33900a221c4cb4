//! A bare iceoryx2 request-response: the reference for the channel.
//!
//! Requests and replies are as large as a single operation and its answer in the channel. There are one client and one
//! server, which answers each request with the next higher number. They wait in the same way as a client and an
//! emulator: both poll, or both sleep on a futex word in a shared page.

use crate::support::PATIENCE;
use crate::support::child::{Child, when_parent_ends};
use crate::support::cpu;
use crate::support::page::{Page, Registers, ring, sleep};
use iceoryx2::port::client::Client;
use iceoryx2::prelude::*;
use iceoryx2::service::port_factory::request_response::PortFactory;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Role of the child process that runs the server.
pub(crate) const ROLE: &str = "request-response";

/// Interval at which a client checks whether its server is ready.
pub(crate) const LOOK: Duration = Duration::from_micros(200);

/// Directory of the channel and of POSIX shared memory.
const SHARED_MEMORY: &str = "/dev/shm";

/// A request of the same size as an operation of the channel.
type Request = [u64; 4];
/// A response of the same size as the reply of the channel.
type Response = [u64; 2];
type Factory = PortFactory<ipc::Service, Request, (), Response, ()>;

/// A server in a child process, and a client of this server.
pub(crate) struct Pair {
    client: Client<ipc::Service, Request, (), Response, ()>,
    _service: Factory,
    _node: Node<ipc::Service>,
    page: Page,
    sleeps: bool,
    // Dropping this field ends the server. The field is declared between the ports and the files, so the server ends
    // after the ports are closed and before the files are removed.
    _server: Child,
    _files: Files,
}

impl Pair {
    /// Starts the server, on processor `cpu` if given. `waiting`: busy or sleeping.
    pub(crate) fn start(waiting: &str, cpu: Option<usize>) -> Self {
        let files = Files::new();
        let page = Page::create();
        let (path, cpu) = (page.path(), cpu.map(|cpu| cpu.to_string()));
        let mut args = vec![ROLE, waiting, &path, files.root(), &files.prefix];
        args.extend(cpu.as_deref());
        let server = Child::play(&args);
        let node = node(files.root(), &files.prefix);
        // The server shows in the page that it is ready.
        let start = Instant::now();
        while page.registers().status.load() == 0 {
            assert!(start.elapsed() < PATIENCE, "the server does not start");
            std::thread::sleep(LOOK);
        }
        let service = service(&node);
        let client = service.client_builder().create().expect("a client can be made");
        let sleeps = waiting == "sleeping";
        Pair { client, _service: service, _node: node, page, sleeps, _server: server, _files: files }
    }

    /// Sends `number` and awaits the next number.
    pub(crate) fn exchange(&self, number: u64) {
        let Registers { doorbell, answer, .. } = self.page.registers();
        let pending = self.client.send_copy([number, 0, 0, 0]).expect("a request can be sent");
        if self.sleeps {
            ring(doorbell);
        }
        let mut start = None;
        loop {
            let seen = answer.load();
            if let Some(response) = pending.receive().expect("a response can be received") {
                assert_eq!(response[0], number + 1);
                return;
            }
            assert!(
                start.get_or_insert_with(Instant::now).elapsed() < PATIENCE,
                "the server does not answer"
            );
            if self.sleeps {
                sleep(answer, seen);
            }
        }
    }
}

/// Runs the server in a child process.
pub(crate) fn play(args: &[String]) {
    let [waiting, page, root, prefix, processor @ ..] = args else { panic!("wrong arguments {args:?}") };
    if let [processor] = processor {
        cpu::pin(processor.parse().expect("the number of a processor"));
    }
    let page = Page::open(page);
    let Registers { doorbell, answer, status, .. } = page.registers();
    let stop = Arc::new(AtomicBool::new(false));
    when_parent_ends({
        let stop = Arc::clone(&stop);
        move || stop.store(true, Ordering::Relaxed)
    });
    let node = node(root, prefix);
    let service = service(&node);
    let server = service.server_builder().create().expect("a server can be made");
    status.store(1);
    let sleeps = waiting == "sleeping";
    while !stop.load(Ordering::Relaxed) {
        let seen = doorbell.load();
        if let Some(request) = server.receive().expect("requests can be received") {
            request.send_copy([request[0] + 1, 0]).expect("a response can be sent");
            drop(request);
            if sleeps {
                ring(answer);
            }
        } else if sleeps {
            sleep(doorbell, seen);
        }
    }
}

fn node(root: &str, prefix: &str) -> Node<ipc::Service> {
    set_log_level(LogLevel::Fatal);
    let mut config = Config::default();
    config.global.set_root_path(&Path::new(root.as_bytes()).expect("a short path"));
    config.global.prefix = FileName::new(prefix.as_bytes()).expect("a short name");
    let builder = NodeBuilder::new().config(&config).signal_handling_mode(SignalHandlingMode::Disabled);
    builder.create::<ipc::Service>().expect("a node can be made")
}

fn service(node: &Node<ipc::Service>) -> Factory {
    let name = ServiceName::new("bare").expect("a service name");
    let builder = node.service_builder(&name).request_response::<Request, Response>();
    builder.open_or_create().expect("the service can be had")
}

/// The directory of a domain and the shared memory that iceoryx2 does not remove.
struct Files {
    root: TempDir,
    prefix: String,
}

impl Files {
    fn new() -> Self {
        let root = tempfile::Builder::new().prefix("commram-bench-").tempdir_in(SHARED_MEMORY);
        let root = root.expect("a directory can be made");
        let name = root.path().file_name().expect("it has a name").to_string_lossy().into_owned();
        Files { prefix: format!("{name}_"), root }
    }

    fn root(&self) -> &str {
        self.root.path().to_str().expect("the path is ASCII")
    }
}

impl Drop for Files {
    fn drop(&mut self) {
        for entry in std::fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten() {
            if entry.file_name().to_string_lossy().starts_with(&self.prefix) {
                let _ = std::fs::remove_file(PathBuf::from(SHARED_MEMORY).join(entry.file_name()));
            }
        }
    }
}
