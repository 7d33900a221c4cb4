//! Blocks of PWM outputs and fast inputs (p. 86-99).

use super::order::{Jobs, Order, ms};
use crate::devices::cs0015::registers::values::job;
use crate::plc::function_block;
use core::time::Duration;

function_block! {
    /// A PWM output. Its values are those of the counter (p. 92). A call with INIT or CHANGE gives an order.
    pub struct PWM(jobs: Jobs) {
        in {
            /// Makes the four outputs of the group PWM outputs. VALUE of this output is then 0 %.
            INIT: bool;
            /// Start value of the counter. It determines the frequency.
            RELOAD: u16;
            /// Makes the counter 64 times slower.
            DIV64: bool;
            /// Output, 0 to 7.
            CHANNEL: u8;
            /// Counter value that switches the output on.
            VALUE: u16;
            /// TRUE takes over VALUE.
            CHANGE: bool;
            /// Amplitude of the dither.
            DITHER_VALUE: u16;
            /// PWM frequency divided by the frequency of the dither.
            DITHER_DIVIDER: u16;
        }
        out {
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl PWM {
    /// Runs one PLC cycle.
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
            /// Makes the four outputs of the group PWM outputs. VALUE of this output is then 0 %.
            INIT: bool;
            /// Frequency of the output in Hz.
            FREQUENCY: u16;
            /// Output, 0 to 7.
            CHANNEL: u8;
            /// Duty cycle in percent.
            VALUE: u8;
            /// TRUE takes over VALUE.
            CHANGE: bool;
            /// Amplitude of the dither in percent.
            DITHER_VALUE: u8;
            /// Frequency of the dither in Hz.
            DITHER_FREQUENCY: u16;
        }
        out {
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl PWM100 {
    /// Runs one PLC cycle.
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
            /// TRUE starts the measurement.
            INIT: bool;
            /// Input, 0 to 3.
            CHANNEL: u8;
            /// Time for counting edges.
            TIMEBASE: Duration;
        }
        out {
            /// Measured frequency in Hz.
            F: u16;
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl FREQUENCY {
    /// Runs one PLC cycle.
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
            /// TRUE starts the measurement.
            INIT: bool;
            /// Input, 0 to 3.
            CHANNEL: u8;
        }
        out {
            /// Measured period in ms.
            C: u16;
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl CYCLE {
    /// Runs one PLC cycle.
    pub fn call(&mut self, jobs: &Jobs) {
        let arguments = [self.INIT.into(), self.CHANNEL.into()];
        let answer = self.internal.call(jobs, true, job::CYCLE, &arguments, &[]);
        self.ANSWERED = answer.is_some();
        self.C = answer.map_or(self.C, |answer| answer.results[0] as u16);
    }
}

function_block! {
    /// Counts the steps of an encoder at two fast inputs (p. 99). Each call gives an order.
    pub struct INC_ENCODER(jobs: Jobs) {
        in {
            /// Starts to count, at 0.
            INIT: bool;
            /// Encoder, 0 or 1.
            CHANNEL: u8;
            /// Counter value that PRESET sets.
            PRESET_VALUE: i32;
            /// Sets the counter; FALSE: the counter runs.
            PRESET: bool;
        }
        out {
            /// Value of the counter.
            COUNTER: i32;
            /// The counter has counted up.
            UP: bool;
            /// The counter has counted down.
            DOWN: bool;
            /// The previous order has been answered. commram has added this output.
            ANSWERED: bool;
        }
        internal: Order;
    }
}

impl INC_ENCODER {
    /// Runs one PLC cycle.
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
