//! The configuration bytes of a frame's four words. They have the same form in each structure that contains
//! them.

use crate::devices::cansync::frames::Channel;
use crate::devices::cansync::registers::{CFG_RDC_WORD, CFG_WRC_WORD_MA, CFG_WRC_WORD_SL};

/// A sub-structure with `b_CFG_..1_WORD0..3` and `b_CFG_..2_WORD0..3`.
pub(super) trait WordConfigs {
    /// Returns the bytes of words 0 to 3 of frame 1 or 2.
    fn words(&self, channel: Channel) -> [u8; 4];

    /// Returns the bytes of both frames.
    #[inline]
    fn of_both_frames(&self) -> [[u8; 4]; 2] {
        Channel::ALL.map(|channel| self.words(channel))
    }
}

macro_rules! word_configs {
    ($($structure:ty => [$($one:ident),+], [$($two:ident),+];)+) => {$(
        impl WordConfigs for $structure {
            #[inline]
            fn words(&self, channel: Channel) -> [u8; 4] {
                match channel {
                    Channel::One => [$(self.$one.load()),+],
                    Channel::Two => [$(self.$two.load()),+],
                }
            }
        }
    )+};
}

word_configs! {
    CFG_WRC_WORD_MA =>
        [b_CFG_WRC1_WORD0, b_CFG_WRC1_WORD1, b_CFG_WRC1_WORD2, b_CFG_WRC1_WORD3],
        [b_CFG_WRC2_WORD0, b_CFG_WRC2_WORD1, b_CFG_WRC2_WORD2, b_CFG_WRC2_WORD3];
    CFG_WRC_WORD_SL =>
        [b_CFG_WRC1_WORD0, b_CFG_WRC1_WORD1, b_CFG_WRC1_WORD2, b_CFG_WRC1_WORD3],
        [b_CFG_WRC2_WORD0, b_CFG_WRC2_WORD1, b_CFG_WRC2_WORD2, b_CFG_WRC2_WORD3];
    CFG_RDC_WORD =>
        [b_CFG_RDC1_WORD0, b_CFG_RDC1_WORD1, b_CFG_RDC1_WORD2, b_CFG_RDC1_WORD3],
        [b_CFG_RDC2_WORD0, b_CFG_RDC2_WORD1, b_CFG_RDC2_WORD2, b_CFG_RDC2_WORD3];
}

#[cfg(test)]
mod tests {
    use super::*;
    use zerocopy::FromZeros;

    #[test]
    fn each_frame_has_four_separate_bytes() {
        let config = CFG_RDC_WORD::new_zeroed();
        config.b_CFG_RDC1_WORD0.store(0x01);
        config.b_CFG_RDC1_WORD3.store(0x0D);
        config.b_CFG_RDC2_WORD1.store(0x13);
        assert_eq!(config.of_both_frames(), [[0x01, 0, 0, 0x0D], [0, 0x13, 0, 0]]);
    }
}
