//! The access checker's table on the wire: 64 bytes for each entry, so that whole blocks carry whole entries.

use super::Block;
use crate::devices;
use crate::journal::{Coded, Entry, Found};
use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout};

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, FromBytes, IntoBytes, Immutable, KnownLayout)]
#[repr(C)]
pub(super) struct WireEntry {
    /// The last finding as the journal encodes it.
    last: [u64; 3],
    count: u64,
    first_us: u64,
    last_us: u64,
    latest_us: u32,
    /// 1 or 0.
    is_single: u32,
    reserved: u64,
}

const _: () =
    assert!(size_of::<WireEntry>() == 64 && size_of::<WireEntry>().is_multiple_of(size_of::<Block>()));

impl From<&Entry> for WireEntry {
    fn from(entry: &Entry) -> Self {
        let Entry { last, is_single, count, first_us, last_us, latest_us } = *entry;
        let last = Found::from(last).words();
        WireEntry { last, count, first_us, last_us, latest_us, is_single: is_single.into(), reserved: 0 }
    }
}

impl WireEntry {
    /// The way back; `None` for what no server of this version can have sent.
    pub(crate) fn entry(&self) -> Option<Entry> {
        let WireEntry { last, count, first_us, last_us, latest_us, is_single, .. } = *self;
        let found: Found = devices::catalogue().event(last)?.get()?;
        let last = found.finding(devices::catalogue())?;
        let entry = Entry { last, is_single: is_single != 0, count, first_us, last_us, latest_us };
        // A field that a later version gives a meaning must not be passed over by this one.
        (count > 0 && WireEntry::from(&entry) == *self).then_some(entry)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::rules;
    use crate::journal::Finding;
    use crate::layout::Live;

    #[test]
    fn entries_travel_whole_and_strange_ones_are_refused() {
        let last = Finding {
            rule: &rules::HEADER,
            plc: 3,
            offset: 40,
            live: Live::Always,
            value: 9,
            late_us: u32::MAX,
        };
        for is_single in [true, false] {
            let entry = Entry { last, is_single, count: 7, first_us: 1, last_us: u64::MAX, latest_us: 5 };
            let wire = WireEntry::from(&entry);
            assert_eq!(wire.entry(), Some(entry));
            assert_eq!(WireEntry { count: 0, ..wire }.entry(), None);
            assert_eq!(WireEntry { is_single: 2, ..wire }.entry(), None);
            assert_eq!(WireEntry { reserved: 1, ..wire }.entry(), None);
            assert_eq!(WireEntry { last: [1, 0, 0], ..wire }.entry(), None, "a SYNC edge");
        }
    }
}
