//! The CAN controller of a port, with functions for firmware and bus.

use crate::can::{ErrorCounters, ErrorState, Filter, Frame};
use crate::snapshot_fields;
use std::collections::VecDeque;

/// A controller's transmit queue is full.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the transmit queue is full ({} frames)", Controller::ROOM)]
pub struct QueueFull;

/// A CAN controller: a transmit queue that keeps the order of its frames (decision D-355), acceptance filters
/// and error counters.
#[derive(Debug, Default)]
pub struct Controller {
    /// Each frame with the earliest time at which it can be sent, in ns.
    queue: VecDeque<(u64, Frame)>,
    /// True if the first frame of the queue is on the wire.
    pub(super) is_sending: bool,
    /// True if the first frame was discarded since the bus last polled.
    has_discarded: bool,
    filters: Vec<Filter>,
    /// True if filters were set since the bus last polled.
    has_new_filters: bool,
    /// Bit rate of the controller in bit/s; `None` for the rate of its bus.
    bit_s: Option<u32>,
    errors: ErrorCounters,
    /// True if the firmware has requested the return from BUS-off.
    restarts: bool,
    /// Present emulated time in us while firmware runs.
    pub(super) now: u64,
}

snapshot_fields!(Controller {
    values: queue,
    is_sending,
    has_discarded,
    filters,
    has_new_filters,
    bit_s,
    errors,
    restarts,
    now
});

impl Controller {
    /// Maximum number of frames in the queue.
    pub const ROOM: usize = 64;

    /// Appends a frame to the transmit queue. When it is the first frame of the queue, it takes part in each
    /// arbitration, and it stays in the queue until it has arrived.
    ///
    /// # Errors
    /// [`QueueFull`].
    pub fn send(&mut self, frame: Frame) -> Result<(), QueueFull> {
        if self.queue.len() >= Self::ROOM {
            return Err(QueueFull);
        }
        self.queue.push_back((self.now * 1000, frame));
        Ok(())
    }

    /// Discards all frames of the queue, except a frame that is on the wire.
    pub fn discard(&mut self) {
        self.has_discarded |= !self.is_sending && !self.queue.is_empty();
        self.queue.truncate(self.is_sending.into());
    }

    /// Returns the number of frames to be sent, including the frame on the wire.
    pub fn to_send(&self) -> usize {
        self.queue.len()
    }

    /// Sets the filters: the firmware receives frames that pass one of them, or all frames if there are no filters.
    pub fn set_filters(&mut self, filters: impl IntoIterator<Item = Filter>) {
        self.filters = filters.into_iter().collect();
        self.has_new_filters = true;
    }

    /// Sets the bit rate. On a bus with another rate the controller neither sends, receives nor acknowledges anything
    /// (decision D-433).
    pub fn set_bit_rate(&mut self, bit_s: u32) {
        self.bit_s = Some(bit_s);
    }

    /// Returns the error counters.
    pub fn errors(&self) -> ErrorCounters {
        self.errors
    }

    /// Returns the error state: active, passive or BUS-off.
    pub fn error_state(&self) -> ErrorState {
        self.errors.state()
    }

    /// Starts the return from BUS-off. After 128 sequences of eleven recessive bits the controller is error-active with
    /// counters of 0 and sends the frames of its queue. Has no effect in any other error state.
    pub fn restart(&mut self) {
        self.restarts = self.error_state() == ErrorState::BusOff;
    }

    /// True if the controller takes part in a bus with bit rate `bit_s`.
    pub(super) fn takes_part(&self, bit_s: u32) -> bool {
        self.bit_s.is_none_or(|own| own == bit_s) && self.error_state() != ErrorState::BusOff
    }

    pub(super) fn accepts(&self, frame: &Frame) -> bool {
        self.filters.is_empty() || self.filters.iter().any(|filter| filter.accepts(frame))
    }

    /// Returns the first frame of the queue and the earliest time at which it can be sent, in ns.
    pub(super) fn front(&self) -> Option<&(u64, Frame)> {
        self.queue.front()
    }

    /// Removes the first frame, which has arrived.
    pub(super) fn take(&mut self) {
        self.queue.pop_front();
    }

    pub(super) fn errors_mut(&mut self) -> &mut ErrorCounters {
        &mut self.errors
    }

    /// Returns whether the first frame was discarded since the last call.
    pub(super) fn take_discarded(&mut self) -> bool {
        core::mem::take(&mut self.has_discarded)
    }

    /// Returns whether filters were set since the last call.
    pub(super) fn take_new_filters(&mut self) -> bool {
        core::mem::take(&mut self.has_new_filters)
    }

    /// Returns whether the return from BUS-off was requested since the last call.
    pub(super) fn take_restart(&mut self) -> bool {
        core::mem::take(&mut self.restarts)
    }

    /// Resets everything to the values at power-on.
    pub(super) fn clear(&mut self) {
        *self = Controller { has_new_filters: true, now: self.now, ..Controller::default() };
    }
}
