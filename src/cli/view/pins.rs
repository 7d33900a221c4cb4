//! The registers that are pinned: what they hold, how long already, how often they change.

use super::list::List;
use super::look::Spot;
use crate::journal::{Change, Names};
use crate::layout::{Place, plc_prefix};
use std::collections::VecDeque;

/// Rates are those of this emulated time, in microseconds.
const WINDOW_US: u64 = 1_000_000;
/// So many changes are kept for the screen.
const KEPT: usize = 10_000;

/// A register that is pinned.
pub(super) struct Pin {
    /// Number of its PLC.
    pub plc: u16,
    /// Which it is.
    pub place: Place,
    /// When it changed last.
    pub last_us: Option<u64>,
    /// When it changed, as far as that is within the window.
    times: VecDeque<u64>,
}

/// All of them.
#[derive(Default)]
pub(super) struct Pins {
    /// Which line is chosen.
    pub list: List,
    /// In the order in which they were pinned.
    pub all: Vec<Pin>,
    /// Their changes, the oldest first.
    pub changes: VecDeque<Change>,
    /// Which change is chosen.
    pub history: List,
    /// How many changes the emulator did not keep for us.
    pub lost: u64,
}

impl Pin {
    /// Where it lies.
    pub(super) fn spot(&self) -> Spot {
        Spot::place(self.plc, &self.place)
    }

    /// Whether a change is one of it.
    fn is_of(&self, change: &Change) -> bool {
        let (what, own) = (&change.what, self.spot());
        let end = |offset: u32, bytes: u32| offset.saturating_add(bytes);
        let meets = what.plc == own.plc
            && what.offset < end(own.offset, own.width.bytes())
            && own.offset < end(what.offset, what.how.width.bytes());
        let Some(bit) = self.place.bit().filter(|_| meets) else { return meets };
        let bit = u32::from(bit) + 8 * own.offset.saturating_sub(what.offset);
        (what.from ^ what.to) >> bit.min(31) & 1 != 0
    }

    /// How often it has changed in the last second of emulated time, as far as it was pinned then.
    pub(super) fn rate(&self, now_us: u64) -> usize {
        self.times.iter().filter(|time| time.saturating_add(WINDOW_US) > now_us).count()
    }
}

impl Pins {
    /// Pins a place, or lets it go if it is pinned. Whether it is pinned now.
    pub(super) fn toggle(&mut self, plc: u16, place: Place) -> bool {
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
        is_new
    }

    /// Takes changes; those of other registers, which others follow, are left out.
    pub(super) fn take(&mut self, changes: &[Change], now_us: u64) {
        for change in changes {
            let mut is_ours = false;
            for pin in self.all.iter_mut().filter(|pin| pin.is_of(change)) {
                is_ours = true;
                pin.last_us = Some(change.time_us);
                pin.times.push_back(change.time_us);
            }
            if is_ours {
                self.changes.push_back(*change);
            }
        }
        for pin in &mut self.all {
            pin.times.retain(|time| time.saturating_add(WINDOW_US) > now_us);
        }
        let surplus = self.changes.len().saturating_sub(KEPT);
        self.changes.drain(..surplus);
        self.history.choose(self.history.chosen.saturating_sub(surplus), self.changes.len());
    }

    /// The emulated time has gone back to `now_us`: what was later has not happened.
    pub(super) fn go_back(&mut self, now_us: u64) {
        self.changes.retain(|change| change.time_us <= now_us);
        for pin in &mut self.all {
            pin.times.retain(|time| *time <= now_us);
            pin.last_us = pin.last_us.filter(|time| *time <= now_us).or(pin.times.back().copied());
        }
    }

    /// What a pin is called in front of its register's name.
    pub(super) fn prefix(names: &Names, plc: u16) -> String {
        plc_prefix(&names.plcs, plc)
    }
}
