//! Addresses in the notation of a device. If the device numbers bytes, they are `%MB3.n`, `%MW3.n`, `%MD3.n` and
//! `%MX3.n.b`. If it numbers words, they are for example `%MW2000` and `%IX0.3`.

use super::descriptor::DeviceLayout;
use super::error::LayoutError;
use super::space::Space;
use super::width::Width;
use core::cmp::Ordering;
use core::fmt;
use core::hash::{Hash, Hasher};

/// A place in the image of a device, with the width of the access. It is printed in the notation of the device
/// ([`DeviceLayout::at`], [`DeviceLayout::address`]), for example `%MW3.200002`. It was perhaps made without a device
/// ([`Width::at`]), or the device has no address for this place. It is then printed as `WORD at byte 200002 of the
/// image`.
///
/// Two addresses are equal if they mean the same bytes, the same bit and the same width.
#[derive(Debug, Clone, Copy)]
pub struct Address {
    offset: u32,
    width: Width,
    bit: Option<u8>,
    space: Option<&'static Space>,
}

impl Address {
    pub(super) const fn new(space: Option<&'static Space>, width: Width, offset: u32) -> Self {
        Self { offset, width, bit: None, space }
    }

    /// Returns byte `offset` of an image, without a device.
    #[must_use]
    pub const fn byte(offset: u32) -> Self {
        Self::new(None, Width::Byte, offset)
    }

    /// Returns the offset of the first byte in the image.
    #[must_use]
    pub const fn offset(self) -> u32 {
        self.offset
    }

    /// Returns the width of the access; a single bit is accessed with its byte.
    #[must_use]
    pub const fn width(self) -> Width {
        self.width
    }

    /// Returns the number of the bit in its byte (0..=7), if this is the address of a single bit.
    #[must_use]
    pub const fn bit(self) -> Option<u8> {
        self.bit
    }

    /// Returns the address of the byte that contains the bit of this address.
    pub(super) const fn of_byte(self) -> Self {
        Self { bit: None, ..self }
    }

    /// Returns the address of bit `bit` of the object at this address.
    pub(super) const fn of_bit(self, bit: u32) -> Self {
        let Self { offset, space, .. } = self;
        Self { offset: offset + bit / 8, width: Width::Byte, bit: Some((bit % 8) as u8), space }
    }

    fn key(self) -> (u32, Width, Option<u8>) {
        (self.offset, self.width, self.bit)
    }
}

impl PartialEq for Address {
    fn eq(&self, other: &Self) -> bool {
        self.key() == other.key()
    }
}

impl Eq for Address {}

impl PartialOrd for Address {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Address {
    fn cmp(&self, other: &Self) -> Ordering {
        self.key().cmp(&other.key())
    }
}

impl Hash for Address {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.key().hash(state);
    }
}

impl Width {
    /// Returns the place of an access of this width at byte `offset` of an image, without a device. The offset need not
    /// be aligned.
    #[must_use]
    pub const fn at(self, offset: u32) -> Address {
        Address::new(None, self, offset)
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { offset, width, bit, space } = *self;
        let Some(space) = space else {
            return f.pad(&match (bit, width) {
                (Some(bit), _) => format!("bit {bit} of byte {offset} of the image"),
                (None, Width::Byte) => format!("byte {offset} of the image"),
                (None, _) => format!("{width} at byte {offset} of the image"),
            });
        };
        let Space { letter, segment, unit, .. } = space;
        f.pad(&match bit {
            Some(bit) => {
                // Bits are numbered within the unit that the address numbers, for example within a word.
                let (number, first) = (space.number(offset, unit.width()), space.offset);
                let inside = (offset - first) % unit.width().bytes();
                format!("%{letter}X{segment}{number}.{}", u32::from(bit) + 8 * inside)
            }
            None => format!("%{letter}{}{segment}{}", width.letter(), space.number(offset, width)),
        })
    }
}

impl DeviceLayout {
    /// Returns the address of an access at byte `offset` of the image. The offset need not be aligned. The result is
    /// printed as a byte of the image in two cases: the device has no address for this byte, or its addresses number
    /// larger units and the access begins inside such a unit.
    #[must_use]
    pub fn at(&self, width: Width, offset: u32) -> Address {
        let space = self.space_at(offset);
        let has_number = |space: &&Space| (offset - space.offset).is_multiple_of(space.unit.bytes(width));
        Address::new(space.filter(has_number), width, offset)
    }

    /// Returns the address of an access like [`DeviceLayout::at`], but only if it is aligned.
    ///
    /// # Errors
    /// [`LayoutError::Misaligned`] if the offset is not divisible by the width.
    pub fn aligned(&self, width: Width, offset: u32) -> Result<Address, LayoutError> {
        let address = self.at(width, offset);
        if offset.is_multiple_of(width.bytes()) {
            return Ok(address);
        }
        Err(LayoutError::Misaligned { address: address.to_string(), rule: width.alignment_rule() })
    }

    /// Returns `address` with the notation of this device.
    #[must_use]
    pub fn in_device_spelling(&self, address: Address) -> Address {
        Address { bit: address.bit, ..self.at(address.width, address.offset) }
    }

    /// Parses the address in `text`. Letters may be lower case.
    ///
    /// # Errors
    /// The text is not an address, or not an address of this device. The error gives the correct notation.
    pub fn address(&'static self, text: &str) -> Result<Address, LayoutError> {
        let wrong = || LayoutError::BadAddress { text: text.to_owned(), known: self.known_spaces() };
        let nowhere = || LayoutError::NoSpace { text: text.to_owned(), known: self.known_spaces() };
        let rest = text.strip_prefix('%').ok_or_else(wrong)?.to_ascii_uppercase();
        let mut letters = rest.chars();
        let (letter, width) = letters.next().zip(letters.next()).ok_or_else(wrong)?;
        let (width, single_bit) = match width {
            'B' => (Width::Byte, false),
            'W' => (Width::Word, false),
            'D' => (Width::Dword, false),
            'X' => (Width::Byte, true),
            _ => return Err(wrong()),
        };
        let digits = letters.as_str();
        if !digits.split('.').all(|number| number.bytes().all(|b| b.is_ascii_digit()) && !number.is_empty()) {
            return Err(wrong());
        }
        // An address without a segment has one number. For a single bit it also has the number of the bit.
        let plain = digits.split('.').count() - usize::from(single_bit);
        let spaces = || self.spaces.iter().filter(|space| space.letter == letter);
        let segment = spaces().find(|space| !space.segment.is_empty() && digits.starts_with(space.segment));
        let (space, number) = match (plain, segment) {
            (2, Some(space)) => (space, &digits[space.segment.len()..]),
            (2, None) => return Err(nowhere()),
            (1, _) => {
                let number: Option<u32> = digits.split('.').next().and_then(|number| number.parse().ok());
                let has = |space: &&Space| {
                    let width = if single_bit { space.unit.width() } else { width };
                    space.segment.is_empty()
                        && number.is_some_and(|number| space.place(number, width).is_some())
                };
                match spaces().find(has) {
                    Some(space) => (space, digits),
                    // `%MX3.2` has a segment and a number. So the bit is missing, not the segment.
                    None if single_bit && segment.is_some() => return Err(wrong()),
                    None => return Err(nowhere()),
                }
            }
            _ => return Err(wrong()),
        };
        self.within(space, text, number, (width, single_bit))
    }

    /// Returns the place in `space` of an address with these `digits`: a number, or a number and a bit.
    fn within(
        &'static self,
        space: &'static Space,
        text: &str,
        digits: &str,
        (width, single_bit): (Width, bool),
    ) -> Result<Address, LayoutError> {
        let wrong = || LayoutError::BadAddress { text: text.to_owned(), known: self.known_spaces() };
        let mut numbers = digits.split('.').map(str::parse::<u32>);
        let number = numbers.next().and_then(Result::ok).ok_or_else(wrong)?;
        let bit = numbers.next().transpose().map_err(|_| wrong())?;
        let counted = if single_bit { space.unit.width() } else { width };
        let Some(offset) = space.place(number, counted) else {
            return Err(self.outside(space, text, number, counted));
        };
        let bit = match bit {
            Some(bit) if bit > space.last_bit() => {
                let (of, last) = (space.unit.width().iec_name(), space.last_bit());
                return Err(LayoutError::BadBit { text: text.to_owned(), bit, of, last });
            }
            other => other,
        };
        // A bit of a word is in the word's first or second byte.
        let offset = offset + bit.map_or(0, |bit| bit / 8);
        let address = Address::new(Some(space), width, offset);
        if !offset.is_multiple_of(width.bytes()) {
            return Err(LayoutError::Misaligned {
                address: address.to_string(),
                rule: width.alignment_rule(),
            });
        }
        Ok(Address { bit: bit.map(|bit| (bit % 8) as u8), ..address })
    }

    /// Returns the reason for which `number` is not an address of `space`.
    fn outside(&'static self, space: &'static Space, text: &str, number: u32, width: Width) -> LayoutError {
        let byte = u64::from(number) * u64::from(space.unit.bytes(width));
        let first = u64::from(space.first) * u64::from(space.unit.bytes(space.unit.width()));
        let hint = self.areas_around(Some(space), byte as i64 - first as i64 + i64::from(space.offset));
        LayoutError::NoArea { address: text.to_owned(), hint }
    }
}

#[cfg(test)]
mod tests;
