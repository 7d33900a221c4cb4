//! The emulator's side of the channel.
//!
//! The server runs on the firmware thread, which creates it and calls [`Server::poll`] after every firmware step. A
//! poll without requests takes some ten nanoseconds. After the first requests of a client, the server needs no system
//! call and no allocation for a request.

mod error;
mod followers;
mod opening;
mod watch;

pub(crate) use super::domain::MAX_CLIENTS;
pub use error::ServerError;
pub use watch::ChannelWatch;

use super::dead_clients::{DeadClients, INTERVAL, LONG_INTERVAL};
use super::domain::{Domain, Ipc, Service};
use super::limit::{self, LimitError};
use super::passage::ChannelSite;
use super::run::{Progress, Run};
use super::wire::{Block, WireOp};
use super::{Bells, EventNotifier};
use crate::memory::limits;
use crate::request::{Host, Refused};
use followers::{Followers, LastRequest};
use iceoryx2::active_request::ActiveRequest;
use iceoryx2::identifiers::{UniqueClientId, UniqueNodeId};
use iceoryx2::prelude::{CallbackProgression, Node, PortFactory};
use opening::{OpenFailure, need_room, ports};
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

type Port = iceoryx2::port::server::Server<Ipc, [WireOp], (), [Block], ()>;
type Request = ActiveRequest<Ipc, [WireOp], (), [Block], ()>;

/// Maximum number of requests that one call of [`Server::poll`] accepts. Busy clients must not stop the firmware.
const MAX_PER_POLL: usize = 2 * MAX_CLIENTS;

/// Longest wait at the end for clients to leave, so that all files can be removed.
const LEAVE: Duration = Duration::from_millis(250);

/// Free space in the memory file system that a channel needs, in bytes: for a reply of the greatest length, and for
/// iceoryx2.
const ROOM: u64 = 2 << 20;

/// Removes the channel of a killed emulator from the directory `root`. The caller must hold the instance's lock.
/// Clients that are still connected lose their connection.
///
/// # Errors
/// The directory cannot be used.
pub fn remove_remains(instance: &str, root: &Path) -> Result<(), ServerError> {
    let (domain, _held) = Domain::own(instance, root)?;
    domain.withdraw();
    domain.sweep();
    Ok(())
}

/// The emulator's side of the channel. Not `Send`: create it on the thread that polls it.
pub struct Server {
    /// Requests that are not answered yet. In real time, they wait for a condition. With a stepped clock, the
    /// first one is in progress, and the others follow in their order of arrival. The field is declared
    /// before the port, because requests refer to the port.
    waiting: Vec<(Request, Run)>,
    departed: DeadClients,
    followers: Followers,
    /// The server's port; `None` only while the server is being dropped.
    port: Option<Port>,
    service: Option<Service<Ipc>>,
    node: Option<Node<Ipc>>,
    /// Unused runs, kept to reuse their memory.
    spare: Vec<Run>,
    bells: Box<dyn Bells>,
    domain: Domain,
}

impl Server {
    /// Opens the channel of `instance` with its files in the directory `root`. Creates the directory if it is missing;
    /// only the channel may use it. Removes files of earlier runs. The caller must hold the instance's lock.
    ///
    /// # Errors
    /// The directory cannot be used, the channel is already served, or iceoryx2 gets no resources.
    pub fn open(instance: &str, root: &Path, bells: Box<dyn Bells>) -> Result<Self, ServerError> {
        let (mut domain, _held) = Domain::own(instance, root)?;
        let in_use = domain.in_use();
        if in_use && domain.is_served() {
            return Err(OpenFailure::AlreadyServed.into_error(instance));
        }
        domain.withdraw();
        if !in_use && !domain.is_new() {
            domain = domain.renew()?;
        }
        let opened = Self::move_in(instance, domain, bells);
        if opened.is_err()
            && let Ok(Some(domain)) = Domain::find(instance, root)
        {
            domain.sweep_if_unused();
        }
        opened
    }

    fn move_in(instance: &str, mut domain: Domain, bells: Box<dyn Bells>) -> Result<Self, ServerError> {
        need_room(instance)?;
        let (node, service, port) = match ports(instance, &domain) {
            // An earlier run was killed while it created the service, so the service is unusable and its
            // files must be removed.
            Err(OpenFailure::Wedged) => {
                domain = domain.renew()?;
                ports(instance, &domain).map_err(|e| e.into_error(instance))?
            }
            other => other.map_err(|e| e.into_error(instance))?,
        };
        let server = Self {
            waiting: Vec::new(),
            departed: DeadClients::default(),
            followers: Followers::default(),
            port: Some(port),
            service: Some(service),
            node: Some(node),
            spare: vec![Run::default()],
            bells,
            domain,
        };
        server.domain.keep_from_programs();
        server.domain.announce()?;
        Ok(server)
    }

    /// Creates the event services of the PLCs `plcs`. Drop them before the server.
    ///
    /// # Errors
    /// iceoryx2 gets no resources.
    pub fn event_notifier(&self, instance: &str, plcs: &[String]) -> Result<EventNotifier, ServerError> {
        let gone =
            || ServerError::Service { instance: instance.to_owned(), reason: "the server ends".into() };
        let notifier = EventNotifier::open(instance, self.node.as_ref().ok_or_else(gone)?, plcs)?;
        self.domain.keep_from_programs();
        Ok(notifier)
    }

    /// Creates a watch for use in another thread. It detects when a program shortens the shared memory that
    /// the channel has now.
    pub fn watch(&self) -> ChannelWatch {
        ChannelWatch { objects: self.domain.lengths().into(), damaged: Arc::default() }
    }

    /// Returns the number of waiting or paused requests. While the number is not zero, the caller must call
    /// [`Server::poll`] after every firmware step, and with a stepped clock immediately.
    pub fn waiting(&self) -> usize {
        self.waiting.len()
    }

    /// Continues requests in progress, receives and executes new requests, and answers finished ones. With a stepped
    /// clock only one request at a time advances the clock and changes the plant; later requests wait for its end.
    /// Requests that only read need not wait ([`Op::only_looks`](crate::request::Op::only_looks)).
    ///
    /// Does not block, except while a request advances the clock; that request ends at its next pause.
    ///
    /// Returns the number of answered requests. If the number is not zero, more requests may have arrived
    /// during the call.
    pub fn poll(&mut self, host: &mut dyn Host) -> usize {
        self.forget_departed_clients(host);
        let answered = if host.is_stepped() { self.resume(host) } else { self.retry(host) };
        answered + self.receive(host)
    }

    /// Drops requests of clients that have given up or died, and everything that departed clients have left in the host and
    /// in the channel.
    fn forget_departed_clients(&mut self, host: &mut dyn Host) {
        let (plant, travel) = host.plant_and_travel();
        let has_belongings = travel.belongs_to_clients() || plant.journal().belongs_to_clients();
        if self.waiting.is_empty() && !has_belongings && !self.has_clients() {
            return;
        }
        let interval = if self.waiting.is_empty() { LONG_INTERVAL } else { INTERVAL };
        let dead = self.departed.look(&self.domain, interval);
        if has_belongings && let Some(dead) = &dead {
            self.release_belongings(host, dead);
        }
        let dead = dead.unwrap_or_default();
        let clients = if dead.is_empty() { Vec::new() } else { self.clients(|node| dead.contains(&node)) };
        let (spare, mut at) = (&mut self.spare, 0);
        while let Some((request, _)) = self.waiting.get(at) {
            if request.is_connected() && !clients.contains(&request.origin().value()) {
                at += 1;
            } else {
                spare.push(self.waiting.remove(at).1);
            }
        }
    }

    /// Deletes the snapshots and files of clients that have left the channel, or whose node is `dead`, and the registers that
    /// they follow as observers.
    fn release_belongings(&self, host: &mut dyn Host, dead: &[UniqueNodeId]) {
        let present = self.clients(|node| !dead.contains(&node));
        let (plant, travel) = host.plant_and_travel();
        travel.release_departed(|client| present.contains(&client));
        plant.release_departed(|client| present.contains(&client));
    }

    /// Releases the snapshots and followed registers of departed clients before a request that could be refused because of
    /// them.
    fn make_room(&mut self, host: &mut dyn Host, request: &Request) {
        let (plant, travel) = host.plant_and_travel();
        let needs_room = travel.is_nearly_full() && Run::asks_to_save(request.payload())
            || plant.journal().follows_many_for_clients() && Run::asks_to_follow(request.payload());
        if needs_room {
            // In a damaged channel the query may not return. Snapshots of dead clients then stay.
            let dead = query_dead_nodes(&self.domain).unwrap_or_default();
            self.release_belongings(host, &dead);
        }
    }

    /// True if a client is connected, or was killed and its objects still exist.
    fn has_clients(&self) -> bool {
        self.service.as_ref().is_some_and(|service| service.dynamic_config().number_of_clients() > 0)
    }

    /// Returns the numbers of the connected clients on nodes for which `is_wanted` is true.
    fn clients(&self, is_wanted: impl Fn(UniqueNodeId) -> bool) -> Vec<u128> {
        clients_of(self.service.as_ref(), is_wanted)
    }

    /// Returns the number of the process of a client; `None` if the client has disconnected.
    fn process_of(&self, client: UniqueClientId) -> Option<u32> {
        let mut process = None;
        self.service.as_ref()?.dynamic_config().list_clients(|it| {
            if it.client_id == client {
                process = it.node_id.pid::<Ipc>().ok().and_then(|pid| u32::try_from(pid.value()).ok());
            }
            CallbackProgression::Continue
        });
        process
    }

    /// Used with a stepped clock. Continues the first request until it pauses again. If it ends, continues with the
    /// next one.
    fn resume(&mut self, host: &mut dyn Host) -> usize {
        let mut answered = 0;
        while let Some((request, run)) = self.waiting.first_mut() {
            if !host.may_act() {
                break;
            }
            let mut is_awaited = is_awaited(request, &self.domain, self.service.as_ref());
            let progress = run.go(host, request.payload(), &mut is_awaited);
            drop(is_awaited);
            if progress == Progress::Waiting {
                break;
            }
            let (request, run) = self.waiting.remove(0);
            answer(request, &run, &*self.bells);
            self.spare.push(run);
            answered += 1;
        }
        answered
    }

    /// Used in real time. Checks once more whether the waiting requests can be answered.
    fn retry(&mut self, host: &mut dyn Host) -> usize {
        let mut answered = 0;
        let mut at = 0;
        while let Some((request, run)) = self.waiting.get_mut(at) {
            // In real time, no operation takes long.
            if run.go(host, request.payload(), &mut || true) == Progress::Waiting {
                at += 1;
                continue;
            }
            let (request, run) = self.waiting.swap_remove(at);
            answer(request, &run, &*self.bells);
            answered += 1;
            self.spare.push(run);
        }
        answered
    }

    fn receive(&mut self, host: &mut dyn Host) -> usize {
        let mut answered = 0;
        for _ in 0..MAX_PER_POLL {
            let Some(request) = self.next_request() else { break };
            let mut run = self.spare.pop().unwrap_or_default();
            run.reset(request.origin().value());
            self.make_room(host, &request);
            if Run::asks_to_read(request.payload()) {
                let present = || clients_of(self.service.as_ref(), |_| true);
                self.followers.note(request.origin().value(), request.payload(), MAX_CLIENTS, present);
            }
            if Run::asks_to_end(request.payload()) {
                run.set_process(self.process_of(request.origin()));
            }
            let progress = if !host.is_stepped() || self.waiting.is_empty() && host.may_act() {
                let mut is_awaited = is_awaited(&request, &self.domain, self.service.as_ref());
                run.go(host, request.payload(), &mut is_awaited)
            } else if Run::only_looks(request.payload()) {
                run.look(host, request.payload())
            } else {
                Progress::Waiting
            };
            match progress {
                Progress::Done => {
                    answer(request, &run, &*self.bells);
                    self.spare.push(run);
                    answered += 1;
                }
                Progress::Waiting => self.waiting.push((request, run)),
            }
        }
        answered
    }

    fn next_request(&self) -> Option<Request> {
        let port = self.port.as_ref()?;
        match port.receive() {
            Ok(request) => request,
            Err(reason) => {
                // A client died while it connected, or a client of another build has too many requests in progress.
                tracing::debug!(?reason, "a request could not be received");
                None
            }
        }
    }

    /// True after the first call of [`Server::poll_followers`] while a client that follows the journal or changes has not
    /// read the rest. Clients that have read nothing for a while before this call do not count.
    pub fn is_followed(&self) -> bool {
        self.followers.are_waiting(&self.clients(|_| true))
    }

    /// Called in place of [`Server::poll`] after the clock has ended. Lets clients that follow the journal or changes read
    /// the rest, and answers all other requests, also those in progress, with
    /// [`Code::SHUTTING_DOWN`](crate::request::Code::SHUTTING_DOWN). Returns the number of answered requests.
    pub fn poll_followers(&mut self, host: &mut dyn Host) -> usize {
        self.followers.end();
        let ending = Refused::ending(host);
        for (request, mut run) in std::mem::take(&mut self.waiting) {
            run.abort(&ending);
            answer(request, &run, &*self.bells);
        }
        let mut answered = 0;
        while answered < MAX_PER_POLL {
            let Some(request) = self.next_request() else { break };
            let (client, ops) = (request.origin().value(), request.payload());
            let (_, changes_end) = host.plant_mut().changes_for(client, u64::MAX, 0);
            let mut run = Run::default();
            run.reset(client);
            let judged = self.followers.judge_last(client, ops, host.plant().journal(), changes_end);
            if judged == LastRequest::Refused || run.look(host, ops) == Progress::Waiting {
                run.abort(&ending);
            }
            answer(request, &run, &*self.bells);
            answered += 1;
        }
        answered
    }

    /// Ends the channel of `host`: answers all requests that have arrived, and removes the domain's files. Clients that are
    /// still connected lose their connection.
    pub fn close(mut self, host: &mut dyn Host) {
        self.domain.withdraw();
        self.poll_followers(host);
    }
}

impl Server {
    /// Ends a damaged channel and removes its files. Does not access its memory, which may be missing, so no request is
    /// answered.
    pub fn abandon(mut self) {
        self.domain.withdraw();
        core::mem::forget(core::mem::take(&mut self.waiting));
        core::mem::forget((self.port.take(), self.service.take(), self.node.take()));
        self.domain.sweep();
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.domain.withdraw();
        self.waiting.clear();
        self.port = None;
        self.service = None;
        // Clients that are still connected find their connection closed.
        self.bells.announce_reply();
        if let Some(node) = self.node.take() {
            let domain = self.domain.clone();
            let cleaned = limit::on_a_thread(limit::SHORT, move || domain.clean_up_after_the_dead(&node));
            if let Err(why) = cleaned {
                let reason = match why {
                    LimitError::NoThread(reason) => {
                        format!("cannot start a thread: {reason}{}", limits::named(&reason))
                    }
                    LimitError::Late | LimitError::Ended => {
                        "another program has damaged the channel".to_owned()
                    }
                };
                tracing::warn!("{reason}; the remaining files of the channel are removed by force");
                self.domain.sweep();
            }
        }
        self.domain.close(LEAVE);
    }
}

impl std::fmt::Debug for Server {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Server").field("domain", &self.domain).field("waiting", &self.waiting.len()).finish()
    }
}

/// Returns the nodes of dead processes.
///
/// # Errors
/// The query has not returned in time, or its thread cannot be started.
fn query_dead_nodes(domain: &Domain) -> Result<Vec<UniqueNodeId>, LimitError> {
    let domain = domain.clone();
    limit::on_a_thread(limit::SHORT, move || domain.dead_nodes())
}

/// Returns the numbers of the connected clients on nodes for which `is_wanted` is true.
fn clients_of(service: Option<&Service<Ipc>>, is_wanted: impl Fn(UniqueNodeId) -> bool) -> Vec<u128> {
    let mut clients = Vec::new();
    if let Some(service) = service {
        service.dynamic_config().list_clients(|client| {
            if is_wanted(client.node_id) {
                clients.push(client.client_id.value());
            }
            CallbackProgression::Continue
        });
    }
    clients
}

/// Returns a function for an operation during which the server does not poll. The function returns false from the moment
/// on at which the client of `request` has given up or died.
fn is_awaited<'a>(
    request: &'a Request,
    domain: &'a Domain,
    service: Option<&'a Service<Ipc>>,
) -> impl FnMut() -> bool {
    // The first call may be the last one, at the end of a long operation.
    let (mut asked, mut is_alive, mut can_ask) = (Instant::now(), true, true);
    move || {
        if !is_alive || !request.is_connected() {
            return false;
        }
        if can_ask && asked.elapsed() >= INTERVAL {
            match query_dead_nodes(domain) {
                Ok(dead) => {
                    let dead = clients_of(service, |node| dead.contains(&node));
                    is_alive = !dead.contains(&request.origin().value());
                }
                // In a damaged channel the query may not return, so it is not repeated.
                Err(_) => can_ask = false,
            }
            asked = Instant::now();
        }
        is_alive
    }
}

/// Sends the replies and closes the request. After a failure the client sees it closed without an answer.
fn answer(request: Request, run: &Run, bells: &dyn Bells) {
    // If the client has left, iceoryx2 may already use its connection for another client, which would get the reply.
    if !request.is_connected() {
        return;
    }
    let blocks = run.replies.blocks();
    match request.loan_slice_uninit(blocks.len()) {
        Ok(response) => {
            if let Err(reason) = response.write_from_slice(blocks).send() {
                tracing::debug!(?reason, "a reply could not be sent");
            }
        }
        Err(reason) => tracing::debug!(?reason, "there is no room for a reply"),
    }
    drop(request);
    bells.announce_reply();
}
