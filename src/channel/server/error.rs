//! Errors of the server's side.

use super::ROOM;
use crate::channel::domain::RootError;
use crate::memory::{limits, room};
use iceoryx2::node::NodeCreationFailure;
use iceoryx2::service::builder::request_response::RequestResponseOpenError as OpenError;

/// The reason why the channel cannot be opened. The emulator can continue without it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ServerError {
    /// The channel's directory cannot be used.
    #[error(transparent)]
    Root(#[from] RootError),
    /// Another server holds the channel.
    #[error(
        "instance '{instance}': another emulator already serves the channel; end it or choose another name"
    )]
    AlreadyServed {
        /// Name of the instance; another emulator serves its channel.
        instance: String,
    },
    /// A client of another version still uses the old service.
    #[error(
        "instance '{instance}': a client of another version is still connected ({reason:?}); end it first"
    )]
    Incompatible {
        /// Name of the instance to which the client of another version is connected.
        instance: String,
        /// Error of iceoryx2 when the server opens the channel.
        reason: OpenError,
    },
    /// The memory file system is nearly full.
    #[error("instance '{instance}': /dev/shm has only {free_kib} KiB left, the channel needs {} KiB", ROOM / 1024)]
    NoRoom {
        /// Name of the instance that the server wants to start.
        instance: String,
        /// Free space in `/dev/shm`, in KiB.
        free_kib: u64,
    },
    /// iceoryx2 cannot create a node.
    #[error(
        "instance '{instance}': no iceoryx2 node ({reason:?}); is /dev/shm full or not writable?{}{}",
        limits::describe_file_limit(),
        room::describe_lack()
    )]
    Node {
        /// Name of the instance that the server wants to start.
        instance: String,
        /// Error of iceoryx2 at the creation of the node.
        reason: NodeCreationFailure,
    },
    /// iceoryx2 cannot create the service or its server port.
    #[error(
        "instance '{instance}': no iceoryx2 service ({reason}); is /dev/shm full or not writable?{}{}{}",
        limits::describe_space_limit(),
        limits::describe_file_limit(),
        room::describe_lack()
    )]
    Service {
        /// Name of the instance that the server wants to start.
        instance: String,
        /// Error of iceoryx2 in words.
        reason: String,
    },
}
