//! Initialization data: the content of `CANsync_INIT_BMSTRUCT` when the PLC orders its takeover.

use crate::devices::cansync::BaudRate;
use crate::devices::cansync::registers::CANsync_INIT_BMSTRUCT;
use crate::devices::cansync::registers::values::ma_sl_mode;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Source of a master's SYNC signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum SyncSource {
    /// The master generates its own signal (`b_MA_SL_MODE` = 16#00).
    Own,
    /// The master passes on the signal that another node of its device receives (16#02, decision D-12).
    Forwarded,
}

/// Initialization data that the firmware has checked.
#[derive(Clone, Debug)]
pub struct InitData {
    /// Baud rate with its interval and slot times.
    pub timing: &'static BaudRate,
    /// Source of the SYNC signal. It has no meaning on a slave.
    pub sync: SyncSource,
    /// Expected slaves: bit n is set if `a_SL_TYP[n]` is not 16#00. The value is 0 on a slave.
    pub expected: u32,
    /// Acceptance code of the CAN controller, register `b_AC`.
    acceptance_code: u8,
    /// Acceptance mask of the CAN controller, register `b_AM`.
    acceptance_mask: u8,
}

/// Reason why initialization data were refused. The node stays in 16#0002 (decision D-05).
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq, Serialize, Deserialize)]
#[repr(u8)]
pub enum InitFault {
    /// `b_MA_SL_MODE` does not fit the node.
    #[error("b_MA_SL_MODE must be 16#00 or 16#02 on a master and 16#01 on a slave")]
    Mode = 1,
    /// `b_BT_0` and `b_BT_1` are not one of the documented pairs.
    #[error(
        "b_BT_0, b_BT_1 must be a pair of the device's table of baud rates, for example those of CANsync_INIT"
    )]
    BitTiming = 2,
    /// `b_TIME_PATTERN` does not belong to the baud rate.
    #[error("b_TIME_PATTERN must be 1 ms at 1000 kbit/s, 2 ms at 500, 4 ms at 250 and 8 ms at 125")]
    TimePattern = 3,
}

/// [`InitData`] in a snapshot. It contains the row of the baud rate in the device's table, and the other
/// fields.
pub(super) type InitSnapshot = (usize, SyncSource, u32, [u8; 2]);

impl InitData {
    /// Returns the data for a snapshot; `rates` is the device's table.
    pub(super) fn to_snapshot(&self, rates: &'static [BaudRate]) -> InitSnapshot {
        let row = rates.iter().position(|rate| rate == self.timing).unwrap_or(rates.len());
        (row, self.sync, self.expected, [self.acceptance_code, self.acceptance_mask])
    }

    /// Restores the data of a snapshot. Returns `None` if the device has no such rate.
    pub(super) fn from_snapshot(snapshot: InitSnapshot, rates: &'static [BaudRate]) -> Option<Self> {
        let (row, sync, expected, [acceptance_code, acceptance_mask]) = snapshot;
        Some(InitData { timing: rates.get(row)?, sync, expected, acceptance_code, acceptance_mask })
    }
}

impl InitFault {
    /// Returns the fault with this number, as stored in the journal.
    pub fn from_number(number: u8) -> Option<Self> {
        [InitFault::Mode, InitFault::BitTiming, InitFault::TimePattern]
            .into_iter()
            .find(|fault| *fault as u8 == number)
    }
}

impl InitData {
    /// Reads and checks the initialization data of a master node.
    pub(super) fn of_master(
        regs: &CANsync_INIT_BMSTRUCT,
        rates: &'static [BaudRate],
    ) -> Result<Self, InitFault> {
        let sync = match regs.b_MA_SL_MODE.load() {
            ma_sl_mode::MASTER => SyncSource::Own,
            ma_sl_mode::MASTER_SYNC_IN => SyncSource::Forwarded,
            _ => return Err(InitFault::Mode),
        };
        let mut expected = 0;
        for (n, slave_type) in regs.a_SL_TYP.iter().enumerate() {
            // Types above 16#01 are reserved. Slaves with such a type count as expected (decision D-24).
            expected |= u32::from(slave_type.load() != 0) << n;
        }
        Self::common(regs, rates, sync, expected)
    }

    /// Reads and checks the initialization data of a slave node. They contain no slave types.
    pub(super) fn of_slave(
        regs: &CANsync_INIT_BMSTRUCT,
        rates: &'static [BaudRate],
    ) -> Result<Self, InitFault> {
        match regs.b_MA_SL_MODE.load() {
            ma_sl_mode::SLAVE => Self::common(regs, rates, SyncSource::Own, 0),
            _ => Err(InitFault::Mode),
        }
    }

    fn common(
        regs: &CANsync_INIT_BMSTRUCT,
        rates: &'static [BaudRate],
        sync: SyncSource,
        expected: u32,
    ) -> Result<Self, InitFault> {
        let (bt_0, bt_1) = (regs.b_BT_0.load(), regs.b_BT_1.load());
        let timing = rates
            .iter()
            .find(|rate| (rate.b_BT_0, rate.b_BT_1) == (bt_0, bt_1))
            .ok_or(InitFault::BitTiming)?;
        if regs.b_TIME_PATTERN.load() != timing.b_TIME_PATTERN {
            return Err(InitFault::TimePattern);
        }
        Ok(InitData {
            timing,
            sync,
            expected,
            acceptance_code: regs.b_AC.load(),
            acceptance_mask: regs.b_AM.load(),
        })
    }

    /// Returns true if the controller's acceptance filter accepts an identifier. The filter compares the
    /// upper eight bits of the identifier with `b_AC`, but only the bits that are 0 in `b_AM`, like an
    /// SJA1000 in BasicCAN mode (decision D-21).
    #[inline]
    pub fn accepts(&self, identifier: u16) -> bool {
        let upper = (identifier >> 3) as u8;
        (upper ^ self.acceptance_code) & !self.acceptance_mask == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::omega_drive_line_2::registers::{BAUD_RATES, SEGMENT_END};
    use crate::memory::Segment;

    fn regs(mode: u8, bt: (u8, u8), pattern: u8) -> crate::memory::View<CANsync_INIT_BMSTRUCT> {
        let regs = Segment::heap(SEGMENT_END).view::<CANsync_INIT_BMSTRUCT>(200_000).unwrap();
        regs.b_MA_SL_MODE.store(mode);
        regs.b_BT_0.store(bt.0);
        regs.b_BT_1.store(bt.1);
        regs.b_TIME_PATTERN.store(pattern);
        regs.b_AC.store(0xFF);
        regs.b_AM.store(0xFF);
        regs
    }

    /// Manual 5.00005.03a p. 148 and the table of baud rates (p. 125).
    #[test]
    fn only_the_three_documented_pairs_are_accepted() {
        for (bt, pattern, kbit_s) in [((0x00, 0x1C), 2, 500), ((0x01, 0x1C), 4, 250), ((0x03, 0x1C), 8, 125)]
        {
            let data = InitData::of_master(&regs(0, bt, pattern), &BAUD_RATES).unwrap();
            assert_eq!(data.timing.kbit_per_s, kbit_s);
            for wrong in [0, 1, 2, 4, 8].into_iter().filter(|p| *p != pattern) {
                assert_eq!(
                    InitData::of_master(&regs(0, bt, wrong), &BAUD_RATES).unwrap_err(),
                    InitFault::TimePattern,
                    "{kbit_s} kbit/s with {wrong} ms"
                );
            }
        }
        assert_eq!(
            InitData::of_master(&regs(0, (0x40, 0x34), 1), &BAUD_RATES).unwrap_err(),
            InitFault::BitTiming
        );
    }

    #[test]
    fn the_mode_must_fit_the_node() {
        let good = (0x00, 0x1C);
        assert!(InitData::of_slave(&regs(1, good, 2), &BAUD_RATES).is_ok());
        assert_eq!(InitData::of_slave(&regs(0, good, 2), &BAUD_RATES).unwrap_err(), InitFault::Mode);
        assert_eq!(InitData::of_master(&regs(1, good, 2), &BAUD_RATES).unwrap_err(), InitFault::Mode);
        assert_eq!(InitData::of_master(&regs(2, good, 2), &BAUD_RATES).unwrap().sync, SyncSource::Forwarded);
    }

    #[test]
    fn slave_types_select_the_expected_slaves() {
        let regs = regs(0, (0x00, 0x1C), 2);
        regs.a_SL_TYP[3].store(0x01);
        regs.a_SL_TYP[31].store(0x01);
        assert_eq!(InitData::of_master(&regs, &BAUD_RATES).unwrap().expected, 1 << 3 | 1 << 31);
    }

    #[test]
    fn the_acceptance_filter_works_as_in_basic_can() {
        let regs = regs(1, (0x00, 0x1C), 2);
        assert!(InitData::of_slave(&regs, &BAUD_RATES).unwrap().accepts(0x7FF));
        regs.b_AC.store(0x020); // identifiers 16#100..16#107
        regs.b_AM.store(0x00);
        let data = InitData::of_slave(&regs, &BAUD_RATES).unwrap();
        assert!(data.accepts(0x107) && !data.accepts(0x108));
    }

    #[test]
    fn faults_keep_their_numbers() {
        for fault in [InitFault::Mode, InitFault::BitTiming, InitFault::TimePattern] {
            assert_eq!(InitFault::from_number(fault as u8), Some(fault));
        }
        assert_eq!(InitFault::from_number(0), None);
    }
}
