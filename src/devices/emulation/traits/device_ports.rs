//! Functions of a device for events of its ports.

use crate::devices::Context;
use crate::identity::PortNumber;

/// A device with number switches, LEDs or a SYNC signal for its ports
/// ([`Device::ports`](crate::devices::Device::ports)). The plant passes events of the ports to such a device.
pub trait DevicePorts {
    /// Called once, before the first start. At this time `port` was connected to a bus with this bit rate in
    /// bit/s. The rate is 0 if the bus has no bit rate.
    fn plugged_in(&mut self, port: PortNumber, bit_s: u32) {
        let _ = (port, bit_s);
    }

    /// Returns the number of `port` on its bus. It is the number that the switches had at the last start.
    fn address(&self, port: PortNumber) -> u8;

    /// Called if another station already has the number of `port`. The port is then not connected.
    fn address_taken(&mut self, ctx: &mut Context, port: PortNumber);

    /// Called when `port` starts or stops taking part in the traffic of its bus.
    fn port_joined(&mut self, port: PortNumber, takes_part: bool);

    /// Called when the firmware of `port` has polled its registers in a processor cycle at `now`.
    /// `last_frame` is the time of the last frame that the port has sent or received since it joined the bus,
    /// if the bus records this time.
    fn port_looked(&mut self, port: PortNumber, last_frame: Option<u64>, now: u64) {
        let _ = (port, last_frame, now);
    }

    /// Pairs of ports. The device can pass the SYNC signal of the first port on to the second port. It does
    /// so if the firmware of the second port enables this.
    fn sync_ways(&self) -> &[(PortNumber, PortNumber)] {
        &[]
    }

    /// True if the device itself handles events of its ports, at the moment of the event. The time of the
    /// device's next event ([`Device::next_time`](crate::devices::Device::next_time)) then depends on these
    /// events.
    fn exchanges_with_ports(&self) -> bool {
        false
    }

    /// True if the device has orders for `port` that the port has not handled yet, for example a frame to be
    /// sent. The plant then makes the port poll at once.
    fn has_orders(&self, port: PortNumber) -> bool {
        let _ = port;
        false
    }

    /// Called at an edge of the SYNC signal at `port`, when all other parts have handled the edge.
    fn sync_edge(&mut self, port: PortNumber, now: u64) {
        let _ = (port, now);
    }
}
