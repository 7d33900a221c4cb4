//! Messages of the editor as events of the session.

use super::session::Event;
use crate::cli::editor_messages::{self, Received};
use std::io::{self, BufRead};
use std::sync::mpsc::Sender;

/// Sends all messages of the input, then its end.
pub(super) fn read_all(input: &mut dyn BufRead, events: &Sender<Event>) {
    editor_messages::read_all(input, |received| {
        let event = match received {
            Ok(Some(Received::Message(message))) => Event::Message(message),
            // A request without a number cannot be answered.
            Ok(Some(Received::NotJson(reason))) => {
                Event::Closed(Some(io::Error::new(io::ErrorKind::InvalidData, reason)))
            }
            Ok(None) => Event::Closed(None),
            Err(reason) => Event::Closed(Some(reason)),
        };
        let is_last = matches!(event, Event::Closed(_));
        events.send(event).is_ok() && !is_last
    });
}
