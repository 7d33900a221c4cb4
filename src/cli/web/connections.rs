//! The open connections. Any user of the machine can open some, so their number is limited, and a connection that has
//! not shown a token makes room for a new one.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::Notify;

/// Maximum number of open connections.
const MAX_OPEN: usize = 256;
/// File descriptors that the server needs besides its connections.
const OTHER_FILES: u64 = 64;
/// Open files that the server asks for: for all connections, and for several instances.
pub(super) const WISHED_FILES: u64 = MAX_OPEN as u64 + 16 * OTHER_FILES;
/// Minimum number of connections, regardless of the limit of descriptors.
const LEAST_OPEN: usize = 8;

/// Maximum number of connections with the process's limit of open files: an accepted connection must not take the
/// descriptors that a connection to an emulator needs.
pub(super) fn max_open() -> usize {
    let limit = rustix::process::getrlimit(rustix::process::Resource::Nofile).current.unwrap_or(u64::MAX);
    let room = usize::try_from(limit.saturating_sub(OTHER_FILES)).unwrap_or(MAX_OPEN);
    room.clamp(LEAST_OPEN, MAX_OPEN)
}

/// The other end of a connection.
#[derive(Default)]
pub(super) struct Peer {
    /// True if one of its requests had a valid token or cookie.
    is_trusted: AtomicBool,
    /// Closes the connection.
    close: Notify,
}

impl Peer {
    /// From now on the connection does not make room for others.
    pub(super) fn trust(&self) {
        self.is_trusted.store(true, Ordering::Relaxed);
    }

    /// Waits until the connection has to be closed.
    pub(super) async fn closed(&self) {
        self.close.notified().await;
    }
}

/// All open connections, the oldest first.
#[derive(Clone)]
pub(super) struct Connections {
    open: Arc<Mutex<VecDeque<Arc<Peer>>>>,
    max: usize,
}

impl Connections {
    /// Room for `max` connections.
    pub(super) fn new(max: usize) -> Self {
        Self { open: Arc::default(), max }
    }

    fn open(&self) -> MutexGuard<'_, VecDeque<Arc<Peer>>> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a new connection, and closes the oldest one without a token if there are too many. `None` if all existing
    /// connections have shown a token.
    pub(super) fn enter(&self) -> Option<OpenConnection> {
        let mut open = self.open();
        if open.len() >= self.max {
            let oldest = open.iter().position(|peer| !peer.is_trusted.load(Ordering::Relaxed))?;
            open.remove(oldest)?.close.notify_one();
        }
        let peer = Arc::<Peer>::default();
        open.push_back(Arc::clone(&peer));
        Some(OpenConnection { peer, all: self.clone() })
    }
}

/// A connection, counted until it is dropped.
pub(super) struct OpenConnection {
    pub peer: Arc<Peer>,
    all: Connections,
}

impl Drop for OpenConnection {
    fn drop(&mut self) {
        self.all.open().retain(|peer| !Arc::ptr_eq(peer, &self.peer));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strangers_make_room_and_trusted_connections_stay() {
        let all = Connections::new(MAX_OPEN);
        let mut open: Vec<_> = (0..MAX_OPEN).map(|_| all.enter().unwrap()).collect();
        open[0].peer.trust();
        let new = all.enter().unwrap();
        let listed = |peer: &Arc<Peer>| all.open().iter().any(|known| Arc::ptr_eq(known, peer));
        assert!(listed(&open[0].peer) && !listed(&open[1].peer) && listed(&new.peer));
        open.iter().for_each(|connection| connection.peer.trust());
        new.peer.trust();
        assert!(all.enter().is_none());
        open.clear();
        drop(new);
        assert!(all.open().is_empty());
    }
}
