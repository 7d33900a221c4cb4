//! Blocks of the display (p. 100-103).

use super::order::{Jobs, Order};
use crate::devices::cs0015::registers::values::job;
use crate::plc::function_block;

function_block! {
    /// Switches segments of the display (p. 101).
    pub struct LCD_SEGMENTS(jobs: Jobs) {
        in {
            /// If TRUE, the call gives the order. If FALSE, the other inputs have no effect.
            CHANGE: bool;
            /// Segments of digit 1 to 5.
            DIGITS: [u8; 5];
            /// Segments of letter 1 to 3.
            LETTERS: [u16; 3];
            /// Digits and letters that blink: bit 0 is digit 1, bit 5 is letter 1.
            BLINK: u8;
            /// Fixed texts; from bit 0 on: CH1, CH2, CH3, CH4, RUN, PRG, TST, KEY.
            STATES: u8;
            /// Decimal points; bit 0 is the point of digit 1.
            POINTS: u8;
        }
        out {
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl LCD_SEGMENTS {
    /// Runs one PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let arguments = [self.CHANGE.into(), self.BLINK.into(), self.STATES.into(), self.POINTS.into()];
        let letters = self.LETTERS.iter().flat_map(|letter| letter.to_le_bytes());
        let data: Vec<u8> = self.DIGITS.into_iter().chain(letters).collect();
        let answer = self.internal.call(jobs, self.CHANGE, job::LCD_SEGMENTS, &arguments, &data);
        self.ANSWERED = answer.is_some();
    }
}

function_block! {
    /// Shows a text (p. 103).
    pub struct LCD_TEXT(jobs: Jobs) {
        in {
            /// If TRUE, the call gives the order. If FALSE, the other inputs have no effect.
            CHANGE: bool;
            /// Characters of the text. A 0 must follow the last character.
            TEXT: [u8; 8];
            /// Digits and letters that blink: bit 0 is digit 1, bit 5 is letter 1.
            BLINK: u8;
            /// Fixed texts; from bit 0 on: CH1, CH2, CH3, CH4, RUN, PRG, TST, KEY.
            STATES: u8;
            /// Decimal points; bit 0 is the point of digit 1.
            POINTS: u8;
        }
        out {
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl LCD_TEXT {
    /// Runs one PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let arguments = [self.CHANGE.into(), self.BLINK.into(), self.STATES.into(), self.POINTS.into()];
        let text = self.TEXT.split(|character| *character == 0).next().unwrap_or_default();
        let answer = self.internal.call(jobs, self.CHANGE, job::LCD_TEXT, &arguments, text);
        self.ANSWERED = answer.is_some();
    }
}
