//! Finds clients that have died during their requests.
//!
//! A killed client cannot withdraw its request, so the request looks as if the client still waited. iceoryx2 can detect
//! the dead node of the client. This query needs system calls, and in a damaged channel it may never return, so a
//! separate thread runs it at intervals.

use super::domain::Domain;
use iceoryx2::identifiers::UniqueNodeId;
use std::sync::mpsc::{self, Receiver, TryRecvError};
use std::time::{Duration, Instant};

/// Real time between two searches for dead clients.
const INTERVAL: Duration = Duration::from_millis(200);

/// Queries iceoryx2 for dead clients.
#[derive(Default)]
pub(super) struct DeadClients {
    last: Option<Instant>,
    /// Receiver of the next result.
    asked: Option<Receiver<Vec<UniqueNodeId>>>,
}

impl DeadClients {
    /// Returns the nodes that were found dead since the last call. A call takes almost no time while there is no
    /// result.
    pub(crate) fn look(&mut self, domain: &Domain) -> Vec<UniqueNodeId> {
        if let Some(answer) = &self.asked {
            return match answer.try_recv() {
                // A query that never returns is not repeated.
                Err(TryRecvError::Empty) => Vec::new(),
                answer => {
                    self.asked = None;
                    answer.unwrap_or_default()
                }
            };
        }
        let last = *self.last.get_or_insert_with(Instant::now);
        if last.elapsed() >= INTERVAL {
            self.last = Some(Instant::now());
            let (send, receive) = mpsc::channel();
            let domain = domain.clone();
            let thread = std::thread::Builder::new().name("channel".to_owned());
            // If the thread cannot be started, the next call tries again.
            self.asked = thread.spawn(move || send.send(domain.dead_nodes())).ok().map(|_| receive);
        }
        Vec::new()
    }
}
