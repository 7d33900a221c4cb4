//! The two register areas in which up-/downloads are shown to a slave's application: block 1 with 300
//! bytes of data and the single-frame area with six (manual 5.00005.03a p. 190-193).

use super::handshake::Handshake;
use crate::bus::codec::updown::BLOCK;
use crate::layout::omega_drive_line_2::{CANsync_SL_CTRL_BMSTRUCT, NODE1};
use crate::memory::{Cell8, Cell16, Cell32};
use core::mem::offset_of;

/// Bytes that block 1 holds.
pub(super) const BLOCK_1_BYTES: u16 = 300;

/// Which of the two areas a transfer uses, from its init frame to its end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    Block1,
    Single,
}

impl Place {
    /// More than 300 bytes never fit block 1; less go there if the application has enabled it (p. 191).
    pub(super) fn of(regs: &CANsync_SL_CTRL_BMSTRUCT, length: u16) -> Self {
        if length <= BLOCK_1_BYTES && regs.b_EN_UPDOWNBLK1.load() != 0 {
            Place::Block1
        } else {
            Place::Single
        }
    }

    pub(super) fn area(self, regs: &CANsync_SL_CTRL_BMSTRUCT) -> Area<'_> {
        match self {
            Place::Block1 => Area {
                control: &regs.b_STEUREG_UPDOWNBLK1,
                status: &regs.b_STATREG_UPDOWNBLK1,
                offset: offset_of!(CANsync_SL_CTRL_BMSTRUCT, b_STEUREG_UPDOWNBLK1),
                error: &regs.w_ERR_NR_UPDOWNBLK1,
                base: &regs.d_BASE_ADR_UPDOWNBLK1,
                length: &regs.w_LENGTH_UPDOWNBLK1,
                counter: &regs.w_COUNTER_UPDOWNBLK1,
                data: Data::Block1(&regs.a_DATA_UPDOWNBLK1),
            },
            Place::Single => Area {
                control: &regs.b_STEUREG_UPDOWN_SINGLE,
                status: &regs.b_STATREG_UPDOWN_SINGLE,
                offset: offset_of!(CANsync_SL_CTRL_BMSTRUCT, b_STEUREG_UPDOWN_SINGLE),
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
    control: &'a Cell8,
    status: &'a Cell8,
    offset: usize,
    pub(super) error: &'a Cell16,
    pub(super) base: &'a Cell32,
    pub(super) length: &'a Cell16,
    pub(super) counter: &'a Cell16,
    data: Data<'a>,
}

enum Data<'a> {
    Block1(&'a [Cell32]),
    /// The frame's first four and last two bytes.
    Single(&'a Cell32, &'a Cell16),
}

impl Area<'_> {
    pub(super) fn handshake(&self) -> Handshake<'_> {
        Handshake { control: self.control, status: self.status, offset: NODE1 + self.offset }
    }

    /// Takes over the frame's bytes that belong to the block: those from `offset` to below `length`
    /// (p. 143). In the single-frame area the others read 0 (decision D-66).
    pub(super) fn put(&self, offset: u16, bytes: [u8; BLOCK], length: u16) {
        let valid = usize::from(length.saturating_sub(offset)).min(BLOCK);
        match self.data {
            Data::Block1(cells) => {
                for (position, byte) in (usize::from(offset)..).zip(bytes.into_iter().take(valid)) {
                    if let Some(cell) = cells.get(position / 4) {
                        let shift = 8 * (position % 4);
                        cell.update(|value| value & !(0xFF << shift) | u32::from(byte) << shift);
                    }
                }
            }
            Data::Single(doubleword, word) => {
                let mut shown = [0; BLOCK];
                for (place, byte) in shown.iter_mut().zip(bytes).take(valid) {
                    *place = byte;
                }
                let [a, b, c, d, e, f] = shown;
                doubleword.store(u32::from_le_bytes([a, b, c, d]));
                word.store(u16::from_le_bytes([e, f]));
            }
        }
    }

    /// Six bytes for an upload. What lies behind the area is irrelevant to the master (p. 142) and
    /// reads 0.
    pub(super) fn get(&self, offset: u16) -> [u8; BLOCK] {
        match self.data {
            Data::Block1(cells) => {
                let mut bytes = [0; BLOCK];
                for (position, byte) in (usize::from(offset)..).zip(&mut bytes) {
                    *byte =
                        cells.get(position / 4).map_or(0, |cell| (cell.load() >> (8 * (position % 4))) as u8);
                }
                bytes
            }
            Data::Single(doubleword, word) => {
                let [a, b, c, d] = doubleword.load().to_le_bytes();
                let [e, f] = word.load().to_le_bytes();
                [a, b, c, d, e, f]
            }
        }
    }
}
