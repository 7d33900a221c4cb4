//! Blocks of CANsync that manual 5.02066.01a describes differently from the manual of another device.

use crate::devices::bm4_o_can_06::registers::BAUD_RATES;
use crate::devices::cansync::blocks::{init, par_ma, pd_comm_read, pd_comm_sl, updownload_ma};

/// Bits 2 and 3 of `b_ERR` of `CANsync_PAR_READ_MA` (p. 139): the format that the block expected, according
/// to `x_PAR_FORMAT`. If an answer has another format, the block still outputs the value and the format of
/// this answer (decision D-336).
const DOUBLEWORD_EXPECTED: u8 = 1 << 2;
const WORD_EXPECTED: u8 = 1 << 3;

init::init!(
    "122-127",
    &BAUD_RATES,
    "from outside",
    "6: 1 Mbit/s, ",
    "8, 4, 2, 1 for the baud rates 3, 4, 5, 6"
);
par_ma::par_read_ma!(
    "136-139",
    "2: the parameter is a doubleword, 3: a word, other than `x_PAR_FORMAT`, ",
    |asked: bool, answered: bool| match (asked, answered) {
        (false, true) => DOUBLEWORD_EXPECTED,
        (true, false) => WORD_EXPECTED,
        _ => 0,
    }
);
pd_comm_read::pd_comm_read!(
    CANsync_PD_COMM_READ_MA,
    CANsync_MA_CTRL_BMSTRUCT,
    "CANsync_PD_COMM_MA",
    "174-176",
    1,
    2
);
pd_comm_read::pd_comm_read!(
    CANsync_PD_COMM_READ_SL,
    CANsync_SL_CTRL_BMSTRUCT,
    "CANsync_PD_COMM_SL",
    "177-179",
    1,
    2
);
pd_comm_sl::pd_comm_sl!("180-184", 1, 2);
updownload_ma::updownload_ma!(
    "187-192",
    "Bit 0: the slave reports `w_ERR_SL`, 1: `u_LENGTH` is 0 or more than 2048, 2: timeout.",
    |failure| match failure {
        Failure::Slave(_) => 1 << 0,
        Failure::Length => 1 << 1,
        Failure::Timeout => 1 << 2,
    }
);
