//! Location of a node's registers.

use crate::devices::cansync::BaudRate;
use crate::layout::Port;

/// Location of a node's registers, index of the node in its device, and supported baud rates.
#[derive(Clone, Copy, Debug)]
pub struct NodeLocation {
    /// First byte of the node's area.
    pub base: u32,
    /// Index of the node among the ports of the header page, from 0.
    pub place: usize,
    /// Baud rates of the device.
    pub rates: &'static [BaudRate],
    /// True if a slave in this location has the single-frame area, the second area for up-/downloads.
    pub has_single_frame_area: bool,
}

impl NodeLocation {
    /// Returns the location of the node at `port` of a device with these baud rates.
    #[must_use]
    pub fn of(port: &Port, rates: &'static [BaudRate]) -> Self {
        let mut registers = port.area.structures.iter().flat_map(|placed| placed.structure.registers);
        NodeLocation {
            base: port.area.first,
            place: port.number.index(),
            rates,
            has_single_frame_area: registers.any(|register| register.name == "b_STEUREG_UPDOWN_SINGLE"),
        }
    }
}
