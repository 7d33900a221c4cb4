//! The arbitration field: identifier, format, and kind of a frame. A frame has data or requests data.

use embedded_can::{ExtendedId, Id, StandardId};
use serde::{Deserialize, Serialize};
use std::fmt;

/// The arbitration field as it is sent after the start bit, left-aligned in 32 bits. It begins with 11 bits of the
/// identifier. In the standard format RTR and IDE (0) follow. In the extended format SRR (1), IDE (1), the other 18
/// bits of the identifier and RTR follow. A 0 is dominant, so the smaller field wins.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Arbitration(u32);

const BASE: u32 = 21;
const SRR: u32 = 1 << 20;
const IDE: u32 = 1 << 19;
const STANDARD_RTR: u32 = 1 << 20;
const EXTENDED_RTR: u32 = 1;

impl Arbitration {
    /// Returns the arbitration field of a frame with this identifier. With `is_remote`, the frame requests data;
    /// otherwise it has data.
    #[inline]
    pub fn new(id: impl Into<Id>, is_remote: bool) -> Self {
        let field = match id.into() {
            Id::Standard(id) => u32::from(id.as_raw()) << BASE,
            Id::Extended(id) => spread(id.as_raw()) | SRR | IDE,
        };
        let field = Arbitration(field);
        if is_remote { Arbitration(field.0 | field.rtr()) } else { field }
    }

    /// Returns the identifier that the arbitration field contains.
    #[inline]
    pub fn id(self) -> Id {
        let base = self.0 >> BASE;
        // The shifts and the mask leave 29 or 11 bits, so neither identifier can be out of range.
        if self.is_extended() {
            let id = base << 18 | self.0 >> 1 & 0x3_FFFF;
            Id::Extended(ExtendedId::new(id).unwrap_or(ExtendedId::MAX))
        } else {
            Id::Standard(StandardId::new(base as u16).unwrap_or(StandardId::MAX))
        }
    }

    /// Returns the identifier as a number of 11 or 29 bits.
    #[inline]
    pub fn number(self) -> u32 {
        match self.id() {
            Id::Standard(id) => id.as_raw().into(),
            Id::Extended(id) => id.as_raw(),
        }
    }

    /// True if the identifier has 29 bits instead of 11.
    #[inline]
    pub const fn is_extended(self) -> bool {
        self.0 & IDE != 0
    }

    /// True for a remote frame, which requests data.
    #[inline]
    pub const fn is_remote(self) -> bool {
        self.0 & self.rtr() != 0
    }

    /// Returns the field, as described at [`Arbitration`].
    #[inline]
    pub(super) const fn bits(self) -> u32 {
        self.0
    }

    /// Returns the bit that marks a remote frame.
    #[inline]
    pub(super) const fn rtr(self) -> u32 {
        if self.is_extended() { EXTENDED_RTR } else { STANDARD_RTR }
    }

    /// Returns the bits of the field that distinguish the formats.
    pub(super) const fn format() -> u32 {
        IDE
    }

    /// Returns the position of the bits of an identifier of this format in the field.
    pub(super) const fn place(self, id_bits: u32) -> u32 {
        if self.is_extended() { spread(id_bits) } else { id_bits << BASE }
    }
}

/// Returns the 29 bits of an identifier with SRR and IDE between the upper 11 bits and the lower 18 bits.
const fn spread(id: u32) -> u32 {
    (id >> 18) << BASE | (id & 0x3_FFFF) << 1
}

impl fmt::Debug for Arbitration {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.id() {
            Id::Standard(id) => write!(f, "16#{:03X}", id.as_raw())?,
            Id::Extended(id) => write!(f, "16#{:08X}", id.as_raw())?,
        }
        f.write_str(if self.is_remote() { " remote" } else { "" })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can::reference;
    use proptest::prelude::*;

    #[test]
    fn the_order_of_the_standard() {
        let standard = |id, remote| Arbitration::new(StandardId::new(id).unwrap(), remote);
        let extended = |id, remote| Arbitration::new(ExtendedId::new(id).unwrap(), remote);
        let in_order = [
            standard(0x122, true),
            standard(0x123, false),
            standard(0x123, true),
            extended(0x123 << 18, false),
            extended(0x123 << 18, true),
            extended(0x123 << 18 | 1, false),
            standard(0x124, false),
        ];
        assert!(in_order.is_sorted_by(|a, b| a < b), "{in_order:?}");
    }

    #[test]
    fn a_field_prints_its_bits() {
        let shown = |field: Arbitration| format!("{field:?}");
        assert_eq!(shown(Arbitration::new(StandardId::new(0x10).unwrap(), false)), "16#010");
        assert_eq!(shown(Arbitration::new(ExtendedId::MAX, true)), "16#1FFFFFFF remote");
    }

    proptest! {
        #![proptest_config(crate::property_tests())]

        #[test]
        fn a_field_keeps_identifier_and_kind(field in reference::arbitration()) {
            let (id, is_remote) = field;
            let made = Arbitration::new(id, is_remote);
            prop_assert_eq!((made.id(), made.is_remote()), (id, is_remote));
            prop_assert_eq!(made.is_extended(), matches!(id, Id::Extended(_)));
        }

        #[test]
        fn identifiers_are_in_the_order_of_the_library(a in reference::id(), b in reference::id()) {
            prop_assert_eq!(Arbitration::new(a, false).cmp(&Arbitration::new(b, false)), a.cmp(&b));
        }
    }
}
