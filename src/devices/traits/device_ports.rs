//! The ports of a device, as far as the device takes part in their events.

use crate::devices::Context;

/// A device with number switches, LEDs or a SYNC signal for its ports ([`Device::ports`](crate::devices::Device::ports)). The
/// plant passes events of the ports to the device.
pub trait DevicePorts {
    /// `port` is connected to a bus with this bit rate in bit/s; 0 if the bus has none. Called once, before the first
    /// start.
    fn plugged_in(&mut self, port: u8, bit_s: u32) {
        let _ = (port, bit_s);
    }

    /// The number on its bus that `port` has from now on: the number of the switches at the last start.
    fn address(&self, port: u8) -> u8;

    /// Another station has the number of `port`, so the port is not connected.
    fn address_taken(&mut self, ctx: &mut Context, port: u8);

    /// Called when `port` starts or stops taking part in the traffic of its bus.
    fn port_joined(&mut self, port: u8, takes_part: bool);

    /// Called after the firmware of `port` has polled its registers in a processor cycle at `now`. `last_frame` is the
    /// time of the last frame that the port sent or received since it joined, if the bus records that time.
    fn port_looked(&mut self, port: u8, last_frame: Option<u64>, now: u64) {
        let _ = (port, last_frame, now);
    }

    /// The ports with a SYNC signal that is passed on to another port of the device if the firmware there enables it:
    /// from, to.
    fn sync_ways(&self) -> &[(u8, u8)] {
        &[]
    }

    /// An edge of the SYNC signal at `port`; called after all other parts have seen it.
    fn sync_edge(&mut self, port: u8, now: u64) {
        let _ = (port, now);
    }
}
