//! Descriptors: areas, structures and registers of the layout files, as static data.

mod meaning;
mod phase;
mod provenance;
mod register;

pub use meaning::{BitField, Handshake, Meaning, ValueMeaning};
pub use phase::{Phase, Phases, RegisterPhase};
pub use provenance::Provenance;
pub use register::{Dim, Owner, RegType, Register};

use super::error::LayoutError;
use super::front::FrontWord;
use super::gsd::Gsd;
use super::object::Object;
use super::space::{Retain, Space};
use crate::identity::PortNumber;
use core::fmt;
use core::hash::{Hash, Hasher};
use core::ops::RangeInclusive;

/// A device: its areas and their content.
pub struct DeviceLayout {
    /// Name of the layout, for `--device` and plant files.
    pub name: &'static str,
    /// The vendor's name for the device.
    pub title: &'static str,
    /// Number of the manual to which the page numbers refer.
    pub manual: &'static str,
    /// Facts about the device as a whole that the manual does not state. The text completes the sentence "it does not
    /// state ..."; it is empty if there are no such facts.
    pub undocumented: &'static str,
    /// Hash over all data that affect addresses or widths.
    pub layout_hash: u64,
    /// The spaces of addresses.
    pub spaces: &'static [Space],
    /// The areas in ascending order.
    pub areas: &'static [Area],
    /// The area of the retain flags, if the device has one. Each plant sets its size.
    pub retain: Option<&'static Retain>,
    /// Object dictionary of the device, in the order of index and sub-index; empty if the device has none.
    pub objects: &'static [Object],
    /// The device description (GSD) for masters, if the device is a PROFIBUS-DP slave.
    pub gsd: Option<&'static Gsd>,
    /// The words of the device's front panel, in the header page.
    pub front: &'static [FrontWord],
    /// The words of the front panel as registers of an area in the header page, if the device has a front panel. The
    /// area is not among the device's [`areas`](DeviceLayout::areas), because no program of the device can access it
    /// (decision D-281).
    pub front_area: Option<&'static Area>,
    /// The ports in the order of their numbers.
    pub ports: &'static [Port],
    /// The area of an interface that belongs to the device and not to a port. Where a user can name a port, the name of
    /// this area means the device itself.
    pub own: Option<&'static Area>,
}

/// Devices are equal if their registers and the places of these are equal.
impl PartialEq for DeviceLayout {
    fn eq(&self, other: &Self) -> bool {
        (self.name, self.layout_hash) == (other.name, other.layout_hash)
    }
}

impl Eq for DeviceLayout {}

impl Hash for DeviceLayout {
    fn hash<H: Hasher>(&self, state: &mut H) {
        (self.name, self.layout_hash).hash(state);
    }
}

impl DeviceLayout {
    /// A device about which nothing is known. It has no areas, so that no register has a name.
    pub const UNKNOWN: DeviceLayout = DeviceLayout {
        name: "unknown",
        title: "unknown device",
        manual: "",
        undocumented: "",
        layout_hash: 0,
        spaces: &[],
        areas: &[],
        retain: None,
        objects: &[],
        gsd: None,
        front: &[],
        front_area: None,
        ports: &[],
        own: None,
    };

    /// Returns the port called `name`.
    #[must_use]
    pub fn port(&self, name: &str) -> Option<&'static Port> {
        self.ports.iter().find(|port| port.name == name)
    }

    /// Returns the port that a user calls `name`.
    ///
    /// # Errors
    /// [`LayoutError::UnknownPort`], which lists all ports.
    pub fn port_named(&self, name: &str) -> Result<&'static Port, LayoutError> {
        self.port(name).ok_or_else(|| {
            let known: Vec<_> = self.ports.iter().map(|port| port.name).collect();
            LayoutError::UnknownPort { port: name.to_owned(), known: known.join(", ") }
        })
    }

    /// Returns the port with this number.
    #[must_use]
    pub fn port_numbered(&self, number: PortNumber) -> Option<&'static Port> {
        self.ports.iter().find(|port| port.number == number)
    }
}

/// A port, which connects the device to a medium such as a bus.
pub struct Port {
    /// Name of the port, for example `node2`.
    pub name: &'static str,
    /// Number of the port in journals and on the channel.
    pub number: PortNumber,
    /// Kind of medium, as in `kind` of a `[[bus]]`.
    pub medium: &'static str,
    /// The possible roles of the port.
    pub roles: &'static [Role],
    /// The area of its registers. The port of a device in a folder has no registers: its area has no bytes.
    pub area: &'static Area,
}

impl Port {
    /// Returns the role of the port at its medium, if only one is possible.
    #[must_use]
    pub const fn role(&self) -> Option<Role> {
        match self.roles {
            [role] => Some(*role),
            _ => None,
        }
    }
}

/// The role of a port at its medium.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Role {
    /// The port controls the medium.
    Master,
    /// The port answers a master.
    Slave,
    /// A station with the same rights as the other stations on the bus.
    Peer,
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Role::Master => "master",
            Role::Slave => "slave",
            Role::Peer => "peer",
        })
    }
}

/// A range of addresses with a common purpose.
pub struct Area {
    /// Name in register names, for example `node2`.
    pub name: &'static str,
    /// Source of the name.
    pub name_from: Provenance,
    /// The space that contains the area.
    pub space: &'static Space,
    /// First byte in the image.
    pub first: u32,
    /// Size in bytes.
    pub bytes: u32,
    /// First and last CPU address, if the manual gives them.
    pub cpu: Option<(u32, u32)>,
    /// Purpose of the area.
    pub doc: &'static str,
    /// Page of the manual.
    pub page: &'static str,
    /// The phases in which different structures are valid; `None` if each structure is always valid.
    pub phases: Option<&'static Phases>,
    /// Structures of the area, which all start at the area's first byte; empty for plain RAM.
    pub structures: &'static [AreaStructure],
}

impl Area {
    /// Last byte in the image.
    #[must_use]
    pub const fn last(&self) -> u32 {
        self.first + (self.bytes - 1)
    }

    /// First address of the area: `%MB3.200000`, `%MW2000`.
    #[must_use]
    pub fn begin(&self) -> String {
        self.space.named(self.first)
    }

    /// Returns the address of the area's last byte, or of the word that contains this byte.
    #[must_use]
    pub fn end(&self) -> String {
        self.space.named(self.last())
    }

    /// Returns the range of numbers that the addresses of the area contain. They number bytes, or words if the device
    /// numbers words.
    #[must_use]
    pub const fn numbers(&self) -> RangeInclusive<u32> {
        self.space.numbers(self.first, self.last())
    }

    /// CPU address of byte `offset` of the image, which must be in this area: `16#B414A004`; empty if the manual does
    /// not state it.
    #[must_use]
    pub fn cpu_address(&self, offset: u32) -> String {
        self.cpu.map_or(String::new(), |(first, _)| format!("16#{:08X}", first + (offset - self.first)))
    }

    /// True if byte `offset` of the image is in the area.
    #[must_use]
    pub const fn contains(&self, offset: u32) -> bool {
        self.first <= offset && offset <= self.last()
    }
}

/// Debug output has only the names, because the tables are long.
macro_rules! short_debug {
    ($($ty:ident),*) => {$(
        impl fmt::Debug for $ty {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.debug_struct(stringify!($ty)).field("name", &self.name).finish_non_exhaustive()
            }
        }
    )*};
}
short_debug!(DeviceLayout, Area, Port, Structure);

/// A structure in an area.
#[derive(Debug)]
pub struct AreaStructure {
    /// Structure with its registers.
    pub structure: &'static Structure,
    /// Phase in which the structure is valid, if several structures overlay each other.
    pub live: RegisterPhase,
    /// The structure is in the area only if the port of the area has this role; `None` for any role.
    pub role: Option<Role>,
    /// Name of the variable that the application declares there. It is the manual's name, if the manual has a name.
    pub variable: &'static str,
    /// Source of the variable's name.
    pub variable_from: Provenance,
    /// Names of registers of the structure that are not used in this area. Another structure may have registers of
    /// another width at the same place. Accesses must then use the width of those registers.
    pub unused: &'static [&'static str],
}

/// A structure of registers. Bytes between registers are padding.
pub struct Structure {
    /// The vendor's type name.
    pub name: &'static str,
    /// Size in bytes.
    pub bytes: u32,
    /// Purpose of the structure.
    pub doc: &'static str,
    /// Pages of the manual.
    pub page: &'static str,
    /// Source of the name.
    pub name_from: Provenance,
    /// The registers in ascending order of their first elements. The registers of a sub-structure are adjacent.
    pub registers: &'static [Register],
}
