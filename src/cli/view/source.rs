//! Where the screen gets what it shows: an emulator behind its channel, in tests a plant in the same process.

use crate::channel::{Client, ClientError};
use crate::cli::error::CliError;
use crate::cli::instance::Instance;
use crate::cli::session::Session;
use crate::devices;
use crate::memory::{AttachMode, Attached, Header};
use crate::request::{Code, Op, Reply};
use std::time::Duration;

/// How long a look waits for its answer: who is busy is looked at again soon.
const LOOK: Duration = Duration::from_millis(500);
/// How long work waits that lets time pass: an emulator drops it when its client gives up.
const WORK: Duration = Duration::from_secs(10);

/// Why there is no answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Trouble {
    /// Not this time: another client lets much time pass.
    Busy,
    /// There is nobody any more: why.
    Gone(String),
    /// It was refused: why.
    Refused(String),
}

/// How long an answer is waited for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Haste {
    /// What only looks is asked again soon.
    Look,
    /// What was begun is to come to its end.
    Work,
}

/// Somebody who answers.
pub(super) trait Source {
    /// Sends operations as one request: a reply for each.
    ///
    /// # Errors
    /// There is no answer.
    fn request(&mut self, ops: &[Op], haste: Haste) -> Result<Vec<Reply>, Trouble>;

    /// The header page of PLC number `plc` as it stands.
    fn header(&mut self, plc: u16) -> Option<Box<Header>>;
}

/// A running instance.
pub(super) struct Running {
    client: Client,
    images: Vec<Attached>,
}

impl Running {
    /// Connects.
    ///
    /// # Errors
    /// Nothing of that name lives, or it has no channel.
    pub(super) fn connect(instance: &Instance) -> Result<Self, CliError> {
        let session = Session::open(instance, 0)?;
        let plcs = session.plcs().to_vec();
        let client = session.into_client()?;
        let attach = |plc: &String| devices::attach(instance.name(), plc, AttachMode::ReadOnly);
        let images = plcs.iter().map(|plc| Ok(attach(plc)?.0)).collect::<Result<Vec<_>, CliError>>()?;
        Ok(Self { client, images })
    }
}

impl Source for Running {
    fn request(&mut self, ops: &[Op], haste: Haste) -> Result<Vec<Reply>, Trouble> {
        self.client.set_patience(match haste {
            Haste::Look => LOOK,
            Haste::Work => WORK,
        });
        let replies = self.client.request(ops).map_err(|error| match error {
            ClientError::Timeout { .. } => Trouble::Busy,
            gone => Trouble::Gone(gone.to_string()),
        })?;
        let ends =
            |reply: &Reply| matches!(reply, Reply::Error(refused) if refused.code == Code::SHUTTING_DOWN);
        if replies.iter().any(ends) { Err(Trouble::Gone("it ends".to_owned())) } else { Ok(replies) }
    }

    fn header(&mut self, plc: u16) -> Option<Box<Header>> {
        Some(self.images.get(usize::from(plc))?.header_snapshot())
    }
}
