//! Process data objects (PDOs): the conditions under which a PDO is sent, or its value is taken over.

use serde::{Deserialize, Serialize};

/// Transmission type: the condition under which a PDO is sent, or a received value is taken over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Transmission {
    /// The PDO is sent at a SYNC object, if the value is new.
    SynchronousAcyclic,
    /// The PDO is sent at every n-th SYNC object, n from 1 to 240.
    Synchronous(u8),
    /// The PDO is sent when the value changes; types 254 and 255.
    Asynchronous(u8),
}

impl Transmission {
    /// Returns the type with this number. `None` for reserved numbers. Also `None` for 252 and 253: these
    /// types send a PDO only in answer to a remote frame.
    #[must_use]
    pub const fn from_code(code: u8) -> Option<Self> {
        match code {
            0 => Some(Transmission::SynchronousAcyclic),
            1..=240 => Some(Transmission::Synchronous(code)),
            241..=253 => None,
            254..=255 => Some(Transmission::Asynchronous(code)),
        }
    }

    /// Returns the number of the type.
    #[must_use]
    pub const fn code(self) -> u8 {
        match self {
            Transmission::SynchronousAcyclic => 0,
            Transmission::Synchronous(code) | Transmission::Asynchronous(code) => code,
        }
    }

    /// True if the PDO waits for SYNC objects.
    #[must_use]
    pub const fn is_synchronous(self) -> bool {
        !matches!(self, Transmission::Asynchronous(_))
    }
}

/// Counts SYNC objects for a PDO.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
struct SyncCounter(u8);

impl SyncCounter {
    /// Called at a SYNC object. Returns true if the PDO must be sent or taken over at this SYNC object.
    fn is_turn(&mut self, kind: Transmission) -> bool {
        match kind {
            Transmission::SynchronousAcyclic => true,
            Transmission::Asynchronous(_) => false,
            Transmission::Synchronous(every) => {
                self.0 = self.0.saturating_add(1);
                let is_turn = self.0 >= every;
                if is_turn {
                    self.0 = 0;
                }
                is_turn
            }
        }
    }
}

/// A PDO of the sending side.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Transmit {
    /// The value that was sent last, which the other stations have received.
    known: [u8; 8],
    count: SyncCounter,
    /// Earliest time of the next asynchronous PDO, in us.
    free_at: u64,
    /// True if a new value waits for `free_at`.
    is_waiting: bool,
}

impl Transmit {
    /// Starts the exchange of PDOs: `value` counts as sent, and SYNC objects are counted from 0.
    pub(crate) fn start(&mut self, value: [u8; 8]) {
        *self = Transmit { known: value, ..Transmit::default() };
    }

    /// Returns true if the value must be sent at `now`. The next asynchronous PDO is sent after `inhibit_us`
    /// at the earliest.
    pub(crate) fn look(&mut self, kind: Transmission, value: [u8; 8], inhibit_us: u64, now: u64) -> bool {
        if kind.is_synchronous() {
            return false;
        }
        let is_new = value != self.known;
        self.is_waiting = is_new && now < self.free_at;
        let is_sent = is_new && !self.is_waiting;
        if is_sent {
            self.known = value;
            self.free_at = now.saturating_add(inhibit_us);
        }
        is_sent
    }

    /// Called at a SYNC object. Returns true if the value has to be sent.
    pub(crate) fn sync(&mut self, kind: Transmission, value: [u8; 8]) -> bool {
        let is_new = value != self.known;
        let is_sent = self.count.is_turn(kind) && (is_new || kind != Transmission::SynchronousAcyclic);
        if is_sent {
            self.known = value;
        }
        is_sent
    }

    /// Returns the time of the next necessary poll; `u64::MAX` if there is none.
    #[must_use]
    pub(crate) fn next_time(&self) -> u64 {
        if self.is_waiting { self.free_at } else { u64::MAX }
    }
}

/// A PDO of the receiving side.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Receive {
    waiting: Option<[u8; 8]>,
    count: SyncCounter,
}

impl Receive {
    /// Starts the exchange of PDOs.
    pub(crate) fn start(&mut self) {
        *self = Receive::default();
    }

    /// Called when a PDO has arrived. Returns the value if it has to be taken over at once.
    pub(crate) fn received(&mut self, kind: Transmission, value: [u8; 8]) -> Option<[u8; 8]> {
        if kind.is_synchronous() {
            self.waiting = Some(value);
            return None;
        }
        Some(value)
    }

    /// Called at a SYNC object. Returns the value to take over.
    pub(crate) fn sync(&mut self, kind: Transmission) -> Option<[u8; 8]> {
        if self.count.is_turn(kind) { self.waiting.take() } else { None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EVENT: Transmission = Transmission::Asynchronous(255);

    fn value(number: u8) -> [u8; 8] {
        [number; 8]
    }

    #[test]
    fn transmission_types_have_numbers() {
        for code in 0..=u8::MAX {
            let kind = Transmission::from_code(code);
            assert_eq!(kind.is_none(), (241..=253).contains(&code), "{code}");
            assert!(kind.is_none_or(|kind| kind.code() == code && kind.is_synchronous() == (code <= 240)));
        }
    }

    #[test]
    fn a_changed_value_is_sent_and_waits_for_the_inhibit_time() {
        let mut pdo = Transmit::default();
        pdo.start(value(0));
        assert!(!pdo.look(EVENT, value(0), 100, 0));
        assert!(pdo.look(EVENT, value(1), 100, 10));
        assert!(!pdo.look(EVENT, value(2), 100, 20));
        assert_eq!(pdo.next_time(), 110);
        assert!(!pdo.look(EVENT, value(1), 100, 30), "the value has not changed");
        assert_eq!(pdo.next_time(), u64::MAX);
        assert!(!pdo.look(EVENT, value(3), 100, 109) && pdo.look(EVENT, value(3), 100, 110));
        assert!(!pdo.sync(EVENT, value(4)));
    }

    #[test]
    fn synchronous_pdos_are_sent_at_their_turn() {
        let turns = |kind| {
            let mut pdo = Transmit::default();
            pdo.start(value(0));
            (1..=10_u8).filter(|turn| pdo.sync(kind, value(u8::from(*turn > 3)))).collect::<Vec<_>>()
        };
        assert_eq!(turns(Transmission::Synchronous(1)), (1..=10).collect::<Vec<_>>());
        assert_eq!(turns(Transmission::Synchronous(5)), [5, 10]);
        assert_eq!(turns(Transmission::SynchronousAcyclic), [4]);
    }

    #[test]
    fn received_values_are_taken_over_at_once_or_at_a_sync() {
        let mut pdo = Receive::default();
        assert_eq!(pdo.received(EVENT, value(1)), Some(value(1)));
        let second = Transmission::Synchronous(2);
        assert_eq!(pdo.received(second, value(2)), None);
        assert_eq!((pdo.sync(second), pdo.received(second, value(3))), (None, None));
        assert_eq!((pdo.sync(second), pdo.sync(second)), (Some(value(3)), None));
    }
}
