//! The line that all participants share: the characters on it, and the errors that receivers detect.

use super::{CharacterError, CharacterFormat, Parity, Received, Wires};
use serde::{Deserialize, Serialize};

/// Signal that a participant puts on the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Signal {
    /// A character with these data bits.
    Octet(u8),
    /// A low level without a stop bit.
    Break,
}

/// The pair of wires on which a participant sends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Pair {
    /// The pair from the first port of the line to all other participants; on two wires, the only pair.
    Down,
    /// The pair from all other participants to the first port.
    Up,
    /// Both pairs: a disturbance.
    Both,
}

impl Pair {
    fn meets(self, other: Pair) -> bool {
        self == other || self == Pair::Both || other == Pair::Both
    }
}

/// A character on the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct OnLine {
    /// Number of the sender, defined by the user of the line.
    pub sender: usize,
    /// The pair of wires.
    pub pair: Pair,
    /// Format of the sender.
    pub format: CharacterFormat,
    /// The signal.
    pub signal: Signal,
    /// Tick at which the start bit begins.
    pub begin: u64,
    /// Tick after the last stop bit.
    pub end: u64,
    /// True if another participant was sending on the same pair at the same time.
    pub has_collided: bool,
    /// True if a disturbance has inverted a data bit.
    pub is_inverted: bool,
    /// True if no participant receives the character.
    pub is_lost: bool,
}

impl OnLine {
    /// Returns a character that no disturbance has changed.
    #[must_use]
    pub const fn new(sender: usize, pair: Pair, format: CharacterFormat, signal: Signal, begin: u64) -> Self {
        let end = begin.saturating_add(format.ticks());
        OnLine {
            sender,
            pair,
            format,
            signal,
            begin,
            end,
            has_collided: false,
            is_inverted: false,
            is_lost: false,
        }
    }

    /// Returns what a participant with this format receives; `None` if it receives nothing.
    #[must_use]
    pub fn received_as(&self, format: CharacterFormat) -> Option<Received> {
        let failed = |error| Some(Received { octet: 0, error: Some(error) });
        let octet = match self.signal {
            _ if self.is_lost => return None,
            // The level stays low after the end of a character that it has destroyed.
            Signal::Break => return failed(CharacterError::Break),
            _ if self.has_collided => return failed(CharacterError::Framing),
            Signal::Octet(octet) => octet ^ u8::from(self.is_inverted),
        };
        if self.format.baud_rate() != format.baud_rate()
            || self.format.bits() - self.format.stop_bits() != format.bits() - format.stop_bits()
            || self.format.data_bits() != format.data_bits()
        {
            return failed(CharacterError::Framing);
        }
        let has_parity = format.parity() != Parity::None;
        let is_wrong = has_parity && (self.is_inverted != (self.format.parity() != format.parity()));
        Some(Received { octet: format.cut(octet), error: is_wrong.then_some(CharacterError::Parity) })
    }
}

/// A line and the characters on it.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Line {
    /// Characters that have not ended, sorted by their ends.
    characters: Vec<OnLine>,
}

impl Line {
    /// Puts a character on the line. Characters at the same time on the same pair destroy each other, unless one of them
    /// is lost.
    pub fn begin(&mut self, mut character: OnLine) {
        for other in &mut self.characters {
            let overlaps = character.begin < other.end && other.begin < character.end;
            if overlaps && character.pair.meets(other.pair) && !character.is_lost && !other.is_lost {
                other.has_collided = true;
                character.has_collided = true;
            }
        }
        let place = self.characters.partition_point(|other| other.end <= character.end);
        self.characters.insert(place, character);
    }

    /// Returns the tick at which the next character ends; `None` if the line is idle.
    #[must_use]
    pub fn next_end(&self) -> Option<u64> {
        self.characters.first().map(|character| character.end)
    }

    /// Removes and returns the character that ends next, if it has ended at this tick.
    pub fn end(&mut self, now: u64) -> Option<OnLine> {
        self.characters.first().filter(|character| character.end <= now)?;
        Some(self.characters.remove(0))
    }

    /// Returns the character that a participant is sending, or is about to send after a delay.
    #[must_use]
    pub fn of_sender(&self, sender: usize) -> Option<&OnLine> {
        self.characters.iter().find(|character| character.sender == sender)
    }

    /// Stops the transmission of `sender` before its end. No participant can then decode the character.
    pub fn cut_off(&mut self, sender: usize) {
        self.characters.iter_mut().filter(|it| it.sender == sender).for_each(|it| it.has_collided = true);
    }

    /// Returns the senders of the characters on the line.
    pub(crate) fn senders(&self) -> impl Iterator<Item = usize> {
        self.characters.iter().map(|character| character.sender)
    }
}

impl Wires {
    /// Returns the pair on which a participant sends. `is_first` is true for the first port of the line.
    #[must_use]
    pub const fn pair_of(self, is_first: bool) -> Pair {
        match self {
            Wires::Four if !is_first => Pair::Up,
            _ => Pair::Down,
        }
    }

    /// True if a participant receives the signals of a pair. `is_first` is true for the first port of the line.
    #[must_use]
    pub fn hears(self, is_first: bool, pair: Pair) -> bool {
        pair == Pair::Both || self == Wires::Two || is_first == (pair == Pair::Up)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn format(baud_rate: u32, parity: Parity) -> CharacterFormat {
        CharacterFormat::new(baud_rate, 8, parity, 1).unwrap()
    }

    fn octet(sender: usize, pair: Pair, begin: u64) -> OnLine {
        OnLine::new(sender, pair, format(38_400, Parity::Even), Signal::Octet(0x41), begin)
    }

    #[test]
    fn a_character_is_received_at_its_end() {
        let mut line = Line::default();
        line.begin(octet(1, Pair::Down, 100));
        assert_eq!((line.next_end(), line.end(110)), (Some(111), None));
        let ended = line.end(111).unwrap();
        let even = format(38_400, Parity::Even);
        assert_eq!(ended.received_as(even), Some(Received { octet: 0x41, error: None }));
        assert_eq!((line.next_end(), line.of_sender(1)), (None, None));
    }

    #[test]
    fn only_characters_on_the_same_pair_collide() {
        for (pair, collides) in [(Pair::Down, true), (Pair::Up, false), (Pair::Both, true)] {
            let mut line = Line::default();
            line.begin(octet(1, Pair::Down, 100));
            line.begin(octet(2, pair, 110));
            line.begin(octet(3, pair, 121));
            let ends = [(); 3].map(|()| line.end(200).unwrap().has_collided);
            assert_eq!(ends, [collides, collides, false], "{pair:?}");
        }
        let mut line = Line::default();
        line.begin(OnLine { is_lost: true, ..octet(1, Pair::Down, 100) });
        line.begin(octet(2, Pair::Down, 110));
        assert_eq!([(); 2].map(|()| line.end(200).unwrap().has_collided), [false; 2]);
    }

    #[test]
    fn receivers_detect_errors_as_their_format_allows() {
        let sent = octet(1, Pair::Down, 0);
        let error = |sent: OnLine, format| sent.received_as(format).and_then(|it| it.error);
        let even = format(38_400, Parity::Even);
        let (odd, none) = (format(38_400, Parity::Odd), format(38_400, Parity::None));
        assert_eq!(error(sent, even), None);
        assert_eq!(error(sent, odd), Some(CharacterError::Parity));
        assert_eq!(error(sent, none), Some(CharacterError::Framing));
        assert_eq!(error(sent, format(9600, Parity::Even)), Some(CharacterError::Framing));
        let inverted = OnLine { is_inverted: true, ..sent };
        assert_eq!(error(inverted, even), Some(CharacterError::Parity));
        assert_eq!(error(inverted, odd), None, "two errors cancel each other");
        let plain = OnLine { format: none, ..inverted };
        assert_eq!(
            plain.received_as(none),
            Some(Received { octet: 0x40, error: None }),
            "no receiver without parity notices"
        );
        let broken = OnLine { signal: Signal::Break, ..sent };
        assert_eq!(error(broken, even), Some(CharacterError::Break));
        assert_eq!(error(OnLine { has_collided: true, ..broken }, even), Some(CharacterError::Break));
        assert_eq!(error(OnLine { has_collided: true, ..sent }, even), Some(CharacterError::Framing));
        assert_eq!(OnLine { is_lost: true, ..sent }.received_as(even), None);
    }

    #[test]
    fn pairs_lead_from_the_first_port_to_the_others_and_back() {
        assert_eq!([true, false].map(|is_first| Wires::Four.pair_of(is_first)), [Pair::Down, Pair::Up]);
        assert_eq!([true, false].map(|is_first| Wires::Two.pair_of(is_first)), [Pair::Down, Pair::Down]);
        for (wires, is_first, heard) in [
            (Wires::Four, true, [false, true, true]),
            (Wires::Four, false, [true, false, true]),
            (Wires::Two, false, [true, true, true]),
        ] {
            let pairs = [Pair::Down, Pair::Up, Pair::Both];
            assert_eq!(pairs.map(|pair| wires.hears(is_first, pair)), heard, "{wires:?} {is_first}");
        }
    }

    #[test]
    fn a_character_of_a_sender_without_power_is_destroyed() {
        let mut line = Line::default();
        line.begin(octet(4, Pair::Down, 0));
        line.cut_off(4);
        assert_eq!(line.senders().collect::<Vec<_>>(), [4]);
        assert!(line.end(11).unwrap().has_collided);
    }
}
