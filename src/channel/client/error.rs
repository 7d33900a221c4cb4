//! Errors of the client's side.

use super::ROOM;
use crate::channel::domain::{MAX_CLIENTS, RootError};
use crate::channel::wire::{DecodeError, WIRE_VERSION};
use crate::memory::{limits, room};
use crate::request::{MAX_OPS, Refused};
use iceoryx2::service::builder::request_response::RequestResponseOpenError as OpenError;
use std::path::PathBuf;
use std::time::Duration;

/// Returns the reason for the end of an emulator, as a part of a message.
fn reason(killed: Option<u32>) -> String {
    killed.map_or_else(String::new, |pid| {
        format!(
            ": its process {pid} ended without an answer, so it was probably killed or has crashed; its last messages are on its \
             standard error output or in the file of `run --log`"
        )
    })
}

/// The reason why a request got no replies.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ClientError {
    /// No emulator serves the channel.
    #[error("instance '{instance}' is not running (no channel in {root}); start it with `commram run`")]
    NotRunning {
        /// Name of the instance that the client wants to connect to.
        instance: String,
        /// Directory with the channels of all instances, as the message shows it.
        root: String,
    },
    /// The channel's directory cannot be used.
    #[error(transparent)]
    Root(#[from] RootError),
    /// Another program has emptied a part of the channel.
    #[error("instance '{instance}': the channel is damaged, {} is empty; restart the emulator (`commram stop` ends it)", .path.display())]
    Damaged {
        /// Name of the instance with the damaged channel.
        instance: String,
        /// Path of the empty file of the channel.
        path: PathBuf,
    },
    /// Entering takes too long: iceoryx2 waits for a part that another program has damaged.
    #[error(
        "instance '{instance}': the channel cannot be entered within {after:?}, a part of it may be damaged; end \
            the emulator with `commram stop -i {instance}`, and remove its remaining files with `commram stop \
            --clean -i {instance}`"
    )]
    Stuck {
        /// Name of the instance that the client wants to connect to.
        instance: String,
        /// Real time for which the client has tried to enter the channel.
        after: Duration,
    },
    /// The operating system cannot start a thread, which a client needs to enter the channel with a time limit.
    #[error("instance '{instance}': a client cannot start a thread: {reason}{}", limits::named(.reason))]
    NoThread {
        /// Name of the instance that the client wants to connect to.
        instance: String,
        /// Error of the operating system at the start of the thread.
        reason: std::io::Error,
    },
    /// A part of the channel is invalid.
    #[error(
        "instance '{instance}': the channel is damaged; end the emulator with `commram stop -i {instance}`, and \
            remove its remaining files with `commram stop --clean -i {instance}`"
    )]
    Broken {
        /// Name of the instance with the damaged channel.
        instance: String,
    },
    /// The memory file system is nearly full.
    #[error("instance '{instance}': /dev/shm has only {free_kib} KiB left, a client needs {} KiB", ROOM / 1024)]
    NoRoom {
        /// Name of the instance that the client wants to connect to.
        instance: String,
        /// Free space in `/dev/shm`, in KiB.
        free_kib: u64,
    },
    /// The limit of open files of this process is too low.
    #[error(
        "instance '{instance}': a client would have {needed} open files, and this process may have {most}: raise that \
         limit (`ulimit -n`)"
    )]
    OpenFiles {
        /// Name of the instance that the client wants to connect to.
        instance: String,
        /// Number of open files that the client needs.
        needed: u64,
        /// Number of open files that the process may have.
        most: u64,
    },
    /// The limit of the address space of this process is too low.
    #[error(
        "instance '{instance}': a client would have {} KiB of address space, and this process may have {}: raise that \
         limit (`ulimit -v`)", .needed.div_ceil(1024), .most / 1024
    )]
    AddressSpace {
        /// Name of the instance that the client wants to connect to.
        instance: String,
        /// Address space that the client needs, in bytes.
        needed: u64,
        /// Address space that the process may have, in bytes.
        most: u64,
    },
    /// Too many clients are connected.
    #[error(
        "instance '{instance}' already has {} clients, which is the maximum; end one of them",
        MAX_CLIENTS
    )]
    TooManyClients {
        /// Name of the instance, which has the maximum number of clients.
        instance: String,
    },
    /// The emulator has a version with another format.
    #[error(
        "instance '{instance}': its channel has {found}, the channel of this commram ({}) has format {WIRE_VERSION} \
         ({reason:?}); use the commram version of the emulator",
        env!("CARGO_PKG_VERSION")
    )]
    Incompatible {
        /// Name of the instance; its channel has another format.
        instance: String,
        /// Format of the emulator's channel.
        found: String,
        /// Error of iceoryx2 when the client opens the channel.
        reason: OpenError,
    },
    /// iceoryx2 cannot connect.
    #[error(
        "instance '{instance}': no connection to the channel ({reason}){}{}",
        limits::describe_file_limit(),
        room::describe_lack()
    )]
    Connect {
        /// Name of the instance that the client wants to connect to.
        instance: String,
        /// Error of iceoryx2 in words.
        reason: String,
    },
    /// The emulator's process has ended.
    #[error("instance '{instance}' has ended{}; start it again and connect again", reason(*.killed))]
    EmulatorGone {
        /// Name of the instance; its emulator has ended.
        instance: String,
        /// Process id of the emulator, if it has ended without an answer: it was probably killed or has crashed.
        killed: Option<u32>,
    },
    /// The emulator was killed, and another one has taken the instance over.
    #[error(
        "the emulator of instance '{instance}' (process {pid}) was killed, and another one runs now; connect again"
    )]
    Replaced {
        /// Name of the instance that another emulator runs now.
        instance: String,
        /// Process id of the killed emulator.
        pid: u32,
    },
    /// The emulator runs, but did not answer in time.
    #[error("instance '{instance}' did not answer within {} ms; is it busy or stopped?", .after.as_millis())]
    Timeout {
        /// Name of the instance that did not answer.
        instance: String,
        /// Real time for which the client waited for the answer.
        after: Duration,
    },
    /// The request has too many operations.
    #[error("{count} operations in one request are too many, at most {MAX_OPS}; split the request")]
    TooManyOperations {
        /// Number of operations in the refused request.
        count: usize,
    },
    /// The request could not be sent.
    #[error("instance '{instance}': the request could not be sent ({reason})")]
    Send {
        /// Name of the instance to which the request was addressed.
        instance: String,
        /// Error of iceoryx2 in words.
        reason: String,
    },
    /// The emulator closed the request without an answer.
    #[error("instance '{instance}' closed the request without an answer; is /dev/shm full?")]
    Unanswered {
        /// Name of the instance to which the request was addressed.
        instance: String,
    },
    /// The reply is malformed.
    #[error(transparent)]
    Reply(#[from] DecodeError),
    /// The reply does not fit the operation.
    #[error(
        "instance '{instance}' gave a reply that does not fit the operation; use the same version on both sides"
    )]
    WrongReply {
        /// Name of the instance that gave the reply.
        instance: String,
    },
    /// The emulator refused the operation.
    #[error(transparent)]
    Refused(#[from] Refused),
}

impl ClientError {
    /// True if a later attempt may succeed: the emulator may still be starting.
    pub(super) fn may_pass(&self) -> bool {
        matches!(self, Self::NotRunning { .. } | Self::Connect { .. } | Self::Broken { .. })
    }
}
