//! The doors of an instance. The process that runs the plant uses them.

use super::descriptors;
use super::guest::{Guest, GuestState};
use super::io::{Command, Entrance, Io, Shared};
use super::pty::Pty;
use super::spec::{Carrier, DoorSpec};
use crate::identity::BusIndex;
use crate::memory::limits;
use mio::net::TcpListener;
use serde::{Deserialize, Serialize};
use std::io;
use std::net::{SocketAddr, SocketAddrV4};
use std::sync::Arc;
use std::sync::mpsc::{self, Sender};
use std::thread::JoinHandle;

/// A door could not be opened.
#[derive(Debug, thiserror::Error)]
#[error("{door}: {reason}{}", limits::named(.reason))]
pub struct DoorError {
    /// Specification of the door that failed.
    pub door: DoorSpec,
    /// Reason for which the door could not be opened.
    pub reason: io::Error,
}

/// State of an open door.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct DoorState {
    /// Specification of the door, with its real port or number.
    pub door: DoorSpec,
    /// The guests at the door.
    pub guests: Vec<GuestState>,
    /// Number of guests that were rejected because no place or no descriptor was free.
    pub refused: u64,
}

struct Door {
    bus: BusIndex,
    spec: DoorSpec,
    key: usize,
}

/// All doors. No function waits for a guest.
pub struct Doors {
    doors: Vec<Door>,
    guests: Vec<Arc<Guest>>,
    next_key: usize,
    is_stepped: bool,
    ring: Arc<dyn Fn() + Send + Sync>,
    io: Option<IoThread>,
}

/// The thread that does all work that could block.
struct IoThread {
    commands: Sender<Command>,
    shared: Arc<Shared>,
    waker: mio::Waker,
    thread: Option<JoinHandle<()>>,
}

impl IoThread {
    fn send(&self, command: Command) {
        // Sending fails only if the thread has ended. Then its guests have gone too, so the command is not
        // needed.
        let _ = self.commands.send(command);
        let _ = self.waker.wake();
    }
}

impl Doors {
    /// Creates a value without doors. `is_stepped` is true if the clock of the plant is stepped. The thread of the
    /// doors calls `ring` when a guest has a request.
    pub fn new(is_stepped: bool, ring: impl Fn() + Send + Sync + 'static) -> Self {
        Doors {
            doors: Vec::new(),
            guests: Vec::new(),
            next_key: 0,
            is_stepped,
            ring: Arc::new(ring),
            io: None,
        }
    }

    /// True if there is neither a door nor a guest.
    #[inline]
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.doors.is_empty() && self.guests.is_empty()
    }

    /// Opens a door to a bus, and returns the specification of the door with the real port or number.
    ///
    /// # Errors
    /// [`DoorError`]: the address is in use or does not belong to this machine, no pseudo-terminal or no
    /// place for its guest is free, or only reserved descriptors are free. After an error the door is not
    /// open.
    pub fn open(&mut self, bus: BusIndex, door: DoorSpec) -> Result<DoorSpec, DoorError> {
        self.try_open(bus, door).map_err(|reason| DoorError { door, reason })
    }

    fn try_open(&mut self, bus: BusIndex, door: DoorSpec) -> io::Result<DoorSpec> {
        let (entrance, spec) = match door.carrier() {
            Carrier::Tcp(at) => {
                let listener = TcpListener::bind(SocketAddr::V4(at))?;
                descriptors::check_room()?;
                let port = listener.local_addr()?.port();
                (Entrance::Tcp(listener), door.over(Carrier::Tcp(SocketAddrV4::new(*at.ip(), port))))
            }
            Carrier::Pty(None) => {
                let pty = Pty::open()?;
                descriptors::check_room()?;
                let number = Some(pty.number);
                (Entrance::Pty(pty), door.over(Carrier::Pty(number)))
            }
            Carrier::Pty(Some(_)) => {
                let name = door.over(Carrier::Pty(None));
                let text = format!("the system chooses the number of a pseudo-terminal; write {name}");
                return Err(io::Error::new(io::ErrorKind::InvalidInput, text));
            }
        };
        let key = self.next_key;
        self.next_key += 1;
        let (result, opened) = mpsc::sync_channel(1);
        self.io()?.send(Command::Open { key, bus, spec, entrance, result });
        // This wait is short, because the thread never blocks.
        opened.recv().map_err(|_| io::Error::other("the thread of the doors has ended; see the log"))??;
        self.doors.push(Door { bus, spec, key });
        Ok(spec)
    }

    /// Returns the thread, which the first call starts.
    fn io(&mut self) -> io::Result<&IoThread> {
        if self.io.is_none() {
            let (commands, heard) = mpsc::channel();
            let shared = Arc::new(Shared::new(self.is_stepped));
            let (io, waker) = Io::new(heard, Arc::clone(&shared), Arc::clone(&self.ring))?;
            let thread = std::thread::Builder::new().name("doors".to_owned()).spawn(move || io.run())?;
            self.io = Some(IoThread { commands, shared, waker, thread: Some(thread) });
        }
        self.io.as_ref().ok_or_else(|| io::ErrorKind::NotConnected.into())
    }

    /// Closes this door of a bus, or all its doors, and disconnects their guests. Returns the number of closed doors.
    pub fn close(&mut self, bus: BusIndex, door: Option<DoorSpec>) -> usize {
        let before = self.doors.len();
        let is_meant = |it: &mut Door| it.bus == bus && door.is_none_or(|door| door == it.spec);
        let closed: Vec<Door> = self.doors.extract_if(.., is_meant).collect();
        if let Some(io) = &self.io {
            closed.iter().for_each(|door| io.send(Command::Close { key: door.key }));
        }
        before - self.doors.len()
    }

    /// Returns the doors of a bus, in the order in which they were opened.
    #[must_use]
    pub fn of_bus(&self, bus: BusIndex) -> Vec<DoorState> {
        let is_its =
            |guest: &Guest, spec| guest.bus == bus && guest.door == spec && !guest.requests().has_gone;
        let guests = |spec| self.guests.iter().filter(move |guest| is_its(guest, spec));
        let of_bus = self.doors.iter().filter(|door| door.bus == bus);
        let state = |door: &Door| DoorState {
            door: door.spec,
            guests: guests(door.spec).map(|guest| guest.state()).collect(),
            refused: self.io.as_ref().map_or(0, |io| io.shared.refused(door.key)),
        };
        of_bus.map(state).collect()
    }

    /// Returns all guests, including those that have connected since the last call.
    pub fn guests(&mut self) -> &[Arc<Guest>] {
        if let Some(io) = &self.io {
            io.shared.take_new(&mut self.guests);
        }
        &self.guests
    }

    /// Removes a disconnected guest.
    pub fn forget(&mut self, guest: &Arc<Guest>) {
        self.guests.retain(|it| !Arc::ptr_eq(it, guest));
        if let Some(io) = &self.io {
            io.shared.forget(guest);
        }
    }

    /// Wakes the thread, because there is new traffic for guests.
    pub fn announce(&self) {
        if let Some(io) = &self.io {
            let _ = io.waker.wake();
        }
    }
}

impl Drop for Doors {
    fn drop(&mut self) {
        let Some(mut io) = self.io.take() else { return };
        io.send(Command::End);
        if let Some(thread) = io.thread.take() {
            // `join` fails only if the thread has panicked. Nothing depends on the thread any more, so the error is
            // ignored.
            let _ = thread.join();
        }
    }
}
