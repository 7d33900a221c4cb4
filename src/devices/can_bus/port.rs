//! The CAN port of a device: a controller and its firmware.

use super::Controller;
use crate::can::{ErrorState, Frame};
use crate::devices::Context;
use crate::fault::{Effect, Hit};
use crate::journal::Origin;
use crate::layout::DeviceLayout;
use crate::memory::Segment;
use crate::snapshot_fields::SnapshotFields;

/// Firmware of a device's port on a CAN bus. The bus calls it at whole microseconds of emulated time with the
/// controller of the port.
pub trait CanPort: Send + SnapshotFields {
    /// Called when the device starts. `address` is the number of the port at the switches
    /// ([`DevicePorts::address`](crate::devices::DevicePorts::address)). The controller has no frames and no filters.
    fn power_on(&mut self, ctx: &mut Context, controller: &mut Controller, address: u8) {
        let _ = (ctx, controller, address);
    }

    /// Called when the device stops. The controller is reset.
    fn power_off(&mut self) {}

    /// Runs a processor cycle: reads the registers.
    fn look(&mut self, ctx: &mut Context, controller: &mut Controller);

    /// True if the program has written a register that the firmware must answer, and the firmware has not
    /// polled this register yet.
    fn has_changed(&self) -> bool {
        false
    }

    /// Called when a frame that passes the filters has arrived.
    fn received(&mut self, ctx: &mut Context, controller: &mut Controller, frame: &Frame);

    /// Called when a frame that passes the filters was lost, because a fault has caused an overrun of the controller.
    fn overrun(&mut self, ctx: &mut Context, controller: &mut Controller, frame: &Frame) {
        let _ = (ctx, controller, frame);
    }

    /// Called when a frame of this port has arrived at the other stations.
    fn sent(&mut self, ctx: &mut Context, controller: &mut Controller, frame: &Frame) {
        let _ = (ctx, controller, frame);
    }

    /// Called when the error state of the controller has changed. The device decides whether the controller returns
    /// from BUS-off by itself. The default implementation starts the return immediately ([`Controller::restart`]).
    fn error_state(&mut self, ctx: &mut Context, controller: &mut Controller, state: ErrorState) {
        let _ = ctx;
        if state == ErrorState::BusOff {
            controller.restart();
        }
    }

    /// Returns the time of the next event of the firmware in microseconds, `u64::MAX` if there is none. Only calls of
    /// the firmware change this time.
    fn next_time(&self) -> u64 {
        u64::MAX
    }

    /// Handles the events that are due at `ctx.now`. Afterwards [`next_time`](CanPort::next_time) must be later,
    /// otherwise the bus calls again at the same time.
    fn due(&mut self, ctx: &mut Context, controller: &mut Controller) {
        let _ = (ctx, controller);
    }

    /// Applies a fault of the device to the port, at the start of the fault or in a processor cycle. If the
    /// fault has an effect, returns the hit.
    fn fire(&mut self, now: u64, effect: &Effect) -> Option<Hit> {
        let _ = (now, effect);
        None
    }
}

/// A CAN port as a device provides it.
pub struct CanSocket {
    /// Device and number of the port.
    pub origin: Origin,
    /// Image of the device.
    pub segment: Segment,
    /// Registers of the device.
    pub layout: &'static DeviceLayout,
    /// Firmware of the port.
    pub port: Box<dyn CanPort>,
}
