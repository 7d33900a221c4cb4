//! What a device has at a CAN bus: a controller, and the firmware behind it.

use crate::can::{Filter, Frame};
use crate::devices::Context;
use crate::fault::{Effect, Hit};
use crate::journal::Origin;
use crate::layout::Device;
use crate::memory::Segment;
use std::collections::VecDeque;

/// The firmware of a device's port at a CAN bus. It is called at whole microseconds of emulated time, with the controller
/// that is its own.
pub trait CanPort: Send {
    /// The device starts; `address` is the port's number at its switches
    /// ([`Device::address`](crate::devices::Device::address)). The controller is empty and without filters.
    fn power_on(&mut self, ctx: &mut Context, controller: &mut Controller, address: u8) {
        let _ = (ctx, controller, address);
    }

    /// The device stops; the controller forgets everything.
    fn power_off(&mut self) {}

    /// The processor cycle: looks at its registers.
    fn look(&mut self, ctx: &mut Context, controller: &mut Controller);

    /// Whether the program has written a register that the firmware answers and has not looked at yet.
    fn has_changed(&self) -> bool {
        false
    }

    /// A frame that passes the filters has arrived.
    fn received(&mut self, ctx: &mut Context, controller: &mut Controller, frame: &Frame);

    /// A frame of its own has arrived at the others.
    fn sent(&mut self, ctx: &mut Context, controller: &mut Controller, frame: &Frame) {
        let _ = (ctx, controller, frame);
    }

    /// When the next of its own times is due, in microseconds; `u64::MAX` if none is.
    fn next_time(&self) -> u64 {
        u64::MAX
    }

    /// Handles what is due at `ctx.now`; afterwards [`next_time`](CanPort::next_time) lies behind that, else the bus goes on
    /// asking at this moment.
    fn due(&mut self, ctx: &mut Context, controller: &mut Controller) {
        let _ = (ctx, controller);
    }

    /// A fault of the device acts on the port, at its begin or in a processor cycle: does it hit?
    fn strike(&mut self, now: u64, effect: &Effect) -> Option<Hit> {
        let _ = (now, effect);
        None
    }
}

/// A CAN port, as a device hands it over.
pub struct CanSocket {
    /// The device and the port's number.
    pub origin: Origin,
    /// The device's image.
    pub segment: Segment,
    /// The device's registers.
    pub layout: &'static Device,
    /// The port's firmware.
    pub port: Box<dyn CanPort>,
}

/// There is no room in a controller's queue.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the controller has {} frames to send already", Controller::ROOM)]
pub struct QueueFull;

/// A CAN controller: frames to send, in their order (decision D-355), and which ones it hands to the firmware.
#[derive(Debug, Default)]
pub struct Controller {
    /// With the time from which on each is there, in ns.
    queue: VecDeque<(u64, Frame)>,
    filters: Vec<Filter>,
    /// The rate that it is set to, in bit/s; none is that of its bus.
    bit_s: Option<u32>,
    /// Present emulated time in us, when firmware runs.
    pub(super) now: u64,
}

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
    }

    /// Sets it to so many bit/s. At a bus with another rate it neither sends, hears nor acknowledges anything (decision D-433).
    pub fn set_bit_rate(&mut self, bit_s: u32) {
        self.bit_s = Some(bit_s);
    }

    /// Whether it takes part in a bus with so many bit/s.
    pub(super) fn hears(&self, bit_s: u32) -> bool {
        self.bit_s.is_none_or(|own| own == bit_s)
    }

    pub(super) fn accepts(&self, frame: &Frame) -> bool {
        self.filters.is_empty() || self.filters.iter().any(|filter| filter.accepts(frame))
    }

    /// The frame that it sends first, if it was there at `at_ns`.
    pub(super) fn offer(&self, at_ns: u64) -> Option<Frame> {
        self.queue.front().filter(|(since_ns, _)| *since_ns <= at_ns).map(|(_, frame)| *frame)
    }

    /// The first frame has arrived.
    pub(super) fn take(&mut self) -> Option<Frame> {
        self.queue.pop_front().map(|(_, frame)| frame)
    }

    /// Puts a frame into the queue at `now`, when no firmware runs.
    ///
    /// # Errors
    /// [`QueueFull`].
    pub(super) fn send_at(&mut self, now: u64, frame: Frame) -> Result<(), QueueFull> {
        self.now = now;
        self.send(frame)
    }

    pub(super) fn clear(&mut self) {
        self.queue.clear();
        self.filters.clear();
        self.bit_s = None;
    }
}
