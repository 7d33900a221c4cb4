//! A single line of the journal.

use super::{Event, Octets, PortPhase};
use std::sync::Arc;

/// A line of the journal: an event, or several equal events at equal distances.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Record {
    /// Number of the record, from 0. [`Record::PENDING`] while its events are still counted; [`Record::COUNTED`] if the
    /// count has ended and the record has no number yet.
    pub seq: u64,
    /// Emulated time in microseconds since power-on. If the record counts several events, the time of the last event.
    pub time_us: u64,
    /// The recorded event.
    pub event: Event,
    /// Number of equal events in the record, at least 1.
    pub count: u32,
    /// Distance between the events in microseconds; 0 for a single event.
    pub period_us: u32,
    /// For a handshake or a state: microseconds from the request to this answer, if the request came through the
    /// channel.
    pub latency_us: Option<u32>,
    /// Octets of a telegram as they were on the line, or of a text, at most 255. `None` if the event has no octets, or
    /// contains all of them itself.
    pub octets: Option<Arc<[u8]>>,
    /// Phases of the ports before this record, if a reader of the preceding records may not know them: in the first
    /// record of a part of the journal, and after missing records. Ports that are missing here are in their first
    /// phase. `None` if no phase has changed since the preceding record.
    pub phases: Option<Arc<[PortPhase]>>,
}

impl Record {
    /// Number of a record with a running count, which has no number yet.
    pub const PENDING: u64 = u64::MAX;

    /// Number of a record with an ended count, which has no number yet.
    pub const COUNTED: u64 = u64::MAX - 1;

    /// Returns a record of one event, without number.
    pub(crate) fn single(time_us: u64, event: Event) -> Self {
        Record {
            seq: Self::PENDING,
            time_us,
            event,
            count: 1,
            period_us: 0,
            latency_us: None,
            octets: None,
            phases: None,
        }
    }

    /// Returns the octets, if the record is a telegram on the line.
    pub fn telegram(&self) -> Option<Octets> {
        let known = self.event.telegram()?;
        let kind = known.kind;
        let whole = self.octets.as_ref();
        let whole = whole.map(|octets| Octets { kind, known: octets.to_vec(), length: octets.len() });
        Some(whole.unwrap_or(known))
    }

    /// True if the record has no number yet.
    pub fn is_pending(&self) -> bool {
        self.seq >= Self::COUNTED
    }

    /// True if the count of the record may continue.
    pub fn may_continue(&self) -> bool {
        self.seq == Self::PENDING
    }

    /// Returns the record as it is at emulated time `now_us`: if an expected event is missing, the count has ended.
    pub(crate) fn judged_at(self, now_us: u64) -> Self {
        let is_over = self.period_us == 0 || self.time_us.saturating_add(self.period_us.into()) < now_us;
        let seq = if self.is_pending() && is_over { Self::COUNTED } else { self.seq };
        Self { seq, ..self }
    }

    /// Returns the time of the first event of the record, in microseconds.
    pub fn first_us(&self) -> u64 {
        let distance = u64::from(self.count.saturating_sub(1)) * u64::from(self.period_us);
        self.time_us.saturating_sub(distance)
    }

    /// Returns times of all events of the record, in microseconds, ascending.
    pub fn times(&self) -> impl DoubleEndedIterator<Item = u64> + use<> {
        let (first, period) = (self.first_us(), u64::from(self.period_us));
        (0..u64::from(self.count)).map(move |n| first + n * period)
    }
}
