//! The client's side of the channel.
//!
//! The client sends a request, rings the doorbell, and waits for the reply. The client never ends before the
//! reply, because iceoryx2 loses the messages of a client that has ended. A client that gives up or dies does
//! not disturb the other clients.

mod error;

pub use error::ClientError;

use super::Bells;
use super::domain::{Domain, Service, Threads};
use super::guest::{self, Guest};
use super::wire::{self, Block, WireOp};
use crate::awake_time::AwakeTime;
use crate::identity::DeviceIndex;
use crate::memory::{Width, limits, room};
use crate::request::{InstanceInfo, MAX_OPS, Op, Reply, WrongReply};
use iceoryx2::pending_response::PendingResponse;
use iceoryx2::prelude::{BackpressureStrategy, Node, PortFactory};
use iceoryx2::service::builder::request_response::RequestResponseOpenError as OpenError;
use iceoryx2::service::port_factory::client::ClientCreateError;
use std::path::Path;
#[cfg(feature = "cli")]
use std::sync::Arc;
#[cfg(feature = "cli")]
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

type Port = iceoryx2::port::client::Client<Threads, [WireOp], (), [Block], ()>;
type Pending = PendingResponse<Threads, [WireOp], (), [Block], ()>;

/// Interval at which a waiting client checks that the emulator still runs.
const ALIVE_CHECK: Duration = Duration::from_millis(100);
/// Longest wait for the end of an emulator that has closed a request without an answer.
const CRASH: Duration = Duration::from_millis(500);
/// Free space in the memory file system that a client needs, in bytes: for a request of the greatest length, and for
/// iceoryx2. Without this space the client would be killed.
pub(super) const ROOM: u64 = 256 << 10;
/// Largest number of files that a client opens, in addition to the other files of its process.
const FILES: u64 = 16;
/// Address space in bytes that a client needs in addition to the address space in use: for the maps of
/// iceoryx2, the threads for entering and leaving, and the memory that the allocator reserves for each
/// thread.
const SPACE: u64 = 160 << 20;
/// Pause between two attempts to connect.
const RETRY: Duration = Duration::from_millis(2);

/// Limits of a client's waits.
#[derive(Clone, Copy, Debug)]
pub struct Patience {
    /// Time for which [`Client::connect`] waits for an instance that does not run yet. The default is zero.
    pub connect: Duration,
    /// Longest time to enter the channel. If a part of the channel is damaged, entering may never end. 5 s by
    /// default.
    pub enter_limit: Duration,
    /// Longest wait for a reply, in wall time. If the request contains waits, their time limits are added to
    /// this time, as if the clock ran in real time. 5 s by default.
    pub reply: Duration,
    /// How long to poll for the reply before sleeping. Zero by default: with few processors a polling client takes
    /// processor time from the emulator.
    pub spin: Duration,
}

impl Default for Patience {
    fn default() -> Self {
        let long = Duration::from_secs(5);
        Self { connect: Duration::ZERO, enter_limit: long, reply: long, spin: Duration::ZERO }
    }
}

/// A connection to an emulator.
pub struct Client {
    port: Port,
    service: Service<Threads>,
    // `port` and `service` belong to the iceoryx2 node in `guest`. Rust drops fields in the order of their declaration,
    // so `guest` is declared after them.
    guest: Guest,
    bells: Box<dyn Bells + Send>,
    patience: Patience,
    instance: String,
    /// Process id of the emulator.
    pid: u32,
    /// Becomes true when the reply is no longer needed.
    #[cfg(feature = "cli")]
    cancel: Option<Arc<AtomicBool>>,
}

impl Client {
    /// Connects to `instance`. The files of its channel are in the directory `root`.
    ///
    /// # Errors
    /// The instance is not running, has another version, or has too many clients; or its channel is damaged.
    pub fn connect(
        instance: &str,
        root: &Path,
        bells: Box<dyn Bells + Send>,
        patience: Patience,
    ) -> Result<Self, ClientError> {
        let start = Instant::now();
        loop {
            let failure = match ports(instance, root, &*bells, patience.enter_limit) {
                Ok((port, service, guest)) => {
                    let instance = instance.to_owned();
                    let pid = bells.emulator_pid();
                    return Ok(Self {
                        port,
                        service,
                        guest,
                        bells,
                        patience,
                        instance,
                        pid,
                        #[cfg(feature = "cli")]
                        cancel: None,
                    });
                }
                Err(failure) => failure,
            };
            if start.elapsed() >= patience.connect || !failure.may_pass() {
                return Err(failure);
            }
            std::thread::sleep(RETRY);
        }
    }

    /// Sends the operations as one request and waits for the replies, one per operation in the same order.
    ///
    /// The reply of a failed operation is [`Reply::Error`]. The replies of the operations after it are
    /// [`Reply::NotExecuted`].
    ///
    /// # Errors
    /// The request as a whole got no replies.
    pub fn request(&self, ops: &[Op]) -> Result<Vec<Reply>, ClientError> {
        self.request_while(ops, &|| false)
    }

    /// Sends a request like [`Client::request`]. After each time limit without a reply, waits once more if `is_working`
    /// returns true.
    ///
    /// # Errors
    /// Returns the errors of [`Client::request`].
    pub(crate) fn request_while(
        &self,
        ops: &[Op],
        is_working: &dyn Fn() -> bool,
    ) -> Result<Vec<Reply>, ClientError> {
        let mut replies = Vec::with_capacity(ops.len());
        self.request_patiently(ops, &mut replies, is_working)?;
        Ok(replies)
    }

    /// Sends a request like [`Client::request`], but writes the replies into a vector that can be reused. The vector is
    /// cleared first.
    ///
    /// # Errors
    /// Returns the errors of [`Client::request`].
    pub fn request_into(&self, ops: &[Op], replies: &mut Vec<Reply>) -> Result<(), ClientError> {
        self.request_patiently(ops, replies, &|| false)
    }

    /// Does both: [`Client::request_into`] and [`Client::request_while`].
    fn request_patiently(
        &self,
        ops: &[Op],
        replies: &mut Vec<Reply>,
        is_working: &dyn Fn() -> bool,
    ) -> Result<(), ClientError> {
        replies.clear();
        if ops.is_empty() {
            return Ok(());
        }
        if ops.len() > MAX_OPS {
            return Err(ClientError::TooManyOperations { count: ops.len() });
        }
        self.exchange(ops, replies, is_working)?;
        let failed = matches!(replies.last(), Some(Reply::Error(_)));
        match replies.len().cmp(&ops.len()) {
            std::cmp::Ordering::Less if failed => replies.resize(ops.len(), Reply::NotExecuted),
            std::cmp::Ordering::Equal => {}
            _ => return Err(self.wrong_reply()),
        }
        Ok(())
    }

    fn exchange(
        &self,
        ops: &[Op],
        replies: &mut Vec<Reply>,
        is_working: &dyn Fn() -> bool,
    ) -> Result<(), ClientError> {
        if self.bells.emulator_has_ended() {
            return Err(self.gone());
        }
        let send_error = |reason: String| ClientError::Send { instance: self.instance.clone(), reason };
        let request = self.port.loan_slice_uninit(ops.len()).map_err(|e| send_error(format!("{e:?}")))?;
        let request = request.write_from_fn(|i| ops.get(i).map(WireOp::from).unwrap_or_default());
        let pending = request.send().map_err(|e| send_error(format!("{e:?}")))?;
        if pending.number_of_server_connections() == 0 {
            return Err(self.gone());
        }
        self.bells.ring_doorbell();
        let waits = ops.iter().map(Op::waits_us).sum();
        let limit = self.patience.reply.saturating_add(Duration::from_micros(waits));
        self.await_reply(&pending, limit, replies, is_working)
    }

    fn await_reply(
        &self,
        pending: &Pending,
        limit: Duration,
        replies: &mut Vec<Reply>,
        is_working: &dyn Fn() -> bool,
    ) -> Result<(), ClientError> {
        // The clock is read only if the reply does not arrive immediately.
        let (mut time, mut withdrawn) = (None, false);
        loop {
            let seen = self.bells.reply_count();
            // The emulator first answers a request and then closes it. So this code reads whether the request
            // is open before it checks for the reply; in the other order it could miss a reply.
            let open = pending.is_connected();
            if self.take_reply(pending, replies)? {
                return Ok(());
            }
            if !open {
                return Err(self.closed());
            }
            let elapsed = time.get_or_insert_with(AwakeTime::start).elapsed();
            if elapsed < self.patience.spin {
                std::hint::spin_loop();
                continue;
            }
            #[cfg(feature = "cli")]
            if self.cancel.as_ref().is_some_and(|cancel| cancel.load(Ordering::Relaxed)) {
                return Err(self.late(elapsed));
            }
            let Some(rest) = limit.checked_sub(elapsed).filter(|rest| !rest.is_zero()) else {
                if is_working() {
                    time = None;
                    continue;
                }
                // The emulator may have answered during the call.
                return if self.take_reply(pending, replies)? { Ok(()) } else { Err(self.late(limit)) };
            };
            self.bells.wait_reply(seen, rest.min(ALIVE_CHECK));
            if self.bells.reply_count() != seen {
                continue;
            }
            if !self.is_emulator_alive() {
                return if self.take_reply(pending, replies)? { Ok(()) } else { Err(self.gone()) };
            }
            // An emulator that ends withdraws its announcement and then answers. An emulator that has given up the
            // channel does not answer.
            if !self.guest.domain().is_announced(self.bells.emulator_pid())
                && core::mem::replace(&mut withdrawn, true)
            {
                return Err(ClientError::Broken { instance: self.instance.clone() });
            }
        }
    }

    fn take_reply(&self, pending: &Pending, replies: &mut Vec<Reply>) -> Result<bool, ClientError> {
        match pending.receive() {
            Ok(Some(response)) => {
                wire::decode(response.payload(), replies)?;
                Ok(true)
            }
            Ok(None) => Ok(false),
            Err(reason) => {
                let reason = format!("{reason:?}");
                Err(ClientError::Send { instance: self.instance.clone(), reason })
            }
        }
    }

    /// The request was closed without a reply.
    fn closed(&self) -> ClientError {
        // An emulator that ends in an orderly way answers first. An emulator that crashes needs a moment until its end.
        let since = Instant::now();
        loop {
            if self.service.dynamic_config().number_of_servers() == 0 || !self.is_emulator_alive() {
                return self.gone_with(Some(self.pid));
            }
            if since.elapsed() >= CRASH {
                return ClientError::Unanswered { instance: self.instance.clone() };
            }
            std::thread::sleep(RETRY);
        }
    }

    fn late(&self, after: Duration) -> ClientError {
        if self.is_emulator_alive() {
            return ClientError::Timeout { instance: self.instance.clone(), after };
        }
        self.gone()
    }

    /// True if the emulator of this connection still runs. False if another emulator has taken the image over. A client that
    /// only uses what it has read from the emulator notices its end in no other way.
    pub(crate) fn is_emulator_alive(&self) -> bool {
        self.bells.emulator_pid() == self.pid
            && !self.bells.emulator_has_ended()
            && self.bells.emulator_alive()
    }

    fn gone(&self) -> ClientError {
        self.gone_with(self.bells.emulator_was_killed().then_some(self.pid))
    }

    fn gone_with(&self, killed: Option<u32>) -> ClientError {
        let instance = self.instance.clone();
        match self.bells.emulator_pid() {
            pid if pid != self.pid && pid != 0 => ClientError::Replaced { instance, pid: self.pid },
            _ => ClientError::EmulatorGone { instance, killed },
        }
    }

    fn wrong_reply(&self) -> ClientError {
        ClientError::WrongReply { instance: self.instance.clone() }
    }
}

/// The functions for the web server.
#[cfg(feature = "web")]
impl Client {
    /// True if another program has shortened a part of the channel. If the client then sends a request or
    /// leaves the channel, it may read zeros.
    pub(crate) fn is_shortened(&self) -> bool {
        self.guest.domain().is_shortened()
    }
}

/// The functions for commands.
#[cfg(feature = "cli")]
impl Client {
    /// Sets the longest wait for a reply from now on ([`Patience::reply`]).
    pub(crate) fn set_patience(&mut self, reply: Duration) {
        self.patience.reply = reply;
    }

    /// From now on, a request is withdrawn when `cancel` becomes true. The request then fails as if its time limit was
    /// over, and the emulator ends it like a request of a killed client.
    pub(crate) fn set_cancel(&mut self, cancel: Arc<AtomicBool>) {
        self.cancel = Some(cancel);
    }
}

/// Functions for single operations.
impl Client {
    /// Reads a register.
    ///
    /// # Errors
    /// The emulator refused the operation ([`ClientError::Refused`]), or there was no reply. The functions below have
    /// the same errors.
    pub fn peek(&self, plc: DeviceIndex, offset: u32, width: Width) -> Result<u32, ClientError> {
        self.fitting(self.single(Op::Peek { plc, offset, width })?.value())
    }

    /// Writes a register.
    ///
    /// # Errors
    /// Returns the errors of [`Client::peek`].
    pub fn poke(&self, plc: DeviceIndex, offset: u32, width: Width, value: u32) -> Result<(), ClientError> {
        self.fitting(self.single(Op::Poke { plc, offset, width, value })?.written())
    }

    /// Copies bytes.
    ///
    /// # Errors
    /// Returns the errors of [`Client::peek`].
    pub fn read_range(&self, plc: DeviceIndex, offset: u32, len: u32) -> Result<Vec<u8>, ClientError> {
        self.fitting(self.single(Op::ReadRange { plc, offset, len })?.bytes())
    }

    /// Advances the clock; returns the new time, in microseconds.
    ///
    /// # Errors
    /// Returns the errors of [`Client::peek`].
    pub fn advance(&self, us: u64) -> Result<u64, ClientError> {
        self.fitting(self.single(Op::Advance { us })?.time())
    }

    /// Describes the instance that answers.
    ///
    /// # Errors
    /// Returns the errors of [`Client::peek`].
    pub fn info(&self) -> Result<InstanceInfo, ClientError> {
        self.fitting(self.single(Op::Info)?.info())
    }

    /// Asks the emulator to end.
    ///
    /// # Errors
    /// Returns the errors of [`Client::peek`].
    pub fn stop(&self) -> Result<(), ClientError> {
        self.fitting(self.single(Op::Stop)?.stopping())
    }

    fn fitting<T>(&self, content: Result<T, WrongReply>) -> Result<T, ClientError> {
        content.map_err(|_| self.wrong_reply())
    }

    fn single(&self, op: Op) -> Result<Reply, ClientError> {
        match self.request(&[op])?.pop() {
            Some(Reply::Error(refused)) => Err(refused.into()),
            Some(reply) => Ok(reply),
            None => Err(self.wrong_reply()),
        }
    }
}

impl std::fmt::Debug for Client {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Client").field("instance", &self.instance).field("patience", &self.patience).finish()
    }
}

/// Returns the domain of a ready emulator.
pub(super) fn domain_of(instance: &str, root: &Path, bells: &dyn Bells) -> Result<Domain, ClientError> {
    let domain = Domain::find(instance, root)?;
    let is_ready = |domain: &Domain| domain.is_announced(bells.emulator_pid()) && bells.emulator_alive();
    let Some(domain) = domain.filter(is_ready) else {
        return Err(not_running(instance, root));
    };
    // iceoryx2 would wait without a timeout for an object that has no content, so such an object is an error.
    if let Some(path) = domain.half_made().pop() {
        return Err(ClientError::Damaged { instance: instance.to_owned(), path });
    }
    match room::free() {
        Some(free) if free < ROOM => {
            Err(ClientError::NoRoom { instance: instance.to_owned(), free_kib: free / 1024 })
        }
        _ => Ok(domain),
    }
}

/// The parts of a client in the domain. The guest is dropped last.
type ClientParts = (Port, Service<Threads>, Guest);

fn ports(
    instance: &str,
    root: &Path,
    bells: &dyn Bells,
    limit: Duration,
) -> Result<ClientParts, ClientError> {
    let not_running = || not_running(instance, root);
    check_limits(instance)?;
    let domain = domain_of(instance, root, bells)?;
    let (name, place) = (instance.to_owned(), root.to_owned());
    let ends = guest::enter_within(limit, instance, move || enter(&name, &place, domain))?;
    // If another emulator has started during the connection and has replaced this emulator, it may have removed the
    // objects of the connection.
    if !ends.2.domain().is_announced(bells.emulator_pid()) {
        return Err(not_running());
    }
    Ok(ends)
}

/// Refuses a client that does not have enough resources for iceoryx2. Otherwise iceoryx2 would fail later without
/// naming the reason.
fn check_limits(instance: &str) -> Result<(), ClientError> {
    let name = || instance.to_owned();
    limits::allow_files(FILES, FILES).map_err(|limits::FileLimit { needed, most }| {
        ClientError::OpenFiles { instance: name(), needed, most }
    })?;
    limits::space::check_address_space(SPACE).map_err(|(needed, most)| ClientError::AddressSpace {
        instance: name(),
        needed,
        most,
    })
}

fn not_running(instance: &str, root: &Path) -> ClientError {
    ClientError::NotRunning { instance: instance.to_owned(), root: root.display().to_string() }
}

fn enter(instance: &str, root: &Path, domain: Domain) -> Result<ClientParts, ClientError> {
    let name = || instance.to_owned();
    let connect = |reason: String| ClientError::Connect { instance: name(), reason };
    let guest = Guest::enter(domain).map_err(|e| connect(e.to_string()))?;
    let node = guest.node().ok_or_else(|| connect("no node".into()))?;
    let service = match open(node).ok_or_else(|| connect("no service".into()))? {
        // Clients that were killed may still occupy places.
        Err(OpenError::ExceedsMaxNumberOfNodes) => {
            guest.domain().clean_up_after_the_dead(node);
            open(node).ok_or_else(|| connect("no service".into()))?
        }
        other => other,
    };
    let service = service.map_err(|reason| match reason {
        OpenError::DoesNotExist | OpenError::IsMarkedForDestruction => not_running(instance, root),
        OpenError::ExceedsMaxNumberOfNodes => ClientError::TooManyClients { instance: name() },
        OpenError::IncompatibleRequestOrResponseType | OpenError::VersionMismatch => {
            ClientError::Incompatible { instance: name(), found: guest.domain().format(), reason }
        }
        OpenError::HangsInCreation | OpenError::ServiceInCorruptedState => {
            ClientError::Broken { instance: name() }
        }
        other => connect(other.to_string()),
    })?;
    let port = match create(&service) {
        Err(ClientCreateError::ExceedsMaxSupportedClients) => {
            guest.domain().clean_up_after_the_dead(node);
            create(&service)
        }
        other => other,
    };
    let port = port.map_err(|reason| match reason {
        ClientCreateError::ExceedsMaxSupportedClients => ClientError::TooManyClients { instance: name() },
        other => connect(format!("{other:?}")),
    })?;
    guest.domain().keep_from_programs();
    Ok((port, service, guest))
}

fn open(node: &Node<Threads>) -> Option<Result<Service<Threads>, OpenError>> {
    Some(Domain::service(node)?.open())
}

fn create(service: &Service<Threads>) -> Result<Port, ClientCreateError> {
    service
        .client_builder()
        .initial_max_slice_len(MAX_OPS)
        .backpressure_strategy(BackpressureStrategy::DiscardData)
        .create()
}
