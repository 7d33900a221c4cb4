//! Data that a CS0015 keeps without supply in addition to its retain flags: the EEPROM, and the parameters
//! that p. 155 lists as saved automatically.

use crate::devices::cs0015::emulation::canopen::communication::{is_cob_id, is_node, is_rate};
use crate::devices::cs0015::registers::values::loaded;
use crate::devices::cs0015::registers::{CS0015_PARAMETERS, DEVICE, PARAMETERS};
use crate::layout::Area;
use crate::memory::{MemoryError, Segment, View};
use crate::snapshot_fields::{Damaged, Saved, Saving, SnapshotFields};
use core::mem::offset_of;
use zerocopy::IntoBytes;

/// Length of the parameters.
const BYTES: usize = size_of::<CS0015_PARAMETERS>();
/// Number of bytes that are compared to detect a change. The EEPROM is not compared, because a counter counts
/// its writes.
const HEAD: usize = offset_of!(CS0015_PARAMETERS, a_EEPROM);

/// Returns the area of the parameters.
pub(crate) fn area() -> Option<&'static Area> {
    DEVICE.areas.iter().find(|area| area.name == "parameters")
}

/// The parameters that keep their values without power.
pub(crate) struct Retained {
    parameters: View<CS0015_PARAMETERS>,
    segment: Segment,
    stored: [u8; BYTES],
    /// Counter for changes of `stored`.
    generation: u32,
}

impl SnapshotFields for Retained {
    fn save(&self, to: &mut Saving) {
        let Self { parameters: _, segment: _, stored, generation: _ } = self;
        to.raw(stored);
    }

    fn restore(&mut self, from: &mut Saved<'_>) -> Result<(), Damaged> {
        let stored = from.raw(BYTES)?;
        // The change of the number makes the emulator write the NOVRAM file again. The file still has the
        // values from before the restoration.
        self.generation = self.generation.wrapping_add((self.stored != stored).into());
        self.stored.copy_from_slice(stored);
        Ok(())
    }
}

impl Retained {
    pub(crate) fn new(segment: &Segment) -> Result<Self, MemoryError> {
        let parameters = segment.view(PARAMETERS)?;
        Ok(Retained { parameters, segment: segment.clone(), stored: [0; BYTES], generation: 0 })
    }

    /// Returns the content of the NOVRAM, and a number that changes with it.
    pub(crate) fn novram(&self) -> (&[u8], u32) {
        (&self.stored, self.generation)
    }

    /// Stores the parameters when they have changed (p. 155). If the value of a parameter is invalid,
    /// replaces it by the stored value (D-661).
    pub(crate) fn keep(&mut self) {
        if self.has_changed() {
            self.put_back();
        }
        if self.has_changed() {
            // Source and destination are arrays of equal size by definition, so the copy cannot fail.
            let _ = self.parameters.snapshot().write_to(&mut self.stored);
            self.generation = self.generation.wrapping_add(1);
        }
    }

    fn has_changed(&self) -> bool {
        let mut head = [0; HEAD];
        // The range is in the image, so this cannot fail.
        let _ = self.segment.read_range(PARAMETERS, &mut head);
        !self.stored.starts_with(&head)
    }

    /// Replaces invalid values in the registers by the stored values. 0 means the factory setting.
    fn put_back(&self) {
        let CS0015_PARAMETERS {
            d_COB_ID_SYNC,
            d_COB_ID_GUARDING,
            d_COB_ID_EMCY,
            w_KBIT_S,
            b_NODE_ID,
            b_OPERATING_SYSTEM,
            ..
        } = &*self.parameters;
        for (register, offset) in [
            (d_COB_ID_SYNC, offset_of!(CS0015_PARAMETERS, d_COB_ID_SYNC)),
            (d_COB_ID_GUARDING, offset_of!(CS0015_PARAMETERS, d_COB_ID_GUARDING)),
            (d_COB_ID_EMCY, offset_of!(CS0015_PARAMETERS, d_COB_ID_EMCY)),
        ] {
            let value = register.load();
            if value != 0 && !is_cob_id(value) {
                register.store(u32::from_le_bytes(self.stored(offset)));
            }
        }
        let kbit_s = w_KBIT_S.load();
        if kbit_s != 0 && !is_rate(kbit_s) {
            w_KBIT_S.store(u16::from_le_bytes(self.stored(offset_of!(CS0015_PARAMETERS, w_KBIT_S))));
        }
        let node = b_NODE_ID.load();
        if node != 0 && !is_node(node) {
            let [stored] = self.stored(offset_of!(CS0015_PARAMETERS, b_NODE_ID));
            b_NODE_ID.store(stored);
        }
        if ![loaded::YES, loaded::NO].contains(&b_OPERATING_SYSTEM.load()) {
            let [stored] = self.stored(offset_of!(CS0015_PARAMETERS, b_OPERATING_SYSTEM));
            b_OPERATING_SYSTEM.store(stored);
        }
    }

    /// Returns the stored bytes at `offset`.
    fn stored<const BYTES: usize>(&self, offset: usize) -> [u8; BYTES] {
        core::array::from_fn(|index| self.stored[offset + index])
    }
}
