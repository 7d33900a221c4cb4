//! The visible state of a device: identity, image, registers and front panel.

use crate::devices::faults_of_device;
use crate::fault::FaultKind;
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

    /// Returns the device with its options: the ports that exist, and their roles. In a modular device they
    /// depend on the modules.
    fn fitted(&self) -> DeviceFit {
        DeviceFit::unknown(self.layout())
    }

    /// Returns the kinds of faults that the device or its ports can have.
    fn fault_kinds(&self) -> &'static [&'static FaultKind] {
        faults_of_device(self.layout())
    }

    /// True if `port` is a drive on its bus and has no registers in the device. Faults name such a drive by
    /// its number on the bus.
    fn is_drive(&self, port: PortNumber) -> bool {
        let _ = port;
        false
    }

    /// Returns the interrupt level of an event. A task of a higher level interrupts a task of a lower level.
    /// `None` if the event does not exist.
    fn event_level(&self, event: usize) -> Option<u8> {
        let _ = event;
        None
    }
}
