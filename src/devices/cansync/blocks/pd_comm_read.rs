//! `CANsync_PD_COMM_READ_MA`, `CANsync_PD_COMM_READ_SL`: actual values of one slave (p. 252-255, in 5.02066.01a p.
//! 174-179). The output values for received frames depend on the device.

use super::process_data::receive_from;
use super::registers::slave_index;
use crate::devices::cansync::registers::STATREG_RDC;
use crate::memory::Cell32;

/// Copies the actual values of one slave from the frames received since the last call. Returns true for each received
/// frame.
pub(crate) fn take_actuals(
    slave: i8,
    states: &[STATREG_RDC; 32],
    registers: &[[Cell32; 16]; 32],
    values: &mut [i32; 8],
) -> [bool; 2] {
    let slave = slave_index(slave).and_then(|slave| states.get(slave).zip(registers.get(slave)));
    slave.map_or([false; 2], |(state, registers)| receive_from(state, registers, values))
}

/// Declares the block of a device for a master or a slave: its pages, and its output values for received
/// frames 1 and 2.
macro_rules! pd_comm_read {
    ($name:ident, $base:ident, $other:literal, $page:literal, $one:literal, $two:literal) => {
        $crate::plc::function_block! {
            #[doc = concat!("Reads the actual values of one slave (manual p. ", $page, "). Kept by the vendor for")]
            #[doc = concat!("old projects, for use with `x_COPY_TO_RD_ARRAY` FALSE at `", $other, "`.")]
            pub struct $name(_BASE: $crate::plc::Base<$crate::devices::cansync::registers::$base>) {
                in {
                    /// Number of the slave, 0 to 31. Other numbers read no values.
                    si_SL_NR: i8;
                }
                out {
                    /// Actual values 0 to 7. A half changes only when its frame has been received.
                    a_RD_VALUES: [i32; 8];
                    #[doc = concat!($one, ": frame 1 was received since the last call; otherwise 0.")]
                    si_RD_SL_NR1_RECEIVED: i8;
                    #[doc = concat!($two, ": frame 2 was received since the last call; otherwise 0.")]
                    si_RD_SL_NR2_RECEIVED: i8;
                }
            }
        }

        impl $name {
            /// Runs one PLC cycle.
            pub fn call(&mut self, _BASE: &$crate::plc::Base<impl $crate::plc::Like<$crate::devices::cansync::registers::$base>>) {
                let _BASE = &_BASE.viewed();
                let [one, two] = $crate::devices::cansync::blocks::pd_comm_read::take_actuals(
                    self.si_SL_NR,
                    &_BASE.a_STATREG_RDC,
                    &_BASE.a_RD_BMARRAY,
                    &mut self.a_RD_VALUES,
                );
                self.si_RD_SL_NR1_RECEIVED = if one { $one } else { 0 };
                self.si_RD_SL_NR2_RECEIVED = if two { $two } else { 0 };
            }
        }
    };
}

pub(crate) use pd_comm_read;
