//! `LED`, `OPT_INIT`, `TIME_MEASURE_START`, `TIME_MEASURE_END`: blocks of the board
//! (manual 5.00005.03a p. 47, 51, 56-60).
//!
//! On the device, these blocks call the firmware and have no registers. Here they use the header page
//! (`docs/reference/attach.md`).

use crate::devices::intr_set::Request;
use crate::memory::header::OptInitResult;
use crate::plc::{Ram, function_block};

function_block! {
    /// Sets the LEDs on the board's front panel (manual p. 51).
    pub struct LED(ram: Ram) {
        in {
            /// Bits of the LEDs: bit 0 upper red, bit 1 upper green, bit 2 lower red, bit 3 lower green. The
            /// other bits have no meaning.
            b_LEDS: u8;
        }
    }
}

impl LED {
    /// Runs one PLC cycle.
    pub fn call(&mut self, ram: &Ram) {
        ram.header().board.leds.store(u32::from(self.b_LEDS & 0x0F));
    }
}

function_block! {
    /// Routes triggers and starts board timers (manual p. 56-60). The block may run once in each start of the
    /// program (D-260).
    ///
    /// The first call submits the inputs. The program must call the block until `x_OK` or `x_ERR` is TRUE.
    /// Later calls do nothing, unless the board has been reset (decisions D-213, D-214).
    pub struct OPT_INIT(ram: Ram) {
        in {
            /// Mode of trigger 1 (option card IEI-02); 0: no source is connected.
            us_MODE_TRIGGER_1: u8;
            /// Mode of trigger 2 (option card MFM-01); 0: no source is connected.
            us_MODE_TRIGGER_2: u8;
            /// Mode of the trigger controller (drive).
            us_MODE_TRIGGER_CONTROLLER: u8;
            /// Divider of board timer A: its period is (divider + 1) x 2 / 5 MHz.
            u_DIVIDER_TIMER_A: u16;
            /// Starts board timer A.
            x_EN_TIMER_A: bool;
            /// Clock of board timer A; 0: 5 MHz.
            ud_CFG_MODE_TIMER_A: u32;
            /// Divider of board timer B.
            u_DIVIDER_TIMER_B: u16;
            /// Starts board timer B.
            x_EN_TIMER_B: bool;
            /// Clock of board timer B; 0: 5 MHz.
            ud_CFG_MODE_TIMER_B: u32;
        }
        out {
            /// The inputs were refused, or `OPT_INIT` has already run in this start of the program.
            x_ERR: bool;
            /// Triggers are routed, timers run.
            x_OK: bool;
        }
        internal: Option<Request>;
    }
}

impl OPT_INIT {
    /// Runs one PLC cycle.
    pub fn call(&mut self, ram: &Ram) {
        let slot = &ram.header().opt_init;
        match self.internal.filter(|request| request.is_of_this_life(ram)) {
            Some(request) => {
                if let Some(result) = slot.outcome(request.number()).filter(|_| !self.x_OK && !self.x_ERR) {
                    self.x_OK = result == OptInitResult::Done.code();
                    self.x_ERR = !self.x_OK;
                }
            }
            None => {
                (self.x_OK, self.x_ERR) = (false, false);
                let modes = [self.us_MODE_TRIGGER_1, self.us_MODE_TRIGGER_2, self.us_MODE_TRIGGER_CONTROLLER];
                slot.triggers.iter().zip(modes).for_each(|(cell, mode)| cell.store(mode.into()));
                let timers = [
                    (self.u_DIVIDER_TIMER_A, self.x_EN_TIMER_A, self.ud_CFG_MODE_TIMER_A),
                    (self.u_DIVIDER_TIMER_B, self.x_EN_TIMER_B, self.ud_CFG_MODE_TIMER_B),
                ];
                for (cells, (divider, enable, cfg_mode)) in slot.timers.iter().zip(timers) {
                    cells.divider.store(divider.into());
                    cells.enable.store(enable.into());
                    cells.cfg_mode.store(cfg_mode);
                }
                self.internal = Some(Request::new(ram, slot.ask()));
            }
        }
    }
}

function_block! {
    /// Notes the time at the start of a piece of code (manual p. 47). Pins: decision D-214.
    pub struct TIME_MEASURE_START(ram: Ram) {
        out {
            /// Emulated time in microseconds, which wraps around. It is the input of [`TIME_MEASURE_END`].
            ud_TIME: u32;
        }
    }
}

impl TIME_MEASURE_START {
    /// Runs one PLC cycle.
    pub fn call(&mut self, ram: &Ram) {
        self.ud_TIME = ram.exact_us() as u32;
    }
}

function_block! {
    /// Returns the run time of a piece of code (manual p. 47). With a stepped clock the result is the
    /// emulated time that has passed between the two blocks. Pins: decision D-214.
    pub struct TIME_MEASURE_END(ram: Ram) {
        in {
            /// The output of [`TIME_MEASURE_START`].
            ud_TIME: u32;
        }
        out {
            /// Emulated time since then in microseconds.
            ud_TIME_DIFF: u32;
        }
    }
}

impl TIME_MEASURE_END {
    /// Runs one PLC cycle.
    pub fn call(&mut self, ram: &Ram) {
        self.ud_TIME_DIFF = (ram.exact_us() as u32).wrapping_sub(self.ud_TIME);
    }
}
