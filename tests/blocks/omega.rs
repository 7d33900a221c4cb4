//! The blocks for CANsync on the Omega Drive-Line II (manual 5.00005.03a chapter 7.3).

/// The differences of this device, for the common tests.
pub(crate) mod device {
    pub(crate) use commram::devices::omega_drive_line_2::blocks::*;
    pub(crate) use commram::devices::omega_drive_line_2::registers::{
        BAUD_RATES, CANsync_INIT_BMSTRUCT as Init, CANsync_MA_CTRL_BMSTRUCT as Master,
        CANsync_SL_CTRL_BMSTRUCT as Slave,
    };

    /// Returns the highest rate of the device.
    pub(crate) fn rate() -> crate::rig::Rate {
        crate::rig::FASTEST[0]
    }

    /// Cases for `CANsync_INIT`: `us_BAUDRATE`, the bit timing and `w_ERR` (p. 214-215).
    pub(crate) const TIMINGS: &[(u8, [u8; 2], u16)] = &[
        (5, [0x00, 0x1C], 0),
        (4, [0x01, 0x1C], 0),
        (3, [0x03, 0x1C], 0),
        (6, [0x03, 0x1C], 2),
        (2, [0x03, 0x1C], 2),
    ];
    /// `b_ERR` of `CANsync_PAR_READ_MA` if the answer is a doubleword instead of a word, and the reverse (p. 224).
    pub(crate) const FORMAT_ERRORS: [u8; 2] = [0, 0];
    /// Values that show that frame 1 or 2 was received (p. 253-259).
    pub(crate) const RECEIVED: [i8; 2] = [2, 2];
    /// `b_ERR` of `CANsync_UPDOWNLOAD_MA`: the slave's error, wrong length, timeout (p. 267, D-20).
    pub(crate) const TRANSFER_ERRORS: [u8; 3] = [0, 1 << 1, 1 << 0];
    /// A slave shows transfers in a single-frame area while block 1 is not enabled (p. 191-193).
    pub(crate) const HAS_SINGLE_FRAME_AREA: bool = true;
}

#[path = "cansync/mod.rs"]
pub(crate) mod cansync;
