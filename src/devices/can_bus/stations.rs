//! The stations of a bus, with lists of the stations in each state: stations with a frame to send, stations
//! with a due event, participating stations, stations with errors. So a frame takes time only for the
//! stations that it affects.

use super::acceptance::Acceptance;
use super::station::Station;
use crate::can::{Arbitration, BitRate, ErrorState, Frame, Participants, Recovery};
use crate::due_queue::{DueQueue, NEVER};
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use serde::{Deserialize, Serialize};

/// A station with a frame to send.
#[derive(Serialize, Deserialize)]
struct WaitingFrame {
    field: Arbitration,
    station: usize,
    /// Time from which the frame takes part in arbitration, in ns.
    since_ns: u64,
}

/// The ports, followed by the guests. The entry of a disconnected guest is kept for the next guest with the same
/// number.
pub(super) struct Stations {
    ends: Vec<Station>,
    /// Bit rate of the bus; `None` if the ports are not plugged in.
    rate: Option<BitRate>,
    waiting: Vec<WaitingFrame>,
    due: DueQueue,
    acceptance: Acceptance,
    /// Number of stations that take part.
    members: usize,
    /// Time at which the last station began to take part, in ns.
    last_came_ns: u64,
    /// Stations with error counters above 0.
    troubled: Vec<usize>,
    /// Stations that are returning from BUS-off.
    recovering: Vec<(usize, Recovery)>,
    /// True if a station has begun or ceased to take part since the last call of `take_changed`.
    has_changed: bool,
    /// True if a frame is held back.
    has_held: bool,
}

impl Stations {
    pub(super) fn new(rate: Option<BitRate>) -> Self {
        Stations {
            ends: Vec::new(),
            rate,
            waiting: Vec::new(),
            due: DueQueue::of(0),
            acceptance: Acceptance::new(),
            members: 0,
            last_came_ns: 0,
            troubled: Vec::new(),
            recovering: Vec::new(),
            has_changed: false,
            has_held: false,
        }
    }

    pub(super) fn add(&mut self, end: Station) -> usize {
        self.ends.push(end);
        self.due.grow(self.ends.len());
        self.acceptance.forget();
        self.ends.len() - 1
    }

    pub(super) fn all(&self) -> &[Station] {
        &self.ends
    }

    /// Returns a station. The caller must call [`Stations::settle`] after it has changed the station.
    pub(super) fn get_mut(&mut self, station: usize) -> &mut Station {
        &mut self.ends[station]
    }

    /// Returns the number of stations that take part.
    pub(super) fn members(&self) -> usize {
        self.members
    }

    /// Returns the time of the first due event of the stations.
    pub(super) fn next_time(&self) -> u64 {
        self.due.first()
    }

    /// Returns the first station from index `from` on with an event due at `now`.
    pub(super) fn due(&self, from: usize, now: u64) -> Option<usize> {
        self.due.due(from, now)
    }

    /// Updates the indexes after a change of `station` at `at_ns`.
    pub(super) fn settle(&mut self, station: usize, at_ns: u64) {
        let end = &mut self.ends[station];
        self.due.set(station, if end.on_since_ns.is_some() { end.port.next_time() } else { NEVER });
        if end.controller.take_new_filters() {
            self.acceptance.forget();
        }
        if end.controller.take_restart() && self.recovering.iter().all(|(other, _)| *other != station) {
            self.recovering.push((station, Recovery::new(at_ns)));
        }
        let bit_s = self.rate.map_or(0, BitRate::bit_s);
        let is_member = end.on_since_ns.is_some() && end.controller.takes_part(bit_s);
        if is_member != end.member_since_ns.is_some() {
            end.member_since_ns = is_member.then_some(at_ns);
            self.has_changed = true;
            if is_member {
                self.members += 1;
                self.last_came_ns = self.last_came_ns.max(at_ns);
            } else {
                self.members -= 1;
            }
        }
        self.offer(station);
    }

    /// Updates the list of stations with a frame to send.
    fn offer(&mut self, station: usize) {
        let end = &mut self.ends[station];
        let since_ns = end.member_since_ns.filter(|_| self.rate.is_some());
        let offer = since_ns.and_then(|since_ns| {
            let (there_ns, frame) = end.controller.front()?;
            Some(WaitingFrame {
                field: frame.arbitration(),
                station,
                since_ns: since_ns.max(*there_ns).max(end.held_until_ns),
            })
        });
        if !end.is_waiting && offer.is_none() {
            return;
        }
        end.is_waiting = offer.is_some();
        self.has_held |= end.held_until_ns > 0;
        let place = self.waiting.iter().position(|waiting| waiting.station == station);
        match (place, offer) {
            (Some(place), Some(offer)) => self.waiting[place] = offer,
            (Some(place), None) => drop(self.waiting.swap_remove(place)),
            (None, Some(offer)) => self.waiting.push(offer),
            (None, None) => {}
        }
    }

    /// Holds the frame of `station` back.
    pub(super) fn hold(&mut self, station: usize, until_ns: u64, is_delayed: bool) {
        let end = &mut self.ends[station];
        end.held_until_ns = until_ns;
        end.is_delayed |= is_delayed;
        self.offer(station);
    }

    /// Returns the time at which the first held frame may begin, in ns, if it is after `now_ns`.
    pub(super) fn next_held(&mut self, now_ns: u64) -> Option<u64> {
        if !self.has_held {
            return None;
        }
        let next = self.waiting.iter().map(|it| it.since_ns).filter(|since_ns| *since_ns > now_ns).min();
        self.has_held = next.is_some();
        next
    }

    /// Returns whether a station has begun or ceased to take part since the last call.
    pub(super) fn take_changed(&mut self) -> bool {
        core::mem::take(&mut self.has_changed)
    }

    /// Fills `receivers` with the ports that receive a frame. The caller excludes the sender. Guests are not included,
    /// because they receive all frames through their doors.
    pub(super) fn receivers(&mut self, frame: &Frame, receivers: &mut Vec<u16>) {
        let Stations { ends, acceptance, .. } = self;
        let known = acceptance.receivers(frame, || {
            let accepts = |end: &Station| end.origin.guest().is_none() && end.controller.accepts(frame);
            (0u16..).zip(ends.iter()).filter(move |(_, end)| accepts(end)).map(|(station, _)| station)
        });
        receivers.clear();
        receivers.extend_from_slice(known);
    }

    /// Called when a frame has arrived: decrements the error counters of the sender and of all stations that have
    /// received the frame.
    pub(super) fn count_good(&mut self, sender: usize, begin_ns: u64) {
        let Stations { ends, troubled, .. } = self;
        for &station in troubled.iter() {
            let end = &mut ends[station];
            match end.took_part_since(begin_ns).then(|| end.controller.errors_mut()) {
                Some(errors) if station == sender => errors.sent(),
                Some(errors) => errors.received(),
                None => {}
            }
        }
    }

    /// Called when a frame has ended in an error: calls `count` for all stations that were receiving the frame.
    pub(super) fn count_errors(&mut self, begin_ns: u64, mut count: impl FnMut(usize, &mut Station)) {
        for station in 0..self.ends.len() {
            if self.ends[station].took_part_since(begin_ns) {
                count(station, &mut self.ends[station]);
                self.note_errors(station);
            }
        }
    }

    /// Notes that the error counters of `station` may not be 0.
    pub(super) fn note_errors(&mut self, station: usize) {
        if !core::mem::replace(&mut self.ends[station].is_troubled, true) {
            self.troubled.push(station);
        }
    }

    /// Returns a station with an error state that was not reported yet, and marks the new state as reported.
    pub(super) fn take_state_change(&mut self) -> Option<(usize, ErrorState)> {
        let Stations { ends, troubled, .. } = self;
        let is_unreported =
            |station: &usize| ends[*station].controller.error_state() != ends[*station].reported;
        let Some(station) = troubled.iter().copied().filter(is_unreported).min() else {
            troubled.retain(|&station| {
                ends[station].is_troubled = ends[station].controller.errors() != Default::default();
                ends[station].is_troubled
            });
            return None;
        };
        let state = ends[station].controller.error_state();
        ends[station].reported = state;
        Some((station, state))
    }

    /// True if any station has errors.
    pub(super) fn has_errors(&self) -> bool {
        !self.troubled.is_empty()
    }

    /// Called when a frame begins at `begin_ns`. The wire was recessive from `quiet_ns` until then.
    pub(super) fn frame_begins(&mut self, begin_ns: u64, quiet_ns: u64) {
        let Some(rate) = self.rate else { return };
        for (_, recovery) in &mut self.recovering {
            recovery.frame_begins(begin_ns, quiet_ns, rate);
        }
    }

    /// Returns the station that returns from BUS-off first, and the time in ns. The result is valid if the
    /// wire has been recessive since `quiet_ns` and stays recessive.
    pub(super) fn next_back(&self, quiet_ns: u64) -> Option<(u64, usize)> {
        let rate = self.rate?;
        self.recovering.iter().map(|(station, recovery)| (recovery.end_ns(quiet_ns, rate), *station)).min()
    }

    /// Ends the return of `station` from BUS-off.
    pub(super) fn end_recovery(&mut self, station: usize) {
        self.recovering.retain(|(other, _)| *other != station);
    }
}

impl SnapshotFields for Stations {
    fn save(&self, to: &mut Saving) {
        let Self {
            ends,
            rate: _,
            waiting,
            due,
            // `acceptance` is rebuilt after loading, from the filters of the stations.
            acceptance: _,
            members,
            last_came_ns,
            troubled,
            recovering,
            has_changed,
            has_held,
        } = self;
        // The snapshot also contains disconnected guests, because their entries are still stations. The ports
        // need no entry: they are stations before the snapshot is loaded.
        let guests: Vec<u8> = ends.iter().filter_map(|end| end.origin.guest()).collect();
        to.value(&guests);
        ends.save(to);
        // The firmware of a port may have another next time since its last run, if it shares a state with another port of
        // its device. The bus does not know this time yet.
        let times = (0..ends.len()).map(|station| due.time(station));
        let times: Vec<_> = times.map(|time| (time != NEVER).then_some(time)).collect();
        to.value(&(waiting, members, last_came_ns, troubled, recovering, has_changed, has_held));
        to.value(&times);
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        let guests: Vec<u8> = from.value()?;
        let (mut ends, rate) = (core::mem::take(&mut self.ends), self.rate);
        ends.retain(|end| end.origin.guest().is_none());
        *self = Stations::new(rate);
        for end in ends.into_iter().chain(guests.into_iter().map(Station::guest)) {
            self.add(end);
        }
        self.ends.restore(from)?;
        let Self { waiting, members, last_came_ns, troubled, recovering, has_changed, has_held, .. } = self;
        (*waiting, *members, *last_came_ns, *troubled, *recovering, *has_changed, *has_held) =
            from.value()?;
        let is_there = |station: usize| station < self.ends.len();
        let has_frame =
            |it: &WaitingFrame| is_there(it.station) && self.ends[it.station].controller.front().is_some();
        from.check(self.waiting.iter().all(has_frame), "station that waits")?;
        from.check(self.troubled.iter().all(|station| is_there(*station)), "station with errors")?;
        from.check(self.recovering.iter().all(|(station, _)| is_there(*station)), "station that recovers")?;
        let members = self.ends.iter().filter(|end| end.member_since_ns.is_some()).count();
        from.check(self.members == members, "number of stations that take part")?;
        let times: Vec<Option<u64>> = from.value()?;
        from.check(times.len() == self.ends.len(), "number of times of stations")?;
        for (station, time) in times.into_iter().enumerate() {
            self.due.set(station, time.unwrap_or(NEVER));
        }
        Ok(())
    }
}

impl Participants for Stations {
    fn first(&self, at_ns: u64, but: Option<usize>) -> Option<(usize, Frame)> {
        let there = self.waiting.iter().filter(|it| it.since_ns <= at_ns && but != Some(it.station));
        let first = there.min_by_key(|it| (it.field, it.station))?;
        let (_, frame) = self.ends[first.station].controller.front()?;
        Some((first.station, *frame))
    }

    fn is_heard(&self, sender: usize, begin_ns: u64) -> bool {
        if self.last_came_ns <= begin_ns {
            return self.members > usize::from(self.ends[sender].member_since_ns.is_some());
        }
        self.ends.iter().enumerate().any(|(station, end)| station != sender && end.took_part_since(begin_ns))
    }

    fn is_passive(&self, station: usize) -> bool {
        self.ends[station].controller.error_state() == ErrorState::Passive
    }
}
