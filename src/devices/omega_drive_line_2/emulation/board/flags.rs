//! The flags, and the effects of power-on and starts on them (manual 5.00005.03a p. 38, 41-42).

use crate::devices::omega_drive_line_2::registers::{DEVICE, RETAIN, RETAIN_BYTES};
use crate::memory::header::{InitialFlag, InitialFlagResult};
use crate::memory::{MemoryError, Segment, Width};
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};

/// Position of the first flag.
const FIRST: u32 = RETAIN;

/// The flags of a PLC. The retain flags have their initial values.
#[derive(Debug)]
pub(super) struct Flags {
    segment: Segment,
    /// Initial value of each byte of the retain flags; 0 if no value was set.
    initial: Box<[u8]>,
}

impl SnapshotFields for Flags {
    fn save(&self, to: &mut Saving) {
        let Self { segment: _, initial } = self;
        to.sparse(initial.as_chunks().0.iter().map(|bytes| u32::from_le_bytes(*bytes).into()));
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        self.initial.fill(0);
        for (index, word) in from.value::<Vec<(usize, u64)>>()? {
            let flags = self.initial.as_chunks_mut().0.get_mut(index).ok_or_else(|| from.no("flag"))?;
            *flags = (word as u32).to_le_bytes();
        }
        Ok(())
    }
}

impl Flags {
    /// Returns the flags in `segment`. The header page contains the number of retain flags.
    ///
    /// # Errors
    /// The memory segment is read-only.
    pub(crate) fn new(segment: &Segment) -> Result<Self, MemoryError> {
        let bytes = segment.header()?.retain_size.load().min(RETAIN_BYTES as u32) & !3;
        Ok(Flags { segment: segment.clone(), initial: vec![0; bytes as usize].into() })
    }

    /// True if at least one retain flag is not 0. In this case NOVRAM has kept the flags.
    pub(crate) fn are_kept(&self) -> bool {
        let mut bytes = vec![0; self.initial.len()];
        self.segment.read_range(FIRST, &mut bytes).is_ok() && bytes.iter().any(|flag| *flag != 0)
    }

    /// Answers a pending request.
    pub(crate) fn look(&mut self, asked: &InitialFlag, slot: &InitialFlag) {
        let request = asked.request.load();
        if request == slot.answer.load() {
            return;
        }
        let done = self.set(asked.flag.load(), asked.width.load(), asked.value.load()).is_some();
        let result = if done { InitialFlagResult::Done } else { InitialFlagResult::NoSuchFlag };
        slot.result.store(result.code());
        slot.answer.store(request);
    }

    /// Sets the initial value of a flag, or clears all initial values if the width is 0. `None` if this is
    /// not possible.
    fn set(&mut self, flag: u32, width: u32, value: u32) -> Option<()> {
        if width == 0 {
            self.forget();
            return Some(());
        }
        let width = [Width::Byte, Width::Word, Width::Dword].into_iter().find(|it| it.bytes() == width)?;
        let first = flag as usize;
        let of = self.initial.get_mut(first..)?.get_mut(..width.bytes() as usize)?;
        if !flag.is_multiple_of(width.bytes()) || value > width.max_value() {
            return None;
        }
        of.copy_from_slice(value.to_le_bytes().get(..of.len())?);
        Some(())
    }

    /// Deletes the initial values, because the program that has set them has ended.
    pub(crate) fn forget(&mut self) {
        self.initial.fill(0);
    }

    /// Called at power-on, reset, cold and warm start: sets flags that are not retained to 0. If a program
    /// has other initial values for them, it sets these itself (D-632).
    pub(crate) fn clear(&self) {
        for area in DEVICE.areas.iter().filter(|area| area.space.name == "free_flags") {
            for offset in (area.first..area.last()).step_by(4) {
                // The flags are in the memory segment, which is writable, so the store cannot fail. Memory
                // that contains only 0 is not written, so that unused memory stays untouched.
                if self.segment.load(offset, Width::Dword).is_ok_and(|flags| flags != 0) {
                    let _: Result<(), MemoryError> = self.segment.store(offset, Width::Dword, 0);
                }
            }
        }
    }

    /// Called at a cold start: gives all retain flags their initial values.
    pub(crate) fn initialize(&self) {
        for (offset, bytes) in (FIRST..).step_by(4).zip(self.initial.as_chunks::<4>().0) {
            // The flags are in the memory segment, which is writable, so the store cannot fail.
            let _: Result<(), MemoryError> =
                self.segment.store(offset, Width::Dword, u32::from_le_bytes(*bytes));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::omega_drive_line_2::registers::SEGMENT_END;

    fn flags(bytes: u32) -> Flags {
        let segment = Segment::heap(SEGMENT_END);
        segment.header().unwrap().retain_size.store(bytes);
        Flags::new(&segment).unwrap()
    }

    #[test]
    fn flags_begin_with_their_initial_values_and_the_others_with_0() {
        let mut flags = flags(24);
        for (flag, width, value, is_set) in [
            (0, 4, 0x0403_0201, true),
            (6, 2, 0xBEEF, true),
            (23, 1, 0x7F, true),
            (5, 2, 1, false),
            (24, 1, 1, false),
            (22, 4, 1, false),
            (u32::MAX, 4, 1, false),
            (8, 2, 0x1_0000, false),
            (8, 3, 1, false),
        ] {
            assert_eq!(flags.set(flag, width, value).is_some(), is_set, "{flag}, {width}");
        }
        assert!(
            flags.set(9, 0, 7).is_some() && flags.set(0, 4, 0x0403_0201).is_some(),
            "width 0 takes all back"
        );
        assert!(flags.set(6, 2, 0xBEEF).is_some() && flags.set(23, 1, 0x7F).is_some());
        let after_last = FIRST + 24;
        for offset in [8, 24] {
            flags.segment.store(FIRST + offset, Width::Dword, 9).unwrap();
        }
        let load = |flags: &Flags, flag| flags.segment.load(FIRST + flag, Width::Byte).unwrap();
        flags.initialize();
        let held = [0, 1, 2, 3, 6, 7, 8, 23].map(|flag| load(&flags, flag));
        assert_eq!(held, [1, 2, 3, 4, 0xEF, 0xBE, 0, 0x7F]);
        assert_eq!(flags.segment.load(after_last, Width::Dword).unwrap(), 9, "after the last flag");
        flags.forget();
        flags.initialize();
        assert_eq!(load(&flags, 23), 0);
    }

    /// Manual p. 10, 41-42: these flags are RAM. Power-on and starts set them to 0.
    #[test]
    fn flags_that_are_not_retained_are_cleared() {
        let flags = flags(24);
        let first = DEVICE.area("flags").unwrap().first;
        for offset in [first, first + 79_996] {
            flags.segment.store(offset, Width::Dword, 9).unwrap();
        }
        flags.segment.store(FIRST, Width::Dword, 9).unwrap();
        flags.clear();
        let left =
            [first, first + 79_996, FIRST].map(|offset| flags.segment.load(offset, Width::Dword).unwrap());
        assert_eq!(left, [0, 0, 9]);
    }
}
