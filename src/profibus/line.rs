//! The line that all stations share: its content, and the time since which it is idle.

use super::Telegram;
use serde::{Deserialize, Serialize};

/// Receivers of a transmission.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Passage {
    /// All other stations receive the telegram.
    #[default]
    Normal,
    /// No station receives the telegram.
    Lost,
    /// A repeated copy of an earlier transmission, which all stations receive. Its sender sends only once.
    Copy,
}

/// A transmission in progress.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sending {
    /// Number of the sender, defined by the user of the line.
    pub sender: usize,
    /// Bit time of the first bit.
    pub begin: u64,
    /// Bit time after the last bit.
    pub end: u64,
    /// Octets that the station sends.
    pub octets: Vec<u8>,
    /// True if another station was sending at the same time. No station can then decode the octets.
    pub is_garbled: bool,
    /// Stations that receive the transmission.
    pub passage: Passage,
}

/// The line of a PROFIBUS segment.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Line {
    /// The transmissions in progress, sorted by their ends.
    sendings: Vec<Sending>,
    idle_since: u64,
}

impl Line {
    /// Begins a transmission of `sender`. Two transmissions at the same time garble each other.
    pub fn begin(&mut self, sender: usize, at: u64, octets: Vec<u8>) {
        self.begin_with(sender, at, octets, Passage::Normal);
    }

    /// Begins a transmission like [`Line::begin`], with another [`Passage`].
    pub fn begin_with(&mut self, sender: usize, at: u64, octets: Vec<u8>, passage: Passage) {
        let end = at.saturating_add(Telegram::bits(octets.len()));
        let mut is_garbled = false;
        for other in self.sendings.iter_mut().filter(|other| at < other.end) {
            other.is_garbled = true;
            is_garbled = true;
        }
        let place = self.sendings.partition_point(|other| other.end <= end);
        self.sendings.insert(place, Sending { sender, begin: at, end, octets, is_garbled, passage });
    }

    /// Returns the end of the transmission that ends next, in bit times; `None` if the line is idle.
    #[must_use]
    pub fn next_end(&self) -> Option<u64> {
        self.sendings.first().map(|sending| sending.end)
    }

    /// Removes and returns the transmission that ends next, if it has ended at bit time `now`.
    pub fn end(&mut self, now: u64) -> Option<Sending> {
        self.sendings.first().filter(|sending| sending.end <= now)?;
        let sending = self.sendings.remove(0);
        self.idle_since = self.idle_since.max(sending.end);
        Some(sending)
    }

    /// Stops the transmission of `sender` before its end. No station can then decode it.
    pub fn cut_off(&mut self, sender: usize) {
        self.sendings.iter_mut().filter(|it| it.sender == sender).for_each(|it| it.is_garbled = true);
    }

    /// Returns the stations that are sending.
    pub(crate) fn senders(&self) -> impl Iterator<Item = usize> {
        self.sendings.iter().map(|sending| sending.sender)
    }

    /// Returns the time since which the line is idle, in bit times; `None` during a transmission.
    #[must_use]
    pub fn idle_since(&self) -> Option<u64> {
        self.sendings.is_empty().then_some(self.idle_since)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_octet_takes_eleven_bits() {
        let mut line = Line::default();
        line.begin(1, 100, vec![0; 6]);
        assert_eq!((line.next_end(), line.idle_since(), line.end(165)), (Some(166), None, None));
        let sending = line.end(166).unwrap();
        assert_eq!((sending.sender, sending.begin, sending.is_garbled), (1, 100, false));
        assert_eq!((line.idle_since(), line.next_end()), (Some(166), None));
    }

    #[test]
    fn two_at_once_spoil_both() {
        let mut line = Line::default();
        line.begin(1, 0, vec![0; 6]);
        line.begin(2, 65, vec![0]);
        let of = |it: Option<Sending>| it.map(|it| (it.sender, it.is_garbled));
        assert_eq!(
            (of(line.end(66)), of(line.end(66)), of(line.end(76))),
            (Some((1, true)), None, Some((2, true)))
        );
        line.begin(3, 76, vec![0]);
        assert_eq!(of(line.end(87)), Some((3, false)));
        line.begin(3, 90, vec![0]);
        line.cut_off(3);
        assert_eq!(of(line.end(101)), Some((3, true)));
    }
}
