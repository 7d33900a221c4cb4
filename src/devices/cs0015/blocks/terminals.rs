//! Blocks of PWM outputs and fast inputs (p. 86-99).

use super::order::{Jobs, Order, ms};
use crate::devices::cs0015::registers::values::job;
use crate::plc::function_block;
use core::time::Duration;

function_block! {
    /// A PWM output by the values of its counter (p. 92). A call with INIT or CHANGE gives an order.
    pub struct PWM(jobs: Jobs) {
        in {
            /// Makes PWM outputs of the four of its group; then VALUE is 0 %.
            INIT: bool;
            /// Where the counter begins, which is the frequency.
            RELOAD: u16;
            /// The counter is 64 times slower.
            DIV64: bool;
            /// Output, 0 to 7.
            CHANNEL: u8;
            /// Where the counter switches the output on.
            VALUE: u16;
            /// Takes VALUE.
            CHANGE: bool;
            /// Amplitude of the dither.
            DITHER_VALUE: u16;
            /// PWM frequency divided by that of the dither.
            DITHER_DIVIDER: u16;
        }
        out {
            /// The order before has been answered; ours.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl PWM {
    /// One PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let arguments = [
            self.INIT.into(),
            self.RELOAD.into(),
            self.DIV64.into(),
            self.CHANNEL.into(),
            self.VALUE.into(),
            self.CHANGE.into(),
            self.DITHER_VALUE.into(),
            self.DITHER_DIVIDER.into(),
        ];
        let answer = self.internal.call(jobs, self.INIT || self.CHANGE, job::PWM, &arguments, &[]);
        self.ANSWERED = answer.is_some();
    }
}

function_block! {
    /// A PWM output in percent (p. 94). A call with INIT or CHANGE gives an order.
    pub struct PWM100(jobs: Jobs) {
        in {
            /// Makes PWM outputs of the four of its group; then VALUE is 0 %.
            INIT: bool;
            /// In Hz.
            FREQUENCY: u16;
            /// Output, 0 to 7.
            CHANNEL: u8;
            /// In percent.
            VALUE: u8;
            /// Takes VALUE.
            CHANGE: bool;
            /// Amplitude of the dither in percent.
            DITHER_VALUE: u8;
            /// Frequency of the dither in Hz.
            DITHER_FREQUENCY: u16;
        }
        out {
            /// The order before has been answered; ours.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl PWM100 {
    /// One PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let arguments = [
            self.INIT.into(),
            self.FREQUENCY.into(),
            self.CHANNEL.into(),
            self.VALUE.into(),
            self.CHANGE.into(),
            self.DITHER_VALUE.into(),
            self.DITHER_FREQUENCY.into(),
        ];
        let answer = self.internal.call(jobs, self.INIT || self.CHANGE, job::PWM100, &arguments, &[]);
        self.ANSWERED = answer.is_some();
    }
}

function_block! {
    /// Measures the frequency at a fast input (p. 97). Each call gives an order.
    pub struct FREQUENCY(jobs: Jobs) {
        in {
            /// Begins to measure.
            INIT: bool;
            /// Input, 0 to 3.
            CHANNEL: u8;
            /// How long edges are counted.
            TIMEBASE: Duration;
        }
        out {
            /// In Hz.
            F: u16;
            /// The order before has been answered; ours.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl FREQUENCY {
    /// One PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let arguments = [self.INIT.into(), self.CHANNEL.into(), ms(self.TIMEBASE)];
        let answer = self.internal.call(jobs, true, job::FREQUENCY, &arguments, &[]);
        self.ANSWERED = answer.is_some();
        self.F = answer.map_or(self.F, |answer| answer.results[0] as u16);
    }
}

function_block! {
    /// Measures the period at a fast input (p. 98). Each call gives an order.
    pub struct CYCLE(jobs: Jobs) {
        in {
            /// Begins to measure.
            INIT: bool;
            /// Input, 0 to 3.
            CHANNEL: u8;
        }
        out {
            /// In ms.
            C: u16;
            /// The order before has been answered; ours.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl CYCLE {
    /// One PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let arguments = [self.INIT.into(), self.CHANNEL.into()];
        let answer = self.internal.call(jobs, true, job::CYCLE, &arguments, &[]);
        self.ANSWERED = answer.is_some();
        self.C = answer.map_or(self.C, |answer| answer.results[0] as u16);
    }
}

function_block! {
    /// Counts what an encoder at two fast inputs turns (p. 99). Each call gives an order.
    pub struct INC_ENCODER(jobs: Jobs) {
        in {
            /// Begins to count, at 0.
            INIT: bool;
            /// Encoder, 0 or 1.
            CHANNEL: u8;
            /// What PRESET sets the counter to.
            PRESET_VALUE: i32;
            /// Sets the counter; it counts when this is FALSE again.
            PRESET: bool;
        }
        out {
            /// The counter.
            COUNTER: i32;
            /// It has counted up.
            UP: bool;
            /// It has counted down.
            DOWN: bool;
            /// The order before has been answered; ours.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl INC_ENCODER {
    /// One PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let preset = self.PRESET_VALUE.cast_unsigned();
        let arguments = [self.INIT.into(), self.CHANNEL.into(), preset, self.PRESET.into()];
        let answer = self.internal.call(jobs, true, job::INC_ENCODER, &arguments, &[]);
        self.ANSWERED = answer.is_some();
        if let Some(answer) = answer {
            let [counter, is_up, is_down, ..] = answer.results;
            (self.COUNTER, self.UP, self.DOWN) = (counter.cast_signed(), is_up != 0, is_down != 0);
        }
    }
}
