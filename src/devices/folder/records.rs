//! Journal records of devices in folders. They contain texts of scripts, in the octets of the record.

use super::own_records;
use super::port::Unsendable;
use crate::can::Frame;
use crate::devices::can_bus;
use crate::event_kinds;
use crate::identity::DeviceIndex;
use crate::journal::{EventCodec, EventKind, EventText, Fields, Journal, Reader};
use crate::plain_text::without_interpreted;
use twox_hash::XxHash3_64;

/// All kinds of records of devices in folders.
pub static KINDS: &[&EventKind] =
    &[Note::KIND, Stopped::KIND, Reload::KIND, DeviceRecord::KIND, Unsent::KIND];

/// Longest text of a record in bytes.
pub const LONGEST_NOTE: usize = 200;

event_kinds! {
    /// A script has written a text.
    Note = 77, "note", Registers, at plc {
        /// XXH3 of the text.
        sum: u64,
    }
    /// A script has stopped after an error; the device does nothing until its next power-on.
    Stopped = 78, "stopped", Rare, at plc {
        /// XXH3 of the text.
        sum: u64,
    }
    /// Files of a device in a folder have changed while it runs.
    Reload = 79, "reload", Rare, at plc {
        /// XXH3 of the text.
        sum: u64,
    }
    /// A script has sent a frame, and the frame is lost before it was in the transmit queue.
    Unsent = 81, "unsent", Missed, at plc {
        /// XXH3 of the text.
        sum: u64,
    }
    /// The script of a device has written a record of a kind that the device declares.
    DeviceRecord = 80, "device_record", Registers, at plc {
        /// XXH3 of the line.
        sum: u64,
    }
}

impl Note {
    /// Writes `text` into the journal, at most [`LONGEST_NOTE`] bytes of it.
    pub fn write(journal: &mut Journal, now: u64, plc: DeviceIndex, text: &str) {
        let (text, sum) = shortened(text);
        journal.push_octets(now, Note { plc, sum }, Some(text.as_bytes()));
    }
}

impl Stopped {
    /// Writes a record like [`Note::write`].
    pub fn write(journal: &mut Journal, now: u64, plc: DeviceIndex, text: &str) {
        let (text, sum) = shortened(text);
        journal.push_octets(now, Stopped { plc, sum }, Some(text.as_bytes()));
    }
}

impl Reload {
    /// Like [`Note::write`].
    pub fn write(journal: &mut Journal, now: u64, plc: DeviceIndex, text: &str) {
        let (text, sum) = shortened(text);
        journal.push_octets(now, Reload { plc, sum }, Some(text.as_bytes()));
    }
}

impl DeviceRecord {
    /// Writes a line that `OwnRecord::line` has formatted. The line is cut after at most 255 bytes.
    #[cfg_attr(not(feature = "script"), expect(dead_code, reason = "only scripts write records"))]
    pub(super) fn write(journal: &mut Journal, now: u64, plc: DeviceIndex, line: &str) {
        let line = &line[..line.floor_char_boundary(255)];
        let sum = XxHash3_64::oneshot(line.as_bytes());
        journal.push_octets(now, DeviceRecord { plc, sum }, Some(line.as_bytes()));
    }
}

impl Unsent {
    /// Writes a record with the frame and the reason for its loss.
    #[cfg_attr(not(feature = "script"), expect(dead_code, reason = "only scripts send frames"))]
    pub(super) fn write(
        journal: &mut Journal,
        now: u64,
        plc: DeviceIndex,
        frame: &Frame,
        reason: Unsendable,
    ) {
        let text = format!("{}: {reason}", can_bus::records::text(frame));
        let (text, sum) = shortened(&text);
        journal.push_octets(now, Unsent { plc, sum }, Some(text.as_bytes()));
    }
}

impl EventText for Unsent {
    fn text(&self, reader: &mut Reader) -> String {
        format!("frame not sent: {}", text(reader))
    }

    fn fields(&self, reader: &mut Reader) -> Fields {
        Fields::new().with("text", text(reader))
    }
}

impl EventText for DeviceRecord {
    fn text(&self, reader: &mut Reader) -> String {
        text(reader)
    }

    fn fields(&self, reader: &mut Reader) -> Fields {
        let line = text(reader);
        let (name, values, text) = own_records::parts(&line);
        Fields::new().with("name", name).with("values", values).with("text", text)
    }
}

/// Returns the beginning of a text up to the length limit, and the check sum of this part.
fn shortened(text: &str) -> (&str, u64) {
    let text = &text[..text.floor_char_boundary(LONGEST_NOTE)];
    (text, XxHash3_64::oneshot(text.as_bytes()))
}

/// Returns the text of the record. Journals may come from unknown authors, so interpreted characters are replaced.
fn text(reader: &Reader) -> String {
    let octets = reader.octets().unwrap_or_default();
    without_interpreted(&String::from_utf8_lossy(&octets))
}

impl EventText for Note {
    fn text(&self, reader: &mut Reader) -> String {
        text(reader)
    }

    fn fields(&self, reader: &mut Reader) -> Fields {
        Fields::new().with("text", text(reader))
    }
}

impl EventText for Stopped {
    fn text(&self, reader: &mut Reader) -> String {
        format!("script stopped: {}", text(reader))
    }

    fn fields(&self, reader: &mut Reader) -> Fields {
        Fields::new().with("text", text(reader))
    }
}

impl EventText for Reload {
    fn text(&self, reader: &mut Reader) -> String {
        text(reader)
    }

    fn fields(&self, reader: &mut Reader) -> Fields {
        Fields::new().with("text", text(reader))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_texts_are_cut_between_characters() {
        let long = "ä".repeat(150);
        let (text, sum) = shortened(&long);
        assert_eq!((text.len(), text.chars().count()), (200, 100));
        assert_ne!(sum, shortened("ä").1);
    }
}
