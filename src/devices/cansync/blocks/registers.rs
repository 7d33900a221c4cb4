//! Functions that several blocks use: for control and status registers, and for writing the register pair of a job
//! (manual 5.00005.03a chapters 7.2.2, 7.2.3).

use crate::devices::cansync::registers::values::{receive, request};
use crate::devices::cansync::registers::{
    CANsync_INIT_BMSTRUCT, CANsync_MA_CTRL_BMSTRUCT, CANsync_SL_CTRL_BMSTRUCT,
};
use crate::memory::Cell8;

/// Implements the conversion of a structure to itself: function blocks accept a structure, or a type that contains it.
macro_rules! as_ref_of_itself {
    ($($structure:ident)*) => {$(
        impl AsRef<$structure> for $structure {
            fn as_ref(&self) -> &Self {
                self
            }
        }
    )*};
}

as_ref_of_itself!(CANsync_INIT_BMSTRUCT CANsync_MA_CTRL_BMSTRUCT CANsync_SL_CTRL_BMSTRUCT);

/// Number of slaves on a bus.
pub(super) const SLAVES: usize = 32;
/// Special slave number. As an input it means that the slave number advances automatically; as an output it
/// means that there is no slave.
pub(super) const AUTOMATIC: i8 = request::AUTOMATIC.cast_signed();

/// Returns a slave number as an index; `None` if it is not 0 to 31.
pub(super) fn slave_index(number: i8) -> Option<usize> {
    usize::try_from(number).ok().filter(|&index| index < SLAVES)
}

/// Clears a receive register. Returns 2 if a frame was received, otherwise 0. The register is cleared before
/// the data are read. So if a frame arrives between these two steps, the next call finds it.
pub(super) fn take_received(register: &Cell8) -> i8 {
    match register.compare_exchange(receive::RECEIVED, receive::NOTHING) {
        Ok(received) => received as i8,
        Err(_) => 0,
    }
}

/// A block that shows the control words of a slave. Both blocks show every control word (decision D-603).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ControlWordReader {
    /// `CANsync_BC_SL`, as broadcast command 1.
    Broadcast,
    /// The structure of the block `CANsync_CONTROLWORD_SL`.
    ControlWord,
}

impl ControlWordReader {
    /// Returns the value of `b_STATREG_CONTROLWORD` by which this block notifies the other block of a control
    /// word that it has shown.
    const fn mark(self) -> u8 {
        match self {
            ControlWordReader::Broadcast => 0x10,
            ControlWordReader::ControlWord => 0x20,
        }
    }

    const fn other(self) -> Self {
        match self {
            ControlWordReader::Broadcast => ControlWordReader::ControlWord,
            ControlWordReader::ControlWord => ControlWordReader::Broadcast,
        }
    }

    /// Works like [`take_received`] on `b_STATREG_CONTROLWORD`.
    pub(super) fn take(self, register: &Cell8) -> i8 {
        let taken = register.compare_exchange(receive::RECEIVED, self.mark()).is_ok()
            || register.compare_exchange(self.other().mark(), receive::NOTHING).is_ok();
        if taken { receive::RECEIVED.cast_signed() } else { 0 }
    }
}

/// Control and status register of a job.
pub(super) struct Job<'a> {
    pub(super) control: &'a Cell8,
    pub(super) status: &'a Cell8,
}

impl Job<'_> {
    /// Returns the control register. Its value alone decides the state of the job.
    pub(super) fn control(&self) -> u8 {
        self.control.load()
    }

    /// Writes both registers; writes the control register last (p. 165).
    pub(super) fn enter(&self, value: u8) {
        self.status.store(value);
        self.control.store(value);
    }

    /// Changes bits of both registers. Simultaneous writes of the firmware to other bits are not lost.
    pub(super) fn change(&self, change: impl Fn(u8) -> u8) {
        self.status.update(&change);
        self.control.update(&change);
    }
}
