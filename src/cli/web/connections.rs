//! The open connections of clients. Any user of the machine can open connections, so their number is limited. If the
//! limit is reached, the oldest connection that has not shown a token is closed.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::Notify;

/// Maximum number of open connections.
const MAX_OPEN: usize = 256;
/// Number of file descriptors that the server needs in addition to those of its connections.
const OTHER_FILES: u64 = 64;
/// Limit of open files that the server requests: enough for all connections, and for several instances.
pub(super) const WISHED_FILES: u64 = MAX_OPEN as u64 + 16 * OTHER_FILES;
/// Minimum number of connections, even if the limit of descriptors is lower.
const LEAST_OPEN: usize = 8;

/// Returns the maximum number of connections that the limit of open files of this process allows. The remaining
/// descriptors are for connections to emulators.
pub(super) fn max_open() -> usize {
    let limit = rustix::process::getrlimit(rustix::process::Resource::Nofile).current.unwrap_or(u64::MAX);
    let room = usize::try_from(limit.saturating_sub(OTHER_FILES)).unwrap_or(MAX_OPEN);
    room.clamp(LEAST_OPEN, MAX_OPEN)
}

/// The client at the other end of a connection.
#[derive(Default)]
pub(super) struct Peer {
    /// True if one of its requests had a valid token or key.
    is_trusted: AtomicBool,
    /// Notified when the connection has to be closed.
    close: Notify,
}

impl Peer {
    /// Marks the connection as trusted: from now on the server does not close it for the benefit of others.
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
    /// Creates a list with room for `max` connections.
    pub(super) fn new(max: usize) -> Self {
        Self { open: Arc::default(), max }
    }

    fn open(&self) -> MutexGuard<'_, VecDeque<Arc<Peer>>> {
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Adds a new connection. If there are too many, closes the oldest one without a token. Returns `None` if all
    /// existing connections have shown a token.
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

/// An open connection. The number of connections includes it until this value is dropped.
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
