//! What a device has at a CAN bus: a controller, and the firmware behind it.

use super::Controller;
use crate::can::{ErrorState, Frame};
use crate::devices::Context;
use crate::fault::{Effect, Hit};
use crate::journal::Origin;
use crate::layout::Device;
use crate::memory::Segment;
use crate::snapshot_fields::SnapshotFields;

/// The firmware of a device's port at a CAN bus. It is called at whole microseconds of emulated time, with the controller
/// that is its own.
pub trait CanPort: Send + SnapshotFields {
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

    /// A frame that passes the filters was lost, as the controller had no room for it: a fault.
    fn overrun(&mut self, ctx: &mut Context, controller: &mut Controller, frame: &Frame) {
        let _ = (ctx, controller, frame);
    }

    /// A frame of its own has arrived at the others.
    fn sent(&mut self, ctx: &mut Context, controller: &mut Controller, frame: &Frame) {
        let _ = (ctx, controller, frame);
    }

    /// The error state of its controller has changed. Whether a controller returns from BUS-off by itself is its device's
    /// affair: left as it is here, it does ([`Controller::restart`]).
    fn error_state(&mut self, ctx: &mut Context, controller: &mut Controller, state: ErrorState) {
        let _ = ctx;
        if state == ErrorState::BusOff {
            controller.restart();
        }
    }

    /// When the next of its own times is due, in microseconds; `u64::MAX` if none is. It changes only in calls to the firmware.
    fn next_time(&self) -> u64 {
        u64::MAX
    }

    /// Handles what is due at `ctx.now`; afterwards [`next_time`](CanPort::next_time) lies behind that, else the bus goes on
    /// asking at this moment.
    fn due(&mut self, ctx: &mut Context, controller: &mut Controller) {
        let _ = (ctx, controller);
    }

    /// A fault of the device acts on the port, at its begin or in a processor cycle: does it hit?
    fn fire(&mut self, now: u64, effect: &Effect) -> Option<Hit> {
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
