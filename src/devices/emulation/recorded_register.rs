//! Registers in which the firmware shows results, error numbers and states to the PLC. They have no
//! handshake.

use crate::devices::Context;
use crate::journal::Register;
use crate::memory::{Cell8, Cell16, Cell32};

/// A register with changes that the journal records. Process data are not recorded, because the journal
/// already has the frames that contain them.
pub(crate) trait RecordedRegister {
    /// Value of the register.
    type Value;

    /// Stores `value`, and records a change in the journal. `offset` is the offset of the register in its
    /// area.
    fn show(&self, ctx: &mut Context, offset: usize, value: Self::Value);
}

macro_rules! shown {
    ($($cell:ty => $value:ty),*) => {$(
        impl RecordedRegister for $cell {
            type Value = $value;

            fn show(&self, ctx: &mut Context, offset: usize, value: $value) {
                let before = self.load();
                self.store(value);
                if before != value {
                    let (origin, offset) = (ctx.origin, ctx.at(offset));
                    ctx.report(Register { origin, offset, from: before.into(), to: value.into() });
                }
            }
        }
    )*};
}

shown!(Cell8 => u8, Cell16 => u16, Cell32 => u32);
