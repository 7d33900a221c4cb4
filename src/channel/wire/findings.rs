//! The access checker's table on the wire.

use crate::devices;
use crate::journal::{Entry, EventCodec, Found};
use core::num::NonZeroU64;
use serde::{Deserialize, Serialize};

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct WireEntry {
    /// The last finding as the journal encodes it.
    last: [u64; 3],
    count: NonZeroU64,
    first_us: u64,
    last_us: u64,
    latest_us: u32,
    is_single: bool,
}

impl From<&Entry> for WireEntry {
    fn from(entry: &Entry) -> Self {
        // The notes follow the list.
        let Entry { last, is_single, count, first_us, last_us, latest_us, note: _ } = *entry;
        // An entry counts at least one finding.
        let count = NonZeroU64::new(count).unwrap_or(NonZeroU64::MIN);
        WireEntry { last: Found::from(last).words(), count, first_us, last_us, latest_us, is_single }
    }
}

impl WireEntry {
    /// Decodes the entry; `None` if no server of this version can have sent it.
    pub(crate) fn entry(&self) -> Option<Entry> {
        let WireEntry { last, count, first_us, last_us, latest_us, is_single } = *self;
        let found: Found = devices::catalogue().event(last)?.get()?;
        let last = found.finding(devices::catalogue())?;
        Some(Entry { last, is_single, count: count.get(), first_us, last_us, latest_us, note: None })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::channel::wire::serde_types;
    use crate::check::rules;
    use crate::identity::DeviceIndex;
    use crate::journal::Finding;
    use crate::layout::RegisterPhase;

    #[test]
    fn entries_travel_whole_and_strange_ones_are_refused() {
        let last = Finding {
            rule: &rules::HEADER,
            plc: DeviceIndex(3),
            offset: 40,
            live: RegisterPhase::ALWAYS,
            value: 9,
            late_us: u32::MAX,
        };
        for is_single in [true, false] {
            let entry =
                Entry { last, is_single, count: 7, first_us: 1, last_us: u64::MAX, latest_us: 5, note: None };
            let wire = WireEntry::from(&entry);
            let bytes = serde_types::encode(&wire);
            let back: WireEntry = serde_types::decode(&bytes).unwrap();
            assert_eq!((back, back.entry()), (wire, Some(entry)));
            assert_eq!(WireEntry { last: [1, 0, 0], ..wire }.entry(), None, "a SYNC edge");
            let strange = |at: usize, byte: u8| {
                let mut bytes = bytes.clone();
                bytes[at] = byte;
                serde_types::decode::<WireEntry>(&bytes)
            };
            assert_eq!(strange(bytes.len() - 1, 2), None, "neither one finding nor several");
            assert_eq!(serde_types::decode::<WireEntry>(&bytes[..bytes.len() - 1]), None);
            assert_eq!(
                serde_types::decode::<WireEntry>(&[&bytes[..], &[0]].concat()),
                None,
                "bytes after it"
            );
        }
    }
}
