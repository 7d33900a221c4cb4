//! What a device has at its front, such as switches and displays: words in the header page, one device's not another's.

use super::decode;
use super::descriptor::{Meaning, Owner, Provenance, RegType};
use core::fmt;

/// A word of the front in the header page.
pub struct FrontWord {
    /// Name in the layout.
    pub name: &'static str,
    /// Data type, 32 bits wide.
    pub ty: RegType,
    /// First byte in the front.
    pub offset: u32,
    /// Who writes it.
    pub owner: Owner,
    /// What its values mean; `None` for plain numbers.
    pub meaning: Option<&'static Meaning>,
    /// Where it is from that the device has this.
    pub source: Provenance,
    /// Pages of the manual.
    pub page: &'static str,
    /// What it is.
    pub doc: &'static str,
}

impl FrontWord {
    /// Which word of the front it is, from 0.
    #[must_use]
    pub const fn index(&self) -> usize {
        self.offset as usize / 4
    }

    /// What `value` means; a plain number in decimal.
    #[must_use]
    pub fn decode(&self, value: u32) -> String {
        decode::decode(self.ty, self.meaning, value)
    }
}

impl fmt::Debug for FrontWord {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("FrontWord").field("name", &self.name).finish_non_exhaustive()
    }
}
