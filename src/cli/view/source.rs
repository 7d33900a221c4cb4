//! Data source of the view: the channel of an emulator; in tests a plant in the same process.

use crate::channel::{Client, ClientError};
use crate::cli::error::CliError;
use crate::cli::instance::Instance;
use crate::cli::session::{Session, send};
use crate::identity::DeviceIndex;
use crate::memory::{AttachMode, Attached, Header, Image};
use crate::request::{Code, Op, Reply};
use std::time::Duration;

/// Time limit for the reply to a poll. It is short, because the view polls a busy emulator again soon.
const LOOK: Duration = Duration::from_millis(500);
/// Time limit for the reply to a task that advances the clock. If the client stops waiting, the emulator cancels the
/// task.
const WORK: Duration = Duration::from_secs(10);

/// The reason why a reply is missing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum RequestError {
    /// The emulator did not reply in time: it advances the clock for another client.
    Busy,
    /// The emulator has ended; the text is the reason.
    Gone(String),
    /// The emulator refused the request; the text is the reason.
    Refused(String),
}

/// Kind of a request, which decides how long the client waits for the reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RequestKind {
    /// A poll, which is repeated soon.
    Poll,
    /// A task, which must be completed.
    Task,
}

/// A data source of the view.
pub(super) trait Source {
    /// Sends operations as one request. Returns a reply for each operation.
    ///
    /// # Errors
    /// The emulator does not reply, or it refuses the request.
    fn request(&mut self, ops: &[Op], kind: RequestKind) -> Result<Vec<Reply>, RequestError>;

    /// Returns a copy of the header page of the PLC with index `plc`.
    fn header(&mut self, plc: DeviceIndex) -> Option<Box<Header>>;
}

/// A running instance that the view shows.
pub(super) struct RunningInstance {
    client: Client,
    instance: String,
    images: Vec<Attached>,
}

impl RunningInstance {
    /// Connects to the instance.
    ///
    /// # Errors
    /// No instance of this name is running, or it has no channel.
    pub(super) fn connect(instance: &Instance) -> Result<Self, CliError> {
        let session = Session::open(instance, 0)?;
        let plcs = session.plcs().to_vec();
        let client = session.into_client()?;
        let attach = |plc: &String| Image::attach(instance.name(), plc, AttachMode::ReadOnly, None);
        let images = plcs.iter().map(attach).collect::<Result<Vec<_>, _>>()?;
        Ok(Self { client, instance: instance.name().to_owned(), images })
    }
}

impl Source for RunningInstance {
    fn request(&mut self, ops: &[Op], kind: RequestKind) -> Result<Vec<Reply>, RequestError> {
        self.client.set_patience(match kind {
            RequestKind::Poll => LOOK,
            RequestKind::Task => WORK,
        });
        let emulated_us = || Some(self.images.first()?.header_snapshot().virtual_time_us.load());
        let replies = send(&self.client, &self.instance, ops, &emulated_us).map_err(|error| match error {
            ClientError::Timeout { .. } => RequestError::Busy,
            gone => RequestError::Gone(gone.to_string()),
        })?;
        let ending = replies.iter().find_map(|reply| match reply {
            Reply::Error(refused) if refused.code == Code::SHUTTING_DOWN => Some(refused.text.clone()),
            _ => None,
        });
        ending.map_or(Ok(replies), |reason| Err(RequestError::Gone(reason)))
    }

    fn header(&mut self, plc: DeviceIndex) -> Option<Box<Header>> {
        Some(self.images.get(plc.index())?.header_snapshot())
    }
}
