//! Records of the journal on the wire: 64 bytes each, so that whole blocks carry whole records.

use super::Block;
use crate::devices;
use crate::journal::Record;
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

/// No latency is known.
const NO_LATENCY: u32 = u32::MAX;

/// A record.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
pub(super) struct WireRecord {
    seq: u64,
    time_us: u64,
    count: u32,
    period_us: u32,
    latency_us: u32,
    /// Zero, as are those behind the event.
    reserved: u32,
    /// The event as the journal encodes it.
    event: [u64; 3],
    reserved_too: u64,
}

const _: () =
    assert!(size_of::<WireRecord>() == 64 && size_of::<WireRecord>().is_multiple_of(size_of::<Block>()));

impl From<&Record> for WireRecord {
    fn from(record: &Record) -> Self {
        WireRecord {
            seq: record.seq,
            time_us: record.time_us,
            count: record.count,
            period_us: record.period_us,
            latency_us: record.latency_us.unwrap_or(NO_LATENCY),
            reserved: 0,
            event: record.event.words(),
            reserved_too: 0,
        }
    }
}

impl WireRecord {
    /// The way back; `None` for what no server of this version can have sent.
    pub(crate) fn record(&self) -> Option<Record> {
        let record = Record {
            seq: self.seq,
            time_us: self.time_us,
            event: devices::catalogue().event(self.event)?,
            count: self.count,
            period_us: self.period_us,
            latency_us: (self.latency_us != NO_LATENCY).then_some(self.latency_us),
        };
        // A field that a later version gives a meaning must not be passed over by this one.
        (record.count > 0 && WireRecord::from(&record) == *self).then_some(record)
    }
}

#[cfg(test)]
#[path = "journal_tests.rs"]
mod tests;
