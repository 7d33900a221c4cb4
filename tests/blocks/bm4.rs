//! The blocks for CANsync on the b maXX PLC with BM4-O-CAN-06 and BM4-O-CAN-05 (manual 5.02066.01a chapter 4).

/// The differences of this device, for the common tests.
mod device {
    pub(crate) use commram::devices::bm4_o_can_06::blocks::*;
    pub(crate) use commram::devices::bm4_o_can_06::registers::{
        BAUD_RATES, CANsync_PLC_INIT_BMSTRUCT as Init, CANsync_PLC_MA_BMSTRUCT as Master,
        CANsync_PLC_SL_BMSTRUCT as Slave,
    };

    /// Returns the highest rate of the device.
    pub(crate) fn rate() -> crate::rig::Rate {
        crate::rig::FASTEST[1]
    }

    /// Cases for `CANsync_INIT`: `us_BAUDRATE`, bit timing and `w_ERR` (p. 126-127).
    pub(crate) const TIMINGS: &[(u8, [u8; 2], u16)] = &[
        (6, [0x40, 0x34], 0),
        (5, [0x41, 0x34], 0),
        (4, [0x43, 0x34], 0),
        (3, [0x47, 0x34], 0),
        (7, [0x47, 0x34], 2),
        (2, [0x47, 0x34], 2),
    ];
    /// `b_ERR` of `CANsync_PAR_READ_MA` if the answer is a doubleword instead of a word, and the reverse (p. 139).
    pub(crate) const FORMAT_ERRORS: [u8; 2] = [1 << 2, 1 << 3];
    /// Values that show that frame 1 or 2 was received (p. 176-184).
    pub(crate) const RECEIVED: [i8; 2] = [1, 2];
    /// `b_ERR` of `CANsync_UPDOWNLOAD_MA`: the slave's error, wrong length, timeout (p. 192).
    pub(crate) const TRANSFER_ERRORS: [u8; 3] = [1 << 0, 1 << 1, 1 << 2];
    /// A slave has no single-frame area: it refuses transfers while block 1 is not enabled (p. 95-97, D-307).
    pub(crate) const HAS_SINGLE_FRAME_AREA: bool = false;
}

#[path = "cansync/mod.rs"]
mod cansync;
