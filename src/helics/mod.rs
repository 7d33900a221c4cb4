//! Transport of federate messages by HELICS. Each federate is a HELICS federate. The messages are commands, which
//! HELICS delivers immediately and in order, independently of granted times (decision D-574).
//!
//! The calls of the library block, so two threads make them: one joins and sends, the other waits for commands.

mod broker;
mod combination;
mod federate;
mod library;
mod simulators;

pub use broker::{BrokerAddress, BrokerAddressError};
pub use library::end_process_if_loaded;
pub use simulators::HelicsSimulators;

use crate::federation::Exchange;
use federate::CommandFederate;
use library::{Functions, VARIABLE};
use std::io::Read;
use std::net::{IpAddr, SocketAddr, TcpStream};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, Sender, TryRecvError};
use std::thread::Builder;
use std::time::Duration;

/// Longest time for the last message to the other federates.
const FAREWELL: Duration = Duration::from_secs(1);
/// Longest time for the check whether a broker runs: to connect, and then to receive its greeting.
const CONNECT: Duration = Duration::from_millis(500);

/// Reasons why HELICS cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum HelicsError {
    /// The library cannot be loaded.
    #[error(
        "HELICS cannot be loaded{}: {reason}; install it, for example by `pip install helics`, and let \
            {VARIABLE} name its libhelics.so.3 or the directory of that \
            file", .given.as_ref().map(|path| format!(" ({VARIABLE}={})", path.display()))
            .unwrap_or_default()
    )]
    NoLibrary {
        /// Path in the environment variable that names the library, if the variable is set.
        given: Option<PathBuf>,
        /// Error of the dynamic loader.
        reason: String,
    },
    /// The federation cannot be joined.
    #[error(
        "the HELICS federation cannot be joined: {reason}; does a broker run at this address, and does it wait \
            for this federate?"
    )]
    NotJoined {
        /// Error text of HELICS.
        reason: String,
    },
    /// The broker knows a federate with this name.
    #[error(
        "a federate with the name '{name}' has already joined at this HELICS broker; give each federate its own number or \
            name. HELICS frees no name: if that federate has ended, start the broker again"
    )]
    NameTaken {
        /// Name of the federate.
        name: String,
    },
    /// No broker answers.
    #[error(
        "no HELICS broker answers at {broker} within {} s: start `helics_broker`, or give its address by \
            --broker", .limit.as_secs_f64()
    )]
    NoBroker {
        /// Address of the broker that did not answer.
        broker: String,
        /// Real time for which the emulator waited.
        limit: Duration,
    },
    /// The broker runs, but other federates are missing.
    #[error(
        "the HELICS broker at {broker} has waited for more federates for {} s: start the missing ones, or a broker for \
            fewer federates", .limit.as_secs_f64()
    )]
    Incomplete {
        /// Address of the broker that waits for more federates.
        broker: String,
        /// Real time for which the emulator waited.
        limit: Duration,
    },
    /// The thread cannot be started.
    #[error("cannot start a thread: {reason}{}", crate::memory::limits::named(.0), reason = .0)]
    Thread(std::io::Error),
}

impl HelicsError {
    /// Returns the error of a federate with this name that could not join.
    fn of_joining(name: &str, reason: String) -> Self {
        // HELICS has no code for this reason.
        if reason.contains("duplicate federate name") {
            HelicsError::NameTaken { name: name.to_owned() }
        } else {
            HelicsError::NotJoined { reason }
        }
    }
}

/// Position of a federate in the federation, and the address of the broker.
#[derive(Clone, Debug)]
pub struct HelicsConfig {
    /// Name of the federation. A federate is called `<federation>/<number>`.
    pub federation: String,
    /// Number of the federate of this process.
    pub own: u8,
    /// Number of federates that simulate the plant.
    pub count: u8,
    /// Address of the broker, for example `tcp://127.0.0.1:23404`.
    pub broker: BrokerAddress,
    /// Longest wait for the broker.
    pub limit: Duration,
}

impl HelicsConfig {
    fn name_of(&self, number: u8) -> String {
        format!("{}/{number}", self.federation)
    }

    /// Arguments for the core of a federate.
    fn of_core(&self) -> String {
        let (broker, limit) = (&self.broker, self.limit.as_millis());
        let local = broker.local_interface().map(|address| match address {
            IpAddr::V4(address) => format!(" --local_interface=tcp://{address}"),
            IpAddr::V6(address) => format!(" --local_interface=tcp://[{address}]"),
        });
        let local = local.unwrap_or_default();
        format!("--federates=1 --broker_address={broker}{local} --timeout={limit}ms --loglevel=no_print")
    }
}

/// The state of joining a federation, as the emulator sees it. Joining blocks a thread of the library.
#[derive(Clone)]
struct Joining {
    is_done: Arc<AtomicBool>,
    broker: BrokerAddress,
    limit: Duration,
}

impl Joining {
    fn of(place: &HelicsConfig) -> Self {
        Joining { is_done: Arc::default(), broker: place.broker.clone(), limit: place.limit }
    }

    fn set_done(&self) {
        self.is_done.store(true, Ordering::Release);
    }

    /// If the limit is over and the federation is not yet joined, describes the missing part.
    fn missing(&self) -> Option<String> {
        if self.is_done.load(Ordering::Acquire) {
            return None;
        }
        let (broker, limit) = (self.broker.to_string(), self.limit);
        let missing = match self.has_broker() {
            true => HelicsError::Incomplete { broker, limit },
            false => HelicsError::NoBroker { broker, limit },
        };
        Some(missing.to_string())
    }

    /// True if a broker answers at its address.
    fn has_broker(&self) -> bool {
        self.broker.addresses().any(greets)
    }

    /// Longest wait for the thread to send the last message and to end. A thread cannot send a message while it still
    /// joins the federation. So there is no wait for it.
    fn farewell(&self) -> Duration {
        if self.is_done.load(Ordering::Acquire) { FAREWELL } else { Duration::ZERO }
    }
}

/// True if the program at this address uses ZeroMQ, as a broker does. A broker sends a greeting at once.
fn greets(address: SocketAddr) -> bool {
    let Ok(mut stream) = TcpStream::connect_timeout(&address, CONNECT) else { return false };
    let mut signature = [0; 10];
    let is_read = stream.set_read_timeout(Some(CONNECT)).is_ok() && stream.read_exact(&mut signature).is_ok();
    is_read && matches!(signature, [0xFF, .., 0x7F])
}

/// Request of the emulator to the sending thread.
enum Command {
    Send(Vec<u8>),
    Leave(Vec<u8>),
}

/// A received message with the number of its sender, or an error.
type Received = Result<(u8, Vec<u8>), String>;

/// The emulator's side of the connection.
///
/// A process that has used it should end by [`end_process_if_loaded`].
pub struct HelicsExchange {
    commands: Sender<Command>,
    messages: Receiver<Received>,
    has_left: Receiver<()>,
    joining: Joining,
}

impl HelicsExchange {
    /// Starts to join; calls `wake` whenever a message can be [received](Exchange::receive).
    ///
    /// # Errors
    /// There is no library. A missing broker is reported later.
    pub fn join(place: HelicsConfig, wake: impl Fn() + Send + Sync + 'static) -> Result<Self, HelicsError> {
        let functions = library::load()?;
        let (commands, asked) = mpsc::channel();
        let (sender, messages) = mpsc::channel();
        let (left, has_left) = mpsc::channel();
        let thread = Builder::new().name("helics".to_owned());
        let joining = Joining::of(&place);
        let joined = joining.clone();
        let run = move || {
            let report = |news: Received| {
                // If the emulator has ended, the message is not needed.
                let _ = sender.send(news);
                wake();
            };
            if let Err(reason) = talk(functions, &place, &joined, &asked, &report) {
                report(Err(reason));
            }
            drop(left);
        };
        thread.spawn(run).map_err(HelicsError::Thread)?;
        Ok(HelicsExchange { commands, messages, has_left, joining })
    }
}

impl Exchange for HelicsExchange {
    fn send(&mut self, message: &[u8]) -> Result<(), String> {
        // A thread that has ended has queued its reason, and the emulator receives it next.
        let _ = self.commands.send(Command::Send(message.to_vec()));
        Ok(())
    }

    fn receive(&mut self) -> Result<Option<(u8, Vec<u8>)>, String> {
        match self.messages.try_recv() {
            Ok(message) => message.map(Some),
            Err(TryRecvError::Empty) => Ok(None),
            Err(TryRecvError::Disconnected) => Err("the thread of HELICS has ended".to_owned()),
        }
    }

    fn missing(&self) -> Option<String> {
        self.joining.missing()
    }

    fn leave(&mut self, message: &[u8]) {
        let _ = self.commands.send(Command::Leave(message.to_vec()));
        // No message is ever sent on this channel. The channel closes when the thread ends.
        let _ = self.has_left.recv_timeout(self.joining.farewell());
    }
}

/// Joins, sends the requested messages, and leaves.
fn talk(
    functions: Functions,
    place: &HelicsConfig,
    joining: &Joining,
    asked: &Receiver<Command>,
    report: &(impl Fn(Received) + Sync),
) -> Result<(), String> {
    let init = place.of_core();
    let own = place.name_of(place.own);
    let federate = CommandFederate::join(functions, &own, &init).map_err(|error| error.to_string())?;
    joining.set_done();
    let others: Vec<_> = (0..place.count).filter(|number| *number != place.own).collect();
    let ends = AtomicBool::new(false);
    let result = std::thread::scope(|scope| {
        let listener = Builder::new().name("helics-listens".to_owned());
        let listener = listener.spawn_scoped(scope, || listen(&federate, place, &others, &ends, report));
        listener.map_err(|error| HelicsError::Thread(error).to_string())?;
        let to_all = |bytes: Vec<u8>| {
            let command = encode_text(&bytes);
            others.iter().try_for_each(|other| federate.send(&place.name_of(*other), &command))
        };
        let mut result = Ok(());
        while result.is_ok() {
            result = match asked.recv() {
                Ok(Command::Send(bytes)) => to_all(bytes),
                Ok(Command::Leave(bytes)) => {
                    result = to_all(bytes);
                    break;
                }
                Err(_) => break,
            };
        }
        // The thread that waits for commands checks this flag after the next command.
        ends.store(true, Ordering::Release);
        result.and(federate.send(&own, "end"))
    });
    federate.leave();
    result
}

/// Passes the commands of the other federates to the emulator.
fn listen(
    federate: &CommandFederate,
    place: &HelicsConfig,
    others: &[u8],
    ends: &AtomicBool,
    report: &impl Fn(Received),
) {
    let mut strangers = Vec::new();
    loop {
        let command = federate.wait();
        if ends.load(Ordering::Acquire) {
            return;
        }
        match command {
            Ok((source, command)) => match others.iter().find(|number| place.name_of(**number) == source) {
                // A malformed command becomes an empty message, which no receiver accepts.
                Some(number) => report(Ok((*number, decode_text(&command).unwrap_or_default()))),
                None if source.is_empty() => return report(Err("HELICS has ended".to_owned())),
                None if !strangers.contains(&source) => {
                    tracing::warn!(
                        "{source} sends commands, but is not a federate of this plant; they are ignored"
                    );
                    strangers.push(source);
                }
                None => {}
            },
            Err(reason) => return report(Err(reason)),
        }
    }
}

/// Encodes bytes as a text without characters that have a meaning for HELICS.
fn encode_text(bytes: &[u8]) -> String {
    let digits = bytes.iter().flat_map(|byte| [byte >> 4, byte & 0xF]);
    digits.map(|digit| char::from(b"0123456789abcdef"[usize::from(digit)])).collect()
}

/// Decodes the bytes of such a text.
fn decode_text(text: &str) -> Option<Vec<u8>> {
    let digit = |byte: u8| char::from(byte).to_digit(16).map(|digit| digit as u8);
    let (pairs, rest) = text.as_bytes().as_chunks::<2>();
    let bytes = pairs.iter().map(|[high, low]| Some(digit(*high)? << 4 | digit(*low)?));
    bytes.collect::<Option<_>>().filter(|_| rest.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A program is a broker only if it greets as ZeroMQ does. It is not enough that it accepts connections.
    #[test]
    fn only_a_program_with_the_greeting_of_zeromq_is_a_broker() {
        let joining = |broker: &str| Joining {
            is_done: Arc::default(),
            broker: broker.parse().unwrap(),
            limit: Duration::from_secs(2),
        };
        for (greeting, is_broker) in [
            (&b"\xFF\0\0\0\0\0\0\0\x01\x7F\x03"[..], true),
            (b"HTTP/1.1 400 Bad Request\r\n", false),
            (b"\xFF", false),
            (b"", false),
        ] {
            let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
            let broker = format!("tcp://{}", listener.local_addr().unwrap());
            let guest = std::thread::spawn(move || {
                let (mut stream, _) = listener.accept().unwrap();
                std::io::Write::write_all(&mut stream, greeting).unwrap();
                // Waits until the other side has closed the connection.
                let _ = stream.read(&mut [0]);
            });
            let missing = joining(&broker).missing().unwrap();
            assert_eq!(missing.contains("has waited for more federates"), is_broker, "{missing}");
            assert_eq!(missing.contains("no HELICS broker answers"), !is_broker, "{missing}");
            guest.join().unwrap();
        }
        let closed = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
        for broker in [format!("tcp://{closed}"), closed.to_string(), "x.invalid".to_owned()] {
            assert!(!joining(&broker).has_broker());
        }
    }

    #[test]
    fn bytes_survive_the_text_encoding() {
        let all: Vec<u8> = (0..=255).collect();
        assert_eq!(decode_text(&encode_text(&all)), Some(all));
        assert_eq!(encode_text(&[0x0A, 0xF0]), "0af0");
        assert_eq!([decode_text("0af"), decode_text("0g"), decode_text("\u{e4}")], [None, None, None]);
    }
}
