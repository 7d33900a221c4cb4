//! The instances that the server serves, and its connections to them.

use super::events::Feed;
use super::link::Link;
use super::problem::Problem;
use super::uploads::Uploads;
use crate::cli::error::CliError;
use crate::cli::session::images_of;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// The instances that are served.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Served {
    /// Only the instance of this name.
    One(String),
    /// All running instances of this user.
    All,
}

/// The connections to an instance. Operations that change nothing use a separate connection, so that the emulator
/// answers them while another operation advances the clock.
pub(super) struct InstanceLinks {
    pub looks: Link,
    pub acts: Link,
    pub feed: Feed,
    pub uploads: Arc<Uploads>,
    /// Distinguishes these connections from those to another emulator of the same instance.
    id: Arc<()>,
}

type Links = HashMap<String, Arc<InstanceLinks>>;

/// The instances and the connections to them.
pub(super) struct Hub {
    served: Served,
    links: Arc<Mutex<Links>>,
}

impl Hub {
    pub(super) fn new(served: Served) -> Self {
        Self { served, links: Arc::default() }
    }

    /// True if requests may name this instance.
    pub(super) fn serves(&self, instance: &str) -> bool {
        match &self.served {
            Served::One(served) => served == instance,
            Served::All => true,
        }
    }

    /// Returns the connections to an instance.
    ///
    /// # Errors
    /// The server does not serve the instance, or the instance is not running.
    pub(super) fn find(&self, instance: &str) -> Result<Arc<InstanceLinks>, Problem> {
        if !self.serves(instance) {
            return Err(Problem::not_found(format!("this server does not serve an instance '{instance}'")));
        }
        let mut links = self.links.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = links.get(instance) {
            return Ok(Arc::clone(found));
        }
        images_of(instance)?;
        let id = Arc::default();
        let new = Arc::new(InstanceLinks {
            looks: Link::start(instance, self.forgetting(instance, &id))?,
            acts: Link::start(instance, self.forgetting(instance, &id))?,
            feed: Feed::new(instance),
            uploads: Arc::default(),
            id,
        });
        links.insert(instance.to_owned(), Arc::clone(&new));
        Ok(new)
    }

    /// Returns a function that closes the connections with this `id` to an instance. Nobody may ever name an ended
    /// instance again, so its connections must not wait for the next request.
    fn forgetting(&self, instance: &str, id: &Arc<()>) -> impl Fn() + Send + 'static {
        let (links, instance, id) = (Arc::downgrade(&self.links), instance.to_owned(), Arc::clone(id));
        move || {
            let Some(links) = links.upgrade() else { return };
            let mut links = links.lock().unwrap_or_else(PoisonError::into_inner);
            if links.get(&instance).is_some_and(|of_instance| Arc::ptr_eq(&of_instance.id, &id)) {
                links.remove(&instance);
            }
        }
    }

    /// Drops the files that a session has sent in parts and nobody can use any more.
    pub(super) fn drop_files_of(&self, session: &str) {
        let links = self.links.lock().unwrap_or_else(PoisonError::into_inner);
        links.values().for_each(|links| drop(links.uploads.take(session)));
    }

    /// Closes the connections to an instance that has ended. Their threads end after their last jobs.
    pub(super) fn forget(&self, instance: &str) {
        self.links.lock().unwrap_or_else(PoisonError::into_inner).remove(instance);
    }
}

impl From<crate::memory::MemoryError> for Problem {
    fn from(error: crate::memory::MemoryError) -> Self {
        CliError::Memory(error).into()
    }
}
