//! Creates the ports of the channel.

use super::{Port, ROOM, ServerError};
use crate::channel::domain::{Domain, Ipc, Service};
use crate::channel::wire::MAX_REPLY_BLOCKS;
use crate::memory::room;
use iceoryx2::node::NodeCreationFailure;
use iceoryx2::prelude::{BackpressureStrategy, Node};
use iceoryx2::service::builder::request_response::{
    RequestResponseCreateError as CreateError, RequestResponseOpenError as OpenError,
    RequestResponseOpenOrCreateError as OpenOrCreateError,
};
use iceoryx2::service::port_factory::server::ServerCreateError;

/// Checks that the memory file system is not nearly full. iceoryx2 uses memory without reserving it, and an access to
/// missing memory kills the process (SIGBUS).
pub(super) fn need_room(instance: &str) -> Result<(), ServerError> {
    match room::free() {
        Some(free) if free < ROOM => {
            Err(ServerError::NoRoom { instance: instance.to_owned(), free_kib: free / 1024 })
        }
        _ => Ok(()),
    }
}

/// The reason why the ports cannot be created.
pub(super) enum OpenFailure {
    /// The service is incomplete or broken. A sweep of the domain repairs this.
    Wedged,
    Incompatible(OpenError),
    AlreadyServed,
    Node(NodeCreationFailure),
    Other(String),
}

impl OpenFailure {
    pub(super) fn into_error(self, instance: &str) -> ServerError {
        let instance = instance.to_owned();
        match self {
            Self::Wedged => ServerError::Service { instance, reason: "it hangs in creation".into() },
            Self::Incompatible(reason) => ServerError::Incompatible { instance, reason },
            Self::AlreadyServed => ServerError::AlreadyServed { instance },
            Self::Node(reason) => ServerError::Node { instance, reason },
            Self::Other(reason) => ServerError::Service { instance, reason },
        }
    }
}

impl From<OpenOrCreateError> for OpenFailure {
    fn from(error: OpenOrCreateError) -> Self {
        match error {
            OpenOrCreateError::RequestResponseOpenError(
                OpenError::HangsInCreation | OpenError::ServiceInCorruptedState,
            )
            | OpenOrCreateError::RequestResponseCreateError(
                CreateError::HangsInCreation | CreateError::ServiceInCorruptedState,
            ) => Self::Wedged,
            OpenOrCreateError::RequestResponseOpenError(
                reason @ (OpenError::IncompatibleRequestOrResponseType
                | OpenError::DoesNotSupportRequestedAmountOfClients
                | OpenError::DoesNotSupportRequestedAmountOfNodes
                | OpenError::VersionMismatch),
            ) => Self::Incompatible(reason),
            other => Self::Other(other.to_string()),
        }
    }
}

/// Creates the ports of the instance, on a separate node.
pub(super) fn ports(instance: &str, domain: &Domain) -> Result<(Node<Ipc>, Service<Ipc>, Port), OpenFailure> {
    if !domain.is_new() {
        domain.remove_half_made();
    }
    let node = domain.owners_node().map_err(OpenFailure::Node)?;
    if !domain.is_new() {
        domain.clean_up_after_the_dead(&node);
    }
    let builder = Domain::service(&node).ok_or_else(|| OpenFailure::Other(instance.to_owned()))?;
    let service = builder.open_or_create()?;
    let port = service
        .server_builder()
        .initial_max_slice_len(MAX_REPLY_BLOCKS)
        .max_loaned_responses_per_request(1)
        .backpressure_strategy(BackpressureStrategy::DiscardData)
        .create()
        .map_err(|reason| match reason {
            ServerCreateError::ExceedsMaxSupportedServers => OpenFailure::AlreadyServed,
            other => OpenFailure::Other(format!("{other:?}")),
        })?;
    Ok((node, service, port))
}
