//! Blocks of CANsync that manual 5.00005.03a describes differently from the manual of another
//! device.

use crate::devices::cansync::blocks::{init, par_ma, pd_comm_read, pd_comm_sl, updownload_ma};
use crate::devices::omega_drive_line_2::registers::BAUD_RATES;

init::init!("211-215", &BAUD_RATES, "of node 1 (cluster)", "", "8, 4, 2 for the baud rates 3, 4, 5");
// The block only outputs the format of the answer and does not check it (p. 224).
par_ma::par_read_ma!("222-224", "", |_, _| 0);
pd_comm_read::pd_comm_read!(
    CANsync_PD_COMM_READ_MA,
    CANsync_MA_CTRL_BMSTRUCT,
    "CANsync_PD_COMM_MA",
    "252-253",
    2,
    2
);
pd_comm_read::pd_comm_read!(
    CANsync_PD_COMM_READ_SL,
    CANsync_SL_CTRL_BMSTRUCT,
    "CANsync_PD_COMM_SL",
    "254-255",
    2,
    2
);
pd_comm_sl::pd_comm_sl!("256-260", 2, 2);
// Decision D-20 defines bit 0 of the errors.
updownload_ma::updownload_ma!(
    "263-267",
    "Bit 0: timeout, 1: `u_LENGTH` is 0 or more than 2048.",
    |failure| match failure {
        Failure::Timeout => 1 << 0,
        Failure::Length => 1 << 1,
        Failure::Slave(_) => 0,
    }
);
