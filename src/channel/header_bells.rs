//! The bells of the header page, as the channel uses them.

use super::Bells;
use crate::memory::{Attached, Header, View};
use std::time::Duration;

/// Doorbell and reply bell in the header page of an instance's first PLC.
pub struct HeaderBells {
    header: View<Header>,
    /// The client's attachment, which knows whether the emulator lives.
    client: Option<Attached>,
}

impl HeaderBells {
    /// The emulator's side.
    pub fn of_emulator(header: View<Header>) -> Self {
        HeaderBells { header, client: None }
    }
}
