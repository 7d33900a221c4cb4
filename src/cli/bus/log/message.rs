//! Messages of a log: frames of CAN and telegrams of PROFIBUS.

use crate::can::Frame;
use crate::journal::candump::FrameText;
use crate::journal::{Octets, Record};
use crate::profibus::{Frame as DpFrame, FunctionCode, Telegram};
use core::fmt;

/// A message of a log or of the journal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Message {
    Frame(Frame),
    /// The octets of a telegram.
    Telegram(Vec<u8>),
}

impl Message {
    /// Returns the message of a record, if the record contains a complete message.
    pub(super) fn of_record(record: &Record) -> Option<Self> {
        let frame = record.event.frame().map(|carried| Message::Frame(carried.frame));
        frame.or_else(|| {
            let is_whole = |octets: &Octets| octets.length > 0 && octets.known.len() == octets.length;
            let octets = record.telegram().filter(is_whole)?;
            Some(Message::Telegram(octets.known))
        })
    }
}

impl fmt::Display for Message {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Message::Frame(frame) => FrameText(frame).fmt(f),
            Message::Telegram(octets) => octets.iter().try_for_each(|octet| write!(f, "{octet:02X}")),
        }
    }
}

/// Determines the sender of each telegram of a bus. The telegrams must be passed in their order on the bus. A short
/// acknowledgement has no address: its sender is the station to which the last request was sent.
#[derive(Debug, Default)]
pub(super) struct Senders {
    /// Destination of the last request.
    asked: Option<u8>,
}

impl Senders {
    /// Returns the address of the sender. `None` if the telegram has no address and no request has preceded it.
    pub(super) fn of_next(&mut self, octets: &[u8]) -> Option<u8> {
        match Telegram::parse(octets).ok()? {
            Telegram::Frame(DpFrame { da, sa, fc, .. }) => {
                if !FunctionCode::is_answer(fc) {
                    self.asked = Some(da);
                }
                Some(sa)
            }
            Telegram::Token { sa, .. } => Some(sa),
            Telegram::ShortAck => self.asked,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_receipt_is_from_the_station_that_was_asked() {
        let mut senders = Senders::default();
        assert_eq!(senders.of_next(&[0xE5]), None);
        // A request for the FDL status of station 5, its answer, a request to station 7, its acknowledgement.
        let telegrams: [&[u8]; 4] = [
            &[0x10, 5, 2, 0x49, 0x50, 0x16],
            &[0x10, 2, 5, 0, 7, 0x16],
            &[0x10, 7, 2, 0x4C, 0x55, 0x16],
            &[0xE5],
        ];
        assert_eq!(telegrams.map(|octets| senders.of_next(octets)), [Some(2), Some(5), Some(2), Some(7)]);
        assert_eq!(senders.of_next(&[0xDC, 3, 2]), Some(2));
    }
}
