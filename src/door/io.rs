//! The thread for sockets and terminals. No operation on a descriptor blocks it.

use super::descriptors;
use super::guest::{Guest, GuestMessage};
use super::log_limiter::LogLimiter;
use super::protocol::GuestSession;
use super::pty::Pty;
use super::spec::DoorSpec;
use super::{MAX_GUESTS, MAX_KNOWN_GUESTS, ROOM_TO_GUEST};
use crate::identity::BusIndex;
use mio::net::{TcpListener, TcpStream};
use mio::unix::SourceFd;
use mio::{Events, Interest, Poll, Token, Waker};
use std::collections::BTreeMap;
use std::io::{self, ErrorKind, Read, Write};
use std::os::fd::AsRawFd;
use std::sync::mpsc::{Receiver, SyncSender};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// A command from the thread of the plant.
pub(super) enum Command {
    /// Opens a door to a bus.
    Open {
        /// Number of the door.
        key: usize,
        /// Index of the door's bus.
        bus: BusIndex,
        /// Specification of the door.
        spec: DoorSpec,
        /// The entrance for guests.
        entrance: Entrance,
        /// The thread sends the result here. The door is open only if the result is `Ok`.
        result: SyncSender<io::Result<()>>,
    },
    /// Closes a door.
    Close {
        /// Number of the door.
        key: usize,
    },
    /// Ends the thread.
    End,
}

/// An entrance for guests.
pub(super) enum Entrance {
    Tcp(TcpListener),
    /// A terminal, which always has one guest.
    Pty(Pty),
}

/// Data that the thread of the doors and the thread of the plant share.
#[derive(Debug)]
pub(super) struct Shared {
    is_stepped: bool,
    all: Mutex<Present>,
}

#[derive(Debug, Default)]
struct Present {
    /// All guests that the thread of the plant has not yet removed.
    guests: Vec<Arc<Guest>>,
    /// Number of guests that the thread of the plant has not yet taken over.
    new: usize,
    /// Number of rejected guests for each door, by the number of the door.
    refused: BTreeMap<usize, u64>,
}

/// Reason for the rejection of further guests.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
enum NoPlace {
    #[error("an instance has places for {MAX_GUESTS} guests, and all are taken; let a guest leave")]
    Taken,
    #[error(
        "no place is free: departed guests still have frames; advance the clock until their buses have sent them"
    )]
    Kept,
}

impl Present {
    /// Returns the number of known guests that occupy a place.
    fn known(&self) -> usize {
        self.guests.iter().filter(|guest| !guest.is_given_up()).count()
    }
}

impl Shared {
    /// Creates a value without guests. `is_stepped` is true if the clock of the plant is stepped.
    pub(super) fn new(is_stepped: bool) -> Self {
        Self { is_stepped, all: Mutex::default() }
    }

    fn present(&self) -> std::sync::MutexGuard<'_, Present> {
        self.all.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Appends the guests that have come since the last call.
    pub(super) fn take_new(&self, to: &mut Vec<Arc<Guest>>) {
        let mut present = self.present();
        let known = present.guests.len() - present.new;
        to.extend_from_slice(&present.guests[known..]);
        present.new = 0;
    }

    /// Removes a guest, even if the thread of the plant has not yet taken it over.
    pub(super) fn forget(&self, guest: &Arc<Guest>) {
        let mut present = self.present();
        let Some(at) = present.guests.iter().position(|it| Arc::ptr_eq(it, guest)) else { return };
        let known = present.guests.len() - present.new;
        present.new -= usize::from(at >= known);
        present.guests.remove(at);
    }

    /// Admits a guest, which gets the first free number of its bus. Disconnected guests occupy no place. If too many
    /// guests are known, a new guest in real time replaces the guest that disconnected first. The unsent frames of that
    /// guest are discarded, because a slow bus would need seconds for them (D-820).
    fn admit(&self, bus: BusIndex, door: DoorSpec) -> Result<Arc<Guest>, NoPlace> {
        let mut present = self.present();
        if present.guests.iter().filter(|it| !it.has_gone()).count() >= MAX_GUESTS {
            return Err(NoPlace::Taken);
        }
        if present.known() >= MAX_KNOWN_GUESTS {
            let departed = present.guests.iter().find(|it| it.has_gone() && !it.is_given_up());
            departed.filter(|_| !self.is_stepped).ok_or(NoPlace::Kept)?.give_up_unsent();
        }
        let is_taken = |number: &u8| present.guests.iter().any(|it| it.bus == bus && it.number == *number);
        let number = (1..=u8::MAX).find(|number| !is_taken(number)).ok_or(NoPlace::Kept)?;
        let guest = Arc::new(Guest::new(bus, number, door));
        present.guests.push(Arc::clone(&guest));
        present.new += 1;
        Ok(guest)
    }

    /// Counts a rejected guest.
    fn refuse(&self, door: usize) {
        *self.present().refused.entry(door).or_default() += 1;
    }

    /// Returns the number of guests that were rejected at a door.
    pub(super) fn refused(&self, door: usize) -> u64 {
        self.present().refused.get(&door).copied().unwrap_or_default()
    }

    fn close(&self, door: usize) {
        self.present().refused.remove(&door);
    }
}

/// Maximum number of bytes of a read operation.
const CHUNK: usize = 4096;
/// Maximum number of bytes that wait to be written. While a guest does not read them, its input is not read.
const MOST_UNWRITTEN: usize = 16 * CHUNK;

/// If the operating system has no descriptor or memory for a guest, the doors try again after this time. No event
/// reports that descriptors or memory are available again.
const RETRY: Duration = Duration::from_millis(100);

const WAKER: Token = Token(0);

/// The object to which a descriptor belongs.
enum Station {
    Listener { listener: TcpListener, door: usize, bus: BusIndex, spec: DoorSpec },
    Guest(Box<GuestConnection>),
}

/// A guest that is connected now.
struct GuestConnection {
    line: Line,
    door: usize,
    guest: Arc<Guest>,
    session: Box<dyn GuestSession>,
    /// True if more input may wait.
    has_more: bool,
    /// True if the guest has sent all that it will send. Then all of it is read, even without room, so that the guest
    /// frees its place.
    is_closed: bool,
    /// True if the guest has sent any byte.
    has_spoken: bool,
    unwritten: Vec<u8>,
}

enum Line {
    Tcp(TcpStream),
    Pty(Pty),
}

impl Line {
    fn read(&mut self, room: &mut [u8]) -> io::Result<usize> {
        match self {
            Line::Tcp(stream) => stream.read(room),
            Line::Pty(pty) => pty.master.read(room),
        }
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Line::Tcp(stream) => stream.write(bytes),
            Line::Pty(pty) => pty.master.write(bytes),
        }
    }
}

/// Presence of a guest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Presence {
    Stays,
    Leaves,
}

impl GuestConnection {
    fn may_read(&self) -> bool {
        self.has_more && self.unwritten.len() < MOST_UNWRITTEN && (self.is_closed || self.guest.may_be_read())
    }

    /// True if this is a TCP connection that has sent no byte and has never taken part.
    fn is_silent(&self) -> bool {
        matches!(self.line, Line::Tcp(_)) && !self.has_spoken && !self.guest.has_opened()
    }

    /// Reads once. The first result is true if the plant may have work.
    fn read(&mut self) -> (bool, Presence) {
        let mut room = [0; CHUNK];
        match self.line.read(&mut room) {
            Ok(0) => (true, Presence::Leaves),
            Ok(count) => {
                self.has_spoken = true;
                let heard = self.session.hear(&room[..count], &mut &*self.guest, &mut self.unwritten);
                let is_nonsense = heard.inspect_err(|length| self.guest.reject_length(*length)).is_err();
                self.has_more &= !is_nonsense;
                (true, if is_nonsense { Presence::Leaves } else { Presence::Stays })
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => {
                self.has_more = false;
                (false, Presence::Stays)
            }
            Err(error) if error.kind() == ErrorKind::Interrupted => (false, Presence::Stays),
            Err(_) => (true, Presence::Leaves),
        }
    }

    /// Writes as much of the pending output as the guest takes.
    fn write(&mut self) -> Presence {
        loop {
            while self.unwritten.len() < CHUNK
                && let Some(news) = self.guest.take_news()
            {
                match news {
                    GuestMessage::Heard { time_us, message } => {
                        self.session.encode(time_us, &message, &mut self.unwritten);
                    }
                    GuestMessage::Granted { time_us } => {
                        let bit = self.guest.bit_at(time_us);
                        self.session.grant(time_us, bit, &mut self.unwritten);
                    }
                }
            }
            if self.unwritten.is_empty() {
                return Presence::Stays;
            }
            match self.line.write(&self.unwritten) {
                Ok(0) => return Presence::Leaves,
                Ok(count) => drop(self.unwritten.drain(..count)),
                Err(error) if error.kind() == ErrorKind::WouldBlock => {
                    if self.session.loses_unread() {
                        self.unwritten.clear();
                        continue;
                    }
                    return Presence::Stays;
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(_) => return Presence::Leaves,
            }
        }
    }
}

/// True if the guest has disconnected while it was accepted. Such an error does not affect other guests.
fn is_of_the_guest(error: &io::Error) -> bool {
    matches!(error.kind(), ErrorKind::Interrupted | ErrorKind::ConnectionAborted | ErrorKind::ConnectionReset)
}

/// State of the thread.
pub(super) struct Io {
    poll: Poll,
    commands: Receiver<Command>,
    shared: Arc<Shared>,
    ring: Arc<dyn Fn() + Send + Sync>,
    stations: BTreeMap<usize, Station>,
    next_token: usize,
    complaints: LogLimiter,
    /// Time at which the doors try again to accept guests without an event.
    retry: Option<Instant>,
}

impl Io {
    /// Creates the state of the thread, and a waker for the thread.
    ///
    /// # Errors
    /// The operating system has no free descriptor.
    pub(super) fn new(
        commands: Receiver<Command>,
        shared: Arc<Shared>,
        ring: Arc<dyn Fn() + Send + Sync>,
    ) -> io::Result<(Self, Waker)> {
        let poll = Poll::new()?;
        let waker = Waker::new(poll.registry(), WAKER)?;
        Ok((
            Io {
                poll,
                commands,
                shared,
                ring,
                stations: BTreeMap::new(),
                next_token: 1,
                complaints: LogLimiter::default(),
                retry: None,
            },
            waker,
        ))
    }

    pub(super) fn run(mut self) {
        let mut events = Events::with_capacity(2 * MAX_GUESTS);
        loop {
            let waits = !self.stations.values().any(|it| matches!(it, Station::Guest(it) if it.may_read()));
            let retry = self.retry.map(|at| at.saturating_duration_since(Instant::now()));
            let timeout = if waits { retry } else { Some(Duration::ZERO) };
            if let Err(error) = self.poll.poll(&mut events, timeout)
                && error.kind() != ErrorKind::Interrupted
            {
                tracing::error!("the doors are shut: {error}");
                return;
            }
            for event in &events {
                if let Some(Station::Guest(connection)) = self.stations.get_mut(&event.token().0) {
                    let is_closed = event.is_read_closed() || event.is_error();
                    connection.has_more |= event.is_readable() || is_closed;
                    // A pseudo-terminal reports this, too, if a program closes it, but other programs may follow.
                    connection.is_closed |= is_closed && matches!(connection.line, Line::Tcp(_));
                }
            }
            if !self.obey() {
                return;
            }
            self.accept();
            self.attend();
        }
    }

    /// Executes the commands from the thread of the plant. Returns false if the thread must end.
    fn obey(&mut self) -> bool {
        while let Ok(command) = self.commands.try_recv() {
            match command {
                Command::Open { key, bus, spec, entrance, result } => {
                    let opened = self.open(key, bus, spec, entrance);
                    // The thread of the plant waits for this result. If that thread has ended, an error does not
                    // matter.
                    let _ = result.send(opened);
                }
                Command::Close { key } => {
                    let is_its = |station: &Station| match station {
                        Station::Listener { door, .. } => *door == key,
                        Station::Guest(connection) => connection.door == key,
                    };
                    let its: Vec<_> =
                        self.stations.iter().filter(|(_, it)| is_its(it)).map(|(token, _)| *token).collect();
                    its.into_iter().for_each(|token| self.remove(token));
                    self.shared.close(key);
                    (self.ring)();
                }
                Command::End => return false,
            }
        }
        true
    }

    fn token(&mut self) -> usize {
        self.next_token += 1;
        self.next_token
    }

    fn open(&mut self, door: usize, bus: BusIndex, spec: DoorSpec, entrance: Entrance) -> io::Result<()> {
        match entrance {
            Entrance::Tcp(mut listener) => {
                let token = self.token();
                self.poll.registry().register(&mut listener, Token(token), Interest::READABLE)?;
                self.stations.insert(token, Station::Listener { listener, door, bus, spec });
            }
            Entrance::Pty(pty) => self.let_in(door, bus, spec, Line::Pty(pty))?,
        }
        Ok(())
    }

    /// Accepts all guests that wait at a door.
    fn accept(&mut self) {
        let mut come = Vec::new();
        self.retry = None;
        for station in self.stations.values() {
            let Station::Listener { listener, door, bus, spec } = station else { continue };
            let now = Instant::now();
            // If guests come too fast, the remaining guests wait until other guests are served.
            let mut retry = Some(now);
            for _ in 0..MAX_GUESTS {
                match listener.accept() {
                    Ok((stream, _)) => come.push((*door, *bus, *spec, stream)),
                    Err(error) if error.kind() == ErrorKind::WouldBlock => {
                        retry = None;
                        break;
                    }
                    Err(error) if is_of_the_guest(&error) => {}
                    Err(error) => {
                        // No descriptor or memory is free. The guest waits, but the operating system reports
                        // its arrival only once, so the doors must try again after a time.
                        if let Some(others) = self.complaints.complains(now) {
                            tracing::warn!("{spec}: no guest can be accepted at the moment: {error}{others}");
                        }
                        retry = Some(now + RETRY);
                        break;
                    }
                }
            }
            self.retry = self.retry.into_iter().chain(retry).min();
        }
        for (door, bus, spec, stream) in come {
            // Frames are small and must not be delayed, and the operating system must not buffer many frames for or
            // from a guest that is not served.
            let _ = stream.set_nodelay(true);
            let _ = rustix::net::sockopt::set_socket_send_buffer_size(&stream, MOST_UNWRITTEN);
            let _ = rustix::net::sockopt::set_socket_recv_buffer_size(&stream, MOST_UNWRITTEN);
            if let Err(error) = self.let_in(door, bus, spec, Line::Tcp(stream)) {
                self.shared.refuse(door);
                if let Some(others) = self.complaints.complains(Instant::now()) {
                    tracing::warn!("{spec}: a guest was sent away: {error}{others}");
                }
            }
        }
    }

    fn let_in(&mut self, door: usize, bus: BusIndex, spec: DoorSpec, mut line: Line) -> io::Result<()> {
        let token = self.token();
        let interest = Interest::READABLE | Interest::WRITABLE;
        let registry = self.poll.registry();
        match &mut line {
            Line::Tcp(stream) => {
                descriptors::check_room()?;
                registry.register(stream, Token(token), interest)?;
            }
            Line::Pty(pty) => {
                registry.register(&mut SourceFd(&pty.master.as_raw_fd()), Token(token), interest)?;
            }
        }
        let guest = match self.shared.admit(bus, spec) {
            Err(NoPlace::Taken) if self.send_a_silent_one_away() => self.shared.admit(bus, spec),
            admitted => admitted,
        };
        let guest = guest.map_err(|error| io::Error::new(io::ErrorKind::QuotaExceeded, error))?;
        let session = spec.protocol().begin(spec.carrier(), &mut &*guest);
        let unwritten = Vec::new();
        let connection = GuestConnection {
            line,
            door,
            guest,
            session,
            has_more: true,
            is_closed: false,
            has_spoken: false,
            unwritten,
        };
        self.stations.insert(token, Station::Guest(Box::new(connection)));
        (self.ring)();
        Ok(())
    }

    /// Closes the connection with the longest silence, to free a place. Returns false if no connection is silent.
    fn send_a_silent_one_away(&mut self) -> bool {
        let silent = self.stations.iter_mut().find_map(|(token, station)| {
            let Station::Guest(connection) = station else { return None };
            if !connection.is_silent() {
                return None;
            }
            // A message of this guest may have arrived since the last read. So the connection is read before
            // it counts as silent.
            let (_, presence) = connection.read();
            (presence == Presence::Leaves || connection.is_silent()).then_some((*token, connection.door))
        });
        let Some((token, door)) = silent else { return false };
        self.shared.refuse(door);
        self.remove(token);
        true
    }

    fn remove(&mut self, token: usize) {
        if let Some(Station::Guest(mut connection)) = self.stations.remove(&token) {
            // Messages that the guest sent before it disconnected are still valid.
            connection.is_closed = true;
            for _ in 0..ROOM_TO_GUEST {
                if !connection.may_read() || connection.read().1 == Presence::Leaves {
                    break;
                }
            }
            connection.guest.leave();
            if !connection.guest.has_opened() {
                // The plant has not taken over this guest, so the guest can be removed here.
                self.shared.forget(&connection.guest);
            }
        }
    }

    /// Reads and writes once for each guest.
    fn attend(&mut self) {
        let (mut gone, mut is_news) = (Vec::new(), false);
        for (token, station) in &mut self.stations {
            let Station::Guest(connection) = station else { continue };
            let mut presence = Presence::Stays;
            if connection.may_read() {
                let (news, now) = connection.read();
                is_news |= news;
                presence = now;
            }
            if presence == Presence::Leaves || connection.write() == Presence::Leaves {
                gone.push(*token);
            }
        }
        for token in gone {
            self.remove(token);
            is_news = true;
        }
        if is_news {
            (self.ring)();
        }
    }
}
