//! A CAN controller, as its firmware has it in hands.

use crate::can::{ErrorCounters, ErrorState, Filter, Frame};
use crate::snapshot_fields;
use std::collections::VecDeque;

/// There is no room in a controller's queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the controller has {} frames to send already", Controller::ROOM)]
pub struct QueueFull;

/// A CAN controller: frames to send, in their order (decision D-355), which ones it hands to the firmware, and its errors.
#[derive(Debug, Default)]
pub struct Controller {
    /// With the time from which on each is there, in ns.
    queue: VecDeque<(u64, Frame)>,
    filters: Vec<Filter>,
    /// Somebody has set filters since the bus last asked.
    has_new_filters: bool,
    /// The rate that it is set to, in bit/s; none is that of its bus.
    bit_s: Option<u32>,
    errors: ErrorCounters,
    /// It is to return from BUS-off.
    restarts: bool,
    /// Present emulated time in us, when firmware runs.
    pub(super) now: u64,
}

snapshot_fields!(Controller { values: queue, filters, has_new_filters, bit_s, errors, restarts, now });

impl Controller {
    /// Frames that the queue has room for.
    pub const ROOM: usize = 64;

    /// Puts a frame behind those that are to be sent. The first one takes part in the next arbitration and stays there until
    /// it has arrived.
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

    /// How many frames are to be sent, the one on the wire included.
    pub fn to_send(&self) -> usize {
        self.queue.len()
    }

    /// From now on hands over frames that pass one of these filters; all frames without any.
    pub fn set_filters(&mut self, filters: impl IntoIterator<Item = Filter>) {
        self.filters = filters.into_iter().collect();
        self.has_new_filters = true;
    }

    /// Sets it to so many bit/s. At a bus with another rate it neither sends, hears nor acknowledges anything (decision D-433).
    pub fn set_bit_rate(&mut self, bit_s: u32) {
        self.bit_s = Some(bit_s);
    }

    /// Its error counters.
    pub fn errors(&self) -> ErrorCounters {
        self.errors
    }

    /// What it may still do on its bus.
    pub fn error_state(&self) -> ErrorState {
        self.errors.state()
    }

    /// Lets a controller that is BUS-off return: when it has seen 128 times eleven recessive bits it is error-active, with
    /// counters of 0, and what waits in its queue is sent. Does nothing in any other state.
    pub fn restart(&mut self) {
        self.restarts = self.error_state() == ErrorState::BusOff;
    }

    /// Whether it takes part in a bus with so many bit/s.
    pub(super) fn takes_part(&self, bit_s: u32) -> bool {
        self.bit_s.is_none_or(|own| own == bit_s) && self.error_state() != ErrorState::BusOff
    }

    pub(super) fn accepts(&self, frame: &Frame) -> bool {
        self.filters.is_empty() || self.filters.iter().any(|filter| filter.accepts(frame))
    }

    /// The frame that it sends first, and the time from which on it is there, in ns.
    pub(super) fn front(&self) -> Option<&(u64, Frame)> {
        self.queue.front()
    }

    /// The first frame has arrived.
    pub(super) fn take(&mut self) {
        self.queue.pop_front();
    }

    pub(super) fn errors_mut(&mut self) -> &mut ErrorCounters {
        &mut self.errors
    }

    /// Whether filters were set since it was last asked.
    pub(super) fn take_new_filters(&mut self) -> bool {
        core::mem::take(&mut self.has_new_filters)
    }

    /// Whether it is to return from BUS-off, since it was last asked.
    pub(super) fn take_restart(&mut self) -> bool {
        core::mem::take(&mut self.restarts)
    }

    /// As at power-on.
    pub(super) fn clear(&mut self) {
        *self = Controller { has_new_filters: true, now: self.now, ..Controller::default() };
    }
}
