//! Addresses in IEC 61131-3 notation: `%MB3.n`, `%MW3.n`, `%MD3.n`, `%MX3.n.b`; retain flags `%MBn`, `%MWn`, `%MDn`,
//! `%MXn.b` with n from 10000000 on.

use super::error::LayoutError;
use super::flags::{self, FIRST_FLAG, MOST_RETAIN, RETAIN_OFFSET};
use super::width::Width;
use core::fmt;
use core::str::FromStr;

/// Segment of the communication RAM.
const SEGMENT: u32 = 3;

/// A place in segment 3, with the width of the access: prints as `%MB3.n`, `%MW3.n`, `%MD3.n`, or
/// `%MX3.n.b` for a single bit. The number is always the byte's, whatever the width. Of the retain flags it prints the
/// flag, `%MB10000000`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Address {
    offset: u32,
    width: Width,
    bit: Option<u8>,
    /// A retain flag, not a byte of segment 3.
    is_flag: bool,
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
        Self { offset, width, bit: None, is_flag: flags::is_flag(offset) }
    }

    /// The byte with number `offset`.
    #[must_use]
    pub const fn byte(offset: u32) -> Self {
        Self::unchecked(Width::Byte, offset)
    }

    /// Whether it is that of a retain flag.
    #[must_use]
    pub const fn is_flag(self) -> bool {
        self.is_flag
    }

    /// Number of the first byte in the segment; of a retain flag its place in the image, where segment 3 has nothing.
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

impl Width {
    /// An access of this width at byte `offset` of segment 3, aligned or not; see [`Address::new`] for
    /// the check.
    #[must_use]
    pub const fn at(self, offset: u32) -> Address {
        Address::unchecked(self, offset)
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let number = if self.is_flag {
            (self.offset - RETAIN_OFFSET + FIRST_FLAG).to_string()
        } else {
            format!("{SEGMENT}.{}", self.offset)
        };
        let text = match (self.bit, self.width) {
            (Some(bit), _) => format!("%MX{number}.{bit}"),
            (None, Width::Byte) => format!("%MB{number}"),
            (None, Width::Word) => format!("%MW{number}"),
            (None, Width::Dword) => format!("%MD{number}"),
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
        let is_flag = segment >= FIRST_FLAG;
        let offset = if is_flag {
            // The number of a retain flag stands alone.
            let flag = segment - FIRST_FLAG;
            if flag >= MOST_RETAIN {
                return Err(LayoutError::NoFlag { text: text.to_owned() });
            }
            RETAIN_OFFSET + flag
        } else {
            let Some(offset) = numbers.next() else {
                // `%MB80000`: the flags of the application, no segment.
                return Err(LayoutError::Segment { text: text.to_owned(), found: "the flags".to_owned() });
            };
            offset.ok_or_else(wrong)?
        };
        let bit = numbers.next();
        if numbers.next().is_some() {
            return Err(wrong());
        }
        if !is_flag && segment != SEGMENT {
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
        let address = Address { bit: None, is_flag, ..Address::unchecked(width, offset) };
        if !offset.is_multiple_of(width.bytes()) {
            return Err(LayoutError::Misaligned {
                address: address.to_string(),
                rule: width.alignment_rule(),
            });
        }
        Ok(Address { bit, ..address })
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
    fn addresses_print_as_the_programmer_writes_them() {
        assert_eq!(Width::Byte.at(3_262_143).to_string(), "%MB3.3262143");
        assert_eq!(Width::Word.at(200_000).to_string(), "%MW3.200000");
        assert_eq!(Width::Dword.at(80_000).to_string(), "%MD3.80000");
    }

    #[test]
    fn retain_flags_have_addresses_of_their_own() {
        for (text, offset) in [
            ("%MB10000000", 8192),
            ("%MW10000002", 8194),
            ("%MD10019996", 28_188),
            ("%MX10000001.7", 8193),
            ("%MB10071807", 79_999),
        ] {
            let address = parse(text).unwrap();
            assert_eq!(
                (address.to_string().as_str(), address.offset(), address.is_flag()),
                (text, offset, true)
            );
        }
        assert_eq!(Address::byte(8193).to_string(), "%MB10000001", "the byte of the image");
        assert_eq!(Address::byte(80_000).to_string(), "%MB3.80000");
        let nowhere = parse("%MB3.8192").unwrap();
        assert_eq!((nowhere.to_string().as_str(), nowhere.is_flag()), ("%MB3.8192", false));
        let message = |text| parse(text).unwrap_err().to_string();
        assert_eq!(message("%MW10000001"), "%MW10000001: a WORD needs an even address");
        assert_eq!(
            message("%MB10071808"),
            "%MB10071808: retain flags are %MB10000000 to %MB10071807 at most"
        );
        assert_eq!(message("%MX10000000.8"), "%MX10000000.8: a byte has bits 0 to 7, not 8");
        for text in ["%MX10000000", "%MB10000000.1", "%MX10000000.1.1"] {
            assert!(matches!(parse(text), Err(LayoutError::BadAddress { .. })), "{text}");
        }
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
