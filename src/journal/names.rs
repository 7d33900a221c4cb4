//! Names of the devices and buses to which records refer by index.

use super::event::{Origin, Source};
use crate::identity::{BusIndex, DeviceIndex, PortNumber};
use crate::layout::{DeviceFit, DeviceLayout};
use std::borrow::Cow;

/// Names of the devices and buses to which records refer by index.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Names {
    /// Names of the PLCs, in the order of the plant.
    pub plcs: Vec<String>,
    /// Names of the buses, in the order of the plant.
    pub buses: Vec<String>,
    /// The device and the options of each PLC, in the order of the plant.
    pub devices: Vec<DeviceFit>,
}

impl Names {
    /// Returns the PLC's name; `plc3` if it has none.
    pub(crate) fn plc(&self, index: DeviceIndex) -> Cow<'_, str> {
        name(&self.plcs, index.index(), "plc")
    }

    /// Returns the bus's name; `bus3` if it has none.
    pub(crate) fn bus(&self, index: BusIndex) -> Cow<'_, str> {
        name(&self.buses, index.index(), "bus")
    }

    /// Returns the device of the PLC; a device without registers if it is not known.
    pub fn device(&self, plc: DeviceIndex) -> &'static DeviceLayout {
        self.fitted(plc).device()
    }

    /// Returns the device of this PLC like [`Names::device`], with the options of the PLC.
    pub fn fitted(&self, plc: DeviceIndex) -> DeviceFit {
        let known = self.devices.get(plc.index()).copied();
        known.unwrap_or_else(|| DeviceFit::unknown(&DeviceLayout::UNKNOWN))
    }

    /// Returns the name of a port; `port3` if it has none. For number 0, which means the device itself, returns the
    /// name of the interface that the device has outside of its ports.
    pub(crate) fn port(&self, origin: Origin) -> Cow<'static, str> {
        let device = self.device(origin.plc);
        match (origin.node, device.port_numbered(origin.node)) {
            (PortNumber::DEVICE, _) => Cow::Borrowed(device.own.map_or("device", |area| area.name)),
            (_, Some(port)) => Cow::Borrowed(port.name),
            (number, None) => Cow::Owned(match number.option_interface() {
                Some(interface) => format!("option{interface}"),
                None => format!("port{number}"),
            }),
        }
    }

    /// Returns the name of a bus or PLC, or of a port as `line:node2`.
    pub(crate) fn source(&self, source: Source) -> String {
        match source {
            Source::Bus(index) => self.bus(index).into_owned(),
            Source::Plc(index) => self.plc(index).into_owned(),
            Source::Node(origin) => match (origin.guest(), origin.drive()) {
                (Some(guest), _) => format!("guest{guest}"),
                (None, Some(address)) => format!("drive{address}"),
                (None, None) => format!("{}:{}", self.plc(origin.plc), self.port(origin)),
            },
        }
    }
}

fn name<'a>(names: &'a [String], index: usize, what: &str) -> Cow<'a, str> {
    match names.get(index) {
        Some(name) => Cow::Borrowed(name),
        None => Cow::Owned(format!("{what}{index}")),
    }
}
