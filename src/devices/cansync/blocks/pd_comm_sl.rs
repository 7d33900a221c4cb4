//! `CANsync_PD_COMM_SL`: process data of a slave (p. 256-260, in 5.02066.01a p. 180-184). The output values for
//! received frames depend on the device.

use super::CANsync_RD_BMARRAY;
use super::process_data::{receive, receive_from_all, send, take_last_slave};
use crate::devices::cansync::registers::CANsync_SL_CTRL_BMSTRUCT;
use crate::plc::Viewed;

/// Releases the actual values of each frame with input value 5.
pub(crate) fn release(base: &CANsync_SL_CTRL_BMSTRUCT, values: &[i32; 8], inputs: [i8; 2]) {
    let controls = [&base.b_CTRLREG_RD_RDC1, &base.b_CTRLREG_RD_RDC2];
    send(values, inputs, &base.a_RD_VALUE_SEND, controls);
}

/// Copies the reference values of the frames received since the last call. Returns true for each received frame.
pub(crate) fn take_references(base: &CANsync_SL_CTRL_BMSTRUCT, values: &mut [i32; 8]) -> [bool; 2] {
    receive([&base.b_CTRLREG_WRC1, &base.b_CTRLREG_WRC2], &base.a_WR_VALUE_RECEIVE, values)
}

/// For each frame, returns the slave that was overheard last since the previous call. Copies the values of
/// the overheard slaves if `a_RD_ARRAY` is given.
pub(crate) fn overhear(
    base: &Viewed<'_, CANsync_SL_CTRL_BMSTRUCT>,
    a_RD_ARRAY: Option<&mut CANsync_RD_BMARRAY>,
) -> [i8; 2] {
    let slaves = [&base.b_STATREG_RDC1, &base.b_STATREG_RDC2].map(take_last_slave);
    if let Some(a_RD_ARRAY) = a_RD_ARRAY {
        receive_from_all(&base.a_STATREG_RDC, &base.a_RD_BMARRAY, a_RD_ARRAY);
    }
    slaves
}

/// Declares the block of a device: its page, and its output values for received frames 1 and 2.
macro_rules! pd_comm_sl {
    ($page:literal, $one:literal, $two:literal) => {
        $crate::plc::function_block! {
            /// Writes own actual values, reads reference values and overhears other slaves' actual values.
            /// Call this block first in the CANsync event task.
            #[doc = concat!("Manual p. ", $page, ".")]
            pub struct CANsync_PD_COMM_SL(_BASE: $crate::plc::Base<$crate::devices::cansync::registers::CANsync_SL_CTRL_BMSTRUCT>) {
                in {
                    /// Own actual values 0 to 7.
                    a_RD_VALUES_SEND: [i32; 8];
                    /// 5: own actual values 0 to 3 are valid, send frame 1 when the master requests it.
                    si_RDC1_SEND: i8;
                    /// 5: own actual values 4 to 7 are valid, send frame 2 when the master requests it.
                    si_RDC2_SEND: i8;
                    /// Copies overheard actual values to `a_RD_ARRAY`; default: FALSE.
                    x_COPY_TO_RD_ARRAY: bool;
                }
                out {
                    /// Reference values 0 to 7. A half changes only when its frame has been received.
                    a_WR_VALUES_RECEIVED: [i32; 8];
                    #[doc = concat!($one, ": reference value frame 1 was received since the last call; otherwise 0.")]
                    si_WRC1_RECEIVED: i8;
                    #[doc = concat!($two, ": reference value frame 2 was received since the last call; otherwise 0.")]
                    si_WRC2_RECEIVED: i8;
                    /// Sender of the last frame 1 that was overheard since the previous call; -128: no
                    /// sender.
                    si_RD_SL_NR1_RECEIVED: i8 = -128;
                    /// Sender of the last frame 2 that was overheard since the previous call; -128: no
                    /// sender.
                    si_RD_SL_NR2_RECEIVED: i8 = -128;
                }
                in_out {
                    a_RD_ARRAY: $crate::devices::cansync::blocks::CANsync_RD_BMARRAY;
                }
            }
        }

        impl CANsync_PD_COMM_SL {
            /// Runs one PLC cycle. Writes `a_RD_ARRAY` only if `x_COPY_TO_RD_ARRAY` is TRUE.
            pub fn call(
                &mut self,
                _BASE: &$crate::plc::Base<impl $crate::plc::Like<$crate::devices::cansync::registers::CANsync_SL_CTRL_BMSTRUCT>>,
                a_RD_ARRAY: &mut $crate::devices::cansync::blocks::CANsync_RD_BMARRAY,
            ) {
                use $crate::devices::cansync::blocks::pd_comm_sl::{overhear, release, take_references};
                let _BASE = &_BASE.viewed();
                release(_BASE, &self.a_RD_VALUES_SEND, [self.si_RDC1_SEND, self.si_RDC2_SEND]);
                let [one, two] = take_references(_BASE, &mut self.a_WR_VALUES_RECEIVED);
                self.si_WRC1_RECEIVED = if one { $one } else { 0 };
                self.si_WRC2_RECEIVED = if two { $two } else { 0 };
                [self.si_RD_SL_NR1_RECEIVED, self.si_RD_SL_NR2_RECEIVED] =
                    overhear(_BASE, self.x_COPY_TO_RD_ARRAY.then_some(a_RD_ARRAY));
            }
        }
    };
}

pub(crate) use pd_comm_sl;
