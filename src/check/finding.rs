//! One finding: which rule, where, with which value.

use super::Rule;
use crate::devices::omega_drive_line_2::registers::DEVICE;
use crate::layout::{Address, Live, RegType, RegisterRef, format_value};
use crate::memory::{HEADER_SIZE, header};

/// A rule was broken at a register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Finding {
    /// The rule.
    pub rule: Rule,
    /// Index of the PLC in the plant.
    pub plc: u16,
    /// Absolute `%MB3` offset of the register.
    pub offset: u32,
    /// Which of the structures that overlay each other the register belongs to.
    pub live: Live,
    /// The value written.
    pub value: u32,
    /// By how many microseconds it was late; 0 for rules without a deadline.
    pub late_us: u32,
}

impl Finding {
    /// The register; `None` in the header page and where there is none.
    #[must_use]
    pub fn register(&self) -> Option<RegisterRef> {
        let found = DEVICE.registers_at(Address::byte(self.offset), Some(self.live)).ok()?;
        found.into_iter().find(|register| register.offset() == self.offset)
    }

    /// Name of the register or of the field in the header page: `node2.w_OPTION_STATUS`, `header.magic`.
    #[must_use]
    pub fn name(&self) -> Option<String> {
        match self.register() {
            Some(register) => Some(register.name()),
            None if self.is_in_header() => {
                Some(format!("header.{}", header::field_at(self.offset as usize)?))
            }
            None => None,
        }
    }

    /// Address at the register's own width: `%MW3.200002`.
    #[must_use]
    pub fn address(&self) -> Address {
        self.register().map_or(Address::byte(self.offset), |register| register.address())
    }

    /// The value as the register writes it: `16#0043`.
    #[must_use]
    pub fn value_text(&self) -> String {
        let plain = if self.is_in_header() { RegType::Dword } else { RegType::Byte };
        format_value(self.register().map_or(plain, |register| register.ty()), self.value)
    }

    fn is_in_header(&self) -> bool {
        (self.offset as usize) < HEADER_SIZE
    }
}
