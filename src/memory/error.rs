//! What can go wrong with the emulated RAM.

use super::{Address, HEADER_SIZE, SEGMENT_SIZE};

/// An access or an image file that was refused: what, where, and what would be right.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MemoryError {
    /// The address does not suit the width.
    #[error("{address}: {}", .address.width.alignment_rule())]
    Misaligned {
        /// The refused access.
        address: Address,
    },
    /// The access ends behind the segment.
    #[error("{address} lies behind the segment's last byte %MB3.{}", SEGMENT_SIZE - 1)]
    OutOfRange {
        /// The refused access.
        address: Address,
    },
    /// The access touches the header page, which belongs to the attach contract and holds no registers.
    #[error("{address} lies in the header page; registers begin at %MB3.{}", HEADER_SIZE)]
    InHeader {
        /// The refused access.
        address: Address,
    },
    /// A block (typed view or copy) does not fit into the segment.
    #[error("%MB3.{offset}: {size} bytes end behind the segment's last byte %MB3.{}", SEGMENT_SIZE - 1)]
    BlockOutOfRange {
        /// First byte of the block.
        offset: usize,
        /// Its length in bytes.
        size: usize,
    },
    /// A typed view at an address its widest register does not allow.
    #[error("%MB3.{offset}: a view of {type_name} needs an address divisible by {align}")]
    BlockMisaligned {
        /// First byte of the block.
        offset: usize,
        /// Alignment it needs.
        align: usize,
        /// The Rust type of the view.
        type_name: &'static str,
    },
    /// The value has more bits than the register.
    #[error("{address}: 16#{value:X} does not fit, a {} holds at most 16#{:X}", .address.width, .address.width.max_value())]
    ValueTooWide {
        /// The register.
        address: Address,
        /// The refused value.
        value: u32,
    },
    /// A partial access that is not part of the register it names.
    #[error("{part} is no part of the {} at {register}", .register.width)]
    NotWithin {
        /// The whole register.
        register: Address,
        /// The access that should have been a part of it.
        part: Address,
    },
    /// A write or a writable view on an image that was attached for reading.
    #[error("%MB3.{offset}: the image is attached read-only; attach it for reading and writing instead")]
    ReadOnly {
        /// First byte of the access.
        offset: usize,
    },
}
