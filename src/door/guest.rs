//! A guest: its requests to the plant, and the traffic for it. Two threads use this data: the thread of the doors and
//! the thread of the plant.

use super::seat::GuestTurn;
use super::slcan::{Rate, Status};
use super::wire::{Adapter, BadLength, BusMessage};
use super::{DoorSpec, OCTETS_TO_PLANT, ROOM_TO_GUEST, ROOM_TO_PLANT};
use crate::can::ErrorState;
use crate::identity::BusIndex;
use crate::profibus::BusRate;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// A foreign program at a door. A thread holds the lock only for a short time, and never while it waits.
#[derive(Debug)]
pub struct Guest {
    /// Index of the guest's bus in the plant.
    pub bus: BusIndex,
    /// Number of the guest on its bus, from 1.
    pub number: u8,
    /// Door of the guest.
    pub door: DoorSpec,
    inner: Mutex<Inner>,
}

#[derive(Debug, Default)]
struct Inner {
    /// `Some(true)` while the guest only listens, `Some(false)` while it takes part, `None` while it does neither.
    open: Option<bool>,
    rate: Option<Rate>,
    has_gone: bool,
    /// True if the guest's unsent messages were discarded after the guest had disconnected.
    is_given_up: bool,
    /// True if the guest has ever taken part or listened.
    has_opened: bool,
    to_plant: VecDeque<BusMessage>,
    /// Number of octets in `to_plant`.
    octets_to_plant: usize,
    /// True if the thread of the doors reads nothing from the guest, because there is no room.
    is_held: bool,
    to_guest: VecDeque<GuestMessage>,
    seat: GuestTurn,
    /// Bit time until which the guest requests emulated time; `None` if the guest has made no such request.
    until_bit: Option<u64>,
    /// The rate of the guest's bus in bit/s, if it is known.
    bus_bit_s: u32,
    dropped: u64,
    refused: u64,
    overrun: bool,
    errors: ErrorState,
    bad_length: Option<u16>,
}

/// A message to a guest. Times are emulated, in microseconds.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum GuestMessage {
    /// A frame or a telegram has arrived at the guest.
    Heard {
        /// Time of the message.
        time_us: u64,
        /// The frame or telegram.
        message: BusMessage,
    },
    /// It is the guest's turn, which it has requested by [`Adapter::ask`].
    Granted {
        /// Time of the turn.
        time_us: u64,
    },
}

/// Everything that a guest requests at the moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GuestRequests {
    /// True if the guest wants to receive the traffic of the bus.
    pub hears: bool,
    /// True if the guest takes part in the traffic: it sends frames and acknowledges them.
    pub takes_part: bool,
    /// The rate that the guest has named.
    pub rate: Option<Rate>,
    /// True if the guest has disconnected. It does not come back.
    pub has_gone: bool,
    /// An invalid number of octets that the guest has announced.
    pub bad_length: Option<u16>,
}

/// Facts about a guest.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct GuestState {
    /// Number of the guest on the bus.
    pub guest: u8,
    /// Door of the guest.
    pub door: DoorSpec,
    /// True if the guest has requested the traffic of the bus. A guest that has named a wrong rate receives
    /// nothing, but the field is true for it, too.
    pub open: bool,
    /// The rate that the guest has named, in bit/s.
    pub bit_s: Option<u32>,
    /// True if the guest has requested a time. A stepped clock then waits for the guest.
    pub seat: bool,
    /// Number of frames or telegrams for the guest that were dropped because there was no room.
    pub dropped: u64,
    /// Number of frames or telegrams of the guest that were refused.
    pub refused: u64,
}

impl Guest {
    pub(super) fn new(bus: BusIndex, number: u8, door: DoorSpec) -> Self {
        Guest { bus, number, door, inner: Mutex::default() }
    }

    fn inner(&self) -> MutexGuard<'_, Inner> {
        // A panic leaves no half-written value here, so a poisoned lock can be used.
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Everything that the guest requests at the moment.
    #[must_use]
    pub fn requests(&self) -> GuestRequests {
        let inner = self.inner();
        GuestRequests {
            hears: inner.open.is_some() && !inner.has_gone,
            takes_part: inner.open == Some(false) && !inner.has_gone,
            rate: inner.rate,
            has_gone: inner.has_gone,
            bad_length: inner.bad_length,
        }
    }

    /// True if the guest has disconnected.
    pub(super) fn has_gone(&self) -> bool {
        self.inner().has_gone
    }

    /// True if the guest has ever taken part or listened. If not, the plant has no entry for it.
    pub(super) fn has_opened(&self) -> bool {
        self.inner().has_opened
    }

    /// Returns the number of messages that the plant has not yet taken from the guest.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.inner().to_plant.len()
    }

    /// Returns the next message from the guest. [`Guest::sent`] removes it.
    #[must_use]
    pub fn next_to_send(&self) -> Option<BusMessage> {
        self.inner().to_plant.front().cloned()
    }

    /// True if messages without room wait in the connection of the guest. The clock waits for a guest with a seat, so
    /// such a guest must not wait for the clock.
    fn waits_for_room(&self, inner: &Inner) -> bool {
        inner.seat == GuestTurn::Free && !self.door.protocol().answers_refusals()
    }

    /// True if the thread of the doors may read from the guest. If not, the plant resumes the guest later
    /// ([`Guest::resume`]).
    pub(crate) fn may_be_read(&self) -> bool {
        let mut inner = self.inner();
        inner.is_held = inner.octets_to_plant >= OCTETS_TO_PLANT && self.waits_for_room(&inner);
        !inner.is_held
    }

    /// Returns true once if the thread of the doors was waiting for room, and there is room now.
    #[must_use]
    pub fn resume(&self) -> bool {
        let mut inner = self.inner();
        let has_room = inner.octets_to_plant < OCTETS_TO_PLANT;
        has_room && core::mem::take(&mut inner.is_held)
    }

    /// Removes the next message from the guest. `was_taken` is true if the bus has taken it, and false if the bus has
    /// finally refused it.
    pub fn sent(&self, was_taken: bool) {
        let mut inner = self.inner();
        let octets = inner.to_plant.pop_front().map_or(0, |message| message.octets());
        inner.octets_to_plant -= octets;
        inner.refused += u64::from(!was_taken);
    }

    /// Queues a message for the guest, if there is room. `time_us` is the emulated time at which the message has
    /// arrived.
    pub fn hear(&self, time_us: u64, message: BusMessage) {
        let mut inner = self.inner();
        inner.seat.hear();
        if inner.to_guest.len() < ROOM_TO_GUEST {
            inner.to_guest.push_back(GuestMessage::Heard { time_us, message });
        } else {
            inner.dropped += 1;
            inner.overrun = true;
        }
    }

    /// Sends the error state of the guest's controller to the guest, if the guest has requested it.
    pub fn note_errors(&self, state: ErrorState) {
        self.inner().errors = state;
    }

    /// Facts about the guest.
    #[must_use]
    pub fn state(&self) -> GuestState {
        let inner = self.inner();
        GuestState {
            guest: self.number,
            door: self.door,
            open: inner.open.is_some(),
            bit_s: inner.rate.map(Rate::bit_s),
            seat: inner.seat != GuestTurn::Free,
            dropped: inner.dropped,
            refused: inner.refused,
        }
    }

    /// Returns the relation of the guest to emulated time.
    #[must_use]
    pub fn seat(&self) -> GuestTurn {
        self.inner().seat
    }

    /// Sets the rate of the guest's bus in bit/s.
    pub fn is_at(&self, bit_s: u32) {
        self.inner().bus_bit_s = bit_s;
    }

    /// If the guest has requested a duration, this duration begins at `now`.
    pub fn take_request(&self, now: u64) {
        let mut inner = self.inner();
        let rate = BusRate::new(inner.bus_bit_s);
        if let Some(bit) = inner.until_bit.take()
            && let GuestTurn::Asks { us, .. } = &mut inner.seat
        {
            // If the requested time is in the past, the duration is 1 us, because 0 would stop the clock.
            *us = rate.map_or(0, |rate| rate.us_at(bit)).saturating_sub(now).max(1);
        }
        inner.seat.begin(now);
    }

    /// Returns the bit time on the guest's bus at this emulated time; 0 if the bus counts no bit times.
    pub(super) fn bit_at(&self, time_us: u64) -> u64 {
        BusRate::new(self.inner().bus_bit_s).map_or(0, |rate| rate.bits_at(time_us))
    }

    /// True if a message to the guest waits.
    #[must_use]
    pub fn has_unread_messages(&self) -> bool {
        !self.inner().to_guest.is_empty()
    }

    /// Records that the guest has announced an invalid number of octets. Because of this number, the guest
    /// must leave.
    pub(super) fn reject_length(&self, length: BadLength) {
        self.inner().bad_length = Some(length.0);
    }

    /// Grants the guest its turn at `now`, if the time of the turn has come. Returns true if the turn was granted.
    pub fn grant(&self, now: u64) -> bool {
        let mut inner = self.inner();
        let is_due = inner.seat.grant(now);
        if is_due {
            // There is always room, because the queue has at most one answer for each request.
            inner.to_guest.push_back(GuestMessage::Granted { time_us: now });
        }
        is_due
    }

    /// If it is the guest's turn, takes its seat away and returns true.
    pub fn give_up(&self) -> bool {
        self.inner().seat.give_up()
    }

    /// Marks the guest as gone.
    pub(super) fn leave(&self) {
        let mut inner = self.inner();
        inner.has_gone = true;
        inner.seat = GuestTurn::Free;
    }

    /// Discards the messages that the plant has not taken from a disconnected guest.
    pub(super) fn give_up_unsent(&self) {
        let mut inner = self.inner();
        inner.to_plant.clear();
        inner.octets_to_plant = 0;
        inner.is_given_up = true;
    }

    /// True if the guest's unsent messages were discarded.
    pub(super) fn is_given_up(&self) -> bool {
        self.inner().is_given_up
    }

    /// Removes and returns the next message to the guest, if one waits.
    pub(super) fn take_news(&self) -> Option<GuestMessage> {
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
        let mut inner = self.inner();
        inner.open = Some(listens);
        inner.has_opened = true;
    }

    fn close(&mut self) {
        let mut inner = self.inner();
        inner.open = None;
        inner.seat = GuestTurn::Free;
        inner.to_guest.clear();
    }

    fn send(&mut self, message: BusMessage) -> bool {
        let mut inner = self.inner();
        let has_room = inner.to_plant.len() < ROOM_TO_PLANT || self.waits_for_room(&inner);
        let may = inner.open == Some(false) && inner.seat.may_speak() && has_room;
        if may {
            inner.octets_to_plant += message.octets();
            inner.to_plant.push_back(message);
        } else {
            inner.refused += 1;
        }
        may
    }

    fn ask(&mut self, us: u64) -> bool {
        let mut inner = self.inner();
        inner.open.is_some() && inner.seat.ask(us)
    }

    fn ask_until(&mut self, bit: u64) -> bool {
        // The request is for a bit time. Its duration in microseconds is computed later, when the turn
        // begins, so this call passes the largest value.
        let may = self.ask(u64::MAX);
        if may {
            self.inner().until_bit = Some(bit);
        }
        may
    }

    fn take_status(&mut self) -> Status {
        let mut inner = self.inner();
        Status { has_missed: core::mem::take(&mut inner.overrun), errors: inner.errors }
    }
}

#[cfg(test)]
impl Guest {
    /// Returns a guest that the test controls.
    pub(crate) fn of_a_test(bus: BusIndex, number: u8) -> std::sync::Arc<Self> {
        Guest::new(bus, number, "slcan-tcp:127.0.0.1:0".parse().unwrap()).into()
    }

    /// Lets the guest take part.
    pub(crate) fn opens(&self) {
        (&mut &*self).open(false);
    }

    /// Sends a frame without data, and receives the permission.
    pub(crate) fn sends(&self, id: u16) {
        assert!(
            (&mut &*self)
                .send(BusMessage::Frame(crate::can::Frame::standard(id, crate::can::Payload::EMPTY)))
        );
    }

    /// Sends a telegram for the bit time 25,000,000, which is 50 s at 500 kbit/s, and receives the
    /// permission.
    pub(crate) fn sends_later(&self) {
        let burst = crate::profibus::Burst { begin: 25_000_000, octets: vec![0xE5] };
        assert!((&mut &*self).send(BusMessage::Burst(burst)));
    }

    /// Ends the guest's participation.
    pub(crate) fn goes(&self) {
        self.leave();
    }

    /// Returns the next message to the guest, if it is bus traffic.
    pub(crate) fn hears(&self) -> Option<BusMessage> {
        match self.take_news()? {
            GuestMessage::Heard { message, .. } => Some(message),
            GuestMessage::Granted { .. } => None,
        }
    }

    /// Returns the number of frames that wait for the guest.
    pub(crate) fn heard(&self) -> usize {
        self.inner().to_guest.len()
    }
}
