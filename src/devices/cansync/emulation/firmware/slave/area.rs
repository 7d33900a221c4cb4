//! The two register areas that show up-/downloads to a slave's application: block 1 with 300 bytes of data,
//! and the single-frame area with six bytes (manual 5.00005.03a p. 190-193). Not every device has the
//! single-frame area.

use crate::devices::cansync::firmware::block;
use crate::devices::cansync::firmware::job_registers::JobRegisters;
use crate::devices::cansync::frames::codec::updown::BLOCK;
use crate::devices::cansync::registers::CANsync_SL_CTRL_BMSTRUCT;
use crate::devices::cansync::registers::values::updown_error;
use crate::memory::{Cell16, Cell32};
use core::mem::offset_of;
use serde::{Deserialize, Serialize};

/// The area that a transfer uses from its init frame to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum AreaKind {
    Block1,
    Single,
}

impl AreaKind {
    /// Selects the area. A transfer of more than 300 bytes never fits block 1. A shorter transfer uses block
    /// 1 if the application has enabled block 1 (p. 191). Other transfers use the single-frame area. If the
    /// device does not have that area, the master gets an error number (decision D-307).
    pub(super) fn of(
        regs: &CANsync_SL_CTRL_BMSTRUCT,
        length: u16,
        has_single_frame_area: bool,
    ) -> Result<Self, u16> {
        let fits = length <= block::MAX_LENGTH;
        if fits && regs.b_EN_UPDOWNBLK1.load() != 0 {
            Ok(AreaKind::Block1)
        } else if has_single_frame_area {
            Ok(AreaKind::Single)
        } else if fits {
            Err(updown_error::NOT_POSSIBLE)
        } else {
            Err(updown_error::TOO_LONG)
        }
    }

    pub(super) fn area(self, regs: &CANsync_SL_CTRL_BMSTRUCT) -> Area<'_> {
        match self {
            AreaKind::Block1 => Area {
                job: JobRegisters {
                    control: &regs.b_STEUREG_UPDOWNBLK1,
                    status: &regs.b_STATREG_UPDOWNBLK1,
                    offset: offset_of!(CANsync_SL_CTRL_BMSTRUCT, b_STEUREG_UPDOWNBLK1),
                    is_masters: false,
                },
                error: &regs.w_ERR_NR_UPDOWNBLK1,
                base: &regs.d_BASE_ADR_UPDOWNBLK1,
                length: &regs.w_LENGTH_UPDOWNBLK1,
                counter: &regs.w_COUNTER_UPDOWNBLK1,
                data: Data::Block1(&regs.a_DATA_UPDOWNBLK1),
            },
            AreaKind::Single => Area {
                job: JobRegisters {
                    control: &regs.b_STEUREG_UPDOWN_SINGLE,
                    status: &regs.b_STATREG_UPDOWN_SINGLE,
                    offset: offset_of!(CANsync_SL_CTRL_BMSTRUCT, b_STEUREG_UPDOWN_SINGLE),
                    is_masters: false,
                },
                error: &regs.w_ERR_NR_UPDOWN_SINGLE,
                base: &regs.d_BASE_ADR_UPDOWN_SINGLE,
                length: &regs.w_LENGTH_UPDOWN_SINGLE,
                counter: &regs.w_COUNTER_UPDOWN_SINGLE,
                data: Data::Single(&regs.d_DATA_DW_UPDOWN_SINGLE, &regs.w_DATA_W_UPDOWN_SINGLE),
            },
        }
    }
}

/// The registers of one area.
pub(super) struct Area<'a> {
    pub(super) job: JobRegisters<'a>,
    pub(super) error: &'a Cell16,
    pub(super) base: &'a Cell32,
    pub(super) length: &'a Cell16,
    pub(super) counter: &'a Cell16,
    data: Data<'a>,
}

enum Data<'a> {
    Block1(&'a [Cell32; 75]),
    /// Registers for the frame's first four bytes and its last two bytes.
    Single(&'a Cell32, &'a Cell16),
}

impl Area<'_> {
    /// Stores the frame's bytes that belong to the block: from `offset` to below `length` (p. 143). In the
    /// single-frame area the other bytes become 0 (decision D-66).
    pub(super) fn put(&self, offset: u16, mut bytes: [u8; BLOCK], length: u16) {
        match self.data {
            Data::Block1(cells) => block::write(cells, offset, length, bytes),
            Data::Single(doubleword, word) => {
                let valid = usize::from(length.saturating_sub(offset));
                bytes.iter_mut().skip(valid).for_each(|byte| *byte = 0);
                let [a, b, c, d, e, f] = bytes;
                doubleword.store(u32::from_le_bytes([a, b, c, d]));
                word.store(u16::from_le_bytes([e, f]));
            }
        }
    }

    /// Returns six bytes for an upload. The master ignores bytes after the end of the block (p. 142).
    pub(super) fn get(&self, offset: u16, length: u16) -> [u8; BLOCK] {
        match self.data {
            Data::Block1(cells) => block::read(cells, offset, length),
            Data::Single(doubleword, word) => {
                let [a, b, c, d] = doubleword.load().to_le_bytes();
                let [e, f] = word.load().to_le_bytes();
                [a, b, c, d, e, f]
            }
        }
    }
}
