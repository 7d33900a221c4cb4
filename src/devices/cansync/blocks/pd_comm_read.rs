//! `CANsync_PD_COMM_READ_MA`, `CANsync_PD_COMM_READ_SL`: actual values of one slave (p. 252-255).

use super::process_data::receive_from;
use super::registers::slave_index;
use crate::devices::omega_drive_line_2::registers::{CANsync_MA_CTRL_BMSTRUCT, CANsync_SL_CTRL_BMSTRUCT};
use crate::plc::{Base, Like, function_block};

macro_rules! read {
    ($name:ident, $base:ident, $master_block:literal, $page:literal) => {
        function_block! {
            #[doc = concat!("Reads the actual values of one slave (manual p. ", $page, "). Kept by the vendor for")]
            #[doc = concat!("old projects, for use with `x_COPY_TO_RD_ARRAY` FALSE at `", $master_block, "`.")]
            pub struct $name(_BASE: Base<$base>) {
                in {
                    /// The slave, 0 to 31; other numbers read nothing.
                    si_SL_NR: i8;
                }
                out {
                    /// Actual values 0 to 7, each half only after its frame was received.
                    a_RD_VALUES: [i32; 8];
                    /// 2: frame 1 was received since the last call; otherwise 0.
                    si_RD_SL_NR1_RECEIVED: i8;
                    /// 2: frame 2 was received since the last call; otherwise 0.
                    si_RD_SL_NR2_RECEIVED: i8;
                }
            }
        }

        impl $name {
            /// One PLC cycle.
            pub fn call(&mut self, _BASE: &Base<impl Like<$base>>) {
                let _BASE = &_BASE.viewed();
                let slave = slave_index(self.si_SL_NR)
                    .and_then(|slave| _BASE.a_STATREG_RDC.get(slave).zip(_BASE.a_RD_BMARRAY.get(slave)));
                [self.si_RD_SL_NR1_RECEIVED, self.si_RD_SL_NR2_RECEIVED] = match slave {
                    Some((state, registers)) => receive_from(state, registers, &mut self.a_RD_VALUES),
                    None => [0; 2],
                };
            }
        }
    };
}

read!(CANsync_PD_COMM_READ_MA, CANsync_MA_CTRL_BMSTRUCT, "CANsync_PD_COMM_MA", "252-253");
read!(CANsync_PD_COMM_READ_SL, CANsync_SL_CTRL_BMSTRUCT, "CANsync_PD_COMM_SL", "254-255");
