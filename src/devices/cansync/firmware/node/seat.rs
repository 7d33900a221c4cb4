//! Where a node's registers lie.

use crate::devices::cansync::BaudRate;
use crate::layout::Port;

/// Where a node's registers lie, which of its device's nodes it is, and at what rates it can run.
#[derive(Clone, Copy, Debug)]
pub struct Seat {
    /// First byte of its area.
    pub base: usize,
    /// Its place among the ports of the header page, from 0.
    pub place: usize,
    /// The baud rates of its device.
    pub rates: &'static [BaudRate],
    /// Whether a slave there has the single-frame area.
    pub has_single_frame_area: bool,
}

impl Seat {
    /// The seat of the node at `port` of a device with these baud rates.
    #[must_use]
    pub fn of(port: &Port, rates: &'static [BaudRate]) -> Self {
        let mut registers = port.area.structures.iter().flat_map(|placed| placed.structure.registers);
        Seat {
            base: port.area.first as usize,
            place: usize::from(port.number) - 1,
            rates,
            has_single_frame_area: registers.any(|register| register.name == "b_STEUREG_UPDOWN_SINGLE"),
        }
    }
}
