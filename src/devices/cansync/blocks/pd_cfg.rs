//! `CANsync_PD_CFG_MA`, `_PD_CFG_READ_MA`, `_PD_CFG_READ_SL`, `_PD_CFG_SL`: assignment of the words of a frame to
//! values and their halves (p. 233-246).

use super::registers::slave_index;
use crate::devices::cansync::registers::values::last_received;
use crate::devices::cansync::registers::{CANsync_MA_CTRL_BMSTRUCT, CANsync_SL_CTRL_BMSTRUCT, CFG_RDC_WORD};
use crate::memory::Cell8;
use crate::plc::{Base, Like, function_block};
use core::ops::RangeInclusive;

/// The values of frame 1.
const FRAME1: RangeInclusive<u8> = 0..=3;
/// The values of frame 2.
const FRAME2: RangeInclusive<u8> = 4..=7;
/// Number of an unassigned word.
const NONE: i8 = -1;

/// Writes the configuration bytes of one frame. If the frame cannot carry the value with the number of a
/// word, the word stays unassigned (decision D-206).
fn configure(registers: [&Cell8; 4], (numbers, high): WordAssignments, values: RangeInclusive<u8>) {
    for ((register, number), high) in registers.into_iter().zip(numbers).zip(high) {
        register.store(match u8::try_from(number) {
            Ok(number) if values.contains(&number) => 1 | u8::from(high) << 1 | number << 2,
            _ => 0,
        });
    }
}

/// Numbers and halves of the words of one frame.
type WordAssignments = ([i8; 4], [bool; 4]);

fn configure_rdc(cfg: &CFG_RDC_WORD, one: WordAssignments, two: WordAssignments) {
    let words1 = [&cfg.b_CFG_RDC1_WORD0, &cfg.b_CFG_RDC1_WORD1, &cfg.b_CFG_RDC1_WORD2, &cfg.b_CFG_RDC1_WORD3];
    let words2 = [&cfg.b_CFG_RDC2_WORD0, &cfg.b_CFG_RDC2_WORD1, &cfg.b_CFG_RDC2_WORD2, &cfg.b_CFG_RDC2_WORD3];
    configure(words1, one, FRAME1);
    configure(words2, two, FRAME2);
}

/// This is a macro because master and slave have separate structures with equal names.
macro_rules! configure_wrc {
    ($cfg:expr, $one:expr, $two:expr) => {{
        let cfg = $cfg;
        let words1 =
            [&cfg.b_CFG_WRC1_WORD0, &cfg.b_CFG_WRC1_WORD1, &cfg.b_CFG_WRC1_WORD2, &cfg.b_CFG_WRC1_WORD3];
        let words2 =
            [&cfg.b_CFG_WRC2_WORD0, &cfg.b_CFG_WRC2_WORD1, &cfg.b_CFG_WRC2_WORD2, &cfg.b_CFG_WRC2_WORD3];
        configure(words1, $one, FRAME1);
        configure(words2, $two, FRAME2);
    }};
}

function_block! {
    /// Maps reference values into the reference value frames of a master (manual p. 233-235).
    ///
    /// The call writes the mapping. It also re-arms the detection of received actual values (decision D-207).
    pub struct CANsync_PD_CFG_MA(_BASE: Base<CANsync_MA_CTRL_BMSTRUCT>) {
        in {
            /// Reference value (0 to 3) in each word of frame 1; -1 (default): none.
            a_WRC1: [i8; 4] = [NONE; 4];
            /// TRUE: the high word of this value; FALSE: its low word.
            a_HL_WRC1: [bool; 4];
            /// Reference value (4 to 7) in each word of frame 2; -1 (default): none.
            a_WRC2: [i8; 4] = [NONE; 4];
            /// TRUE: the high word of this value; FALSE: its low word.
            a_HL_WRC2: [bool; 4];
        }
    }
}

impl CANsync_PD_CFG_MA {
    /// Runs one PLC cycle.
    pub fn call(&mut self, _BASE: &Base<impl Like<CANsync_MA_CTRL_BMSTRUCT>>) {
        let _BASE = &_BASE.viewed();
        configure_wrc!(&_BASE._CFG_WRC_WORD, (self.a_WRC1, self.a_HL_WRC1), (self.a_WRC2, self.a_HL_WRC2));
        _BASE.b_STATREG_RDC1.store(last_received::RE_ARMED);
        _BASE.b_STATREG_RDC2.store(last_received::RE_ARMED);
    }
}

macro_rules! read {
    ($name:ident, $base:ident, $owner:literal, $page:literal) => {
        function_block! {
            #[doc = concat!("Maps the actual value frames of one slave to actual values of ", $owner)]
            #[doc = concat!("(manual p. ", $page, ").")]
            pub struct $name(_BASE: Base<$base>) {
                in {
                    /// The slave that sends the frames, 0 to 31. Other numbers have no effect.
                    si_SL_NR: i8;
                    /// Actual value (0 to 3) for each word of frame 1; -1 (default): none.
                    a_RDC1: [i8; 4] = [NONE; 4];
                    /// TRUE: the high word of this value; FALSE: its low word.
                    a_HL_RDC1: [bool; 4];
                    /// Actual value (4 to 7) for each word of frame 2; -1 (default): none.
                    a_RDC2: [i8; 4] = [NONE; 4];
                    /// TRUE: the high word of this value; FALSE: its low word.
                    a_HL_RDC2: [bool; 4];
                }
            }
        }

        impl $name {
            /// Runs one PLC cycle.
            pub fn call(&mut self, _BASE: &Base<impl Like<$base>>) {
                let _BASE = &_BASE.viewed();
                let slave = slave_index(self.si_SL_NR);
                if let Some(cfg) = slave.and_then(|slave| _BASE.a_CFG_RDC_WORD.get(slave)) {
                    configure_rdc(cfg, (self.a_RDC1, self.a_HL_RDC1), (self.a_RDC2, self.a_HL_RDC2));
                }
            }
        }
    };
}

read!(CANsync_PD_CFG_READ_MA, CANsync_MA_CTRL_BMSTRUCT, "the master", "236-238");
read!(CANsync_PD_CFG_READ_SL, CANsync_SL_CTRL_BMSTRUCT, "another slave", "239-241");

function_block! {
    /// Maps the reference value frames of a slave to reference values, and its own actual values into its
    /// actual value frames (manual p. 242-246).
    ///
    /// The call also re-arms the detection of overheard actual values (decision D-207).
    pub struct CANsync_PD_CFG_SL(_BASE: Base<CANsync_SL_CTRL_BMSTRUCT>) {
        in {
            /// Reference value (0 to 3) for each word of frame 1; -1 (default): none.
            a_WRC1: [i8; 4] = [NONE; 4];
            /// TRUE: the high word of this value; FALSE: its low word.
            a_HL_WRC1: [bool; 4];
            /// Reference value (4 to 7) for each word of frame 2; -1 (default): none.
            a_WRC2: [i8; 4] = [NONE; 4];
            /// TRUE: the high word of this value; FALSE: its low word.
            a_HL_WRC2: [bool; 4];
            /// Own actual value (0 to 3) in each word of frame 1; -1 (default): none.
            a_RDC1: [i8; 4] = [NONE; 4];
            /// TRUE: the high word of this value; FALSE: its low word.
            a_HL_RDC1: [bool; 4];
            /// Own actual value (4 to 7) in each word of frame 2; -1 (default): none.
            a_RDC2: [i8; 4] = [NONE; 4];
            /// TRUE: the high word of this value; FALSE: its low word.
            a_HL_RDC2: [bool; 4];
        }
    }
}

impl CANsync_PD_CFG_SL {
    /// Runs one PLC cycle.
    pub fn call(&mut self, _BASE: &Base<impl Like<CANsync_SL_CTRL_BMSTRUCT>>) {
        let _BASE = &_BASE.viewed();
        configure_wrc!(&_BASE._CFG_WRC_WORD, (self.a_WRC1, self.a_HL_WRC1), (self.a_WRC2, self.a_HL_WRC2));
        configure_rdc(&_BASE._CFG_RDC_WORD, (self.a_RDC1, self.a_HL_RDC1), (self.a_RDC2, self.a_HL_RDC2));
        _BASE.b_STATREG_RDC1.store(last_received::RE_ARMED);
        _BASE.b_STATREG_RDC2.store(last_received::RE_ARMED);
    }
}
