//! Recordings of buses: logs of this program and of other loggers, read for playing and comparing.
//!
//! [`read_text`] reads texts, [`pcapng::read`](super::pcapng::read) the files of Wireshark.

mod candump;
mod gvret;
mod jsonl;

use crate::can::Frame;

/// Direction of a frame at the logger's own station.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    /// The logger's station received the frame.
    Received,
    /// The logger's station sent the frame.
    Transmitted,
}

/// A frame of a recording, or the octets of a telegram.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Logged<T = Frame> {
    /// Position in the file: the line of a text, counted from 1; the first byte of the block in a pcapng log.
    pub at: usize,
    /// Time in microseconds. In a log of commram, a telegram ends at this time.
    pub time_us: u64,
    /// Name of the interface. In a log of commram, the name of the bus.
    pub interface: String,
    /// Direction of the frame, if the logger has written it.
    pub direction: Option<Direction>,
    /// The recorded frame, or the telegram from its start delimiter to its end delimiter.
    pub frame: T,
}

/// An entry of a recording with neither a frame of Classical CAN nor a telegram of PROFIBUS.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Skipped {
    /// Position in the file, as [`Logged::at`].
    pub at: usize,
    /// Description of the entry.
    pub reason: String,
}

/// The content of a recording.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Recording {
    /// The frames in the order of the file.
    pub frames: Vec<Logged>,
    /// The telegrams of PROFIBUS in the order of the file.
    pub telegrams: Vec<Logged<Vec<u8>>>,
    /// The other entries in the order of the file.
    pub skipped: Vec<Skipped>,
}

/// An entry of a recording: a frame, a telegram, or the reason why it is skipped.
pub(super) enum Entry {
    Frame(Logged),
    Telegram(Logged<Vec<u8>>),
    Skipped(String),
}

impl Recording {
    fn is_empty(&self) -> bool {
        self.frames.is_empty() && self.telegrams.is_empty()
    }

    pub(super) fn add(&mut self, at: usize, entry: Entry) {
        match entry {
            Entry::Frame(logged) => self.frames.push(logged),
            Entry::Telegram(logged) => self.telegrams.push(logged),
            Entry::Skipped(reason) => self.skipped.push(Skipped { at, reason }),
        }
    }
}

/// An invalid line of a recording.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}: {right}")]
pub struct BadLine {
    /// Number of the line, from 1.
    pub line: usize,
    /// Description of a correct line.
    pub right: &'static str,
}

/// Reads a text: a log of `candump -L` or `candump -ta` (can-utils), of python-can, a file of GVRET or SavvyCAN in CSV, or
/// lines of `commram trace --format json`.
/// Empty lines and comments (`#`, `;`, `//`) are ignored. Error frames and frames of CAN FD and CAN XL are
/// [`Recording::skipped`], as is a last line that was cut off.
///
/// # Errors
/// [`BadLine`]: the line has another form, or its frame is not possible on a CAN bus.
pub fn read_text(text: &str) -> Result<Recording, BadLine> {
    // Some programs of Windows begin a text with a byte order mark.
    let text = text.strip_prefix('\u{FEFF}').unwrap_or(text);
    let is_comment = |line: &str| ["#", ";", "//"].iter().any(|mark| line.starts_with(mark));
    let lines = text.lines().enumerate().map(|(index, line)| (index + 1, line.trim()));
    let mut lines = lines.filter(|(_, line)| !line.is_empty() && !is_comment(line)).peekable();
    let table = lines.peek().and_then(|(_, line)| gvret::Columns::of_head(line));
    let is_json = lines.peek().is_some_and(|(_, line)| jsonl::is_one(line));
    let table = table.map(|columns| columns.shifted_for(text));
    if table.is_some() {
        lines.next();
    }
    let last_is_whole = text.ends_with('\n');
    let mut recording = Recording::default();
    while let Some((at, line)) = lines.next() {
        let entry = match &table {
            Some(columns) => columns.entry(at, line).map(Some),
            None if is_json => jsonl::entry(at, line),
            None => candump::entry(at, line).map(Some),
        };
        match entry {
            Ok(Some(entry)) => recording.add(at, entry),
            // The record is neither a frame nor a telegram.
            Ok(None) => {}
            // A logger that was killed may leave an incomplete last line.
            Err(_) if !last_is_whole && lines.peek().is_none() && !recording.is_empty() => {
                recording.add(at, Entry::Skipped("the last line, which is cut off".to_owned()));
            }
            Err(right) => return Err(BadLine { line: at, right }),
        }
    }
    Ok(recording)
}

#[cfg(test)]
mod tests;
