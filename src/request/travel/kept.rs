//! Snapshots that clients keep, by their numbers. A snapshot ends with its client.

use super::unknown;
use crate::plant::{Plant, Snapshot};
use crate::request::{Code, Refused};
use std::collections::BTreeMap;

/// Maximum number of snapshots that clients keep at a time.
pub(super) const MAX_KEPT: usize = 64;
/// Maximum memory of these snapshots together, in bytes. A snapshot that is kept alone may be larger.
const MAX_KEPT_BYTES: usize = 256 << 20;

#[derive(Debug)]
pub(super) struct KeptSnapshot {
    /// Number of the client that keeps the snapshot; 0 for the emulator's own process.
    client: u128,
    pub(super) snapshot: Snapshot,
    /// Number of events in the journal at the time of the snapshot.
    written: u64,
    /// True if the plant has reached its present state from the snapshot, without a return or another snapshot in
    /// between.
    pub(super) is_behind: bool,
}

/// The kept snapshots of all clients.
#[derive(Debug)]
pub(super) struct KeptSnapshots {
    by_number: BTreeMap<u32, KeptSnapshot>,
    /// Number of the last snapshot.
    last: u32,
    /// Maximum memory of the snapshots together, in bytes.
    pub(super) most_bytes: usize,
}

impl Default for KeptSnapshots {
    fn default() -> Self {
        KeptSnapshots { by_number: BTreeMap::new(), last: 0, most_bytes: MAX_KEPT_BYTES }
    }
}

impl KeptSnapshots {
    /// Keeps a snapshot of the plant for a client, and returns its number.
    ///
    /// # Errors
    /// The maximum number of snapshots, or of their bytes, is reached.
    pub(super) fn keep(&mut self, client: u128, plant: &Plant) -> Result<u32, Refused> {
        let count = self.by_number.len();
        let others = self.by_number.values().filter(|kept| kept.client != client).count();
        let full = |what: String| match others {
            0 => Refused::new(
                Code::SNAPSHOT,
                format_args!(
                    "{what}: forget one (`forget`, in a scenario and in Python `forget(saved)`), or keep the number of an \
                     earlier save() and go back to that"
                ),
            ),
            _ => Refused::new(
                Code::NOT_NOW,
                format_args!("{what}: other clients keep {others} of them until they end or forget them"),
            ),
        };
        if count >= MAX_KEPT {
            return Err(full(format!("{MAX_KEPT} snapshots are kept, which is the maximum")));
        }
        let snapshot = plant.snapshot();
        let size = self.size() + snapshot.size();
        if count > 0 && size > self.most_bytes {
            let (most, need) = (self.most_bytes >> 20, size.div_ceil(1 << 20));
            return Err(full(format!(
                "the {count} kept snapshots and this one need {need} MiB, and the maximum is {most} MiB"
            )));
        }
        self.last = self.last.wrapping_add(1).max(1);
        let written = plant.journal().written();
        self.by_number.insert(self.last, KeptSnapshot { client, snapshot, written, is_behind: true });
        Ok(self.last)
    }

    /// Deletes a snapshot.
    ///
    /// # Errors
    /// There is no snapshot with this number.
    pub(super) fn forget(&mut self, number: u32) -> Result<(), Refused> {
        self.by_number.remove(&number).map(drop).ok_or_else(|| unknown(number))
    }

    /// Returns the snapshot with this number.
    ///
    /// # Errors
    /// There is no such snapshot.
    pub(super) fn get(&mut self, number: u32) -> Result<&mut KeptSnapshot, Refused> {
        self.by_number.get_mut(&number).ok_or_else(|| unknown(number))
    }

    /// True if there is a snapshot with this number.
    pub(super) fn contains(&self, number: u32) -> bool {
        self.by_number.contains_key(&number)
    }

    /// Memory of all snapshots in bytes.
    fn size(&self) -> usize {
        self.by_number.values().map(|kept| kept.snapshot.size()).sum()
    }

    /// Called when the plant has returned to the moment with `written` events in the journal.
    pub(super) fn is_at(&mut self, written: u64) {
        self.by_number.values_mut().for_each(|kept| kept.is_behind &= kept.written <= written);
    }

    /// Called when the state of the plant has been replaced: it did not come from any of the snapshots.
    pub(super) fn is_elsewhere(&mut self) {
        self.by_number.values_mut().for_each(|kept| kept.is_behind = false);
    }
}

/// The functions for clients of a channel, which may leave.
#[cfg(feature = "channel")]
impl KeptSnapshots {
    /// Deletes the snapshots of clients for which `is_present` is false.
    pub(super) fn release(&mut self, is_present: impl Fn(u128) -> bool) {
        self.by_number.retain(|_, kept| is_present(kept.client));
    }

    /// True if a client of a channel keeps a snapshot.
    pub(super) fn any_of_clients(&self) -> bool {
        self.by_number.values().any(|kept| kept.client != 0)
    }

    /// True if another snapshot may have no place.
    pub(super) fn is_nearly_full(&self) -> bool {
        let largest = self.by_number.values().map(|kept| kept.snapshot.size()).max().unwrap_or(0);
        self.by_number.len() >= MAX_KEPT || self.size() + 2 * largest > self.most_bytes
    }
}
