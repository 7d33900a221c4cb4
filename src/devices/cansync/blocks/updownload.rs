//! Common part of `CANsync_UPDOWNLOAD_MA` and `_SL`: division of a transfer of up to 2048 values into blocks of 75
//! (decision D-211).

use crate::devices::cansync::registers::values::{base_adr, updown_error};

/// Maximum number of values in a transfer (p. 264).
pub const UPDOWN_VALUES: usize = 2048;
/// The values of a transfer.
pub type CANsync_UPDOWN_BMARRAY = [i32; UPDOWN_VALUES];

/// Maximum number of values in a block (p. 266).
pub(super) const BLOCK_VALUES: usize = 75;
/// Base address of a transfer's first value. Lower addresses belong to the operating system (p. 167).
const FIRST_ADDRESS: u32 = *base_adr::FREE.start();

/// One block of a transfer: `d_BASE_ADR` and `w_LENGTH` of its job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block {
    /// Index of the block's first value.
    pub(super) first: usize,
    /// Number of values in the block.
    pub(super) values: usize,
    /// Number of values in the whole transfer.
    pub(super) total: usize,
}

impl Block {
    /// Returns the block of a transfer that begins with value `first`.
    pub(super) fn starting_at(first: usize, total: usize) -> Self {
        Block { first, values: total.saturating_sub(first).min(BLOCK_VALUES), total }
    }

    /// Returns the next block, if the transfer has one.
    pub(super) fn next(self) -> Option<Self> {
        let end = self.first + self.values;
        (end < self.total).then(|| Block::starting_at(end, self.total))
    }

    /// Returns the base address. Bits 31 to 16 are the number of values of the transfer. Bits 15 to 0 are 16#0100 plus
    /// the index of the first value.
    pub(super) fn base_address(self) -> u32 {
        (self.total as u32) << 16 | (FIRST_ADDRESS + self.first as u32)
    }

    /// Returns the length in bytes.
    pub(super) fn length(self) -> u16 {
        (self.values * 4) as u16
    }

    /// Returns the block of a job, or the error number of an invalid job (p. 168). If the master does not
    /// give the transfer's length (bits 31 to 16), the transfer consists of a single block.
    pub(super) fn of_job(base_address: u32, length: u16) -> Result<Self, u16> {
        let low = base_address & 0xFFFF;
        let first = low.checked_sub(FIRST_ADDRESS).ok_or(updown_error::BASE_ADDRESS)? as usize;
        let values = usize::from(length / 4);
        if values == 0 || !length.is_multiple_of(4) {
            return Err(updown_error::NOT_POSSIBLE);
        }
        let total = match base_address >> 16 {
            0 => first + values,
            total => total as usize,
        };
        if total > UPDOWN_VALUES || first + values > total {
            return Err(updown_error::TOO_LONG);
        }
        Ok(Block { first, values, total })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_cover_a_transfer_exactly_once() {
        for total in [1, 74, 75, 76, 150, 151, UPDOWN_VALUES] {
            let mut block = Some(Block::starting_at(0, total));
            let mut covered = 0;
            while let Some(at) = block {
                assert_eq!(at.first, covered);
                assert!((1..=BLOCK_VALUES).contains(&at.values));
                assert_eq!(Block::of_job(at.base_address(), at.length()), Ok(at));
                covered += at.values;
                block = at.next();
            }
            assert_eq!(covered, total);
        }
    }

    #[test]
    fn invalid_jobs_are_refused() {
        assert_eq!(Block::of_job(0x0000_0100, 300), Ok(Block { first: 0, values: 75, total: 75 }));
        assert_eq!(Block::of_job(0x0000_00FF, 4), Err(0x0105));
        assert_eq!(Block::of_job(0x0001_0000, 4), Err(0x0105));
        assert_eq!(Block::of_job(0x0000_0100, 0), Err(0x0104));
        assert_eq!(Block::of_job(0x0000_0100, 6), Err(0x0104));
        assert_eq!(Block::of_job(0x0002_0100, 12), Err(0x0107));
        assert_eq!(Block::of_job(0x0801_0100, 4), Err(0x0107));
        assert_eq!(Block::of_job(0x0000_0900, 4), Err(0x0107));
    }
}
