//! Which clients have died while requests of theirs are under way.
//!
//! A client that is killed takes nothing back, so its request looks as if it still waited for the answer. iceoryx2 knows its
//! node for dead, but asking takes system calls and, in a damaged channel, may take for ever: a thread asks now and then.

use super::domain::Domain;
use iceoryx2::identifiers::UniqueNodeId;
use std::sync::mpsc::{self, Receiver, TryRecvError};
use std::time::{Duration, Instant};

/// How often it is asked.
const INTERVAL: Duration = Duration::from_millis(200);

/// Asks who has died.
#[derive(Default)]
pub(super) struct Departed {
    last: Option<Instant>,
    /// The answer to come.
    asked: Option<Receiver<Vec<UniqueNodeId>>>,
}

impl Departed {
    /// The nodes of those found dead since the last look. Costs nothing to speak of while nothing is known.
    pub(crate) fn look(&mut self, domain: &Domain) -> Vec<UniqueNodeId> {
        if let Some(answer) = &self.asked {
            return match answer.try_recv() {
                // One that does not come any more is not asked for again.
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
            // If no thread can be had, the next look tries again.
            self.asked = thread.spawn(move || send.send(domain.dead_nodes())).ok().map(|_| receive);
        }
        Vec::new()
    }
}
