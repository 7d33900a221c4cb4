//! The history of the plant, and the return to an earlier moment.
//!
//! The history consists of snapshots and the stores that operations have made after each snapshot. If a client has
//! changed the plant by another operation, the history takes a snapshot before the clock advances again. From a
//! snapshot the plant reaches every later moment by the same stores, because it is deterministic. The history does not
//! know the stores of programs that have mapped the image. If a return would lose such stores, the client gets a
//! report.

mod back;
mod file;
mod kept;
mod stretch;
#[cfg(test)]
mod tests;

pub(super) use back::{back, back_to_start, back_until};
use file::IncomingFiles;
pub(super) use file::{read, restore, take_in};
use kept::KeptSnapshots;
pub(super) use stretch::Store;

use super::{Code, Host, Refused};
use crate::plant::{Plant, Snapshot};
use crate::time;
use std::collections::VecDeque;
use stretch::Stretch;

/// Emulated time between two snapshots while the clock only advances. So a return computes at most this time again.
const STRETCH_US: u64 = 10_000_000;
/// Shortest emulated time between two snapshots that are taken at the beginning of operations. Programs that map the
/// image may store between two operations, and such a snapshot contains their stores.
const PAUSE_US: u64 = 100_000;

/// The history by which the plant can return to an earlier moment.
#[derive(Debug)]
pub struct Travel {
    /// Snapshots that clients have requested.
    saved: KeptSnapshots,
    /// A snapshot as a file that a client is reading.
    leaving: (u32, Vec<u8>),
    /// Files that clients are sending.
    coming: IncomingFiles,
    /// The plant at its start, before the first action of a client and before the clock first advanced.
    start: Option<Snapshot>,
    /// Stretches of the history, the oldest first.
    history: VecDeque<Stretch>,
    /// Memory that the history uses, in bytes; `most` is its maximum.
    size: usize,
    most: usize,
    /// True if a client has acted since the last snapshot in a way that the history does not record.
    is_touched: bool,
    /// True if the history was dropped because the plant has restored a snapshot from outside its history.
    came_from_elsewhere: bool,
}

impl Default for Travel {
    fn default() -> Self {
        Self::new(Self::DEFAULT_BYTES)
    }
}

impl Travel {
    /// Default limit of the memory for snapshots of the history, in bytes.
    pub const DEFAULT_BYTES: usize = 8 << 20;

    /// Creates an empty history. Its snapshots may take `most` bytes; with 0 no snapshot is kept.
    #[must_use]
    pub fn new(most: usize) -> Self {
        Travel {
            saved: KeptSnapshots::default(),
            leaving: (0, Vec::new()),
            coming: IncomingFiles::default(),
            start: None,
            history: VecDeque::new(),
            size: 0,
            most,
            is_touched: false,
            came_from_elsewhere: false,
        }
    }

    /// Emulated time of the earliest moment to which the plant can return, in microseconds; `None` if there is none.
    #[must_use]
    pub fn earliest(&self) -> Option<u64> {
        self.history.front().map(|stretch| stretch.begin.time_us())
    }

    /// Called before or after a client changes the plant in a way that the history does not record.
    pub fn touch(&mut self) {
        self.is_touched = true;
    }

    /// Drops the file of a snapshot that is no longer kept, if a client has read only a part of it.
    fn drop_unread(&mut self) {
        if !self.saved.contains(self.leaving.0) {
            self.leaving = (0, Vec::new());
        }
    }

    /// Records a store of an operation.
    pub(super) fn has_stored(&mut self, store: Store) {
        let stretch = self.history.back_mut().filter(|stretch| !self.is_touched && stretch.has_room());
        match stretch {
            Some(stretch) => {
                stretch.stores.push(store);
                self.size += size_of::<Store>();
            }
            None => self.is_touched = true,
        }
    }

    /// True if the last snapshot is older than `after_us`.
    fn is_overdue(&self, now: u64, after_us: u64) -> bool {
        self.history.back().is_none_or(|last| last.begin.time_us() + after_us <= now)
    }

    /// Takes a snapshot of the start, if the plant is still at its start.
    fn note_start(&mut self, plant: &Plant) {
        if self.start.is_none() && self.most > 0 && !self.came_from_elsewhere {
            let start = plant.snapshot();
            self.size += start.size();
            self.start = Some(start);
        }
    }

    /// Begins a new stretch of the history at the present moment.
    fn note(&mut self, plant: &mut Plant) {
        plant.settle();
        let now = plant.now();
        self.is_touched = false;
        let mut room = Vec::new();
        // Only the last of several snapshots at one emulated time is kept, because it contains all actions at this
        // time.
        while let Some(last) = self.history.pop_back_if(|last| last.begin.time_us() >= now) {
            self.size -= last.size();
            room = last.begin.into_state();
        }
        let stretch = Stretch::from_here(plant, room);
        self.size += stretch.size();
        self.history.push_back(stretch);
        while self.size > self.most && self.history.len() > 1 {
            self.size -= self.history.pop_front().map_or(0, |oldest| oldest.size());
        }
    }

    /// Called when the plant has returned to an earlier moment: removes later moments from the history.
    fn is_at(&mut self, plant: &Plant) {
        let (now, written) = (plant.now(), plant.journal().written());
        self.drop_from(now + 1);
        if let Some(last) = self.history.back_mut() {
            let before = last.size();
            last.ends_here(plant);
            self.size -= before - last.size();
        }
        self.saved.is_at(written);
    }

    /// Called like [`Travel::is_at`], if the plant has returned to a state without the actions that clients made at
    /// this emulated time.
    fn begins_anew(&mut self, plant: &Plant) {
        // A stretch that begins at the same emulated time may contain actions that the plant has not made now, so it is
        // dropped. A new snapshot is taken before the clock advances.
        self.drop_from(plant.now());
        self.is_at(plant);
        self.touch();
    }

    /// Drops stretches of the history that begin at this moment or later.
    fn drop_from(&mut self, time_us: u64) {
        while let Some(later) = self.history.pop_back_if(|it| it.begin.time_us() >= time_us) {
            self.size -= later.size();
        }
    }

    /// Drops the history. Called after the state of the plant has been replaced, because the history does not lead to
    /// the new state.
    fn is_elsewhere(&mut self) {
        self.history.clear();
        self.start = None;
        self.size = 0;
        self.came_from_elsewhere = true;
        self.saved.is_elsewhere();
    }

    /// Called when devices have taken over changed files: the plant can then no longer repeat its history.
    pub(crate) fn has_other_files(&mut self) {
        self.is_elsewhere();
        self.touch();
    }

    /// Reason why the plant cannot go back.
    fn nothing(&self) -> String {
        let why = match (self.most, self.came_from_elsewhere) {
            (0, _) => "--keep-states is 0",
            (_, true) => {
                "no time has passed since another state was restored or a changed script was read, which drops the history"
            }
            (_, false) => "no time has passed since the start",
        };
        format!("nothing is kept to go back to: {why}")
    }

    /// Reason why the plant cannot go back to its start.
    fn no_start(&self) -> String {
        let why = "the start is not kept, because another state was restored or a changed script was read since then";
        match self.earliest().map(time::seconds) {
            None => why.to_owned(),
            Some(earliest) => format!("{why}; the earliest moment is {earliest}"),
        }
    }

    /// Returns the number of stretches that begin before this moment.
    fn count_before(&self, time_us: u64) -> usize {
        self.history.partition_point(|it| it.begin.time_us() < time_us)
    }

    /// Returns the stretch that contains this moment, if it is kept.
    fn stretch_of(&self, time_us: u64) -> Option<usize> {
        self.history.partition_point(|it| it.begin.time_us() <= time_us).checked_sub(1)
    }
}

/// The functions for a channel, whose clients may leave.
#[cfg(feature = "channel")]
impl Travel {
    /// True if a client of a channel keeps snapshots or is sending a file.
    pub(crate) fn belongs_to_clients(&self) -> bool {
        self.saved.any_of_clients() || !self.coming.is_empty()
    }

    /// True if another snapshot of a client may have no place.
    pub(crate) fn is_nearly_full(&self) -> bool {
        self.saved.is_nearly_full()
    }

    /// Deletes the snapshots and files of clients for which `is_present` is false. Client 0, the emulator's own
    /// process, is always present.
    pub(crate) fn release_departed(&mut self, is_present: impl Fn(u128) -> bool) {
        let is_present = |client| client == 0 || is_present(client);
        self.saved.release(is_present);
        self.coming.release(is_present);
        self.drop_unread();
    }
}

/// Called before a client acts on the plant.
pub(super) fn is_about_to_act(host: &mut dyn Host) {
    if host.is_stepped() {
        let (plant, travel) = host.plant_and_travel();
        travel.note_start(plant);
    }
}

/// Called before the clock advances in stepped mode. `is_first`: the operation that advances it has just begun.
pub(super) fn set_out(host: &mut dyn Host, is_first: bool) {
    if host.is_stepped() {
        if is_first {
            host.take_over_files();
        }
        let (plant, travel) = host.plant_and_travel();
        travel.note_start(plant);
        let after_us = if is_first { PAUSE_US } else { STRETCH_US };
        if travel.most > 0 && (travel.is_touched || travel.is_overdue(plant.now(), after_us)) {
            travel.note(plant);
        }
    }
}

/// Called when the clock has advanced without a request of a client.
pub(super) fn arrived(host: &mut dyn Host) {
    let (plant, travel) = host.plant_and_travel();
    if let Some(stretch) = travel.history.back_mut() {
        stretch.goes_on_to(plant);
    }
}

/// Keeps a snapshot for a client. Returns its number.
pub(super) fn save(host: &mut dyn Host, client: u128) -> Result<u32, Refused> {
    stepped(host)?;
    host.take_over_files();
    let (plant, travel) = host.plant_and_travel();
    let number = travel.saved.keep(client, plant)?;
    // Stores after this call must not count as stores before the snapshot, even if the clock does not advance in
    // between.
    travel.touch();
    Ok(number)
}

/// Deletes a kept snapshot.
pub(super) fn forget(host: &mut dyn Host, number: u32) -> Result<(), Refused> {
    let (_, travel) = host.plant_and_travel();
    travel.saved.forget(number)?;
    travel.drop_unread();
    Ok(())
}

/// Restores a kept snapshot.
pub(super) fn back_to(host: &mut dyn Host, number: u32, detached: bool) -> Result<(), Refused> {
    alone(host, detached)?;
    host.plant_and_travel().1.saved.get(number)?;
    host.take_over_files();
    let saved = host.plant_and_travel().1.saved.get(number)?;
    let (snapshot, is_behind) = (saved.snapshot.clone(), saved.is_behind);
    go_to(host, &snapshot, is_behind)?;
    let (plant, travel) = host.plant_and_travel();
    if is_behind {
        travel.begins_anew(plant);
    } else {
        travel.is_elsewhere()
    }
    if let Ok(saved) = travel.saved.get(number) {
        saved.is_behind = true;
    }
    host.has_travelled();
    Ok(())
}

fn go_to(host: &mut dyn Host, snapshot: &Snapshot, is_behind: bool) -> Result<(), Refused> {
    let plant = host.plant_mut();
    let gone = if is_behind { plant.go_back(snapshot) } else { plant.restore(snapshot) };
    // The snapshot is of this plant.
    gone.map_err(|error| Refused::new(Code::SNAPSHOT, plant.name_changed_folder(error)))
}

/// Refuses a return if the clock is not stepped, or if there is an outside participant that cannot go back.
fn alone(host: &mut dyn Host, detached: bool) -> Result<(), Refused> {
    stepped(host)?;
    match host.outsiders().filter(|_| !detached) {
        None => Ok(()),
        Some(who) => {
            let text =
                format_args!("{who} cannot go back with the plant; let it end, or give --ignore-programs");
            Err(Refused::new(Code::NOT_ALONE, text))
        }
    }
}

fn stepped(host: &dyn Host) -> Result<(), Refused> {
    if host.is_stepped() {
        return Ok(());
    }
    let text = "the clock runs in real time; snapshots and going back need a stepped one (start the instance with \
                --clock stepped)";
    Err(Refused::new(Code::CLOCK_IS_REAL_TIME, text))
}

fn unknown(number: u32) -> Refused {
    Refused::new(Code::SNAPSHOT, format_args!("no snapshot {number} is kept"))
}
