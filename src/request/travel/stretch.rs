//! A stretch of the plant's history: a snapshot, and the stores of operations since then.

use crate::identity::DeviceIndex;
use crate::memory::Width;
use crate::plant::{Plant, Snapshot};

/// Maximum number of stores after one snapshot: about the same number of bytes as the snapshot itself.
const MOST_STORES: usize = 256;

/// A store by an operation.
#[derive(Clone, Copy, Debug)]
pub(in crate::request) struct Store {
    pub(in crate::request) time_us: u64,
    pub(in crate::request) plc: DeviceIndex,
    pub(in crate::request) offset: u32,
    pub(in crate::request) width: Width,
    pub(in crate::request) value: u32,
}

/// A stretch of time in which clients have only stored registers.
#[derive(Clone, Debug)]
pub(super) struct Stretch {
    /// Snapshot of the beginning.
    pub(super) begin: Snapshot,
    /// Stores of operations after the snapshot, in order.
    pub(super) stores: Vec<Store>,
    /// The last moment that the plant has reached in this stretch.
    end: StretchEnd,
}

/// The last known moment of a stretch.
#[derive(Clone, Copy, Debug)]
struct StretchEnd {
    time_us: u64,
    /// Number of stores up to the end.
    stores: usize,
    /// Hash of the journal at this moment.
    hash: u64,
}

impl Stretch {
    /// Creates a stretch that begins at the present moment. Its snapshot reuses the memory `room` of an earlier
    /// snapshot.
    pub(super) fn from_here(plant: &Plant, room: Vec<u8>) -> Self {
        let end = StretchEnd { time_us: plant.now(), stores: 0, hash: plant.journal().hash() };
        Stretch { begin: plant.snapshot_reusing(room), stores: Vec::new(), end }
    }

    /// Memory of the stretch in bytes.
    pub(super) fn size(&self) -> usize {
        self.begin.size() + size_of_val(&self.stores[..])
    }

    pub(super) fn has_room(&self) -> bool {
        self.stores.len() < MOST_STORES
    }

    /// Extends the stretch to the present time.
    pub(super) fn goes_on_to(&mut self, plant: &Plant) {
        self.end =
            StretchEnd { time_us: plant.now(), stores: self.stores.len(), hash: plant.journal().hash() };
    }

    /// Ends the stretch at the present moment of the plant, which has returned to it. Later stores are dropped.
    pub(super) fn ends_here(&mut self, plant: &Plant) {
        let now = plant.now();
        self.stores.truncate(self.stores.partition_point(|store| store.time_us <= now));
        if self.end.time_us > now {
            self.goes_on_to(plant);
        }
    }

    pub(super) fn end_us(&self) -> u64 {
        self.end.time_us
    }

    /// Repeats the stretch. The plant must be at the beginning of the stretch. Returns true if the journal at the end
    /// has the same hash as the first time. If `is_awaited` returns false, ends early; the result is then meaningless.
    pub(super) fn is_repeated(&self, plant: &mut Plant, is_awaited: &mut dyn FnMut() -> bool) -> bool {
        let StretchEnd { time_us, stores, hash } = self.end;
        RemainingStores(&self.stores[..stores]).go_to(plant, time_us, is_awaited);
        if plant.journal().hash() == hash {
            return true;
        }
        // When the hash was taken, the plant may have handled the events at the end already. So both hashes are
        // compared.
        plant.advance_while(time_us, is_awaited);
        plant.journal().hash() == hash
    }

    /// Returns the stores from the beginning of the stretch up to a moment.
    pub(super) fn way(&self, until_us: u64) -> RemainingStores<'_> {
        RemainingStores(&self.stores[..self.stores.partition_point(|store| store.time_us <= until_us)])
    }
}

/// Stores that are still to be repeated.
pub(super) struct RemainingStores<'a>(&'a [Store]);

impl RemainingStores<'_> {
    /// Returns the time of the next store; `u64::MAX` if there is none.
    pub(super) fn next_store(&self) -> u64 {
        self.0.first().map_or(u64::MAX, |store| store.time_us)
    }

    /// Advances to a moment, and makes the stores up to and including this moment. An operation may cause an event at
    /// its own emulated time. As in the first run, such an event is handled only when the clock advances. If `is_awaited`
    /// returns false, ends at an earlier moment.
    pub(super) fn go_to(&mut self, plant: &mut Plant, time_us: u64, is_awaited: &mut dyn FnMut() -> bool) {
        let mut advance = |plant: &mut Plant, time_us| {
            if time_us > plant.now() {
                plant.advance_while(time_us, is_awaited);
            }
        };
        while let Some((store, rest)) = self.0.split_first().filter(|(store, _)| store.time_us <= time_us) {
            advance(plant, store.time_us);
            // The result is ignored: the plant is in the same state as in the first run, in which the store succeeded.
            let _ = plant.store(store.plc, store.offset, store.width, store.value);
            self.0 = rest;
        }
        advance(plant, time_us);
    }
}
