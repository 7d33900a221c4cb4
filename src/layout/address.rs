//! Addresses in IEC 61131-3 notation: `%MB3.n`, `%MW3.n`, `%MD3.n`, `%MX3.n.b`.

use super::error::LayoutError;
use super::width::Width;
use core::fmt;
use core::str::FromStr;

/// Segment of the communication RAM.
const SEGMENT: u32 = 3;

/// A place in segment 3, with the width of the access: prints as `%MB3.n`, `%MW3.n`, `%MD3.n`, or
/// `%MX3.n.b` for a single bit. The number is always the byte's, whatever the width.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Address {
    offset: u32,
    width: Width,
    bit: Option<u8>,
}

impl Address {
    /// The address of byte `offset` of the segment, accessed at `width`.
    ///
    /// # Errors
    /// [`LayoutError::Misaligned`] if the offset is not divisible by the width (manual 5.00005.03a
    /// ch. 4.4.4).
    pub fn new(width: Width, offset: u32) -> Result<Self, LayoutError> {
        let address = Self::unchecked(width, offset);
        if offset.is_multiple_of(width.bytes()) {
            return Ok(address);
        }
        Err(LayoutError::Misaligned { address: address.to_string(), rule: width.alignment_rule() })
    }

    /// As [`Address::new`] without the check, also for what was refused.
    pub(super) const fn unchecked(width: Width, offset: u32) -> Self {
        Self { offset, width, bit: None }
    }

    /// The byte with number `offset`.
    #[must_use]
    pub const fn byte(offset: u32) -> Self {
        Self::unchecked(Width::Byte, offset)
    }

    /// Number of the first byte in the segment.
    #[must_use]
    pub const fn offset(self) -> u32 {
        self.offset
    }

    /// Width of the access; a single bit is accessed with its byte.
    #[must_use]
    pub const fn width(self) -> Width {
        self.width
    }

    /// The bit (0..=7) of the byte, if the address is that of a single bit.
    #[must_use]
    pub const fn bit(self) -> Option<u8> {
        self.bit
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let offset = self.offset;
        let text = match (self.bit, self.width) {
            (Some(bit), _) => format!("%MX{SEGMENT}.{offset}.{bit}"),
            (None, Width::Byte) => format!("%MB{SEGMENT}.{offset}"),
            (None, Width::Word) => format!("%MW{SEGMENT}.{offset}"),
            (None, Width::Dword) => format!("%MD{SEGMENT}.{offset}"),
        };
        f.pad(&text)
    }
}

impl FromStr for Address {
    type Err = LayoutError;

    /// Parses an address; letters may be lower case.
    fn from_str(text: &str) -> Result<Self, LayoutError> {
        let wrong = || LayoutError::BadAddress { text: text.to_owned() };
        let rest = text.strip_prefix('%').ok_or_else(wrong)?;
        let (head, rest) = rest.split_at_checked(2).ok_or_else(wrong)?;
        let (width, single_bit) = match head.to_ascii_uppercase().as_str() {
            "MB" => (Width::Byte, false),
            "MW" => (Width::Word, false),
            "MD" => (Width::Dword, false),
            "MX" => (Width::Byte, true),
            _ => return Err(wrong()),
        };
        let mut numbers = rest.split('.').map(number);
        let segment = numbers.next().flatten().ok_or_else(wrong)?;
        let Some(offset) = numbers.next() else {
            // `%MB80000`: the flags of the application, no segment.
            return Err(LayoutError::Segment { text: text.to_owned(), found: "the flags".to_owned() });
        };
        let offset = offset.ok_or_else(wrong)?;
        let bit = numbers.next();
        if numbers.next().is_some() {
            return Err(wrong());
        }
        if segment != SEGMENT {
            return Err(LayoutError::Segment { text: text.to_owned(), found: format!("segment {segment}") });
        }
        let bit = match (single_bit, bit) {
            (true, Some(Some(bit))) => match u8::try_from(bit) {
                Ok(bit @ 0..=7) => Some(bit),
                _ => return Err(LayoutError::BadBit { text: text.to_owned(), bit }),
            },
            (false, None) => None,
            _ => return Err(wrong()),
        };
        Ok(Address { bit, ..Address::new(width, offset)? })
    }
}

fn number(text: &str) -> Option<u32> {
    // `u32::from_str` alone would take `+5`.
    if text.bytes().all(|b| b.is_ascii_digit()) { text.parse().ok() } else { None }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Address, LayoutError> {
        text.parse()
    }

    #[test]
    fn prints_what_it_parses() {
        for text in ["%MB3.200001", "%MW3.200000", "%MD3.300000", "%MX3.100003.7"] {
            assert_eq!(parse(text).unwrap().to_string(), text);
            assert_eq!(parse(&text.to_lowercase()).unwrap().to_string(), text);
        }
        assert_eq!(parse("%MX3.5.2").unwrap().bit(), Some(2));
    }

    #[test]
    fn alignment_errors_name_the_rule() {
        let message = parse("%MW3.200001").unwrap_err().to_string();
        assert_eq!(message, "%MW3.200001: a WORD needs an even address");
        let message = parse("%MD3.200002").unwrap_err().to_string();
        assert_eq!(message, "%MD3.200002: a DWORD needs an address divisible by 4");
    }

    #[test]
    fn other_segments_are_refused() {
        let message = parse("%MW4.200000").unwrap_err().to_string();
        assert_eq!(
            message,
            "%MW4.200000 lies in segment 4; the communication RAM is segment 3, for example %MW3.200000"
        );
        assert!(parse("%MB100").unwrap_err().to_string().starts_with("%MB100 lies in the flags;"));
    }

    #[test]
    fn everything_else_is_no_address() {
        for text in [
            "",
            "%",
            "%M",
            "%MQ3.1",
            "MW3.2",
            "%MW3.",
            "%MW3.x",
            "%MW3.+2",
            "%MW3.2.1",
            "%MX3.2",
            "%MX3.2.1.0",
        ] {
            assert!(matches!(parse(text), Err(LayoutError::BadAddress { .. })), "{text}");
        }
        assert!(matches!(parse("%MB3.4294967296"), Err(LayoutError::BadAddress { .. })));
        assert_eq!(parse("%MX3.2.8").unwrap_err().to_string(), "%MX3.2.8: a byte has bits 0 to 7, not 8");
        assert!(matches!(parse("%é3.1"), Err(LayoutError::BadAddress { .. })));
    }
}
