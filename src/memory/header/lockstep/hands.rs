//! How a seat changes hands.

#[cfg(test)]
mod model;

use super::{Seat, SeatState};
use crate::memory::Cell32;
use crate::memory::process::ProcessId;

impl Seat {
    fn is_running(&self, pid: u32) -> bool {
        ProcessId { pid, start: self.owner_start.load() }.is_running()
    }

    fn hands(&self) -> Hands<'_, Cell32> {
        Hands { owner: &self.owner, state: &self.state, event: &self.event }
    }

    /// Answers whoever asks: seated if it may run on its event, else refused. The event and whether, `None` if it has left.
    pub(crate) fn decide(&self, may: impl FnMut(u32) -> bool) -> Option<(u32, bool)> {
        self.hands().decide(may)
    }

    /// Gives up the task that is seated; `false` if it has left.
    pub(crate) fn lose(&self) -> bool {
        self.hands().lose()
    }

    /// Frees the seat if who was refused or lost has died instead of leaving; whether it did.
    pub(crate) fn bury(&self) -> bool {
        self.hands().bury(|owner| self.is_running(owner), || self.clear())
    }
}

/// The words by which a seat changes hands, of cells or of a model of them. A task takes a free seat by exchanging `owner`, sets the event
/// and asks. It may leave at any moment, when nobody waits for it any longer: it sets `state` to free and then `owner` to 0, and the next
/// one may have asked before the emulator has looked again. So whatever the emulator does here must not hit the next one.
struct Hands<'a, W> {
    owner: &'a W,
    state: &'a W,
    event: &'a W,
}

/// A word that others write at the same time.
trait Word {
    fn load(&self) -> u32;
    /// Stores if it holds that; whether it did.
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

/// The owner of a seat that is being freed; no process.
const NOBODY: u32 = u32::MAX;

impl<W: Word> Hands<'_, W> {
    fn decide(&self, mut may: impl FnMut(u32) -> bool) -> Option<(u32, bool)> {
        let (asking, deciding) = (SeatState::Asking.code(), SeatState::Deciding.code());
        while self.state.exchange(asking, deciding) {
            let event = self.event.load();
            let is_seated = may(event);
            let answer = if is_seated { SeatState::Seated } else { SeatState::Refused };
            if self.state.exchange(deciding, answer.code()) {
                return Some((event, is_seated));
            }
            // It has left, so the event may be that of the next one, who is told nothing before it has asked.
        }
        None
    }

    fn lose(&self) -> bool {
        self.state.exchange(SeatState::Seated.code(), SeatState::Lost.code())
    }

    fn bury(&self, is_running: impl Fn(u32) -> bool, clear: impl FnOnce()) -> bool {
        let owner = self.owner.load();
        // Looked at behind the owner: whoever takes a seat finds it free.
        let state = SeatState::from_code(self.state.load());
        let is_out = matches!(state, Some(SeatState::Refused | SeatState::Lost));
        // It may have left before it died, and somebody else be here.
        if !is_out || is_running(owner) || !self.owner.exchange(owner, NOBODY) {
            return false;
        }
        clear();
        true
    }
}
