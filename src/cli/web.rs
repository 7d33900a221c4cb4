//! `commram web`: a page and an HTTP interface for running instances.

mod assets;
mod beside;
mod connections;
mod distinct;
mod ending;
mod events;
mod guard;
mod hub;
mod link;
mod openapi;
mod operations;
mod predecessor;
mod problem;
mod router;
mod scenario;
mod secret;
mod server;
mod session;
mod show;
mod strand;
mod uploads;

pub(crate) use beside::WebProcess;
pub(crate) use secret::remove_left_files;

use super::error::CliError;
use super::{Instance, demo, log, output};
use crate::devices::folder::edited::allow_many_folders;
use crate::memory::{limits, survive_lost_channels};
use crate::request::Op;
use guard::{Guard, Origin};
use hub::{Hub, Served};
use problem::Problem;
use secret::{Secret, TokenFile};
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::Semaphore;

/// Serve a page and an HTTP interface for a running instance.
///
/// Prints the address of the page. The address contains a token, which every client needs, because other users of
/// this machine can connect, too. Programs find the token in a file that only you can read, and send it in the header
/// `Authorization: Bearer TOKEN`. The server ends with the emulator or at Ctrl-C; with --all it continues without
/// emulators. It has no encryption: other machines reach it through a tunnel or a proxy with TLS.
/// docs/guide/browser.md describes the page and the interface.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  commram web
  commram web -i press-1 --listen 127.0.0.1:0
  commram web --all --read-only
  commram web --origin https://plant.example")]
pub(crate) struct Args {
    /// Serve all instances of this user, also those that start later
    #[arg(long, conflicts_with = "name")]
    all: bool,
    /// Address and port to listen at; port 0 selects a free port
    #[arg(long, value_name = "ADDRESS:PORT", default_value = USUAL_ADDRESS, value_parser = listen_address)]
    listen: SocketAddr,
    /// Refuse all actions that change something in the plant
    #[arg(long)]
    read_only: bool,
    /// Allow an address that other machines reach; token and values are not encrypted
    #[arg(long)]
    allow_network: bool,
    /// Address at which browsers reach the server, if it is another one, such as that of a proxy
    #[arg(long, value_name = "URL", value_parser = Origin::parse)]
    origin: Vec<Origin>,
    /// File for the token; it must not exist, unless a killed server has left it [default: a file in the directory commram
    /// of XDG_RUNTIME_DIR, or in /dev/shm/commram-web-UID]
    #[arg(long, value_name = "FILE")]
    token_file: Option<PathBuf>,
    /// End when the process with this id ends
    #[arg(long, value_name = "PID", hide = true)]
    parent: Option<u32>,
    #[command(flatten)]
    instance: Instance,
}

/// Address at which the server listens if no other one is given.
pub(crate) const USUAL_ADDRESS: &str = "127.0.0.1:8080";

/// Time limit for closing the connections to emulators at the end of the server.
const LEAVE: Duration = Duration::from_secs(2);

/// State of the server.
struct App {
    hub: Hub,
    guard: Guard,
    /// Limits the number of event streams.
    streams: Arc<Semaphore>,
    read_only: bool,
}

impl App {
    /// Refuses an operation that changes something if the server is read-only.
    ///
    /// # Errors
    /// The operation changes something, and the server is read-only.
    fn check_writes(&self, op: &Op) -> Result<(), Problem> {
        if self.read_only { operations::check_reads_only(op) } else { Ok(()) }
    }

    /// Closes the connections to an instance if the problem shows that its emulator has ended.
    fn notice(&self, instance: &str, problem: &Problem) {
        if problem.is_gone() {
            self.hub.forget(instance);
        }
    }
}

/// Serves until the emulator ends or the process receives a signal.
pub(crate) fn run(args: &Args) -> Result<(), CliError> {
    if !args.listen.ip().is_loopback() && !args.allow_network {
        let right = "other machines could reach this address, without encryption; choose 127.0.0.1, or add \
                     --allow-network, for example in a container whose port is published for its host alone";
        return Err(CliError::Argument { text: args.listen.to_string(), right: right.to_owned() });
    }
    if let Some(parent) = args.parent {
        demo::end_with(parent)?;
    }
    log::to_stderr();
    allow_many_folders();
    strand::stop_at_panics();
    survive_lost_channels().map_err(|reason| CliError::Signals { reason })?;
    // If the limit cannot be raised, the server accepts fewer connections.
    let _ = limits::allow_files(0, connections::WISHED_FILES);
    let served = if args.all { Served::All } else { Served::One(args.instance.name().to_owned()) };
    let ending = ending::Ending::watch(&served, &args.instance)?;
    // Only `run --web` starts a server with this option.
    let option = if args.parent.is_some() { "--web=" } else { "--listen " };
    let refused = |reason| CliError::Listen { address: args.listen, reason, option };
    let listener = match &served {
        Served::One(name) => predecessor::bind(name, args.listen),
        Served::All => TcpListener::bind(args.listen),
    };
    let listener = listener.map_err(refused)?;
    let address = listener.local_addr().map_err(refused)?;
    let random = || Secret::random().map_err(|reason| CliError::Process { reason });
    let token = random()?;
    let name = match &served {
        Served::One(name) => secret::file_name(name, address.port()),
        // No instance can have this name.
        Served::All => format!("+all-{}", address.port()),
    };
    let file = match &args.token_file {
        Some(path) => TokenFile::named(path, &token)?,
        None => TokenFile::usual(&name, &token)?,
    };
    let printed = output::print(&first_lines(args, &served, address, &token));
    output::note(&format!("the token for programs is in {}", file.path().display()));
    let guard = Guard { token, sessions: session::Sessions::default(), origins: args.origin.clone() };
    let streams = Arc::new(Semaphore::new(events::MAX_STREAMS));
    let app = App { hub: Hub::new(served), guard, streams, read_only: args.read_only };
    let served = server::serve(Arc::new(app), listener, ending.receiver());
    link::wait_until_closed(LEAVE);
    served?;
    drop(file);
    match printed {
        // The reader of the output closed it early.
        Err(CliError::Interrupted) => {}
        printed => printed?,
    }
    ending.result()
}

/// Parses an address to listen at.
///
/// # Errors
/// The text is not an IP address with a port.
pub(crate) fn listen_address(text: &str) -> Result<SocketAddr, String> {
    text.parse()
        .map_err(|_| format!("write an IP address and a port, for example {USUAL_ADDRESS} or [::1]:8080"))
}

/// Formats the first line of the output, `commram: page of instance 'default': http://127.0.0.1:8080/#token=...`, and a
/// line for each further address.
fn first_lines(args: &Args, served: &Served, mut address: SocketAddr, token: &Secret) -> String {
    if address.ip().is_unspecified() {
        address.set_ip(Ipv4Addr::LOCALHOST.into());
    }
    let what = match served {
        Served::One(name) => format!("page of instance '{name}'"),
        Served::All => "page of all instances".to_owned(),
    };
    let own = format!("http://{address}");
    let places = std::iter::once(own.as_str()).chain(args.origin.iter().map(Origin::text));
    places.map(|place| format!("commram: {what}: {place}/#token={}\n", token.digits())).collect()
}
