//! Actual value frames as master and slave node receive them (manual 5.00005.03a p. 155-159, 182-187).
//!
//! The cyclic structures of master and slave contain these registers under equal names. The trait gives
//! access to them in both structures.

use super::word_config::WordConfigs;
use crate::devices::cansync::frames::codec::process::FrameConfig;
use crate::devices::cansync::frames::{Channel, Frame};
use crate::devices::cansync::registers::values::receive;
use crate::devices::cansync::registers::{CANsync_MA_CTRL_BMSTRUCT, CANsync_SL_CTRL_BMSTRUCT};
use crate::memory::{Cell8, Cell32};

/// The registers in which the actual values of slaves are received.
pub(super) trait ActualValueRegisters {
    /// Register `b_STATREG_RDCx`: the slave with the last answer.
    fn last_slave(&self, channel: Channel) -> &Cell8;
    /// Register `a_STATREG_RDC[slave].b_STATREG_RDCx`.
    fn acknowledgement(&self, slave: usize, channel: Channel) -> Option<&Cell8>;
    /// Registers `a_CFG_RDC_WORD[slave].b_CFG_RDCx_WORD0..3`, with the mapping of the words.
    fn config(&self, slave: usize, channel: Channel) -> Option<[u8; 4]>;
    /// Register `a_RD_BMARRAY[slave][number]`.
    fn value(&self, slave: usize, number: u8) -> Option<&Cell32>;

    /// Takes over a frame of `slave`. Writes the words, as configured at this moment, then the
    /// acknowledgement of the slave, then the acknowledgement of the channel.
    #[inline]
    fn receive(&self, channel: Channel, slave: u8, frame: &Frame) {
        let index = usize::from(slave);
        let (Some(config), Some(acknowledgement)) =
            (self.config(index, channel), self.acknowledgement(index, channel))
        else {
            return; // The slave number in the identifier is above 31. No register belongs to it.
        };
        FrameConfig::new(config).scatter(frame.payload(), |number, high_word, word| {
            if let Some(cell) = self.value(index, number) {
                store_word(cell, high_word, word);
            }
        });
        acknowledgement.store(receive::RECEIVED);
        self.last_slave(channel).store(slave);
    }
}

/// Stores a received word in one half of a value. The other half does not change.
#[inline]
pub(super) fn store_word(cell: &Cell32, high_word: bool, word: u16) {
    let old = cell.load();
    cell.store(if high_word {
        old & 0x0000_FFFF | u32::from(word) << 16
    } else {
        old & 0xFFFF_0000 | u32::from(word)
    });
}

macro_rules! actual_value_registers {
    ($structure:ty) => {
        impl ActualValueRegisters for $structure {
            #[inline]
            fn last_slave(&self, channel: Channel) -> &Cell8 {
                match channel {
                    Channel::One => &self.b_STATREG_RDC1,
                    Channel::Two => &self.b_STATREG_RDC2,
                }
            }

            #[inline]
            fn acknowledgement(&self, slave: usize, channel: Channel) -> Option<&Cell8> {
                let registers = self.a_STATREG_RDC.get(slave)?;
                Some(match channel {
                    Channel::One => &registers.b_STATREG_RDC1,
                    Channel::Two => &registers.b_STATREG_RDC2,
                })
            }

            #[inline]
            fn config(&self, slave: usize, channel: Channel) -> Option<[u8; 4]> {
                Some(self.a_CFG_RDC_WORD.get(slave)?.words(channel))
            }

            #[inline]
            fn value(&self, slave: usize, number: u8) -> Option<&Cell32> {
                self.a_RD_BMARRAY.get(slave)?.get(usize::from(number))
            }
        }
    };
}

actual_value_registers!(CANsync_MA_CTRL_BMSTRUCT);
actual_value_registers!(CANsync_SL_CTRL_BMSTRUCT);
