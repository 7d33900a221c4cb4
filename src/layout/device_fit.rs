//! A device with its options. The options decide which structures its areas contain.

use super::LayoutError;
use super::descriptor::{Area, AreaStructure, DeviceLayout, Dim, Port, Register, RegisterPhase, Role};
use super::register::RegisterRef;
use crate::identity::PortNumber;

/// Maximum number of ports of a device.
pub(crate) const MOST_PORTS: usize = 15;

/// The known facts about a port.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Fit {
    /// The options are not known: the port may have any role that the layout allows.
    #[default]
    Unknown,
    /// The port does not exist, for instance because a slot is empty. Its area has no registers.
    Empty,
    /// The port has this role at the medium.
    As(Role),
}

impl Fit {
    /// Returns the role of the port, if it is known.
    #[must_use]
    pub const fn role(self) -> Option<Role> {
        match self {
            Fit::As(role) => Some(role),
            Fit::Unknown | Fit::Empty => None,
        }
    }

    /// True if the area of such a port contains, or can contain, structures for this role. The area always contains
    /// structures for any role (`None`).
    #[must_use]
    pub fn has(self, role: Option<Role>) -> bool {
        match (self, role) {
            (Fit::Unknown, _) | (_, None) => true,
            (Fit::Empty, Some(_)) => false,
            (Fit::As(is), Some(role)) => is == role,
        }
    }
}

/// A device, and the known facts about its ports. Names and widths of registers depend on the device and on these
/// facts: in a modular PLC, the module in a slot decides which registers the slot has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct DeviceFit {
    device: &'static DeviceLayout,
    /// Options of the ports, in the order of the device's ports.
    ports: [Fit; MOST_PORTS],
    /// Number of the declarations in the folder of the device, which belong to no register; 0 if there are none.
    declarations: u64,
}

impl DeviceFit {
    /// Returns the device without known facts about its ports.
    #[must_use]
    pub fn unknown(device: &'static DeviceLayout) -> Self {
        let mut fitted = Self { device, ports: [Fit::Unknown; MOST_PORTS], declarations: 0 };
        for (fit, port) in fitted.ports.iter_mut().zip(device.ports) {
            *fit = port.role().map_or(Fit::Unknown, Fit::As);
        }
        fitted
    }

    /// Sets the known facts about port `number`. An unknown number changes nothing.
    #[must_use]
    pub fn with(mut self, number: PortNumber, fit: Fit) -> Self {
        let ports = self.ports.iter_mut().zip(self.device.ports);
        ports.filter(|(_, port)| port.number == number).for_each(|(known, _)| *known = fit);
        self
    }

    /// Sets the number of the declarations in the folder of the device.
    #[cfg(feature = "emulator")]
    #[must_use]
    pub(crate) fn declaring(self, declarations: u64) -> Self {
        Self { declarations, ..self }
    }

    /// Returns the number of the declarations in the folder of the device; 0 if there are none. Devices with equal
    /// registers may have different declarations.
    #[cfg(feature = "emulator")]
    pub(crate) const fn declarations(&self) -> u64 {
        self.declarations
    }

    /// Returns the layout of the device.
    #[must_use]
    pub const fn device(&self) -> &'static DeviceLayout {
        self.device
    }

    /// Returns the known facts about port `number`.
    #[must_use]
    pub fn port(&self, number: PortNumber) -> Fit {
        let mut ports = self.device.ports.iter().zip(self.ports);
        ports.find(|(port, _)| port.number == number).map_or(Fit::Unknown, |(_, fit)| fit)
    }

    /// Returns the first port that is or can be a master. It is the default port for users who name no port.
    #[must_use]
    pub fn first_master(&self) -> Option<&'static Port> {
        self.device.ports.iter().zip(self.ports).find_map(|(port, fit)| match fit {
            Fit::Unknown => port.roles.contains(&Role::Master).then_some(port),
            _ => (fit.role() == Some(Role::Master)).then_some(port),
        })
    }

    /// Returns the port with this name; for an empty name, the first port that is or can be a master.
    ///
    /// # Errors
    /// The device has no such port, or no master.
    pub fn port_or_master(&self, name: &str) -> Result<&'static Port, LayoutError> {
        match name {
            "" => self.first_master().ok_or(LayoutError::NoMaster),
            name => self.device.port_named(name),
        }
    }

    /// Returns the known facts about the port that has its registers in `area`.
    #[must_use]
    pub fn area(&self, area: &Area) -> Fit {
        let mut ports = self.device.ports.iter().zip(self.ports);
        ports.find(|(port, _)| port.area.first == area.first).map_or(Fit::Unknown, |(_, fit)| fit)
    }

    /// Returns the structures that `area` contains or can contain.
    pub fn placed(
        &self,
        area: &'static Area,
    ) -> impl DoubleEndedIterator<Item = &'static AreaStructure> + use<> {
        let fit = self.area(area);
        area.structures.iter().filter(move |placed| fit.has(placed.role))
    }

    /// Returns the registers of a structure that [`DeviceFit::placed`] has returned, in address order.
    pub(super) fn registers_of(
        &self,
        area: &'static Area,
        placed: &'static AreaStructure,
    ) -> impl Iterator<Item = RegisterRef> + use<> {
        let role = self.area(area).role();
        area.registers_of(placed).map(move |found| RegisterRef { role, ..found })
    }

    /// Returns the registers that are valid in phase `live`, structure by structure, each in address order.
    pub fn registers_in(
        &self,
        area: &'static Area,
        live: RegisterPhase,
    ) -> impl Iterator<Item = RegisterRef> + use<> {
        let fitted = *self;
        let placed = self.placed(area).filter(move |placed| placed.live.is_valid_in(live));
        placed.flat_map(move |placed| fitted.registers_of(area, placed))
    }

    /// Returns the registers that are used in this area, structure by structure. Where structures of the same role
    /// overlay each other, their registers have the same widths.
    pub fn used_registers(&self, area: &'static Area) -> impl Iterator<Item = RegisterRef> + use<> {
        let fitted = *self;
        self.placed(area).flat_map(move |placed| {
            let registers = fitted.registers_of(area, placed);
            registers.filter(|found| !placed.unused.contains(&found.register.name))
        })
    }
}

impl AreaStructure {
    /// True if the area can contain both structures at once.
    pub(super) fn shares_role(&self, other: &Self) -> bool {
        self.role.is_none() || other.role.is_none() || self.role == other.role
    }
}

impl Register {
    /// True if the name of `self` is the name of `other`.
    pub(crate) fn has_name_of(&self, other: &Self) -> bool {
        self.name == other.name && self.group == other.group
    }

    /// True if `self` and `other` have equal offsets in their structures, equal widths and equal array bounds.
    pub(super) fn lies_like(&self, other: &Self) -> bool {
        let bounds = |of: &'static [Dim]| of.iter().map(|dim| (dim.count, dim.stride));
        self.offset == other.offset
            && self.ty.width() == other.ty.width()
            && self.group_dims == other.group_dims
            && bounds(self.dims).eq(bounds(other.dims))
    }
}

impl From<&'static DeviceLayout> for DeviceFit {
    fn from(device: &'static DeviceLayout) -> Self {
        Self::unknown(device)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::samples::tables::NODES;
    use crate::devices::samples::tables::SLOTS as DEVICE;
    use crate::devices::samples::tables::phases;
    use std::collections::BTreeMap;

    fn fitted(fit: Fit) -> DeviceFit {
        DeviceFit::unknown(&DEVICE).with(PortNumber(1), fit)
    }

    /// Returns the roles of the structures in the first slot.
    fn roles(fit: Fit, live: RegisterPhase) -> Vec<Option<Role>> {
        let registers = fitted(fit).registers_in(DEVICE.areas.first().unwrap(), live);
        let mut roles: Vec<_> = registers.map(|found| found.placed.role).collect();
        roles.dedup();
        roles
    }

    #[test]
    fn the_role_selects_the_structures() {
        let [master, slave] = [Role::Master, Role::Slave];
        assert_eq!(roles(Fit::As(master), phases::CYCLIC), [Some(master)]);
        assert_eq!(roles(Fit::As(slave), phases::CYCLIC), [Some(slave)]);
        assert_eq!(roles(Fit::Unknown, phases::CYCLIC), [Some(master), Some(slave)]);
        assert_eq!(roles(Fit::As(slave), phases::INIT), [Some(slave)]);
        assert_eq!(roles(Fit::Empty, phases::CYCLIC), []);
    }

    #[test]
    fn a_port_is_known_by_its_number_and_by_its_area() {
        let fitted =
            fitted(Fit::Empty).with(PortNumber(3), Fit::As(Role::Slave)).with(PortNumber(99), Fit::Empty);
        assert_eq!((fitted.port(PortNumber(1)), fitted.port(PortNumber(2))), (Fit::Empty, Fit::Unknown));
        assert_eq!(
            (fitted.port(PortNumber(3)), fitted.port(PortNumber(99))),
            (Fit::As(Role::Slave), Fit::Unknown)
        );
        assert_eq!(fitted.area(DEVICE.area("slotJ").unwrap()), Fit::As(Role::Slave));
    }

    #[test]
    fn where_a_layout_leaves_no_choice_the_role_is_known() {
        let fitted = DeviceFit::unknown(&NODES);
        assert_eq!(
            (fitted.port(PortNumber(1)), fitted.port(PortNumber(2))),
            (Fit::As(Role::Slave), Fit::As(Role::Master))
        );
    }

    #[test]
    fn used_registers_of_a_role_agree_on_the_width_of_every_byte() {
        let of_role = |role| {
            (1..=6).fold(DeviceFit::unknown(&DEVICE), |fitted, port| {
                fitted.with(PortNumber(port), Fit::As(role))
            })
        };
        let fitted = [DeviceFit::unknown(&NODES), of_role(Role::Master), of_role(Role::Slave)];
        for (fitted, area) in
            fitted.iter().flat_map(|it| it.device().areas.iter().map(move |area| (it, area)))
        {
            let mut widths = BTreeMap::new();
            for found in fitted.used_registers(area) {
                for byte in found.offset()..found.offset() + found.width() {
                    let cell = (found.offset(), found.width());
                    assert_eq!(*widths.entry(byte).or_insert(cell), cell, "{found}");
                }
            }
            assert_eq!(widths.is_empty(), area.structures.is_empty(), "{area:?}");
        }
    }

    #[test]
    fn the_slave_types_are_the_masters_alone() {
        let used = |fitted: DeviceFit, area: &str| {
            let registers = fitted.used_registers(fitted.device().area(area).unwrap());
            registers.filter(|found| found.register.name == "a_SL_TYP").count()
        };
        let nodes = DeviceFit::unknown(&NODES);
        assert_eq!((used(nodes, "node1"), used(nodes, "node2")), (0, 32));
        let [slave, master] = [Role::Slave, Role::Master].map(|role| fitted(Fit::As(role)));
        assert_eq!((used(slave, "slotG"), used(master, "slotG")), (0, 32));
    }
}
