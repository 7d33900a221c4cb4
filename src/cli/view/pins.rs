//! The pinned registers with their values, the ages of the values, and the rates of change.

use super::list::List;
use super::poll::MemoryLocation;
use crate::identity::DeviceIndex;
use crate::journal::{Change, Names};
use crate::layout::{NamedLocation, plc_prefix};
use std::collections::VecDeque;

/// Length of the window in which changes are counted for the rate, in microseconds of emulated time.
const WINDOW_US: u64 = 1_000_000;
/// Number of changes that are kept for the screen.
const KEPT: usize = 10_000;

/// A register that the user has pinned, with its last values.
pub(super) struct Pin {
    /// Number of the PLC.
    pub plc: DeviceIndex,
    /// The register or address.
    pub place: NamedLocation,
    /// Time of the last change, in microseconds.
    pub last_us: Option<u64>,
    /// Times of the changes within the window, in microseconds.
    times: VecDeque<u64>,
}

/// All registers that the user has pinned.
#[derive(Default)]
pub(super) struct Pins {
    /// Position of the selection in the list of pinned registers.
    pub list: List,
    /// The registers in the order in which they were pinned.
    pub all: Vec<Pin>,
    /// Changes of the pinned registers since they were pinned, the oldest first.
    changes: VecDeque<Change>,
    /// Changes from the journal, of pinned and other registers, the oldest first.
    recorded: VecDeque<Change>,
    /// The displayed changes, merged from `changes` and `recorded`; the oldest first.
    shown: Vec<Change>,
    /// Position of the selection in the list of changes.
    pub history: List,
    /// Number of changes that are lost because the emulator did not keep them.
    pub lost: u64,
}

impl Pin {
    /// Memory location of the register.
    pub(super) fn location(&self) -> MemoryLocation {
        MemoryLocation::place(self.plc, &self.place)
    }

    /// True if the change concerns this register.
    fn is_of(&self, change: &Change) -> bool {
        let (what, own) = (&change.what, self.location());
        let end = |offset: u32, bytes: u32| offset.saturating_add(bytes);
        let meets = what.plc == own.plc
            && what.offset < end(own.offset, own.width.bytes())
            && own.offset < end(what.offset, what.how.width.bytes());
        let Some(bit) = self.place.bit().filter(|_| meets) else { return meets };
        let bit = u32::from(bit) + 8 * own.offset.saturating_sub(what.offset);
        (what.from ^ what.to) >> bit.min(31) & 1 != 0
    }

    /// Returns the number of changes in the last second of emulated time. Changes from before the pinning are not
    /// counted.
    pub(super) fn rate(&self, now_us: u64) -> usize {
        self.times.iter().filter(|time| time.saturating_add(WINDOW_US) > now_us).count()
    }
}

impl Pins {
    /// Pins a register or address, or removes the pin. Returns true if it is pinned now.
    pub(super) fn toggle(&mut self, plc: DeviceIndex, place: NamedLocation) -> bool {
        let same = |pin: &Pin| pin.plc == plc && pin.place.address() == place.address();
        let before = self.all.len();
        self.all.retain(|pin| !same(pin));
        let is_new = self.all.len() == before;
        if is_new {
            self.all.push(Pin { plc, place, last_us: None, times: VecDeque::new() });
            self.list.choose(usize::MAX, self.all.len());
        } else {
            self.list.choose(self.list.chosen, self.all.len());
            let all = &self.all;
            self.changes.retain(|change| all.iter().any(|pin| pin.is_of(change)));
        }
        self.join();
        is_new
    }

    /// Adds the changes since the last poll (`changes`), and changes from the journal (`recorded`). Leaves out changes
    /// of registers that only other clients follow.
    pub(super) fn take(&mut self, changes: &[Change], recorded: &[Change], now_us: u64) {
        let mut is_news = !recorded.is_empty();
        for change in changes {
            let mut is_ours = false;
            for pin in self.all.iter_mut().filter(|pin| pin.is_of(change)) {
                is_ours = true;
                pin.last_us = Some(change.time_us);
                pin.times.push_back(change.time_us);
            }
            if is_ours {
                self.changes.push_back(*change);
                is_news = true;
            }
        }
        self.recorded.extend(recorded);
        for pin in &mut self.all {
            pin.times.retain(|time| time.saturating_add(WINDOW_US) > now_us);
        }
        for list in [&mut self.changes, &mut self.recorded] {
            list.drain(..list.len().saturating_sub(KEPT));
        }
        if is_news {
            self.join();
        }
    }

    /// Returns the displayed changes, the oldest first: changes of the pinned registers or, if none is pinned, of all
    /// registers that the journal records.
    pub(super) fn shown(&self) -> &[Change] {
        &self.shown
    }

    /// Merges both lists. A change in both lists is shown once.
    fn join(&mut self) {
        let is_shown = |change: &&Change| self.all.is_empty() || self.all.iter().any(|pin| pin.is_of(change));
        let mut shown: Vec<Change> = self.recorded.iter().filter(is_shown).copied().collect();
        let mut at = 0;
        let mut matched = vec![false; shown.len()];
        let mut others = Vec::new();
        for change in &self.changes {
            at += shown[at..].partition_point(|known| known.time_us < change.time_us);
            let same_time = shown[at..].iter().take_while(|known| known.time_us == change.time_us);
            let mut same = same_time.zip(at..).filter(|(known, _)| known.what == change.what);
            match same.find(|(_, place)| !matched[*place]) {
                Some((_, place)) => matched[place] = true,
                None => others.push(*change),
            }
        }
        shown.append(&mut others);
        shown.sort_by_key(|change| change.time_us);
        let surplus = shown.len().saturating_sub(KEPT);
        shown.drain(..surplus);
        let growth = shown.len().saturating_sub(self.shown.len());
        let is_older = |first: &Change| self.shown.first().is_some_and(|known| first.time_us < known.time_us);
        // The selection moves by the number of changes that are inserted before it.
        let moved = if shown.first().is_some_and(is_older) { growth } else { 0 };
        self.history.choose((self.history.chosen + moved).saturating_sub(surplus), shown.len());
        self.shown = shown;
        for pin in self.all.iter_mut().filter(|pin| pin.last_us.is_none()) {
            pin.last_us = self.shown.iter().rfind(|change| pin.is_of(change)).map(|change| change.time_us);
        }
    }

    /// Deletes all changes, because they belong to another emulator.
    pub(super) fn forget(&mut self) {
        self.changes.clear();
        self.recorded.clear();
        self.join();
    }

    /// Removes the changes after `now_us`: the emulated time has gone back.
    pub(super) fn go_back(&mut self, now_us: u64) {
        self.changes.retain(|change| change.time_us <= now_us);
        self.recorded.retain(|change| change.time_us <= now_us);
        for pin in &mut self.all {
            pin.times.retain(|time| *time <= now_us);
            pin.last_us = pin.last_us.filter(|time| *time <= now_us).or(pin.times.back().copied());
        }
        self.join();
    }

    /// Prefix in front of the register name of a pin: the PLC, if the instance has several.
    pub(super) fn prefix(names: &Names, plc: DeviceIndex) -> String {
        plc_prefix(&names.plcs, plc)
    }
}
