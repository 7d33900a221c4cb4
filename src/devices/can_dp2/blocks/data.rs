//! Parts of a PLC that the blocks access: peripherals and data blocks. All words have their high byte first.

use crate::devices::can_dp2::registers::gsd;
use std::collections::BTreeMap;

/// Number of octets in each direction.
const OCTETS: usize = gsd::MAX_OUTPUT_LEN as usize;

/// Outputs to the gateway and inputs from it. The blocks address outputs and inputs from 0 on, in the order of the
/// gateway's modules (D-469).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Peripherals {
    /// Outputs that the next data exchange sends to the gateway.
    pub outputs: [u8; OCTETS],
    /// Inputs from the last data exchange.
    pub inputs: [u8; OCTETS],
}

impl Default for Peripherals {
    fn default() -> Self {
        Peripherals { outputs: [0; OCTETS], inputs: [0; OCTETS] }
    }
}

impl Peripherals {
    /// Returns `N` inputs from `address` on, if they exist.
    pub(super) fn read<const N: usize>(&self, address: u16) -> Option<[u8; N]> {
        self.inputs.get(usize::from(address)..)?.first_chunk().copied()
    }

    /// Writes outputs from `address` on; returns `false` if they do not all exist.
    pub(super) fn write(&mut self, address: u16, octets: &[u8]) -> bool {
        let first = usize::from(address);
        let cells = self.outputs.get_mut(first..first + octets.len());
        cells.map(|cells| cells.copy_from_slice(octets)).is_some()
    }
}

/// The data blocks of a PLC by their numbers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DataBlocks(BTreeMap<u16, Vec<u8>>);

impl DataBlocks {
    /// Creates or replaces data block `number` with these bytes.
    pub fn set(&mut self, number: u16, bytes: &[u8]) {
        self.0.insert(number, bytes.to_vec());
    }

    /// Returns the bytes of a data block; `None` if the data block does not exist.
    #[must_use]
    pub fn get(&self, number: u16) -> Option<&[u8]> {
        self.0.get(&number).map(Vec::as_slice)
    }

    /// Returns bytes of a data block from `offset` on.
    pub(super) fn read<const N: usize>(&self, number: u16, offset: usize) -> Option<[u8; N]> {
        self.get(number)?.get(offset..)?.first_chunk().copied()
    }

    /// Returns a word of a data block.
    pub(super) fn word(&self, number: u16, offset: usize) -> Option<u16> {
        self.read(number, offset).map(u16::from_be_bytes)
    }

    /// Writes bytes of a data block; returns `false` if the block does not have all of them.
    pub(super) fn write(&mut self, number: u16, offset: usize, bytes: &[u8]) -> bool {
        let cells = self.0.get_mut(&number).and_then(|block| block.get_mut(offset..offset + bytes.len()));
        cells.map(|cells| cells.copy_from_slice(bytes)).is_some()
    }
}
