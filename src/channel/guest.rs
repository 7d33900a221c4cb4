//! A client in a domain. It enters and leaves the domain with a time limit.
//!
//! Entering and leaving run in a separate thread ([`limit`]). The result then moves to the calling thread. So clients
//! use the variant of iceoryx2 with objects that may move to another thread.

use super::client::ClientError;
use super::domain::{Domain, Threads};
use super::limit::{self, LimitError};
use super::passage;
use iceoryx2::node::NodeCreationFailure;
use iceoryx2::prelude::Node;
use std::time::Duration;

/// A client in a domain. Dropping it leaves the domain.
pub(super) struct Guest {
    /// The node of the client; `None` only while the client leaves the channel.
    node: Option<Node<Threads>>,
    domain: Domain,
}

impl Guest {
    /// Enters a domain. May never return: see [`enter_within`].
    pub(crate) fn enter(domain: Domain) -> Result<Self, NodeCreationFailure> {
        // A failed attempt to create the node leaves files. The guest is created first, so that dropping it
        // removes these files.
        let mut guest = Guest { node: None, domain };
        guest.node = Some(guest.domain.node()?);
        Ok(guest)
    }

    /// Returns the node of the client; `None` while it leaves.
    pub(crate) fn node(&self) -> Option<&Node<Threads>> {
        self.node.as_ref()
    }

    pub(crate) fn domain(&self) -> &Domain {
        &self.domain
    }
}

impl Drop for Guest {
    fn drop(&mut self) {
        let (node, domain) = (self.node.take(), self.domain.clone());
        let left = limit::on_a_thread(limit::SHORT, move || {
            drop(node);
            passage::leave(&domain);
        });
        match left {
            Ok(()) => {}
            // The node is dropped already.
            Err(LimitError::NoThread(_)) => passage::leave(&self.domain),
            Err(LimitError::Late | LimitError::Ended) => {
                tracing::debug!("leaving a damaged channel takes too long; its thread is abandoned");
            }
        }
    }
}

/// Calls `enter`, which enters the channel of `instance`, in a separate thread, and waits at most `limit` for its result.
///
/// # Errors
/// The error of `enter`, [`ClientError::Stuck`] if the time is over, or [`ClientError::NoThread`].
pub(super) fn enter_within<R: Send + 'static>(
    limit: Duration,
    instance: &str,
    enter: impl FnOnce() -> Result<R, ClientError> + Send + 'static,
) -> Result<R, ClientError> {
    limit::on_a_thread(limit, enter).unwrap_or_else(|why| {
        let instance = instance.to_owned();
        Err(match why {
            LimitError::Late => ClientError::Stuck { instance, after: limit },
            LimitError::Ended => ClientError::Broken { instance },
            LimitError::NoThread(reason) => ClientError::NoThread { instance, reason },
        })
    })
}
