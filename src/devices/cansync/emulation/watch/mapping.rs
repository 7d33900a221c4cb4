//! Rules about the mapping of whole frames. A program writes a mapping byte by byte, so the checker checks
//! the mapping only when the firmware takes it over.

use super::judge::Judge;
use crate::devices::cansync::registers::values::{cfg_word, request};
use crate::devices::cansync::registers::{
    CANsync_MA_CTRL_BMSTRUCT as Master, CANsync_SL_CTRL_BMSTRUCT as Slave, CFG_RDC_WORD,
};
use crate::devices::cansync::rules;
use core::mem::offset_of;

/// Number of words of both frames together.
const WORDS: usize = 8;

/// Checks the mapping of a node.
pub(super) fn judge(judge: &mut Judge) {
    let (single, others): (&[usize], usize) = if judge.facts.is_master {
        (&[offset_of!(Master, _CFG_WRC_WORD)], offset_of!(Master, a_CFG_RDC_WORD))
    } else {
        let own = [offset_of!(Slave, _CFG_WRC_WORD), offset_of!(Slave, _CFG_RDC_WORD)];
        (&{ own }, offset_of!(Slave, a_CFG_RDC_WORD))
    };
    let others = (0..32).map(|slave| others + slave * size_of::<CFG_RDC_WORD>());
    for group in single.iter().copied().chain(others) {
        split_doublewords(judge, group);
    }
    if judge.facts.is_master {
        requests(judge);
    }
}

/// Finds values with halves in different frames: one frame contains only one half of the value, and the other
/// frame only the other half.
fn split_doublewords(judge: &mut Judge, group: usize) {
    let config: [u8; WORDS] = core::array::from_fn(|word| judge.registers.now(group + word));
    // For each frame, two bit sets of values: the values that have their low word in the frame, and the
    // values that have their high word in the frame.
    let mut halves = [[0u8; 2]; 2];
    for (word, byte) in config.iter().enumerate().filter(|(_, byte)| **byte & cfg_word::ASSIGNED != 0) {
        halves[word / 4][usize::from(byte & cfg_word::HIGH_WORD != 0)] |= value_bit(*byte);
    }
    let [[low1, high1], [low2, high2]] = halves;
    let split = low1 & high2 & !(high1 | low2) | low2 & high1 & !(high2 | low1);
    for (word, byte) in config.iter().enumerate() {
        let is_low_word_of_split = byte & (cfg_word::ASSIGNED | cfg_word::HIGH_WORD) == cfg_word::ASSIGNED
            && value_bit(*byte) & split != 0;
        if is_low_word_of_split {
            judge.report_violation(&rules::SPLIT_DOUBLEWORD, group + word, (*byte).into());
        }
    }
}

/// Returns the bit of the value that a configuration byte selects. The result is 0 for value numbers above 7.
fn value_bit(byte: u8) -> u8 {
    let number = (byte & cfg_word::NUMBER) >> cfg_word::NUMBER.trailing_zeros();
    1u8.checked_shl(number.into()).unwrap_or(0)
}

/// Finds expected slaves that the automatic requests for actual values never reach.
fn requests(judge: &mut Judge) {
    let orders = [offset_of!(Master, b_CTRLREG_RD_ORDER_RDC1), offset_of!(Master, b_CTRLREG_RD_ORDER_RDC2)];
    let max = judge.registers.now(offset_of!(Master, b_MAX_SL_NR));
    let never_asked = judge.facts.expected.checked_shr(u32::from(max) + 1).unwrap_or(0);
    if never_asked != 0 && orders.iter().any(|&order| judge.registers.now(order) == request::AUTOMATIC) {
        judge.report_violation(&rules::NOT_REQUESTED, offset_of!(Master, b_MAX_SL_NR), max.into());
    }
}
