//! Iterates over all registers of an area in address order. An array is listed element by element.

use super::descriptor::{Area, AreaStructure, Register, Structure};
use super::register::RegisterRef;

/// Iterator over the registers of a structure in ascending order of their addresses, without padding, but with reserved
/// registers.
#[derive(Debug, Clone)]
pub struct Registers {
    area: &'static Area,
    placed: &'static AreaStructure,
    /// First descriptor of the current run. A run is a single register, or the registers of a sub-structure.
    run: usize,
    run_end: usize,
    /// Descriptor and indices of the next element.
    next: usize,
    index: [u16; 2],
}

impl Registers {
    fn new(area: &'static Area, placed: &'static AreaStructure) -> Self {
        let run_end = run_end(placed.structure, 0);
        Self { area, placed, run: 0, run_end, next: 0, index: [0; 2] }
    }

    /// Goes to the element that follows `register`.
    fn advance(&mut self, register: &Register) {
        let group_dims = register.group_dims;
        for dim in (group_dims..register.dims.len()).rev() {
            if self.step(register, dim) {
                return;
            }
        }
        self.next += 1;
        if self.next < self.run_end {
            return;
        }
        // One element of the sub-structure ends here. If the sub-structure is an array, the next element follows.
        self.next = self.run;
        for dim in (0..group_dims).rev() {
            if self.step(register, dim) {
                return;
            }
        }
        self.run = self.run_end;
        self.next = self.run;
        self.run_end = run_end(self.placed.structure, self.run);
    }

    /// Increments an index. At the end of the array, sets it back to 0.
    fn step(&mut self, register: &Register, dim: usize) -> bool {
        let (Some(index), Some(dim)) = (self.index.get_mut(dim), register.dims.get(dim)) else {
            return false;
        };
        *index += 1;
        if *index < dim.count {
            return true;
        }
        *index = 0;
        false
    }
}

/// Returns the end of the descriptors of the same sub-structure as `start`, exclusive.
fn run_end(structure: &Structure, start: usize) -> usize {
    let registers = structure.registers.get(start..).unwrap_or_default();
    let run = match registers.first() {
        None => 0,
        Some(first) if first.group.is_empty() => 1,
        Some(first) => registers.iter().take_while(|register| register.group == first.group).count(),
    };
    start + run
}

impl Iterator for Registers {
    type Item = RegisterRef;

    fn next(&mut self) -> Option<RegisterRef> {
        let register = self.placed.structure.registers.get(self.next)?;
        let found =
            RegisterRef { area: self.area, placed: self.placed, register, index: self.index, role: None };
        self.advance(register);
        Some(found)
    }
}

impl Area {
    /// Returns the registers of a structure of this area, in address order.
    #[must_use]
    pub fn registers_of(&'static self, placed: &'static AreaStructure) -> Registers {
        Registers::new(self, placed)
    }

    /// Returns the registers of a structure of this area that have a descriptor with `has`, in address order. Skips arrays
    /// without such a descriptor as a whole.
    pub(super) fn registers_with(
        &'static self,
        placed: &'static AreaStructure,
        has: impl Fn(&Register) -> bool,
    ) -> impl Iterator<Item = RegisterRef> {
        let structure = placed.structure;
        let all = structure.registers;
        let run_from = move |start| Some(start..run_end(structure, start)).filter(|run| !run.is_empty());
        let mut wanted = Vec::new();
        let mut next = run_from(0);
        while let Some(run) = next {
            next = run_from(run.end);
            if all.get(run.clone()).is_some_and(|run| run.iter().any(&has)) {
                wanted.push(run);
            }
        }
        let elements = wanted.into_iter().flat_map(move |run| {
            let start = run.start;
            let mut rest =
                Registers { run: start, run_end: run.end, next: start, ..Registers::new(self, placed) };
            core::iter::from_fn(move || if rest.run == start { rest.next() } else { None })
        });
        elements.filter(move |found| has(found.register))
    }
}

#[cfg(test)]
mod tests {
    use crate::devices::samples::tables::NODES as DEVICE;
    use crate::devices::samples::tables::phases;
    use crate::layout::{Area, DeviceFit, RegisterPhase, RegisterRef};

    fn registers(area: &'static Area, live: RegisterPhase) -> impl Iterator<Item = RegisterRef> {
        DeviceFit::unknown(&DEVICE).registers_in(area, live)
    }

    /// The iterator, the names and the addresses must agree on every single register.
    #[test]
    fn every_register_is_found_again_by_name_and_by_address() {
        for area in DEVICE.areas {
            for placed in area.structures {
                let mut end = area.first;
                for found in area.registers_of(placed) {
                    assert!(found.offset() >= end, "{found} is out of order");
                    end = found.offset() + found.width();
                    let named = DEVICE.register(&found.name()).unwrap();
                    assert_eq!(named.address(), found.address(), "{found}");
                }
                let bytes = end - area.first;
                assert!(bytes <= placed.structure.bytes && placed.structure.bytes - bytes < 4);
            }
        }
        for address in ["%MB3.200185", "%MD3.203000", "%MB3.100823"] {
            let found = DEVICE.target(address).unwrap().registers;
            assert!(!found.is_empty(), "{address}");
            assert!(found.iter().all(|register| DEVICE.register(&register.name()).unwrap() == *register));
        }
    }

    #[test]
    fn reserved_elements_are_marked() {
        let node2 = DEVICE.area("node2").unwrap();
        let count = |wanted: &dyn Fn(&RegisterRef) -> bool| {
            registers(node2, phases::CYCLIC).filter(wanted).filter(RegisterRef::is_reserved).count()
        };
        assert_eq!(count(&|r| r.register.name == "a_WR_VALUE"), 24);
        assert_eq!(count(&|r| r.register.name == "a_RD_BMARRAY"), 32 * 8);
        assert_eq!(count(&|r| r.register.group == "_CFG_WRC_WORD"), 24);
        assert_eq!(count(&|r| r.register.name == "a_DATA_UPDOWNBLK0"), 75);
        assert_eq!(count(&|r| r.register.name == "w_CPU_CONTROL"), 0);
    }

    #[test]
    fn the_phase_selects_the_structure() {
        let node1 = DEVICE.area("node1").unwrap();
        assert_eq!(registers(node1, phases::INIT).count(), 6 + 8 + 32);
        assert!(registers(node1, phases::CYCLIC).all(|r| r.placed.live == phases::CYCLIC));
        assert_eq!(registers(DEVICE.area("option1").unwrap(), phases::CYCLIC).count(), 0);
    }
}
