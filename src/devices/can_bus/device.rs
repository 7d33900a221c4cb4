//! A device with registers and one port on a CAN bus: the smallest custom device.

use super::{CanPort, CanSocket, FAMILY};
use crate::devices::{BuildError, Device, DeviceConfig, Plain, Plug, PortConfig};
use crate::identity::DeviceIndex;
use crate::journal::Origin;
use crate::layout;
use crate::layout::Port;
use crate::memory::{MemoryError, Segment};
use core::fmt;
use core::marker::PhantomData;
use serde::Deserialize;
use std::sync::Arc;
use toml::de::{Error, ValueDeserializer};

/// Firmware of a device with one CAN port. The whole firmware runs at the port.
pub trait CanDevice: CanPort + Sized + 'static {
    /// Registers of the device. The first port for a bus of kind `can` in this layout connects the device to
    /// its bus.
    const LAYOUT: &'static layout::DeviceLayout;

    /// Creates the firmware of a device with this image.
    ///
    /// # Errors
    /// [`MemoryError`]: the image is too small for the registers, or is read-only.
    fn new(segment: &Segment) -> Result<Self, MemoryError>;
}

/// Reads the `[[device]]` section, for [`Emulation::read`](crate::devices::Emulation::read): `name`, and `bus`, which
/// is optional.
///
/// # Errors
/// The fault in the section, with its position.
pub fn read<D: CanDevice>(value: ValueDeserializer<'_>) -> Result<Arc<dyn DeviceConfig>, Error> {
    let Section { name, bus } = Section::deserialize(value)?;
    Ok(Arc::new(Config::<D> { name, bus, firmware: PhantomData }))
}

/// Keys of the section in the plant file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
#[serde(expecting = "a device at a CAN bus: a table with its settings")]
struct Section {
    name: String,
    bus: Option<String>,
}

/// Configuration of a device with one CAN port in the plant file.
struct Config<D> {
    name: String,
    bus: Option<String>,
    firmware: PhantomData<fn() -> D>,
}

impl<D: CanDevice> Config<D> {
    fn port() -> Option<&'static Port> {
        D::LAYOUT.ports.iter().find(|port| port.medium == FAMILY)
    }
}

impl<D: CanDevice> fmt::Debug for Config<D> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct(D::LAYOUT.name).field("name", &self.name).field("bus", &self.bus).finish()
    }
}

impl<D: CanDevice> DeviceConfig for Config<D> {
    fn name(&self) -> &str {
        &self.name
    }

    fn layout(&self) -> &'static layout::DeviceLayout {
        D::LAYOUT
    }

    fn ports(&self) -> Vec<PortConfig<'_>> {
        Self::port().map(|port| PortConfig::of(port, self.bus.as_deref())).into_iter().collect()
    }

    fn build(
        &self,
        index: DeviceIndex,
        segment: Segment,
    ) -> Result<(Box<dyn Device>, Vec<Plug>), BuildError> {
        let mut plugs = Vec::new();
        if let Some(port) = Self::port() {
            let origin = Origin { plc: index, node: port.number };
            let firmware = Box::new(D::new(&segment)?);
            let socket = CanSocket { origin, segment: segment.clone(), layout: D::LAYOUT, port: firmware };
            let (number, bus) = (port.number, self.bus.clone());
            plugs.push(Plug { number, family: port.medium, bus, socket: Box::new(socket) });
        }
        let device = Plain::new(index, &self.name, D::LAYOUT, segment, ())?;
        Ok((Box::new(device), plugs))
    }
}
