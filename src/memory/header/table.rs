//! Tables of the header page that describe the device of an image: its areas and its ports.

use crate::layout::{Area, Fit, MOST_PORTS, Port, Role, Space};
use crate::memory::header::set_name;
use crate::memory::struct_tables::publish;
use crate::memory::{Cell8, Cell32, SharedRegs};
use zerocopy::{FromBytes, IntoBytes, KnownLayout};

/// Maximum number of areas of a device, including its retain flags.
pub const AREAS: usize = 16;
/// Maximum number of ports of a device.
pub const PORTS: usize = MOST_PORTS;
/// Length of the names in the tables in bytes, with the terminating zero.
pub const TABLE_NAME_LENGTH: usize = 16;

/// A range of addresses with one purpose, and its position in the file. Written by the emulator while it starts.
#[derive(FromBytes, IntoBytes, KnownLayout, Debug)]
#[repr(C)]
pub struct AreaEntry {
    /// Name in register names, for example `node2`; UTF-8, zero-padded. All zeros: no area.
    pub name: [Cell8; TABLE_NAME_LENGTH],
    /// Text of an address of this area without `%`, width and number: `M3.` for `%MB3.200000`, `M` for `%MB10000000`.
    pub space: [Cell8; 8],
    /// Number of the first byte or word of the area in the space.
    pub first: Cell32,
    /// Number of bytes per address: 1 or 2.
    pub unit: Cell32,
    /// Offset of the area in the file.
    pub file_offset: Cell32,
    /// Length of the area in bytes.
    pub size: Cell32,
    /// Reserved; always zero.
    pub reserved_40: [Cell32; 2],
}

/// The connection of the device to a medium, such as a bus.
#[derive(FromBytes, IntoBytes, KnownLayout, Debug)]
#[repr(C)]
pub struct PortEntry {
    /// Name of the port, for example `node2`; UTF-8, zero-padded. All zeros: no port.
    pub name: [Cell8; TABLE_NAME_LENGTH],
    /// Kind of the medium, as in `kind` of `[[bus]]`; UTF-8, zero-padded.
    pub medium: [Cell8; TABLE_NAME_LENGTH],
    /// Number of the port in journals and on the channel, from 1.
    pub number: Cell32,
    /// Offset of the port's registers in the file.
    pub file_offset: Cell32,
    /// Incremented, wrapping, by a program after it has stored 16#0000 in the port's `w_CPU_CONTROL`. This makes the
    /// store a restart even if the register already held 16#0000 (decision D-29).
    pub restarts_written: Cell32,
    /// DIP switches of the port, if it has its own.
    pub dip: Cell32,
    /// LEDs of the port, if it has its own, with eight bits for each LED: 0 off, 16#FF on, 16#FE alternating with
    /// another LED, any other value the number of flashes.
    pub leds: Cell32,
    /// Role of the port on its medium: 0 none, because the module is missing; 1 master, 2 slave, 3 peer.
    pub role: Cell32,
    /// Reserved; always zero.
    pub reserved_56: [Cell32; 2],
}

// SAFETY: every field is a cell or an array of cells; IntoBytes proves that there is no padding and FromBytes that any
// bit pattern is valid.
unsafe impl SharedRegs for AreaEntry {}
// SAFETY: as above.
unsafe impl SharedRegs for PortEntry {}

publish! { AreaEntry:
    0 => name, 16 => space, 24 => first, 28 => unit, 32 => file_offset, 36 => size, 40 => reserved_40,
}
publish! { PortEntry:
    0 => name, 16 => medium, 32 => number, 36 => file_offset, 40 => restarts_written, 44 => dip, 48 => leds,
    52 => role, 56 => reserved_56,
}
const _: () = assert!(size_of::<AreaEntry>() == 48 && size_of::<PortEntry>() == 64);

impl AreaEntry {
    /// Describes `area` and replaces the previous content.
    pub(super) fn fill(&self, area: &Area) {
        set_name(&self.name, area.name);
        let Space { letter, segment, unit, .. } = area.space;
        set_name(&self.space, &format!("{letter}{segment}"));
        self.first.store(area.space.number(area.first, unit.width()));
        self.unit.store(unit.width().bytes());
        self.file_offset.store(area.first);
        self.size.store(area.bytes);
    }

    /// Clears all cells of the entry.
    pub(super) fn clear(&self) {
        self.name.iter().chain(&self.space).for_each(|byte| byte.store(0));
        [&self.first, &self.unit, &self.file_offset, &self.size].into_iter().for_each(|cell| cell.store(0));
    }
}

impl PortEntry {
    /// Fills the entry with the description of `port` and the state of the port at power-on.
    pub(super) fn fill(&self, port: &Port) {
        self.clear();
        set_name(&self.name, port.name);
        set_name(&self.medium, port.medium);
        self.number.store(port.number.0.into());
        self.file_offset.store(port.area.first);
    }

    /// Clears all cells of the entry.
    pub(super) fn clear(&self) {
        self.name.iter().chain(&self.medium).for_each(|byte| byte.store(0));
        let words =
            [&self.number, &self.file_offset, &self.restarts_written, &self.dip, &self.leds, &self.role];
        words.into_iter().for_each(|cell| cell.store(0));
    }

    /// Writes the role of the port.
    pub(super) fn set_fit(&self, fit: Fit) {
        self.role.store(match fit.role() {
            None => 0,
            Some(Role::Master) => 1,
            Some(Role::Slave) => 2,
            Some(Role::Peer) => 3,
        });
    }

    /// Returns the device option that [`PortEntry::role`] describes; `Fit::Unknown` for an invalid code.
    pub(super) fn fit(&self) -> Fit {
        match self.role.load() {
            0 => Fit::Empty,
            1 => Fit::As(Role::Master),
            2 => Fit::As(Role::Slave),
            3 => Fit::As(Role::Peer),
            _ => Fit::Unknown,
        }
    }
}
