//! Blocks that work on memory by its address (p. 108, 111). On the device, `ADR` returns an address. In
//! commram an address is the byte offset in the image (D-446).

use crate::devices::cs0015::registers::DEVICE;
use crate::memory::Segment;
use crate::plc::{Ram, function_block};

/// The address spaces that are memory of the device.
const MEMORY: [&str; 3] = ["inputs", "outputs", "flags"];

/// Returns `bytes` bytes of the device's memory from an address on; `None` if some of them are not memory.
pub(super) fn read(ram: &Ram, address: u32, bytes: u32) -> Option<Vec<u8>> {
    let last = address.checked_add(bytes.checked_sub(1)?)?;
    let space = DEVICE.space_at(address).filter(|space| MEMORY.contains(&space.name))?;
    let mut data = vec![0; bytes as usize];
    let is_read = space.contains(last) && ram.segment().read_range(address, &mut data).is_ok();
    is_read.then_some(data)
}

fn write(segment: &Segment, address: u32, data: &[u8]) {
    for (offset, byte) in (address..).zip(data) {
        // The caller has checked that the bytes are in the image, so this cannot fail.
        let _ = segment.store(offset, crate::layout::Width::Byte, (*byte).into());
    }
}

function_block! {
    /// Copies bytes from one address of the memory to another (p. 108). Addresses outside the device's memory are
    /// ignored (D-446).
    pub struct MEMCPY(ram: Ram) {
        in {
            /// Address of the destination.
            DST: u32;
            /// Address of the source.
            SRC: u32;
            /// Number of bytes to copy.
            LEN: u16;
        }
    }
}

impl MEMCPY {
    /// Runs one PLC cycle.
    pub fn call(&mut self, ram: &Ram) {
        let bytes = self.LEN.into();
        if let (Some(data), Some(_)) = (read(ram, self.SRC, bytes), read(ram, self.DST, bytes)) {
            write(ram.segment(), self.DST, &data);
        }
    }
}

function_block! {
    /// Detects changes of data that must not change (p. 111, D-446).
    pub struct CHECK_DATA(ram: Ram) {
        in {
            /// Address of the data.
            STARTADR: i32;
            /// Number of bytes of the area.
            LENGTH: u16;
            /// TRUE accepts the changed data.
            UPDATE: bool;
        }
        out {
            /// FALSE: the data have changed, or are not in the memory of the device.
            RESULT: bool;
        }
        internal: Option<ReferenceData>;
    }
}

/// Reference data and their place.
#[derive(Clone, Debug)]
pub struct ReferenceData {
    place: (i32, u16),
    data: Vec<u8>,
}

impl CHECK_DATA {
    /// Runs one PLC cycle. Three kinds of calls take the present data as reference: the first call, a call
    /// with UPDATE, and the first call for another address or length.
    pub fn call(&mut self, ram: &Ram) {
        let place = (self.STARTADR, self.LENGTH);
        let data = u32::try_from(self.STARTADR).ok().and_then(|at| read(ram, at, self.LENGTH.into()));
        let known = self.internal.take().filter(|known| known.place == place && !self.UPDATE);
        self.RESULT = match (&data, &known) {
            (Some(data), Some(known)) => *data == known.data,
            (Some(_), None) => true,
            (None, _) => false,
        };
        self.internal = known.or_else(|| Some(ReferenceData { place, data: data? }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::cs0015::registers::{FLAGS, FUNCTION, INPUTS};
    use crate::layout::Width;

    fn ram() -> Ram {
        Ram::of(&Segment::of(&DEVICE)).unwrap()
    }

    fn load(ram: &Ram, offset: u32) -> u32 {
        ram.segment().load(offset, Width::Byte).unwrap()
    }

    #[test]
    fn bytes_are_copied_also_onto_themselves() {
        let ram = ram();
        write(ram.segment(), FUNCTION, &[1, 2, 3, 4]);
        let (from, to) = (FUNCTION, FUNCTION + 1);
        MEMCPY { DST: to, SRC: from, LEN: 3 }.call(&ram);
        assert_eq!(read(&ram, from, 5), Some(vec![1, 1, 2, 3, 0]));
        // Copies a single byte of a word (p. 108).
        MEMCPY { DST: to + 4, SRC: from + 3, LEN: 1 }.call(&ram);
        assert_eq!((load(&ram, FUNCTION + 4), load(&ram, FUNCTION + 5)), (0, 3));
    }

    #[test]
    fn addresses_outside_the_memory_are_ignored() {
        let ram = ram();
        write(ram.segment(), FUNCTION, &[7; 8]);
        let end = FLAGS + 256;
        for (dst, src, len) in [
            (0, FUNCTION, 4),
            (FUNCTION, 0, 4),
            (end - 2, FUNCTION, 4),
            (FUNCTION, end - 2, 4),
            (INPUTS + 6, FUNCTION, 4),
            (u32::MAX, FUNCTION, 4),
            (FUNCTION + 1, FUNCTION, 0),
        ] {
            let before = (read(&ram, FUNCTION, 8), read(&ram, end - 4, 4));
            MEMCPY { DST: dst, SRC: src, LEN: len }.call(&ram);
            assert_eq!((read(&ram, FUNCTION, 8), read(&ram, end - 4, 4)), before, "{dst} {src} {len}");
        }
    }

    #[test]
    fn changed_data_are_reported_until_accepted() {
        let ram = ram();
        let mut check = CHECK_DATA { STARTADR: FUNCTION as i32, LENGTH: 4, ..Default::default() };
        let result = |check: &mut CHECK_DATA| {
            check.call(&ram);
            check.RESULT
        };
        assert!(result(&mut check) && result(&mut check));
        write(ram.segment(), FUNCTION + 4, &[1]);
        assert!(result(&mut check), "after them");
        write(ram.segment(), FUNCTION + 3, &[1]);
        assert!(!result(&mut check) && !result(&mut check));
        check.UPDATE = true;
        assert!(result(&mut check));
        check.UPDATE = false;
        assert!(result(&mut check));
        check.STARTADR = -1;
        assert!(!result(&mut check), "no memory");
        check.STARTADR = FUNCTION as i32;
        check.LENGTH = 5;
        assert!(result(&mut check), "another place");
    }
}
