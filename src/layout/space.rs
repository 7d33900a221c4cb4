//! Address spaces of a device: their notation, and their place in the image.

use super::descriptor::{Area, DeviceLayout};
use super::width::Width;
use core::fmt;
use core::ops::RangeInclusive;

/// A range of addresses with one notation, contiguous in the image. Two spaces of a device share no byte of the
/// image, so that every byte has exactly one name.
#[derive(Debug)]
pub struct Space {
    /// Name in the layout files.
    pub name: &'static str,
    /// The letter that follows the `%`: `I`, `Q` or `M`; `F` for the front panel, which is specific to commram.
    pub letter: char,
    /// The text between width and number: `3.` of `%MB3.80000`, or empty.
    pub segment: &'static str,
    /// The unit that addresses number.
    pub unit: Unit,
    /// Number of the first byte or word.
    pub first: u32,
    /// The first byte in the image.
    pub offset: u32,
    /// Length of the space in bytes.
    pub bytes: u32,
    /// Pages of the manual.
    pub page: &'static str,
    /// Content of the space.
    pub doc: &'static str,
}

/// The unit that addresses number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Unit {
    /// Bytes, for any width: `%MD3.200000` begins with `%MB3.200000`, and bits 0 to 7 are the bits of the byte.
    Byte,
    /// The number counts units of the address's width: `%MW2000`, `%MB4000` and `%MD1000` begin at one byte. Bits 0 to
    /// 15 are bits of the word (decision D-286).
    Word,
}

impl Unit {
    /// Returns the number of bytes between consecutive numbers in addresses of this width.
    #[must_use]
    pub const fn bytes(self, width: Width) -> u32 {
        match self {
            Unit::Byte => 1,
            Unit::Word => width.bytes(),
        }
    }

    /// Returns the width of the unit in which [`Space::first`] is given, and in which the layout gives areas.
    #[must_use]
    pub const fn width(self) -> Width {
        match self {
            Unit::Byte => Width::Byte,
            Unit::Word => Width::Word,
        }
    }
}

/// The area of the retain flags. Each plant sets its size.
#[derive(Debug)]
pub struct Retain {
    /// The range of the flags at their largest size. It is plain RAM, and the device's [`areas`](DeviceLayout::areas)
    /// do not contain it.
    pub area: Area,
    /// Default number of bytes in a plant.
    pub default_bytes: u32,
}

impl Space {
    /// True if byte `offset` of the image is in this space.
    #[must_use]
    pub const fn contains(&self, offset: u32) -> bool {
        self.offset <= offset && offset - self.offset < self.bytes
    }

    /// Returns the number in the address of the byte, word or double word at byte `offset` of the image.
    #[must_use]
    pub const fn number(&self, offset: u32, width: Width) -> u32 {
        let first = self.first * self.unit.bytes(self.unit.width());
        (first + (offset - self.offset)) / self.unit.bytes(width)
    }

    /// Returns the byte of the image at which the unit with number `number` begins, if it is in this space.
    pub(super) fn place(&self, number: u32, width: Width) -> Option<u32> {
        let byte = number.checked_mul(self.unit.bytes(width))?;
        let first = self.first.checked_mul(self.unit.bytes(self.unit.width()))?;
        let offset = self.offset.checked_add(byte.checked_sub(first)?)?;
        self.contains(offset).then_some(offset)
    }

    /// Returns the range of numbers by which addresses name bytes `first` to `last` of the image. They number bytes or
    /// words.
    #[must_use]
    pub const fn numbers(&self, first: u32, last: u32) -> RangeInclusive<u32> {
        let width = self.unit.width();
        self.number(first, width)..=self.number(last, width)
    }

    /// Returns the address of byte `offset` of the image, or of the word that contains it: `%MB3.80000`, `%MW2000`.
    pub(super) fn named(&self, offset: u32) -> String {
        let width = self.unit.width();
        format!("%{}{}{}{}", self.letter, width.letter(), self.segment, self.number(offset, width))
    }

    /// Returns the first address.
    #[must_use]
    pub fn begin(&self) -> String {
        self.named(self.offset)
    }

    /// Returns the last address of the space, in its unit.
    #[must_use]
    pub fn end(&self) -> String {
        self.named(self.offset + (self.bytes - 1))
    }

    /// Returns the highest number of a bit in `%MX`.
    pub(super) const fn last_bit(&self) -> u32 {
        8 * self.unit.width().bytes() - 1
    }
}

impl fmt::Display for Space {
    /// Formats the space: `%MB3.80000 to %MB3.3262143 (communication RAM)`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} to {} ({})", self.begin(), self.end(), self.doc)
    }
}

impl DeviceLayout {
    /// Returns the space that contains byte `offset` of the image.
    #[must_use]
    pub fn space_at(&self, offset: u32) -> Option<&'static Space> {
        self.spaces.iter().find(|space| space.contains(offset))
    }

    /// Returns all spaces, for messages.
    pub(super) fn known_spaces(&self) -> String {
        let known: Vec<_> = self.spaces.iter().map(Space::to_string).collect();
        if known.is_empty() { "no addresses".to_owned() } else { known.join(", ") }
    }

    /// Returns the areas with named registers: the front panel, if there is one, and then the other areas.
    pub fn named_areas(&'static self) -> impl Iterator<Item = &'static Area> {
        self.front_area.into_iter().chain(self.areas)
    }

    /// Returns all areas in ascending order, including the front panel and the retain flags.
    pub fn all_areas(&'static self) -> impl Iterator<Item = &'static Area> {
        let retain = self.retain.map(|retain| &retain.area);
        let before = retain.filter(|area| self.areas.first().is_none_or(|first| area.first < first.first));
        let last = if before.is_none() { retain } else { None };
        self.front_area.into_iter().chain(before).chain(self.areas).chain(last)
    }

    /// True if byte `offset` of the image belongs to the front panel.
    #[must_use]
    pub fn is_front(&self, offset: u32) -> bool {
        self.front_area.is_some_and(|front| front.contains(offset))
    }

    /// True if byte `offset` of the image is a retain flag, or could be a retain flag with another size of this area.
    #[must_use]
    pub fn is_retain(&self, offset: u32) -> bool {
        self.retain.is_some_and(|retain| retain.area.contains(offset))
    }
}

#[cfg(test)]
pub(crate) mod samples {
    use super::{DeviceLayout, Space, Unit};

    /// A device with word numbers and spaces that begin at 0.
    pub(crate) static WORDS: DeviceLayout =
        DeviceLayout { name: "words", title: "words", spaces: &SPACES, ..DeviceLayout::UNKNOWN };

    static SPACES: [Space; 3] =
        [space('I', 4096, 6, "inputs"), space('Q', 4104, 2, "outputs"), space('M', 8192, 8192, "flags")];

    const fn space(letter: char, offset: u32, bytes: u32, doc: &'static str) -> Space {
        Space { name: doc, letter, segment: "", unit: Unit::Word, first: 0, offset, bytes, page: "1", doc }
    }
}
