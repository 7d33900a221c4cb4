//! The visible state of a device: identity, image, registers and front panel.

use crate::identity::PortNumber;
use crate::layout::{DeviceFit, DeviceLayout};
use crate::memory::{Header, Segment};

/// The visible state of a device. Reading it changes nothing.
pub trait DeviceView {
    /// Returns the name of the device in the plant.
    fn name(&self) -> &str;

    /// Image of the device.
    fn segment(&self) -> &Segment;

    /// Layout of the registers of the device.
    fn layout(&self) -> &'static DeviceLayout;

    /// Returns the header page of the device's image.
    fn header(&self) -> &Header;

    /// Returns the device with its options: which ports exist, and their roles. In a modular device the modules decide
    /// this.
    fn fitted(&self) -> DeviceFit {
        DeviceFit::unknown(self.layout())
    }

    /// True if `port` is a drive on its bus, without registers in the device. Faults name this drive by its number on
    /// the bus.
    fn is_drive(&self, port: PortNumber) -> bool {
        let _ = port;
        false
    }

    /// Interrupt level of an event: a task of a higher level interrupts a task of a lower level. `None` if there is no
    /// such event.
    fn event_level(&self, event: usize) -> Option<u8> {
        let _ = event;
        None
    }
}
