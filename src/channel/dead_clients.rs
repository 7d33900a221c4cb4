//! Finds clients that have died.
//!
//! A killed client cannot withdraw its request, so the request looks as if the client still waited. It also leaves its
//! snapshots, and its files and shared memory objects. iceoryx2 can detect the dead node of the client. This query needs
//! system calls, and in a damaged channel it may never return, so a separate thread runs it at intervals.

use super::domain::Domain;
use iceoryx2::identifiers::UniqueNodeId;
use std::sync::mpsc::{self, Receiver, TryRecvError};
use std::time::{Duration, Instant};

/// Real time between two searches for dead clients, while requests wait.
pub(super) const INTERVAL: Duration = Duration::from_millis(200);
/// The same while no request waits, and a dead client could only have left objects, snapshots or files.
pub(super) const LONG_INTERVAL: Duration = Duration::from_secs(2);

/// Queries iceoryx2 for dead clients.
#[derive(Default)]
pub(super) struct DeadClients {
    last: Option<Instant>,
    /// Receiver of the next result.
    asked: Option<Receiver<Vec<UniqueNodeId>>>,
    /// The last result. The caller has dropped the requests of these nodes, so the next query removes their objects.
    known: Vec<UniqueNodeId>,
}

impl DeadClients {
    /// Returns the nodes that the last query has found dead; `None` if there is no new result. Such a call takes almost
    /// no time. A new query begins `interval` after the last one. It removes the objects of the nodes that the last call
    /// with a result has returned.
    pub(crate) fn look(&mut self, domain: &Domain, interval: Duration) -> Option<Vec<UniqueNodeId>> {
        if let Some(answer) = &self.asked {
            return match answer.try_recv() {
                // A query that never returns is not repeated.
                Err(TryRecvError::Empty) => None,
                answer => {
                    self.asked = None;
                    self.known = answer.clone().unwrap_or_default();
                    answer.ok()
                }
            };
        }
        let last = *self.last.get_or_insert_with(Instant::now);
        if last.elapsed() >= interval {
            self.last = Some(Instant::now());
            let (send, receive) = mpsc::channel();
            let (domain, known) = (domain.clone(), core::mem::take(&mut self.known));
            let query = move || {
                domain.remove_objects_of(&known);
                send.send(domain.dead_nodes())
            };
            let thread = std::thread::Builder::new().name("channel".to_owned());
            // If the thread cannot be started, the next call tries again.
            self.asked = thread.spawn(query).ok().map(|_| receive);
        }
        None
    }
}
