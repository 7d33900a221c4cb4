//! Acceptance filters. They decide which frames a controller passes to its firmware.

use super::{Arbitration, Frame};
use embedded_can::Id;
use serde::{Deserialize, Serialize};

/// A filter as in CAN controllers: a code, and a mask. The bits of the arbitration field that are 1 in the mask must
/// agree with the code.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Filter {
    code: Arbitration,
    mask: u32,
}

impl Filter {
    /// Accepts data frames and remote frames with this identifier and its format.
    pub fn exactly(id: impl Into<Id>) -> Self {
        Filter::masked(id, u32::MAX)
    }

    /// Accepts frames of this identifier's format that agree with the identifier in the bits that are 1 in `mask`. Mask
    /// bits above the 11 or 29 bits of the identifier are ignored.
    pub fn masked(id: impl Into<Id>, mask: u32) -> Self {
        let code = Arbitration::new(id, false);
        let bits = if code.is_extended() { mask & 0x1FFF_FFFF } else { mask & 0x7FF };
        Filter { code, mask: Arbitration::format() | code.place(bits) }
    }

    /// Limits the filter to data frames.
    #[must_use]
    pub const fn data_only(self) -> Self {
        Filter { mask: self.mask | self.code.rtr(), ..self }
    }

    /// True if a controller with this filter takes the frame.
    #[inline]
    pub const fn accepts(&self, frame: &Frame) -> bool {
        (frame.arbitration().bits() ^ self.code.bits()) & self.mask == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::can::reference;
    use embedded_can::{ExtendedId, StandardId};
    use proptest::prelude::*;

    fn raw(id: Id) -> u32 {
        match id {
            Id::Standard(id) => id.as_raw().into(),
            Id::Extended(id) => id.as_raw(),
        }
    }

    #[test]
    fn one_identifier_of_one_format() {
        let filter = Filter::exactly(StandardId::new(0x123).unwrap());
        let accepts = |id: Id| filter.accepts(&Frame::remote(id, 0).unwrap());
        assert!(accepts(StandardId::new(0x123).unwrap().into()));
        for other in [0x122, 0x124, 0x523] {
            assert!(!accepts(StandardId::new(other).unwrap().into()), "{other:X}");
        }
        for other in [0x123, 0x123 << 18] {
            assert!(!accepts(ExtendedId::new(other).unwrap().into()), "{other:X}");
        }
    }

    proptest! {
        #![proptest_config(crate::property_tests())]

        #[test]
        fn the_bits_of_the_mask_count(
            code in reference::id(),
            mask: u32,
            flipped in 0u32..=29,
            frame in reference::frame(),
            data_only: bool,
        ) {
            let filter = Filter::masked(code, mask);
            let filter = if data_only { filter.data_only() } else { filter };
            // Tests a random frame, and a frame that differs from the code of the filter in at most one bit.
            let near = match code {
                Id::Standard(id) => StandardId::new(id.as_raw() ^ 1u16.checked_shl(flipped).unwrap_or(0)).map(Id::Standard),
                Id::Extended(id) => ExtendedId::new(id.as_raw() ^ 1 << flipped).map(Id::Extended),
            };
            let near = near.and_then(|id| Frame::remote(id, 0));
            for frame in [Some(frame), near].into_iter().flatten() {
                let field = frame.arbitration();
                let alike = matches!(field.id(), Id::Standard(_)) == matches!(code, Id::Standard(_))
                    && (raw(field.id()) ^ raw(code)) & mask == 0;
                prop_assert_eq!(filter.accepts(&frame), alike && !(data_only && field.is_remote()));
            }
        }
    }
}
