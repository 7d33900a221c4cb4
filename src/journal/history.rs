//! Finds the changes of followed registers and stores them.
//!
//! Plain RAM cannot trap accesses, so registers are compared with their previous values. A comparison before each poll
//! of the firmware finds writes of a program, and a comparison after each event of the firmware finds writes of the
//! firmware. Another comparison follows each write through the channel. The firmware also reports some registers that
//! it writes. Such a report shows a request even if the request was answered between two comparisons. If a program
//! makes several writes between two polls, their order is not known. The changes are then reported in the order of
//! their addresses.
//!
//! A comparison changes nothing in the plant. Changes for the journal become records ([`Changed`]). Other changes go to
//! a bounded list with separate numbers. Observers (clients that only observe, for example a view) read that list, so
//! they do not change the journal.

use super::changed::{By, ChangeDetails, Changed};
use super::onlookers::Onlookers;
use crate::identity::DeviceIndex;
use crate::layout::{RegisterPhase, Width};
use core::ops::Range;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Maximum number of followed registers.
pub const MAX_FOLLOWED: usize = 65_536;
/// Maximum count of changes in the list for observers.
pub const KEPT_CHANGES: usize = 65_536;
/// Real time without a request for changes, after which an observer counts as disconnected.
pub(super) const GONE: Duration = Duration::from_secs(10);
/// Count of comparisons between two reads of the host's clock.
const LOOKS: u32 = 4096;

/// List to which changes of a register are added.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Keep {
    /// Into the journal, until the end.
    InJournal,
    /// Into the list for observers (clients that only observe), as long as an observer requests changes.
    ForOnlookers,
}

/// A change of a register, and its number in the list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Change {
    /// Number of the change. A gap in the numbers means that the changes in between are no longer kept.
    pub seq: u64,
    /// Emulated time in microseconds: of the comparison, or of the firmware's report.
    pub time_us: u64,
    /// The changed register, and its values before and after the change.
    pub what: Changed,
}

/// The firmware's report of a register that it has written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stored {
    /// Index of the device.
    pub plc: DeviceIndex,
    /// Offset of the register.
    pub offset: u32,
    /// The value before the write, if the firmware has read the register.
    pub found: Option<u32>,
    /// The value that the firmware has written.
    pub now: u32,
}

/// The RAM of the devices, as the comparisons need it.
pub(crate) trait Rams {
    /// Returns the value of a register of device `plc`.
    fn load(&self, plc: DeviceIndex, offset: u32, width: Width) -> Option<u32>;

    /// Returns the phase at this offset: if structures overlay each other, it shows which structure is valid.
    fn live(&self, plc: DeviceIndex, offset: u32) -> RegisterPhase;

    /// True if the register is forced.
    fn is_forced(&self, plc: DeviceIndex, offset: u32) -> bool;

    /// Returns the originator of a change: the force, if the register is forced, else `by`.
    fn changed_by(&self, plc: DeviceIndex, offset: u32, by: By) -> By {
        if self.is_forced(plc, offset) { By::Force } else { by }
    }
}

/// A register with recorded changes.
#[derive(Serialize, Deserialize)]
pub(super) struct FollowedRegister {
    plc: DeviceIndex,
    offset: u32,
    width: Width,
    /// Value at the last comparison.
    held: u32,
    /// The phase at the last change: if structures overlay each other, it shows which structure was valid.
    live: RegisterPhase,
    in_journal: bool,
    for_onlookers: bool,
    /// The value that observers received last, if the plant has moved to another moment and they have not been notified
    /// yet.
    #[serde(skip)]
    left: Option<u32>,
}

/// The registers that are followed, and their changes.
pub(super) struct History {
    /// Sorted by PLC and address.
    followed: Vec<FollowedRegister>,
    changes: VecDeque<Change>,
    /// The number of the next change.
    end: u64,
    onlookers: Onlookers,
    /// Time of the last request for changes.
    asked: Instant,
    looks: u32,
    /// True while a client searches for a past moment. Changes during the search are not reported to observers.
    pub(super) is_searching: bool,
}

impl History {
    pub(super) fn new() -> Self {
        History {
            followed: Vec::new(),
            changes: VecDeque::new(),
            end: 0,
            onlookers: Onlookers::default(),
            asked: Instant::now(),
            looks: 0,
            is_searching: false,
        }
    }

    /// Returns the registers with changes in the journal.
    pub(super) fn in_journal(&self) -> impl Iterator<Item = &FollowedRegister> {
        self.followed.iter().filter(|register| register.in_journal)
    }

    /// True if the changes of a register are in the journal.
    pub(super) fn is_recorded(&self, plc: DeviceIndex, offset: u32) -> bool {
        // Finds the last register that begins at this offset or at a lower one: a wider register can contain the
        // offset.
        let at = self.find(plc, offset).map_or_else(|next| next.checked_sub(1), Some);
        let register = at.and_then(|at| self.followed.get(at)).filter(|it| it.plc == plc);
        register.is_some_and(|it| it.in_journal && offset < it.offset + it.width.bytes())
    }

    /// Replaces the registers with changes in the journal. Registers that observers follow stay followed.
    pub(super) fn restore_in_journal(&mut self, followed: Vec<FollowedRegister>) {
        self.followed.retain_mut(|register| {
            register.in_journal = false;
            register.for_onlookers
        });
        for mut register in followed.into_iter().take(MAX_FOLLOWED) {
            register.in_journal = true;
            match self.find(register.plc, register.offset) {
                Ok(at) => {
                    let known = &self.followed[at];
                    register.left = known.left.or(Some(known.held));
                    register.for_onlookers = true;
                    self.followed[at] = register;
                }
                Err(at) => {
                    register.for_onlookers = false;
                    self.followed.insert(at, register);
                }
            }
        }
    }

    /// True if no register is followed.
    #[inline]
    pub(super) fn is_empty(&self) -> bool {
        self.followed.is_empty()
    }

    /// Follows a register for a client from now on. Returns `false` if too many registers are followed already.
    pub(super) fn follow(
        &mut self,
        client: u128,
        plc: DeviceIndex,
        offset: u32,
        width: Width,
        keep: Keep,
        rams: &impl Rams,
    ) -> bool {
        if self.asked.elapsed() > GONE {
            self.forget_onlookers();
        }
        let now = Instant::now();
        self.asked = now;
        if keep == Keep::ForOnlookers && !self.has_room_for(client, (plc, offset), now) {
            return false;
        }
        let at = match self.find(plc, offset) {
            Ok(at) => at,
            Err(_) if self.followed.len() >= MAX_FOLLOWED => return false,
            Err(at) => {
                let held = rams.load(plc, offset, width).unwrap_or(0);
                let live = rams.live(plc, offset);
                let (in_journal, for_onlookers, left) = (false, false, None);
                let register =
                    FollowedRegister { plc, offset, width, held, live, in_journal, for_onlookers, left };
                self.followed.insert(at, register);
                at
            }
        };
        if let Some(register) = self.followed.get_mut(at) {
            match keep {
                Keep::InJournal => register.in_journal = true,
                Keep::ForOnlookers => {
                    register.for_onlookers = true;
                    self.onlookers.add(client, (plc, offset), now);
                }
            }
        }
        true
    }

    /// True if a client may follow this register. A client may follow at most as many registers as then remain free for
    /// other clients.
    fn has_room_for(&mut self, client: u128, place: (DeviceIndex, u32), now: Instant) -> bool {
        let has_room = |this: &Self| {
            let left = MAX_FOLLOWED - this.followed.len().min(MAX_FOLLOWED);
            this.onlookers.contains(client, place) || this.onlookers.count(client) < left
        };
        if has_room(self) {
            return true;
        }
        if self.onlookers.release(client, now) {
            self.release_unfollowed();
        }
        has_room(self)
    }

    /// Releases the registers that no observer follows any more.
    fn release_unfollowed(&mut self) {
        let Self { followed, onlookers, .. } = self;
        followed.retain_mut(|it| {
            it.for_onlookers = it.for_onlookers && onlookers.any_follows((it.plc, it.offset));
            it.in_journal || it.for_onlookers
        });
    }

    /// True if a client of a channel follows registers as an observer.
    #[cfg(any(feature = "channel", test))]
    pub(super) fn belongs_to_clients(&self) -> bool {
        self.onlookers.any_of_clients()
    }

    /// True if more than a quarter of all places is taken.
    #[cfg(feature = "channel")]
    pub(super) fn follows_many(&self) -> bool {
        self.followed.len() > MAX_FOLLOWED / 4
    }

    /// Releases the registers of observers for which `is_present` is false.
    #[cfg(any(feature = "channel", test))]
    pub(super) fn release_departed(&mut self, is_present: impl Fn(u128) -> bool) {
        if self.onlookers.release_departed(is_present) {
            self.release_unfollowed();
        }
    }

    /// Compares all registers with their previous values; changes for the journal go to `note`.
    pub(super) fn compare(&mut self, time_us: u64, by: By, rams: &impl Rams, note: impl FnMut(Changed)) {
        self.forget_absent_onlookers();
        self.compare_places(0..self.followed.len(), time_us, by, rams, note);
    }

    /// Compares the registers that begin in `bytes` of the image of a PLC, like [`History::compare`].
    pub(super) fn compare_in(
        &mut self,
        (plc, bytes): (DeviceIndex, Range<u32>),
        time_us: u64,
        by: By,
        rams: &impl Rams,
        note: impl FnMut(Changed),
    ) {
        let [first, end] =
            [bytes.start, bytes.end].map(|at| self.find(plc, at).unwrap_or_else(|place| place));
        self.compare_places(first..end, time_us, by, rams, note);
    }

    fn compare_places(
        &mut self,
        places: Range<usize>,
        time_us: u64,
        by: By,
        rams: &impl Rams,
        mut note: impl FnMut(Changed),
    ) {
        let History { followed, changes, end, is_searching, .. } = self;
        let followed = followed.get_mut(places).unwrap_or_default();
        for register in followed.iter_mut().filter(|register| register.in_journal || !*is_searching) {
            let Some(now) = rams.load(register.plc, register.offset, register.width) else { continue };
            if now == register.held {
                continue;
            }
            register.live = rams.live(register.plc, register.offset);
            let by = rams.changed_by(register.plc, register.offset, by);
            let keep = |change| keep(changes, end, time_us, change);
            register.set_value(now, by, (!*is_searching).then_some(keep), &mut note);
        }
    }

    /// Called when the plant has moved to another moment of emulated time, for example back to an earlier one.
    /// Observers receive the differences as changes; the journal does not. The next comparison still finds what
    /// programs have written since the last comparison.
    pub(super) fn arrived(&mut self, time_us: u64, rams: &impl Rams) {
        let History { followed, changes, end, is_searching, .. } = self;
        if *is_searching {
            return;
        }
        for register in followed.iter_mut().filter(|register| register.for_onlookers) {
            let from = register.left.take().unwrap_or(register.held);
            let &mut FollowedRegister { plc, offset, width, in_journal, .. } = register;
            let live = rams.live(plc, offset);
            if !in_journal {
                register.held = rams.load(plc, offset, width).unwrap_or(register.held);
                register.live = live;
            }
            if from != register.held {
                let how = ChangeDetails { width, by: rams.changed_by(plc, offset, By::Channel), live };
                keep(changes, end, time_us, Changed { plc, offset, how, from, to: register.held });
            }
        }
    }

    /// Records the firmware's report of a register that it has written.
    pub(super) fn stored(&mut self, time_us: u64, stored: Stored, mut note: impl FnMut(Changed)) {
        let Ok(at) = self.find(stored.plc, stored.offset) else { return };
        let History { followed, changes, end, is_searching, .. } = self;
        let Some(register) = followed.get_mut(at).filter(|it| it.in_journal || !*is_searching) else {
            return;
        };
        let found = stored.found.map(|found| (found, By::Program));
        for (now, by) in found.into_iter().chain([(stored.now, By::Firmware)]) {
            if now == register.held {
                continue;
            }
            let keep = |change| keep(changes, end, time_us, change);
            register.set_value(now, by, (!*is_searching).then_some(keep), &mut note);
        }
    }

    /// Returns at most `max` changes from number `from` on, and the number of the next change. The call also shows that
    /// the observer is still present.
    pub(super) fn read(&mut self, client: u128, from: u64, max: usize) -> (Vec<Change>, u64) {
        self.asked = Instant::now();
        self.onlookers.ask(client, self.asked);
        let first = self.changes.partition_point(|change| change.seq < from);
        (self.changes.iter().skip(first).take(max).copied().collect(), self.end)
    }

    #[inline]
    fn find(&self, plc: DeviceIndex, offset: u32) -> Result<usize, usize> {
        self.followed.binary_search_by_key(&(plc, offset), |register| (register.plc, register.offset))
    }

    /// Releases the registers of observers that have not sent a request for a long time. The function uses the clock of
    /// the host, not of the plant; it has no influence on the plant.
    fn forget_absent_onlookers(&mut self) {
        self.looks = self.looks.wrapping_add(1);
        if self.looks.is_multiple_of(LOOKS) && self.asked.elapsed() > GONE {
            self.forget_onlookers();
        }
    }

    /// Releases the registers that only observers follow, and their changes.
    fn forget_onlookers(&mut self) {
        self.followed.iter_mut().for_each(|register| register.for_onlookers = false);
        self.followed.retain(|register| register.in_journal);
        self.changes = VecDeque::new();
        self.onlookers = Onlookers::default();
    }
}

impl FollowedRegister {
    /// Sets the value to `to`, and reports the change to the journal and to observers if they follow the register.
    fn set_value(
        &mut self,
        to: u32,
        by: By,
        keep: Option<impl FnOnce(Changed)>,
        note: &mut impl FnMut(Changed),
    ) {
        let &mut FollowedRegister { plc, offset, width, held: from, live, .. } = self;
        self.held = to;
        let change = Changed { plc, offset, how: ChangeDetails { width, by, live }, from, to };
        if let Some(keep) = keep.filter(|_| self.for_onlookers) {
            keep(change);
        }
        if self.in_journal {
            note(change);
        }
    }
}

fn keep(changes: &mut VecDeque<Change>, end: &mut u64, time_us: u64, what: Changed) {
    if changes.len() == KEPT_CHANGES {
        changes.pop_front();
    }
    changes.push_back(Change { seq: *end, time_us, what });
    *end += 1;
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;
    use std::collections::HashMap;

    /// RAM of the tests: registers without a device.
    #[derive(Default)]
    struct Loose {
        held: RefCell<HashMap<u32, u32>>,
        forced: Option<u32>,
    }

    impl Loose {
        fn store(&self, offset: u32, value: u32) {
            self.held.borrow_mut().insert(offset, value);
        }
    }

    impl Rams for Loose {
        fn load(&self, _: DeviceIndex, offset: u32, _: Width) -> Option<u32> {
            Some(self.held.borrow().get(&offset).copied().unwrap_or(0))
        }

        fn live(&self, _: DeviceIndex, _: u32) -> RegisterPhase {
            RegisterPhase::ALWAYS
        }

        fn is_forced(&self, _: DeviceIndex, offset: u32) -> bool {
            self.forced == Some(offset)
        }
    }

    fn kept_changes(history: &mut History) -> Vec<(u32, u32, u32, By)> {
        let (changes, _) = history.read(0, 0, usize::MAX);
        changes.iter().map(|it| (it.what.offset, it.what.from, it.what.to, it.what.how.by)).collect()
    }

    #[test]
    fn a_change_is_reported_once_with_its_originator() {
        let (rams, mut history) = (Loose::default(), History::new());
        rams.store(4, 9);
        assert!(history.follow(0, DeviceIndex(0), 4, Width::Word, Keep::ForOnlookers, &rams));
        assert!(history.follow(0, DeviceIndex(0), 2, Width::Byte, Keep::ForOnlookers, &rams));
        rams.store(4, 5);
        rams.store(2, 1);
        rams.store(8, 1);
        history.compare(1, By::Program, &rams, |_| panic!("not wanted in the journal"));
        history.compare(2, By::Firmware, &rams, |_| panic!("nothing has changed"));
        assert_eq!(kept_changes(&mut history), [(2, 0, 1, By::Program), (4, 9, 5, By::Program)]);
    }

    #[test]
    fn a_request_answered_between_two_comparisons_is_reported_with_its_answer() {
        let (rams, mut history) = (Loose::default(), History::new());
        history.follow(0, DeviceIndex(0), 12, Width::Byte, Keep::InJournal, &rams);
        rams.store(12, 4);
        history.compare(1, By::Firmware, &rams, drop);
        let mut noted = Vec::new();
        let stored = Stored { plc: DeviceIndex(0), offset: 12, found: Some(5), now: 4 };
        history.stored(7, stored, |change| noted.push((change.from, change.to, change.how.by)));
        history.compare(7, By::Firmware, &rams, |_| panic!("already reported"));
        assert_eq!(noted, [(4, 5, By::Program), (5, 4, By::Firmware)]);
        assert!(kept_changes(&mut history).is_empty());
    }

    /// The plant goes back to a snapshot that was taken between a program's write and the next comparison.
    #[test]
    fn a_return_to_a_snapshot_is_not_a_write() {
        let (rams, mut history) = (Loose::default(), History::new());
        for (offset, keep) in
            [(2, Keep::InJournal), (4, Keep::InJournal), (4, Keep::ForOnlookers), (6, Keep::ForOnlookers)]
        {
            history.follow(0, DeviceIndex(0), offset, Width::Word, keep, &rams);
        }
        let kept = |history: &History| {
            let copy = |it: &FollowedRegister| FollowedRegister { left: None, for_onlookers: false, ..*it };
            history.in_journal().map(copy).collect::<Vec<_>>()
        };
        let before = kept(&history);
        let store = |value: u32| [2, 4, 6].map(|offset| rams.store(offset, value));
        store(9);
        history.compare(1, By::Program, &rams, drop);
        let known = kept_changes(&mut history).len();
        store(5);
        history.restore_in_journal(before);
        history.arrived(2, &rams);
        assert_eq!(kept_changes(&mut history)[known..], [(4, 9, 0, By::Channel), (6, 9, 5, By::Channel)]);
        let mut noted = Vec::new();
        history.compare(3, By::Program, &rams, |change| noted.push((change.offset, change.from, change.to)));
        assert_eq!(noted, [(2, 0, 5), (4, 0, 5)]);
        assert_eq!(kept_changes(&mut history)[known + 2..], [(4, 0, 5, By::Program)]);
    }

    #[test]
    fn a_forced_register_changes_by_its_force() {
        let mut rams = Loose::default();
        let mut history = History::new();
        history.follow(0, DeviceIndex(0), 2, Width::Word, Keep::ForOnlookers, &rams);
        rams.forced = Some(2);
        rams.store(2, 7);
        history.compare(1, By::Firmware, &rams, drop);
        assert_eq!(kept_changes(&mut history), [(2, 0, 7, By::Force)]);
    }

    #[test]
    fn numbers_show_which_changes_are_no_longer_kept() {
        let (rams, mut history) = (Loose::default(), History::new());
        history.follow(0, DeviceIndex(0), 2, Width::Dword, Keep::ForOnlookers, &rams);
        let many = KEPT_CHANGES as u32 + 3;
        for value in 1..=many {
            rams.store(2, value);
            history.compare(value.into(), By::Firmware, &rams, drop);
        }
        let (changes, end) = history.read(0, 0, 2);
        assert_eq!(changes.iter().map(|it| (it.seq, it.what.to)).collect::<Vec<_>>(), [(3, 4), (4, 5)]);
        assert_eq!(end, u64::from(many));
        assert_eq!(history.read(0, end, 9).0, []);
    }

    #[test]
    fn absent_onlookers_are_forgotten() {
        let (rams, mut history) = (Loose::default(), History::new());
        history.follow(0, DeviceIndex(0), 2, Width::Dword, Keep::ForOnlookers, &rams);
        history.follow(0, DeviceIndex(0), 6, Width::Dword, Keep::InJournal, &rams);
        let compare =
            |history: &mut History| (0..LOOKS).for_each(|_| history.compare(1, By::Firmware, &rams, drop));
        compare(&mut history);
        assert_eq!(history.followed.len(), 2);
        history.asked = Instant::now().checked_sub(GONE + Duration::from_secs(1)).unwrap();
        compare(&mut history);
        assert_eq!(history.followed.iter().map(|it| it.offset).collect::<Vec<_>>(), [6]);
        // With a stepped clock, a long real time may pass without a comparison. So a request, too, drops the registers
        // that no client has requested for a while.
        history.follow(0, DeviceIndex(0), 2, Width::Dword, Keep::ForOnlookers, &rams);
        history.asked = Instant::now().checked_sub(GONE + Duration::from_secs(1)).unwrap();
        history.follow(0, DeviceIndex(0), 10, Width::Dword, Keep::ForOnlookers, &rams);
        assert_eq!(history.followed.iter().map(|it| it.offset).collect::<Vec<_>>(), [6, 10]);
    }

    #[test]
    fn there_is_a_bound() {
        let (rams, mut history) = (Loose::default(), History::new());
        for offset in 0..MAX_FOLLOWED as u32 {
            assert!(history.follow(0, DeviceIndex(0), offset, Width::Byte, Keep::InJournal, &rams));
        }
        assert!(!history.follow(0, DeviceIndex(1), 0, Width::Byte, Keep::ForOnlookers, &rams));
        assert!(history.follow(0, DeviceIndex(0), 3, Width::Byte, Keep::InJournal, &rams));
        assert!(!history.follow(0, DeviceIndex(1), 0, Width::Byte, Keep::InJournal, &rams));
    }

    /// A client that follows many registers leaves room for other clients. After some time it can follow further
    /// registers itself.
    #[test]
    fn a_client_leaves_registers_to_others() {
        let (rams, mut history) = (Loose::default(), History::new());
        let follow = |history: &mut History, client: u128, offset: u32| {
            history.follow(client, DeviceIndex(0), offset, Width::Byte, Keep::ForOnlookers, &rams)
        };
        for client in [1, 2, 3] {
            let most = (MAX_FOLLOWED >> client) as u32;
            let first = client as u32 * MAX_FOLLOWED as u32;
            let count = (0..).take_while(|number| follow(&mut history, client, first + number)).count();
            assert!(count as u32 >= most - 1 && count as u32 <= most, "{client}: {count}");
            assert!(follow(&mut history, client, first), "a register that it follows already");
        }
        // The registers of a client that sends no more requests become free for other clients.
        assert!(follow(&mut history, 4, 0) && !follow(&mut history, 1, 1));
        history.onlookers.age(1, GONE + Duration::from_secs(1));
        assert!((0..MAX_FOLLOWED as u32 / 4).all(|number| follow(&mut history, 5, number)));
        assert_eq!(history.onlookers.count(1), 0);
    }

    #[test]
    fn departed_clients_leave_no_registers() {
        let (rams, mut history) = (Loose::default(), History::new());
        let mut follow = |client: u128, offset: u32, keep: Keep| {
            assert!(history.follow(client, DeviceIndex(0), offset, Width::Byte, keep, &rams));
        };
        follow(0, 1, Keep::ForOnlookers);
        (1..4).for_each(|offset| follow(7, offset, Keep::ForOnlookers));
        follow(7, 3, Keep::InJournal);
        follow(8, 2, Keep::ForOnlookers);
        follow(8, 4, Keep::ForOnlookers);
        let offsets = |history: &History| history.followed.iter().map(|it| it.offset).collect::<Vec<_>>();
        history.release_departed(|client| client != 7);
        assert_eq!(offsets(&history), [1, 2, 3, 4], "followed by another client, or recorded");
        assert!(history.belongs_to_clients() && history.onlookers.count(7) == 0);
        history.release_departed(|_| false);
        assert_eq!(offsets(&history), [1, 3]);
        assert!(!history.belongs_to_clients());
    }

    #[test]
    fn a_client_that_browses_keeps_what_it_has_asked_for_again() {
        let (rams, mut history) = (Loose::default(), History::new());
        let follow = |history: &mut History, offset: u32| {
            history.follow(7, DeviceIndex(0), offset, Width::Byte, Keep::ForOnlookers, &rams)
        };
        let most = (0..).take_while(|offset| follow(&mut history, *offset)).count() as u32;
        history.onlookers.age(7, Duration::from_secs(60));
        assert!(follow(&mut history, 0) && follow(&mut history, most + 1));
        assert_eq!(history.followed.iter().map(|it| it.offset).collect::<Vec<_>>(), [0, most + 1]);
    }
}
