//! The bells of the header page, for use by the channel.

use super::Bells;
use crate::memory::{Attached, Header, MemoryError, View};
use std::time::Duration;

/// Doorbell and reply bell in the header pages of an instance's PLCs. A client uses one of the pages; the
/// emulator waits and rings on all of them.
pub struct HeaderBells {
    headers: Vec<View<Header>>,
    /// A client's attachment, which detects the end of the emulator.
    attached: Option<Attached>,
}

impl HeaderBells {
    /// The emulator's side, with the header page of each PLC.
    pub fn of_emulator(headers: Vec<View<Header>>) -> Self {
        HeaderBells { headers, attached: None }
    }

    /// A client's side. Attach with [`AttachMode::HeaderOnly`](crate::memory::AttachMode::HeaderOnly): while a client
    /// maps the registers, the emulator cannot go back in time.
    ///
    /// # Errors
    /// The image is attached read-only: such a client cannot ring.
    pub fn of_client(attached: Attached) -> Result<Self, MemoryError> {
        // A client of the channel does not access the registers, so it keeps only the header page.
        let attached = attached.only_header()?;
        Ok(HeaderBells { headers: vec![attached.header()?.clone()], attached: Some(attached) })
    }
}

impl Bells for HeaderBells {
    fn ring_doorbell(&self) {
        self.headers.iter().for_each(|header| header.doorbell.ring());
    }

    fn reply_count(&self) -> u32 {
        self.headers.first().map_or(0, |header| header.channel_reply.rings())
    }

    fn wait_reply(&self, seen: u32, timeout: Duration) {
        if let Some(header) = self.headers.first() {
            header.channel_reply.wait(seen, Some(timeout));
        }
    }

    fn announce_reply(&self) {
        self.headers.iter().for_each(|header| header.channel_reply.ring());
    }

    fn emulator_pid(&self) -> u32 {
        self.headers.first().map_or(0, |header| header.firmware_pid.load())
    }

    fn emulator_alive(&self) -> bool {
        // The emulator itself always counts as running.
        self.attached.as_ref().is_none_or(Attached::is_alive)
    }

    fn emulator_has_ended(&self) -> bool {
        self.attached.as_ref().is_some_and(Attached::has_ended)
    }
}
