//! `BAPS_PD_COMM24`: process data with two reference and four actual values in every communication, and
//! re-initialization while they run (p. 104-111).

use super::OMEGA_DRIVE_LINE_II;
use super::pd_comm::{NOT_EXCHANGED, exchange, is_error};
use crate::devices::omega_drive_line_2::registers::BAPS_CTRL_BMSTRUCT;
use crate::devices::omega_drive_line_2::registers::values::{baps_command, baps_quit};
use crate::plc::{Base, Watch, function_block};
use core::time::Duration;

/// Bit 1 of `b_ERR`.
const TIMEOUT: u8 = 1 << 1;

function_block! {
    /// Exchanges control word, status word, two reference values and four actual values with the drive. The
    /// block can also change the parameter numbers during the exchange (manual p. 104-111).
    ///
    /// A rising edge of `x_RE_INIT_START` begins the re-initialization. [`BAPS_INIT`](super::BAPS_INIT) with
    /// `us_MODE` 2 must have written the numbers before. The result stays until the next rising edge
    /// (decision D-217).
    pub struct BAPS_PD_COMM24(_BASE: Base<BAPS_CTRL_BMSTRUCT>) {
        in {
            /// 0: Omega Drive-Line II; with any other value the block does nothing.
            us_HW_TYPE: u8;
            /// Control word for the drive.
            w_CONTROLWORD: u16;
            /// Transmission method and cycle time, as at `BAPS_INIT`. Another value changes them.
            w_COMMAND_REG: u16;
            /// Task that calls the block: 0 any task, 1 the event task "BAPS process data". The input has no effect in
            /// commram.
            us_MODE: u8;
            /// Reference value 0 for the drive.
            ud_WR_VALUE0: u32;
            /// Reference value 1 for the drive.
            ud_WR_VALUE1: u32;
            /// Monitoring time of a re-initialization, in emulated time; preset 1 s.
            t_RE_INIT_TIME: Duration = Duration::from_secs(1);
            /// A rising edge starts the re-initialization.
            x_RE_INIT_START: bool;
            /// Enables the exchange; TRUE by default.
            x_EN: bool = true;
        }
        out {
            /// Status word of the drive.
            w_STATUSWORD: u16;
            /// Bit 0: the drive is synchronized to the trigger controller.
            w_STATUS_REG: u16;
            /// Actual value 0 of the drive.
            ud_RD_VALUE0: u32;
            /// Actual value 1 of the drive.
            ud_RD_VALUE1: u32;
            /// Actual value 2 of the drive.
            ud_RD_VALUE2: u32;
            /// Actual value 3 of the drive.
            ud_RD_VALUE3: u32;
            /// Acknowledgement of the drive.
            b_SL_QUIT: u8;
            /// Bit 0: the drive has not exchanged the values; `b_SL_QUIT` gives the reason. Bit 1: timeout of
            /// a re-initialization.
            b_ERR: u8;
            /// `b_ERR` is not 0.
            x_ERR: bool;
            /// The last re-initialization has failed; `b_SL_QUIT` gives the reason.
            x_RE_INIT_ERR: bool;
            /// The last re-initialization has succeeded.
            x_RE_INIT_OK: bool;
        }
        internal: Internal;
    }
}

/// Internal state of the block.
#[derive(Clone, Debug, Default)]
pub struct Internal {
    start: bool,
    re_initialization: Option<Watch>,
    /// The last command given.
    command: u8,
}

impl BAPS_PD_COMM24 {
    /// Runs one PLC cycle.
    pub fn call(&mut self, _BASE: &Base<BAPS_CTRL_BMSTRUCT>) {
        if self.us_HW_TYPE != OMEGA_DRIVE_LINE_II {
            return;
        }
        let edge = self.x_RE_INIT_START && !self.internal.start;
        self.internal.start = self.x_RE_INIT_START;
        if !self.x_EN {
            return;
        }
        // If the drive has cleared the command register, it has answered the last command.
        let answered = _BASE.b_COMMAND.load() == 0;
        self.b_SL_QUIT = _BASE.b_SL_QUIT.load();
        self.w_STATUSWORD = _BASE.w_STATUSWORD.load();
        self.w_STATUS_REG = _BASE.w_STATUS_REG.load();
        if edge {
            (self.x_RE_INIT_OK, self.x_RE_INIT_ERR) = (false, false);
            self.b_ERR = 0;
            self.internal.re_initialization = Some(_BASE.ram().watch(self.t_RE_INIT_TIME));
        } else if let Some(watch) = self.internal.re_initialization {
            self.watch_re_initialization(_BASE, watch, answered);
        }
        let command = match self.internal.re_initialization {
            Some(_) => baps_command::RE_INITIALIZE,
            None => baps_command::EXCHANGE,
        };
        let actuals = &mut [
            &mut self.ud_RD_VALUE0,
            &mut self.ud_RD_VALUE1,
            &mut self.ud_RD_VALUE2,
            &mut self.ud_RD_VALUE3,
        ];
        let words = [self.w_CONTROLWORD, self.w_COMMAND_REG];
        exchange(_BASE, command, words, &[self.ud_WR_VALUE0, self.ud_WR_VALUE1], actuals);
        self.internal.command = command;
        let of_re_initialization =
            [baps_quit::RE_INITIALIZING, baps_quit::RE_INIT_UNWRITABLE, baps_quit::RE_INIT_UNREADABLE];
        self.b_ERR &= TIMEOUT;
        if is_error(self.b_SL_QUIT) && !of_re_initialization.contains(&self.b_SL_QUIT) {
            self.b_ERR |= NOT_EXCHANGED;
        }
        self.x_ERR = self.b_ERR != 0;
    }

    /// Ends a re-initialization when the drive has answered, or when the monitoring time has run out.
    fn watch_re_initialization(&mut self, base: &Base<BAPS_CTRL_BMSTRUCT>, watch: Watch, answered: bool) {
        let answer =
            (answered && self.internal.command == baps_command::RE_INITIALIZE).then_some(self.b_SL_QUIT);
        match answer {
            Some(baps_quit::RE_INITIALIZING) | None if watch.is_over(base.ram()) => self.b_ERR |= TIMEOUT,
            Some(baps_quit::RE_INITIALIZING) | None => return,
            Some(baps_quit::EXCHANGED) => self.x_RE_INIT_OK = true,
            Some(_) => self.x_RE_INIT_ERR = true,
        }
        self.internal.re_initialization = None;
    }
}
