//! Descriptions of frames for users and tools, as far as the devices know the content. They are never sent on the bus.

use super::Arbitration;
use embedded_can::Id;

/// All data frames of one identifier.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// Name of the message.
    pub name: String,
    /// Identifier of the frames with this message.
    pub id: Id,
    /// Number of data bytes, 0 to 8.
    pub length: u8,
    /// Senders: names of devices, empty for other senders.
    pub senders: Vec<String>,
    /// Names of the stations that receive the message.
    pub receivers: Vec<String>,
    /// Signals in the data bytes of the message.
    pub signals: Vec<Signal>,
    /// Description, in a sentence; empty if the name is sufficient.
    pub about: String,
}

/// A number in a message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Signal {
    /// Name of the signal, unique in its message.
    pub name: String,
    /// Lowest bit of the signal, counted from the lowest bit of the first byte. With [`BitOrder::HighFirst`] it is the
    /// highest bit of the signal.
    pub first_bit: u8,
    /// Number of bits of the signal.
    pub bits: u8,
    /// Order of the signal's bytes.
    pub order: BitOrder,
    /// Frames that contain the signal.
    pub presence: Presence,
    /// Description; empty if the name is sufficient.
    pub about: String,
}

/// Order of the bytes of a signal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BitOrder {
    /// The lowest byte comes first.
    #[default]
    LowFirst,
    /// The highest byte comes first.
    HighFirst,
}

/// Frames of a message that contain a signal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Presence {
    /// The signal is in all frames of the message.
    #[default]
    Always,
    /// All frames. The value of the signal selects further signals. A message has at most one such signal.
    Selector,
    /// Frames in which the selector has this value.
    If(u8),
}

/// Combines the descriptions of each identifier into one message. Its name and content are from the first sender that
/// describes it, or from the first receiver if no sender does. The messages are in the order of arbitration.
#[must_use]
pub fn merged(mut messages: Vec<Message>) -> Vec<Message> {
    messages.sort_by_key(|message| (Arbitration::new(message.id, false), message.senders.is_empty()));
    messages.dedup_by(|next, first| {
        let is_same = next.id == first.id;
        if is_same {
            for (names, more) in
                [(&mut first.senders, &next.senders), (&mut first.receivers, &next.receivers)]
            {
                let new: Vec<_> = more.iter().filter(|name| !names.contains(name)).cloned().collect();
                names.extend(new);
            }
        }
        is_same
    });
    messages
}

#[cfg(test)]
mod tests {
    use super::*;
    use embedded_can::{ExtendedId, StandardId};

    #[test]
    fn each_identifier_has_one_message() {
        let message = |name: &str, id: Id, senders: &[&str], receivers: &[&str]| {
            let list = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
            let (senders, receivers) = (list(senders), list(receivers));
            let (signals, about) = (Vec::new(), String::new());
            Message { name: name.to_owned(), id, length: 8, senders, receivers, signals, about }
        };
        let standard: Id = StandardId::new(0x181).unwrap().into();
        let extended: Id = ExtendedId::new(0x181).unwrap().into();
        let all = vec![
            message("b_RX", standard, &[], &["b"]),
            message("other", extended, &["x"], &[]),
            message("a_TX", standard, &["a"], &["c"]),
            message("c_RX", standard, &["d"], &["c"]),
        ];
        let expected =
            [message("other", extended, &["x"], &[]), message("a_TX", standard, &["a", "d"], &["c", "b"])];
        assert_eq!(merged(all), expected);
    }
}
