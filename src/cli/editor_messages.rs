//! Messages between an editor and this program on the standard input and output: a header with the length, then JSON.
//! The Language Server Protocol and the Debug Adapter Protocol have the same frame.

use serde_json::Value;
use std::io::{self, BufRead, Read};

/// Longest message, in bytes. JSON may need six bytes for a byte of a file, and the largest file has 1 MiB.
const LONGEST_MESSAGE: usize = 8 << 20;
/// Longest line of a header, in bytes.
const LONGEST_HEADER: u64 = 1024;
/// Most lines of a header.
const MOST_HEADERS: usize = 16;

/// A message of an editor.
#[derive(Debug, PartialEq)]
pub(super) enum Received {
    Message(Value),
    /// The bytes after a header are not JSON. The next message begins after them.
    NotJson(String),
}

/// Passes all messages of the input to `take`, then its end or the error. Ends earlier if `take` returns false.
pub(super) fn read_all(input: &mut dyn BufRead, mut take: impl FnMut(io::Result<Option<Received>>) -> bool) {
    loop {
        let received = read(input);
        let is_last = !matches!(received, Ok(Some(_)));
        if !take(received) || is_last {
            return;
        }
    }
}

/// Reads the next message. Returns `None` at the end of the input.
///
/// # Errors
/// A header is wrong, the message is too long, or the input cannot be read.
fn read(input: &mut dyn BufRead) -> io::Result<Option<Received>> {
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
    Ok(Some(match serde_json::from_slice(&bytes) {
        Ok(message) => Received::Message(message),
        Err(reason) => Received::NotJson(format!("a message is not JSON: {reason}")),
    }))
}

/// Returns a message with its header.
pub(super) fn framed(message: &Value) -> String {
    let text = message.to_string();
    format!("Content-Length: {}\r\n\r\n{text}", text.len())
}

fn wrong(text: String) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use std::io::Cursor;

    #[test]
    fn a_wrong_length_names_the_limit() {
        let read = |text: &str| read(&mut Cursor::new(text.as_bytes())).unwrap_err().to_string();
        assert_eq!(
            read("Content-Length: 99999999999\r\n\r\n"),
            "Content-Length is \"99999999999\"; right is 0 to 8388608"
        );
        assert_eq!(read("\r\n"), "a message has no header `Content-Length: N`");
        assert_eq!(read(&"A: b\r\n".repeat(20)), "a message has more than 16 header lines");
        assert!(read(&"x".repeat(5000)).starts_with("a header line is"));
    }

    #[test]
    fn the_message_after_one_that_is_no_json_is_read() {
        let message = json!({ "text": "Größe" });
        let text = format!("Content-Length: 1\r\n\r\nx{}", framed(&message));
        let input = &mut Cursor::new(text.as_bytes());
        assert!(matches!(read(input), Ok(Some(Received::NotJson(_)))));
        assert_eq!(read(input).unwrap(), Some(Received::Message(message)));
        assert_eq!(read(input).unwrap(), None);
    }
}
