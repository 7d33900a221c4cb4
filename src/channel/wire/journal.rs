//! Records of the journal on the wire.

use crate::devices;
use crate::journal::{Change, Changed, EventCodec, PortPhase, Record};
use core::num::NonZeroU32;
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// A record of the journal.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct WireRecord {
    seq: u64,
    time_us: u64,
    count: NonZeroU32,
    period_us: u32,
    latency_us: Option<u32>,
    /// The event as the journal encodes it.
    event: [u64; 3],
    /// Octets of a telegram, if the event does not have all of them.
    octets: Option<Vec<u8>>,
    /// Phases of the ports before the record, if the reader may not know them.
    phases: Option<Vec<PortPhase>>,
}

impl From<&Record> for WireRecord {
    fn from(record: &Record) -> Self {
        let &Record { seq, time_us, event, count, period_us, latency_us, ref octets, ref phases } = record;
        let octets = octets.as_ref().map(|octets| octets.to_vec());
        // A record counts at least one event.
        let count = NonZeroU32::new(count).unwrap_or(NonZeroU32::MIN);
        let (event, phases) = (event.words(), phases.as_ref().map(|phases| phases.to_vec()));
        WireRecord { seq, time_us, count, period_us, latency_us, event, octets, phases }
    }
}

impl WireRecord {
    /// Decodes the record; `None` if no server of this version can have sent it.
    pub(crate) fn record(&self) -> Option<Record> {
        let &WireRecord { seq, time_us, count, period_us, latency_us, event, ref octets, ref phases } = self;
        let octets = octets.as_deref().map(Arc::from);
        let phases = phases.as_deref().map(Arc::from);
        let event = devices::catalogue().event(event)?;
        Some(Record { seq, time_us, event, count: count.get(), period_us, latency_us, octets, phases })
    }
}

/// A change of a followed register.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct WireChange {
    seq: u64,
    time_us: u64,
    what: [u64; 3],
}

impl From<&Change> for WireChange {
    fn from(&Change { seq, time_us, what }: &Change) -> Self {
        WireChange { seq, time_us, what: what.words() }
    }
}

impl WireChange {
    /// Decodes the change; `None` if no server of this version can have sent it.
    pub(crate) fn change(&self) -> Option<Change> {
        let what = Changed::read(self.what).filter(|what| what.words() == self.what)?;
        Some(Change { seq: self.seq, time_us: self.time_us, what })
    }
}

#[cfg(test)]
#[path = "journal_tests.rs"]
mod tests;
