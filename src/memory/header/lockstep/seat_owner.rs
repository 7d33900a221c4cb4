//! Changes of the owner of a seat.

#[cfg(test)]
mod model;

use super::{Seat, SeatState};
use crate::memory::Cell32;
use crate::memory::process::ProcessId;

impl Seat {
    fn is_running(&self, pid: u32) -> bool {
        ProcessId { pid, start: self.owner_start.load() }.is_running()
    }

    fn hands(&self) -> SeatWords<'_, Cell32> {
        SeatWords { owner: &self.owner, state: &self.state, event: &self.event }
    }

    /// Answers a task that requests the seat. The task is accepted if `may` returns true for its event, otherwise
    /// refused. Returns the event and the decision; `None` if the task has given up its seat.
    pub(crate) fn decide(&self, may: impl FnMut(u32) -> bool) -> Option<(u32, bool)> {
        self.hands().decide(may)
    }

    /// Takes the seat from its task; `false` if the task has already given it up.
    pub(crate) fn lose(&self) -> bool {
        self.hands().lose()
    }

    /// Frees the seat if a refused or lost task died without leaving. Returns true if the seat was freed.
    pub(crate) fn free_if_dead(&self) -> bool {
        self.hands().free_if_dead(|owner| self.is_running(owner), || self.clear())
    }
}

/// The words that determine the owner of a seat: cells, or a model of them. A task takes a free seat by exchanging
/// `owner`, sets the event and sends its request. The task may leave at any moment, even if the emulator no longer
/// waits for it. To leave, it sets `state` to free and then `owner` to 0. The next task may send a request before the
/// emulator reads the seat again, so no step that concerns the old task may affect the next task.
struct SeatWords<'a, W> {
    owner: &'a W,
    state: &'a W,
    event: &'a W,
}

/// A word that other processes write concurrently.
trait Word {
    fn load(&self) -> u32;
    /// Stores `new` if the word holds `current`; returns whether it did.
    fn exchange(&self, current: u32, new: u32) -> bool;
}

impl Word for Cell32 {
    fn load(&self) -> u32 {
        Cell32::load(self)
    }

    fn exchange(&self, current: u32, new: u32) -> bool {
        self.compare_exchange(current, new).is_ok()
    }
}

/// Owner of a seat while it is freed; not the id of a process.
const NO_OWNER: u32 = u32::MAX;

impl<W: Word> SeatWords<'_, W> {
    fn decide(&self, mut may: impl FnMut(u32) -> bool) -> Option<(u32, bool)> {
        let (asking, deciding) = (SeatState::Asking.code(), SeatState::Deciding.code());
        while self.state.exchange(asking, deciding) {
            let event = self.event.load();
            let is_seated = may(event);
            let answer = if is_seated { SeatState::Seated } else { SeatState::Refused };
            if self.state.exchange(deciding, answer.code()) {
                return Some((event, is_seated));
            }
            // The task has given up its seat. The event that was read above may belong to the next task, which must not
            // get an answer before it sends its request.
        }
        None
    }

    fn lose(&self) -> bool {
        self.state.exchange(SeatState::Seated.code(), SeatState::Lost.code())
    }

    fn free_if_dead(&self, is_running: impl Fn(u32) -> bool, clear: impl FnOnce()) -> bool {
        let owner = self.owner.load();
        // The state is read after the owner: if a new task has taken the seat in between, the state is free, not
        // refused or lost.
        let state = SeatState::from_code(self.state.load());
        let is_out = matches!(state, Some(SeatState::Refused | SeatState::Lost));
        // The task may have given up its seat before it died, and another task may have the seat now.
        if !is_out || is_running(owner) || !self.owner.exchange(owner, NO_OWNER) {
            return false;
        }
        clear();
        true
    }
}
