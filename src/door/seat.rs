//! The relation of a guest to emulated time: a guest is free, or it has a seat in lockstep.
//!
//! A guest that has never requested a time is free. With a request the guest promises to send nothing for this time, or
//! until it receives a frame. From the first request on the guest has a seat: a stepped clock does not advance further
//! than the end of the requested time. When the time is over or a frame has come, it is the guest's turn: the clock
//! stops, and the guest may send until its next request. The protocol of the door defines the format of the request.

/// The relation of a guest to emulated time. Times are in microseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum GuestTurn {
    /// The guest has never requested a time, or has lost its seat. The clock does not wait for the guest.
    #[default]
    Free,
    /// The guest has requested a duration that has not begun yet.
    Asks {
        /// Requested duration in microseconds.
        us: u64,
        /// True if the guest has received a frame since the request.
        has_heard: bool,
    },
    /// The guest waits for its turn.
    Waits {
        /// Latest time of the turn of the guest, in microseconds.
        until: u64,
        /// True if the guest has received a frame since the request. Its turn has then come.
        has_heard: bool,
    },
    /// The guest has its turn.
    HasTurn,
}

impl GuestTurn {
    /// Requests a turn after `us` microseconds. Returns false if another request is pending, or if `us` is 0: the clock
    /// would then never advance.
    pub(super) fn ask(&mut self, us: u64) -> bool {
        let may = self.may_speak() && us > 0;
        if may {
            *self = GuestTurn::Asks { us, has_heard: false };
        }
        may
    }

    /// Begins the requested duration at `now`.
    pub(super) fn begin(&mut self, now: u64) {
        if let GuestTurn::Asks { us, has_heard } = *self {
            *self = GuestTurn::Waits { until: now.saturating_add(us), has_heard };
        }
    }

    /// Called when the guest has received a frame.
    pub(super) fn hear(&mut self) {
        if let GuestTurn::Asks { has_heard, .. } | GuestTurn::Waits { has_heard, .. } = self {
            *has_heard = true;
        }
    }

    /// Grants the turn if it has come at `now`, and then returns true.
    pub(super) fn grant(&mut self, now: u64) -> bool {
        let is_due = self.next_turn() <= now;
        if is_due {
            *self = GuestTurn::HasTurn;
        }
        is_due
    }

    /// If the guest has its turn, ends the turn and returns true.
    pub(super) fn give_up(&mut self) -> bool {
        let had_turn = *self == GuestTurn::HasTurn;
        if had_turn {
            *self = GuestTurn::Free;
        }
        had_turn
    }

    /// Returns the time of the guest's turn; `u64::MAX` if it waits for no turn, and 0 if the turn has already come.
    #[must_use]
    pub fn next_turn(self) -> u64 {
        match self {
            GuestTurn::Waits { has_heard: true, .. } => 0,
            GuestTurn::Waits { until, .. } => until,
            _ => u64::MAX,
        }
    }

    /// True if the guest may send. After a request for time, the guest must not send until it receives the answer,
    /// because the request is a promise to send nothing.
    #[must_use]
    pub fn may_speak(self) -> bool {
        matches!(self, GuestTurn::Free | GuestTurn::HasTurn)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_comes_when_the_time_has_come() {
        let mut seat = GuestTurn::default();
        assert!(seat.may_speak() && !seat.grant(u64::MAX - 1), "a guest that never asks has no turn");
        assert!(seat.ask(100) && !seat.may_speak());
        assert!(!seat.ask(100), "one at a time");
        seat.begin(1_000);
        seat.begin(5_000);
        assert_eq!((seat.next_turn(), seat.grant(1_099), seat.grant(1_100)), (1_100, false, true));
        assert!(seat == GuestTurn::HasTurn && seat.may_speak() && !seat.grant(2_000));
        assert!(!seat.ask(0) && seat.ask(u64::MAX));
        seat.begin(5);
        assert_eq!((seat.next_turn(), seat.give_up()), (u64::MAX, false));
        seat = GuestTurn::HasTurn;
        assert!(seat.give_up() && seat == GuestTurn::Free);
    }

    #[test]
    fn a_frame_brings_it_earlier_but_only_one_heard_meanwhile() {
        let mut seat = GuestTurn::default();
        seat.hear();
        seat.ask(100);
        seat.begin(0);
        assert!(!seat.grant(99));
        seat.hear();
        assert!(seat.grant(99));
        seat.hear();
        seat.ask(100);
        seat.begin(99);
        assert_eq!(seat.next_turn(), 199);
        assert!(seat.grant(199) && seat.ask(100));
        seat.hear();
        seat.begin(199);
        assert!(seat.grant(199), "it was before time began to pass, but after the request");
    }
}
