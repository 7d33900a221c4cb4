//! A guest: what it wants of the plant and what it is to hear, between the two threads that deal with it.

use super::seat::Seat;
use super::slcan::{Adapter, Rate, Status};
use super::{DoorSpec, ROOM_TO_GUEST, ROOM_TO_PLANT};
use crate::can::{ErrorState, Frame};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// A foreign program at a door. The lock is held for moments only, and never while anything waits.
#[derive(Debug)]
pub struct Guest {
    /// Index of its bus in the plant.
    pub bus: u16,
    /// Its number there, from 1.
    pub number: u8,
    /// Its door.
    pub door: DoorSpec,
    inner: Mutex<Inner>,
}

#[derive(Debug, Default)]
struct Inner {
    /// Whether it takes part, and then whether it only listens.
    open: Option<bool>,
    rate: Option<Rate>,
    has_gone: bool,
    to_plant: VecDeque<Frame>,
    to_guest: VecDeque<News>,
    seat: Seat,
    dropped: u64,
    refused: u64,
    overrun: bool,
    errors: ErrorState,
}

/// What a guest is told. Times are emulated, in microseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum News {
    /// A frame has arrived.
    Heard {
        /// When.
        time_us: u64,
        /// Which.
        frame: Frame,
    },
    /// It has its turn: what it asked for by [`Adapter::ask`].
    Granted {
        /// When.
        time_us: u64,
    },
}

/// What a guest wants at the moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wish {
    /// To hear what is on the bus.
    pub hears: bool,
    /// To take part: to be heard and to acknowledge.
    pub takes_part: bool,
    /// The rate it has named.
    pub rate: Option<Rate>,
    /// It has left for ever.
    pub has_gone: bool,
}

/// What there is to know of a guest.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct GuestState {
    /// Its number on the bus.
    pub guest: u8,
    /// Its door.
    pub door: DoorSpec,
    /// Whether it hears what is on the bus, or would if it had named the right rate.
    pub open: bool,
    /// The rate it has named, in bit/s.
    pub bit_s: Option<u32>,
    /// Whether it has asked for a time, and emulated time waits for it if the clock is stepped.
    pub seat: bool,
    /// Frames that it was to hear and for which there was no room.
    pub dropped: u64,
    /// Frames that it wanted to send and that were not taken.
    pub refused: u64,
}

impl Guest {
    pub(super) fn new(bus: u16, number: u8, door: DoorSpec) -> Self {
        Guest { bus, number, door, inner: Mutex::default() }
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        // Nothing in there can be half done.
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What it wants at the moment.
    #[must_use]
    pub fn wish(&self) -> Wish {
        let inner = self.inner();
        Wish {
            hears: inner.open.is_some() && !inner.has_gone,
            takes_part: inner.open == Some(false) && !inner.has_gone,
            rate: inner.rate,
            has_gone: inner.has_gone,
        }
    }

    /// How many frames it has to send.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.inner().to_plant.len()
    }

    /// The frame that it sends next, which stays there until [`Guest::sent`].
    #[must_use]
    pub fn next_to_send(&self) -> Option<Frame> {
        self.inner().to_plant.front().copied()
    }

    /// That frame was taken; `false`: refused for good.
    pub fn sent(&self, was_taken: bool) {
        let mut inner = self.inner();
        inner.to_plant.pop_front();
        inner.refused += u64::from(!was_taken);
    }

    /// Lets it hear a frame that has arrived at this emulated time, if there is room.
    pub fn hear(&self, time_us: u64, frame: &Frame) {
        let mut inner = self.inner();
        inner.seat.hear();
        if inner.to_guest.len() < ROOM_TO_GUEST {
            inner.to_guest.push_back(News::Heard { time_us, frame: *frame });
        } else {
            inner.dropped += 1;
            inner.overrun = true;
        }
    }

    /// Lets it know, if it asks, how its controller stands with the bus.
    pub fn note_errors(&self, state: ErrorState) {
        self.inner().errors = state;
    }

    /// What there is to know of it.
    #[must_use]
    pub fn state(&self) -> GuestState {
        let inner = self.inner();
        GuestState {
            guest: self.number,
            door: self.door,
            open: inner.open.is_some(),
            bit_s: inner.rate.map(Rate::bit_s),
            seat: inner.seat != Seat::Free,
            dropped: inner.dropped,
            refused: inner.refused,
        }
    }

    /// How it stands to emulated time.
    #[must_use]
    pub fn seat(&self) -> Seat {
        self.inner().seat
    }

    /// Emulated time begins to pass for it, at `now`, if it has asked for that.
    pub fn take_request(&self, now: u64) {
        self.inner().seat.begin(now);
    }

    /// Gives it its turn, at `now`, if it is due. Tells whether it was.
    pub fn grant(&self, now: u64) -> bool {
        let mut inner = self.inner();
        let is_due = inner.seat.grant(now);
        if is_due {
            // There always is room: one answer at most waits for each request.
            inner.to_guest.push_back(News::Granted { time_us: now });
        }
        is_due
    }

    /// Takes its seat away if it has its turn; tells whether it had.
    pub fn give_up(&self) -> bool {
        self.inner().seat.give_up()
    }

    /// It has left.
    pub(super) fn leave(&self) {
        let mut inner = self.inner();
        inner.has_gone = true;
        inner.seat = Seat::Free;
    }

    /// What it is to be told next; `None` if nothing waits.
    pub(super) fn take_news(&self) -> Option<News> {
        self.inner().to_guest.pop_front()
    }
}

impl Adapter for &Guest {
    fn set_rate(&mut self, rate: Option<Rate>) -> bool {
        let mut inner = self.inner();
        let may = inner.open.is_none();
        if may {
            inner.rate = rate;
        }
        may
    }

    fn open(&mut self, listens: bool) {
        self.inner().open = Some(listens);
    }

    fn close(&mut self) {
        let mut inner = self.inner();
        inner.open = None;
        inner.seat = Seat::Free;
        inner.to_guest.clear();
    }

    fn send(&mut self, frame: Frame) -> bool {
        let mut inner = self.inner();
        let has_room = inner.to_plant.len() < ROOM_TO_PLANT;
        let may = inner.open == Some(false) && inner.seat.may_speak() && has_room;
        if may {
            inner.to_plant.push_back(frame);
        } else {
            inner.refused += 1;
        }
        may
    }

    fn ask(&mut self, us: u64) -> bool {
        let mut inner = self.inner();
        inner.open.is_some() && inner.seat.ask(us)
    }

    fn take_status(&mut self) -> Status {
        let mut inner = self.inner();
        Status { has_missed: core::mem::take(&mut inner.overrun), errors: inner.errors }
    }
}

#[cfg(test)]
impl Guest {
    /// One whose program is the test.
    pub(crate) fn of_a_test(bus: u16, number: u8) -> std::sync::Arc<Self> {
        Guest::new(bus, number, "slcan-tcp:127.0.0.1:0".parse().unwrap()).into()
    }

    /// It takes part.
    pub(crate) fn opens(&self) {
        (&mut &*self).open(false);
    }

    /// It sends a frame without data, and is told that it may.
    pub(crate) fn says(&self, id: u16) {
        assert!((&mut &*self).send(Frame::standard(id, crate::can::Payload::EMPTY)));
    }

    /// How many frames it has to be told of.
    pub(crate) fn heard(&self) -> usize {
        self.inner().to_guest.len()
    }
}
