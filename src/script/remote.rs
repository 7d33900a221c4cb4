//! A running instance, reached through its channel.

use super::ScenarioError;
use super::carrier::Carrier;
use crate::channel::{Client, ClientError};
use crate::identity::DeviceIndex;
use crate::memory::{AttachMode, Image, Segment};
use crate::request::{Op, Reply, WrongReply};

/// A connection to an instance.
pub(super) struct Remote {
    client: Client,
    instance: String,
    plcs: Vec<String>,
}

impl Remote {
    /// Uses an existing connection.
    ///
    /// # Errors
    /// The instance does not answer.
    pub(crate) fn new(client: Client) -> Result<Self, ClientError> {
        let info = client.info()?;
        Ok(Self { client, instance: info.name, plcs: info.names.plcs })
    }
}

impl Carrier for Remote {
    fn ask(&mut self, op: Op) -> Result<Reply, ScenarioError> {
        match self.client.request(&[op])?.pop() {
            Some(Reply::Error(refused)) => Err(refused.into()),
            Some(reply) => Ok(reply),
            None => Err(WrongReply.into()),
        }
    }

    #[cfg(feature = "cli")]
    fn is_there(&self) -> bool {
        self.client.is_emulator_alive()
    }

    fn segment(&mut self, plc: DeviceIndex) -> Result<Segment, ScenarioError> {
        let name = self.plcs.get(plc.index()).map_or("", String::as_str);
        let attached = Image::attach(&self.instance, name, AttachMode::ReadWrite, None)?;
        Ok(attached.segment().clone())
    }
}
