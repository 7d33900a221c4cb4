//! The modules of a modular device: their switches and LEDs.

use crate::devices::of_hash;
use crate::layout::{DeviceLayout as Layout, Fit, Role};
use crate::memory::Header;

/// State of a LED.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Led {
    /// The LED is dark.
    #[default]
    Off,
    /// The LED is lit.
    On,
    /// Flashes this many times, then pauses.
    Flashes(u8),
    /// The LED flashes alternately with another LED of the module that also has this state.
    InTurn,
}

/// Position of a switch of a module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Switch {
    /// Several switches that form a number.
    Number(u8),
    /// A switch that is ON (`true`) or OFF.
    Is(bool),
}

/// The front panel of a module.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ModuleFront {
    /// Kind of the module, as in plant files.
    pub kind: &'static str,
    /// Switches of the module, by the names that they have in plant files.
    pub switches: Vec<(&'static str, Switch)>,
    /// LEDs of the module, by the names that the manual gives them.
    pub leds: Vec<(&'static str, Led)>,
}

/// Returns the front panel of the module in a port. The arguments are the role of the port, its DIP switches
/// and its LEDs from the header page ([`PortEntry`](crate::memory::header::PortEntry)). The role is `None` if
/// the module has no registers in the device. The result is `None` if the port has no module.
pub type ReadModule = fn(Option<Role>, u32, u32) -> Option<ModuleFront>;

/// Returns the modules of a device in the order of their ports, each with the name of its port. `None` if the
/// device is not modular.
pub fn modules(header: &Header, device: &'static Layout) -> Option<Vec<(&'static str, ModuleFront)>> {
    let read = of_hash(device.layout_hash)?.emulation.module?;
    let fitted = header.fitted(device);
    let ports = device.ports.iter().zip(&header.ports);
    let modules = ports.filter_map(|(port, entry)| {
        let role = match fitted.port(port.number) {
            Fit::As(role) => Some(role),
            Fit::Empty | Fit::Unknown => None,
        };
        Some((port.name, read(role, entry.dip.load(), entry.leds.load())?))
    });
    Some(modules.collect())
}
