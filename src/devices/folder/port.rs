//! The CAN port of a device in a folder.
//!
//! The script of the device decides about frames, but the bus runs the controller. Port and script share a
//! [`BusLink`]: the port puts arrived frames into it, and takes from it the frames to send. The plant calls
//! the device when a frame arrives, and the port when the script has sent a frame.

use crate::can::{ErrorState, Filter, Frame};
use crate::devices::can_bus::{CanPort, Controller};
use crate::devices::{Context, DevicePorts};
use crate::identity::PortNumber;
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Number of the CAN port in each device with such a port.
const CAN_PORT: PortNumber = PortNumber(1);

/// Maximum number of arrivals that wait for the script. The script handles all arrivals of a moment at this
/// moment, so the number is never reached.
const MOST_ARRIVALS: usize = 64;

/// An event at the port that the script must handle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum Arrival {
    /// A frame that passes the filters has arrived.
    Frame(Frame),
    /// The error state of the controller has changed.
    State(ErrorState),
    /// A fault has lost a frame that passes the filters.
    Overrun,
}

/// Reason why a frame is not sent.
#[cfg_attr(not(feature = "script"), expect(dead_code, reason = "only scripts send frames"))]
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(super) enum Unsendable {
    #[error("the port is at no bus")]
    NoBus,
    #[error("the device has no power")]
    Off,
    #[error("the transmit queue is full ({} frames)", Controller::ROOM)]
    Full,
}

/// Frames between a controller and its device.
#[derive(Debug, Default)]
struct Exchange {
    /// True if the port is connected to a bus.
    has_bus: bool,
    is_on: bool,
    /// Events with their times, in microseconds.
    arrivals: VecDeque<(u64, Arrival)>,
    /// Frames that were not given to the controller yet.
    to_send: VecDeque<Frame>,
    /// Filters that were not given to the controller yet.
    filters: Option<Vec<Filter>>,
    /// Frames in the transmit queue of the controller.
    queued: usize,
    state: ErrorState,
}

/// The part that the port and the firmware of its device share.
#[derive(Clone, Debug, Default)]
pub(super) struct BusLink(Arc<Mutex<Exchange>>);

impl BusLink {
    fn lock(&self) -> MutexGuard<'_, Exchange> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Switches the link on or off together with the device. Frames and events that wait in the link are
    /// lost.
    pub(super) fn switch(&self, is_on: bool) {
        let mut exchange = self.lock();
        *exchange = Exchange { has_bus: exchange.has_bus, is_on, ..Exchange::default() };
    }

    /// Returns the time of the first event that the firmware has not handled; `u64::MAX` if there is none.
    pub(super) fn next_time(&self) -> u64 {
        self.lock().arrivals.front().map_or(u64::MAX, |(time, _)| *time)
    }
}

/// The functions for the script of the device.
#[cfg(feature = "script")]
impl BusLink {
    /// Removes and returns the first event.
    pub(super) fn take_arrival(&self) -> Option<Arrival> {
        self.lock().arrivals.pop_front().map(|(_, arrival)| arrival)
    }

    /// Puts a frame into the transmit queue.
    ///
    /// # Errors
    /// The frame is lost, for the reason in the error.
    pub(super) fn send(&self, frame: Frame) -> Result<(), Unsendable> {
        let mut exchange = self.lock();
        if !exchange.has_bus {
            return Err(Unsendable::NoBus);
        }
        if !exchange.is_on {
            return Err(Unsendable::Off);
        }
        if exchange.queued + exchange.to_send.len() >= Controller::ROOM {
            return Err(Unsendable::Full);
        }
        exchange.to_send.push_back(frame);
        Ok(())
    }

    /// Replaces the filters of the controller. With an empty list, the controller accepts all frames.
    pub(super) fn accept(&self, filters: Vec<Filter>) {
        let mut exchange = self.lock();
        if exchange.is_on {
            exchange.filters = Some(filters);
        }
    }

    /// Returns the error state of the controller; `None` if the port is not connected to a bus.
    pub(super) fn state(&self) -> Option<ErrorState> {
        let exchange = self.lock();
        exchange.has_bus.then_some(exchange.state)
    }
}

impl DevicePorts for BusLink {
    fn plugged_in(&mut self, port: PortNumber, bit_s: u32) {
        if port == CAN_PORT {
            self.lock().has_bus = bit_s != 0;
        }
    }

    /// The port has no switches for a number, so the number is 0.
    fn address(&self, _: PortNumber) -> u8 {
        0
    }

    /// Has no effect, because the stations of a CAN bus have no numbers.
    fn address_taken(&mut self, _: &mut Context, _: PortNumber) {}

    fn port_joined(&mut self, _: PortNumber, _: bool) {}

    fn has_orders(&self, port: PortNumber) -> bool {
        let exchange = self.lock();
        port == CAN_PORT && (!exchange.to_send.is_empty() || exchange.filters.is_some())
    }

    fn exchanges_with_ports(&self) -> bool {
        true
    }
}

/// The port at its bus.
pub(super) struct FolderPort {
    link: BusLink,
    /// True if the device has a script. Only a script handles the events.
    has_script: bool,
}

impl FolderPort {
    pub(super) fn new(link: BusLink, has_script: bool) -> Self {
        FolderPort { link, has_script }
    }

    /// Passes the frames and filters that the script has set to the controller.
    fn pass(&self, controller: &mut Controller) {
        let mut exchange = self.link.lock();
        if let Some(filters) = exchange.filters.take() {
            controller.set_filters(filters);
        }
        while let Some(frame) = exchange.to_send.front()
            && controller.send(*frame).is_ok()
        {
            exchange.to_send.pop_front();
        }
        exchange.queued = controller.to_send();
    }

    fn arrived(&self, ctx: &Context, arrival: Arrival) {
        let mut exchange = self.link.lock();
        if self.has_script {
            exchange.arrivals.push_back((ctx.now, arrival));
        }
    }
}

impl SnapshotFields for FolderPort {
    fn save(&self, to: &mut Saving) {
        let exchange = self.link.lock();
        let Exchange { has_bus: _, is_on, arrivals, to_send, filters, queued, state } = &*exchange;
        to.value(&(is_on, arrivals, to_send, filters, queued, state));
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        let mut exchange = self.link.lock();
        let Exchange { has_bus: _, is_on, arrivals, to_send, filters, queued, state } = &mut *exchange;
        (*is_on, *arrivals, *to_send, *filters, *queued, *state) = from.value()?;
        from.check(arrivals.len() <= MOST_ARRIVALS, "number of arrived frames")?;
        from.check(to_send.len().saturating_add(*queued) <= Controller::ROOM, "number of frames to send")
    }
}

impl CanPort for FolderPort {
    fn power_on(&mut self, _: &mut Context, controller: &mut Controller, _: u8) {
        self.pass(controller);
    }

    fn power_off(&mut self) {
        self.link.switch(false);
    }

    fn look(&mut self, _: &mut Context, controller: &mut Controller) {
        self.pass(controller);
    }

    fn received(&mut self, ctx: &mut Context, _: &mut Controller, frame: &Frame) {
        self.arrived(ctx, Arrival::Frame(*frame));
    }

    fn overrun(&mut self, ctx: &mut Context, _: &mut Controller, _: &Frame) {
        self.arrived(ctx, Arrival::Overrun);
    }

    fn sent(&mut self, _: &mut Context, controller: &mut Controller, _: &Frame) {
        self.link.lock().queued = controller.to_send();
    }

    /// The controller returns from BUS-off automatically, and then sends the frames of its queue.
    fn error_state(&mut self, ctx: &mut Context, controller: &mut Controller, state: ErrorState) {
        self.link.lock().state = state;
        self.arrived(ctx, Arrival::State(state));
        if state == ErrorState::BusOff {
            controller.restart();
        }
    }
}
