//! Messages of the protocol on the standard input and output: a header with the length, then JSON.

use super::session::Event;
use serde_json::Value;
use std::io::{self, BufRead, Read};
use std::sync::mpsc::Sender;

/// Longest message, in bytes.
const LONGEST_MESSAGE: usize = 4 << 20;
/// Longest line of a header, in bytes.
const LONGEST_HEADER: u64 = 1024;
/// Most lines of a header.
const MOST_HEADERS: usize = 16;

/// Sends all messages of the input, then its end.
pub(super) fn read_all(input: &mut dyn BufRead, events: &Sender<Event>) {
    loop {
        let event = match read(input) {
            Ok(Some(message)) => Event::Message(message),
            Ok(None) => Event::Closed(None),
            Err(reason) => Event::Closed(Some(reason)),
        };
        let is_last = matches!(event, Event::Closed(_));
        if events.send(event).is_err() || is_last {
            return;
        }
    }
}

/// The next message; `None` at the end of the input.
///
/// # Errors
/// The input is no message of the protocol, or cannot be read.
pub(super) fn read(input: &mut dyn BufRead) -> io::Result<Option<Value>> {
    let mut length = None;
    for count in 0.. {
        if count >= MOST_HEADERS {
            return Err(wrong("a message has more than 16 header lines".to_owned()));
        }
        let mut line = Vec::new();
        (&mut *input).take(LONGEST_HEADER).read_until(b'\n', &mut line)?;
        if line.is_empty() {
            return if count == 0 { Ok(None) } else { Err(io::ErrorKind::UnexpectedEof.into()) };
        }
        let text = String::from_utf8_lossy(&line);
        let text = text.trim();
        if text.is_empty() {
            break;
        }
        let Some((name, value)) = text.split_once(':') else {
            return Err(wrong(format!("a header line is {text:?}; right is `Content-Length: N`")));
        };
        if name.trim().eq_ignore_ascii_case("content-length") {
            let number = value.trim().parse().ok().filter(|number| *number <= LONGEST_MESSAGE);
            let right =
                || wrong(format!("Content-Length is {:?}; right is 0 to {LONGEST_MESSAGE}", value.trim()));
            length = Some(number.ok_or_else(right)?);
        }
    }
    let length: usize =
        length.ok_or_else(|| wrong("a message has no header `Content-Length: N`".to_owned()))?;
    let mut bytes = vec![0; length];
    input.read_exact(&mut bytes)?;
    serde_json::from_slice(&bytes).map(Some).map_err(|error| wrong(format!("a message is not JSON: {error}")))
}

/// A message with its header.
pub(super) fn framed(message: &Value) -> String {
    let text = message.to_string();
    format!("Content-Length: {}\r\n\r\n{text}", text.len())
}

fn wrong(text: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, text)
}
