//! The bells of the header page, as the channel uses them.

use super::Bells;
use crate::memory::{Attached, Header, MemoryError, View};
use std::time::Duration;

/// Doorbell and reply bell in the header page of an instance's first PLC.
pub struct HeaderBells {
    header: View<Header>,
    /// A client's attachment, which knows whether the emulator lives.
    attached: Option<Attached>,
}

impl HeaderBells {
    /// The emulator's side.
    pub fn of_emulator(header: View<Header>) -> Self {
        HeaderBells { header, attached: None }
    }

    /// A client's side.
    ///
    /// # Errors
    /// The image is attached read-only: a client that cannot ring cannot be heard.
    pub fn of_client(attached: Attached) -> Result<Self, MemoryError> {
        Ok(HeaderBells { header: attached.header()?.clone(), attached: Some(attached) })
    }
}

impl Bells for HeaderBells {
    fn ring_doorbell(&self) {
        self.header.doorbell.ring();
    }

    fn reply_count(&self) -> u32 {
        self.header.channel_reply.rings()
    }

    fn wait_reply(&self, seen: u32, timeout: Duration) {
        self.header.channel_reply.wait(seen, Some(timeout));
    }

    fn announce_reply(&self) {
        self.header.channel_reply.ring();
    }

    fn emulator_alive(&self) -> bool {
        // The emulator need not ask about itself.
        self.attached.as_ref().is_none_or(Attached::is_alive)
    }
}
