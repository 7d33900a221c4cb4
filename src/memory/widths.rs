//! Splits accesses of any width into accesses of registers, each at its own width.

use super::{MemoryError, Segment, Width};
use crate::layout::{DeviceFit, DeviceLayout, RegisterRef};

/// No register area covers an address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unmapped {
    /// Byte offset of the first uncovered byte.
    pub offset: u32,
}

/// Register widths of a device, byte by byte.
///
/// Rule of the shared memory: a byte is accessed at one width only, the width of the register at its address. Where the
/// initialization structure overlays a cyclic structure, the registers of both have the same width. The exception are
/// registers that the area does not use. Only the master uses `a_SL_TYP[12]` to `[31]` (manual 5.00005.03a p. 149-150,
/// 174-175), so on node 1 an access to them is an access to a part of `a_WR_VALUE_RECEIVE`.
///
/// Splits accesses from outside, which may be narrower or wider than the registers at their addresses.
pub struct RegisterWidths {
    device: &'static DeviceLayout,
    areas: Vec<AreaWidths>,
}

struct AreaWidths {
    first: u32,
    /// For each byte of the area: the width of its register in the low four bits (0 for plain RAM), and the position of
    /// the byte in the register in the bits above them.
    bytes: Vec<u8>,
    /// Offset after the last byte.
    end: u32,
}

/// A part of an access that lies within one register.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct PartialAccess {
    /// Offset of the part.
    offset: u32,
    /// Number of bytes of the part: 1, 2 or 4.
    bytes: u32,
    /// Offset and width of the register that contains the part.
    register: (u32, Width),
}

impl RegisterWidths {
    /// Returns the widths of the device's registers, with its options. An area is plain RAM if it depends on a port of
    /// unknown kind.
    #[must_use]
    pub fn of(fitted: &DeviceFit) -> Self {
        let device = fitted.device();
        let areas = device.all_areas().map(|area| {
            // Only the bytes up to the end of the registers are stored, because the areas of option interfaces are
            // large and mostly empty.
            let described = fitted.placed(area).map(|placed| placed.structure.bytes).max().unwrap_or(0);
            let mut bytes = vec![0; described as usize];
            if device.is_front(area.first) {
                // The front panel of the header page consists of words, even if the device does not use them.
                bytes = (0..area.bytes).map(|place| (4 | ((place % 4) << 4)) as u8).collect();
            }
            let decided = |found: &RegisterRef| found.placed.role.is_none() || found.role.is_some();
            for register in fitted.used_registers(area).filter(decided) {
                let start = (register.offset() - area.first) as usize;
                for place in 0..register.width() {
                    if let Some(byte) = bytes.get_mut(start + place as usize) {
                        *byte = (register.width() | place << 4) as u8;
                    }
                }
            }
            AreaWidths { first: area.first, bytes, end: area.first + area.bytes }
        });
        RegisterWidths { device, areas: areas.collect() }
    }

    /// Returns the area that contains all bytes of `offset..offset + len`. The error is the first byte that no area
    /// contains. The number of retain flags of a PLC is read from the header page.
    fn area(&self, segment: &Segment, offset: u32, len: u32) -> Result<&AreaWidths, Unmapped> {
        let area = self
            .areas
            .iter()
            .find(|area| (area.first..area.end).contains(&offset))
            .ok_or(Unmapped { offset })?;
        let end = match self.device.is_retain(offset) {
            true => area.first.saturating_add(retain_bytes(segment)).min(area.end).max(offset),
            false => area.end,
        };
        if len > end - offset { Err(Unmapped { offset: end }) } else { Ok(area) }
    }

    /// Splits an access into parts that lie within one register each, in ascending order.
    fn parts(
        &self,
        segment: &Segment,
        offset: u32,
        width: Width,
    ) -> Result<impl Iterator<Item = PartialAccess>, Unmapped> {
        let area = self.area(segment, offset, width.bytes())?;
        let end = offset + width.bytes();
        let mut at = offset;
        Ok(core::iter::from_fn(move || {
            if at >= end {
                return None;
            }
            let part = area.part(at, end, offset, width);
            at += part.bytes;
            Some(part)
        }))
    }

    /// Reads `width` at `offset`, for registers of any width.
    ///
    /// # Errors
    /// No register area covers the access.
    pub fn load(&self, segment: &Segment, offset: u32, width: Width) -> Result<u32, Unmapped> {
        let mut value = 0;
        for part in self.parts(segment, offset, width)? {
            let bits = load_part(segment, part).map_err(|_| Unmapped { offset })?;
            value |= bits << ((part.offset - offset) * 8);
        }
        Ok(value)
    }

    /// Writes `width` at `offset`; registers that are covered in part keep their other bytes.
    ///
    /// # Errors
    /// No register area covers the access.
    pub fn store(&self, segment: &Segment, offset: u32, width: Width, value: u32) -> Result<(), Unmapped> {
        for part in self.parts(segment, offset, width)? {
            let bits = value >> ((part.offset - offset) * 8) & mask(part.bytes);
            store_part(segment, part, bits).map_err(|_| Unmapped { offset })?;
        }
        Ok(())
    }

    /// Writes `new` if the memory holds `current`. The inner result is the old value: as `Ok` if `new` was written,
    /// otherwise as `Err`.
    ///
    /// # Errors
    /// No register area covers the access.
    pub fn compare_exchange(
        &self,
        segment: &Segment,
        offset: u32,
        width: Width,
        current: u32,
        new: u32,
    ) -> Result<Result<u32, u32>, Unmapped> {
        let missing = Unmapped { offset };
        let mut parts = self.parts(segment, offset, width)?;
        let first = parts.next().ok_or(missing)?;
        if parts.next().is_none() {
            return exchange_part(segment, first, current, new).map_err(|_| missing);
        }
        // Several registers cannot be exchanged in one step, so they are loaded and then stored. The firmware does not
        // run in between, but a client that has mapped the image may write in between, as on the device.
        let seen = self.load(segment, offset, width)?;
        if seen != current {
            return Ok(Err(seen));
        }
        self.store(segment, offset, width, new)?;
        Ok(Ok(seen))
    }

    /// Returns offset and width of each register with a byte in `offset..offset + len`, in ascending order. Plain RAM
    /// is divided into doublewords. A range of plain RAM without registers is one item if it is as long as a register.
    ///
    /// # Errors
    /// No register area covers one of the bytes.
    pub fn registers(&self, segment: &Segment, offset: u32, len: u32) -> Result<Vec<(u32, Width)>, Unmapped> {
        let area = self.area(segment, offset, len)?;
        let end = offset + len;
        let mut found = Vec::new();
        let mut at = offset;
        while at < end {
            let plain = if len < 4 && end.is_multiple_of(len) { len } else { 4 };
            let register = area.register(at).unwrap_or_else(|| {
                let is_plain = (at..at + plain).all(|byte| byte < end && area.register(byte).is_none());
                let whole = Width::of_bytes(plain).filter(|_| at.is_multiple_of(plain) && is_plain);
                (at, whole.unwrap_or(Width::Byte))
            });
            at = register.0 + register.1.bytes();
            found.push(register);
        }
        Ok(found)
    }

    /// Copies bytes out of one area.
    ///
    /// # Errors
    /// No register area covers one of the bytes.
    pub fn read_range(&self, segment: &Segment, offset: u32, to: &mut [u8]) -> Result<(), Unmapped> {
        let missing = Unmapped { offset };
        let len = u32::try_from(to.len()).map_err(|_| missing)?;
        self.area(segment, offset, len)?;
        segment.read_range(offset, to).map_err(|_| missing)
    }
}

impl AreaWidths {
    /// Returns the offset and width of the register that contains the byte; `None` in plain RAM.
    fn register(&self, at: u32) -> Option<(u32, Width)> {
        let byte = self.bytes.get((at - self.first) as usize).copied().unwrap_or(0);
        Some((at - u32::from(byte >> 4), Width::of_bytes(u32::from(byte & 0x0F))?))
    }

    fn part(&self, at: u32, end: u32, offset: u32, width: Width) -> PartialAccess {
        match self.register(at) {
            Some((first, width)) => {
                let bytes = (first + width.bytes() - at).min(end - at);
                PartialAccess { offset: at, bytes, register: (first, width) }
            }
            // Plain RAM has no registers, so the width of the access applies.
            None => PartialAccess { offset: at, bytes: end - at, register: (offset, width) },
        }
    }
}

/// Returns the size of the PLC's retain flags, in bytes.
fn retain_bytes(segment: &Segment) -> u32 {
    segment.header().map_or(0, |header| header.retain_size.load())
}

/// Reads the bytes of `part` by a load of the whole register.
fn load_part(segment: &Segment, part: PartialAccess) -> Result<u32, MemoryError> {
    let (start, width) = part.register;
    let value = segment.load(start, width)? >> ((part.offset - start) * 8);
    Ok(value & mask(part.bytes))
}

fn store_part(segment: &Segment, part: PartialAccess, value: u32) -> Result<(), MemoryError> {
    let (start, width) = part.register;
    if part.bytes == width.bytes() {
        return segment.store(start, width, value);
    }
    let shift = (part.offset - start) * 8;
    let keep = !(mask(part.bytes) << shift);
    segment.update(start, width, |old| old & keep | value << shift).map(|_| ())
}

/// Exchanges the bytes of a part, by an atomic compare-exchange of the whole register.
fn exchange_part(
    segment: &Segment,
    part: PartialAccess,
    current: u32,
    new: u32,
) -> Result<Result<u32, u32>, MemoryError> {
    let (start, width) = part.register;
    let shift = (part.offset - start) * 8;
    let field = mask(part.bytes) << shift;
    let old = segment.update(start, width, |old| {
        if (old & field) >> shift == current { old & !field | new << shift } else { old }
    })?;
    let seen = (old & field) >> shift;
    Ok(if seen == current { Ok(seen) } else { Err(seen) })
}

fn mask(bytes: u32) -> u32 {
    u32::MAX >> (32 - 8 * bytes.clamp(1, 4))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::samples::tables::NODES as DEVICE;

    fn parts(offset: u32, width: Width) -> Vec<PartialAccess> {
        RegisterWidths::of(&DeviceFit::unknown(&DEVICE))
            .parts(&Segment::of(&DEVICE), offset, width)
            .unwrap()
            .collect()
    }

    #[test]
    fn an_access_of_the_registers_width_is_one_part() {
        let part = PartialAccess { offset: 200_000, bytes: 2, register: (200_000, Width::Word) };
        assert_eq!(parts(200_000, Width::Word), [part]);
    }

    #[test]
    fn a_range_is_whole_registers_and_plain_ram_is_doublewords_or_one_place() {
        let (widths, ram) = (RegisterWidths::of(&DeviceFit::unknown(&DEVICE)), Segment::of(&DEVICE));
        let of = |offset, len| widths.registers(&ram, offset, len).unwrap();
        assert_eq!(of(200_001, 3), [(200_000, Width::Word), (200_002, Width::Word)]);
        assert_eq!(of(200_012, 2), [(200_012, Width::Byte), (200_013, Width::Byte)]);
        assert_eq!(of(1_000_000, 1), [(1_000_000, Width::Byte)]);
        assert_eq!(of(1_000_002, 2), [(1_000_002, Width::Word)]);
        assert_eq!(of(1_000_000, 8), [(1_000_000, Width::Dword), (1_000_004, Width::Dword)]);
        let odd = [1_000_001, 1_000_002, 1_000_003].map(|byte| (byte, Width::Byte));
        assert_eq!(of(1_000_001, 3), odd);
        let rest = [(1_000_000, Width::Dword), (1_000_004, Width::Byte), (1_000_005, Width::Byte)];
        assert_eq!(of(1_000_000, 6), rest, "nothing after the range");
        assert!(widths.registers(&ram, 0, 4).is_err());
    }

    #[test]
    fn a_narrow_access_is_within_its_register() {
        let part = PartialAccess { offset: 200_003, bytes: 1, register: (200_002, Width::Word) };
        assert_eq!(parts(200_003, Width::Byte), [part]);
    }

    #[test]
    fn a_wide_access_is_split_at_registers() {
        let part = |offset| PartialAccess { offset, bytes: 2, register: (offset, Width::Word) };
        assert_eq!(parts(200_000, Width::Dword), [part(200_000), part(200_002)]);
        assert_eq!(parts(200_012, Width::Word).len(), 2, "two byte registers");
    }

    /// Only a master uses the slave types. On node 1, which is a slave, their bytes belong to reference values.
    #[test]
    fn an_unused_register_has_the_width_of_the_one_under_it() {
        let slave = DEVICE.register("node1.a_SL_TYP[13]").unwrap().offset();
        let part = PartialAccess { offset: slave, bytes: 1, register: (100_032, Width::Dword) };
        assert_eq!(parts(slave, Width::Byte), [part]);
        let master = DEVICE.register("node2.a_SL_TYP[13]").unwrap().offset();
        let part = PartialAccess { offset: master, bytes: 1, register: (master, Width::Byte) };
        assert_eq!(parts(master, Width::Byte), [part]);
    }

    #[test]
    fn plain_ram_is_accessed_as_asked() {
        let part = PartialAccess { offset: 1_000_004, bytes: 4, register: (1_000_004, Width::Dword) };
        assert_eq!(parts(1_000_004, Width::Dword), [part]);
    }

    /// Tests a byte of a word register, and a word across two word registers: the other bits are unchanged.
    #[test]
    fn parts_of_registers_are_written_and_compared_alone() {
        let (map, segment) = (RegisterWidths::of(&DeviceFit::unknown(&DEVICE)), Segment::of(&DEVICE));
        let all = |value| map.store(&segment, 200_000, Width::Dword, value).unwrap();
        let now = || map.load(&segment, 200_000, Width::Dword).unwrap();
        all(0x1122_33C4);
        map.store(&segment, 200_001, Width::Byte, 0x5A).unwrap();
        assert_eq!(now(), 0x1122_5AC4);
        map.store(&segment, 200_001, Width::Word, 0xABCD).unwrap();
        assert_eq!(now(), 0x11AB_CDC4);
        assert_eq!(map.compare_exchange(&segment, 200_003, Width::Byte, 0x11, 0xF0), Ok(Ok(0x11)));
        assert_eq!(now(), 0xF0AB_CDC4);
        assert_eq!(map.compare_exchange(&segment, 200_003, Width::Byte, 0x11, 0), Ok(Err(0xF0)));
        assert_eq!(now(), 0xF0AB_CDC4);
    }

    #[test]
    fn holes_are_named() {
        let (map, segment) = (RegisterWidths::of(&DeviceFit::unknown(&DEVICE)), Segment::of(&DEVICE));
        assert_eq!(map.area(&segment, 8191, 1).err(), Some(Unmapped { offset: 8191 }));
        assert_eq!(map.area(&segment, 88_190, 4).err(), Some(Unmapped { offset: 88_192 }));
        assert!(map.area(&segment, 88_190, 2).is_ok());
    }

    #[test]
    fn the_header_page_gives_the_number_of_retain_flags() {
        let (map, segment) = (RegisterWidths::of(&DeviceFit::unknown(&DEVICE)), Segment::of(&DEVICE));
        for (bytes, end) in [(0, 8192), (20_000, 28_192), (57_344, 65_536), (u32::MAX, 65_536)] {
            segment.header().unwrap().retain_size.store(bytes);
            assert_eq!(map.store(&segment, 8192, Width::Dword, 7).is_ok(), bytes != 0);
            assert_eq!(map.load(&segment, end - 4, Width::Dword).is_ok(), bytes != 0);
            assert!(map.read_range(&segment, 8192, &mut vec![0; (end - 8192) as usize]).is_ok());
            if end < 65_536 {
                assert_eq!(map.load(&segment, end, Width::Byte), Err(Unmapped { offset: end }));
            }
        }
    }
}
