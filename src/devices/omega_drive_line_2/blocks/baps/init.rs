//! `BAPS_INIT`: configures the process data (p. 86-92).

use super::OMEGA_DRIVE_LINE_II;
use crate::devices::omega_drive_line_2::blocks::INTR_SET;
use crate::devices::omega_drive_line_2::registers::BAPS_CTRL_BMSTRUCT;
use crate::devices::omega_drive_line_2::registers::values::{baps_command, baps_quit};
use crate::plc::{Base, Watch, function_block};
use core::time::Duration;

/// Bit 0 of `b_ERR`.
const NOT_CONFIGURED: u8 = 1 << 0;
/// Bit 3 of `b_ERR`: invalid event number.
const EVENT_NUMBER: u8 = 1 << 3;
/// Bit 4 of `b_ERR`: timeout.
const TIMEOUT: u8 = 1 << 4;
/// Bit 5 of `b_ERR`: the event was refused.
const EVENT_REFUSED: u8 = 1 << 5;

macro_rules! block {
    ($([$index:literal $wr:ident $rd:ident])*) => {
        function_block! {
            /// Configures the parameters and the cycle time of the process data exchange in the drive (manual p.
            /// 86-92).
            ///
            /// The program must call the block until `x_OK` or `x_ERR` is TRUE. With `us_MODE` 2, a call only
            /// writes the new numbers for [`BAPS_PD_COMM24`](super::BAPS_PD_COMM24), and `x_OK` and `x_ERR`
            /// do not change.
            pub struct BAPS_INIT(_BASE: Base<BAPS_CTRL_BMSTRUCT>) {
                in {
                    /// 0: Omega Drive-Line II; with any other value the block does nothing.
                    us_HW_TYPE: u8;
                    /// Event "BAPS process data" that is enabled: 4 or 8; 0 (default): no event.
                    i_EVENT: i16;
                    /// Transmission method and cycle time, see `docs/devices/omega-drive-line-2/baps.md`.
                    w_COMMAND_REG: u16;
                    /// 0: first initialization; 1: initialization while process data are stopped; 2: initialization
                    /// while process data run.
                    us_MODE: u8;
                    $(
                        #[doc = concat!("Parameter number of reference value ", $index, "; 0: none.")]
                        $wr: u16;
                    )*
                    $(
                        #[doc = concat!("Parameter number of actual value ", $index, "; 0: none.")]
                        $rd: u16;
                    )*
                    /// Monitoring time in emulated time; preset 3 s.
                    t_TIME: Duration = Duration::from_secs(3);
                    /// Enables the initialization; TRUE by default.
                    x_EN: bool = true;
                    /// Resets the block; needed after an error.
                    x_RESET: bool;
                }
                out {
                    /// Bit 0: the drive is synchronized to the trigger controller.
                    w_STATUS_REG: u16;
                    /// The initialization is in progress. The output can be TRUE only with `us_MODE` 1.
                    x_BUSY: bool;
                    /// Acknowledgement of the drive.
                    b_SL_QUIT: u8;
                    /// Bit 0: `b_SL_QUIT` is not 16#02; bit 3: `i_EVENT` is not 0, 4 or 8; bit 4: timeout;
                    /// bit 5: the event was refused.
                    b_ERR: u8;
                    /// `b_ERR` is not 0.
                    x_ERR: bool;
                    /// The BAPS, and the event if it is used, are initialized.
                    x_OK: bool;
                }
                internal: Internal;
            }
        }

        impl BAPS_INIT {
            fn numbers(&self) -> [[u16; 8]; 2] {
                [[$(self.$wr),*], [$(self.$rd),*]]
            }
        }
    };
}

block! {
    [0 u_WR_PAR_NR0 u_RD_PAR_NR0]
    [1 u_WR_PAR_NR1 u_RD_PAR_NR1]
    [2 u_WR_PAR_NR2 u_RD_PAR_NR2]
    [3 u_WR_PAR_NR3 u_RD_PAR_NR3]
    [4 u_WR_PAR_NR4 u_RD_PAR_NR4]
    [5 u_WR_PAR_NR5 u_RD_PAR_NR5]
    [6 u_WR_PAR_NR6 u_RD_PAR_NR6]
    [7 u_WR_PAR_NR7 u_RD_PAR_NR7]
}

/// Internal state of the block.
#[derive(Clone, Debug, Default)]
pub struct Internal {
    phase: Phase,
    event: INTR_SET,
}

#[derive(Clone, Copy, Debug, Default)]
enum Phase {
    #[default]
    Idle,
    /// The drive has the configuration.
    Configuring(Watch),
    /// The board has the event.
    Enabling(Watch),
    /// Ends when `x_EN` falls.
    Done,
    /// Failed: only `x_RESET` helps.
    Locked,
}

impl BAPS_INIT {
    /// Runs one PLC cycle.
    pub fn call(&mut self, _BASE: &Base<BAPS_CTRL_BMSTRUCT>) {
        if self.us_HW_TYPE != OMEGA_DRIVE_LINE_II {
            return;
        }
        self.w_STATUS_REG = _BASE.w_STATUS_REG.load();
        if self.x_RESET {
            return self.end(Phase::Idle, 0);
        }
        match (self.us_MODE, self.x_EN) {
            (2, true) => return self.write_new_numbers(_BASE),
            (0 | 1, true) => {}
            _ => {
                if !matches!(self.internal.phase, Phase::Locked) {
                    self.internal.phase = Phase::Idle;
                    self.x_BUSY = false;
                }
                return;
            }
        }
        if let Phase::Idle = self.internal.phase {
            self.begin(_BASE);
        }
        if let Phase::Configuring(watch) = self.internal.phase {
            if _BASE.b_COMMAND.load() == 0 {
                self.configured(_BASE, watch);
            } else if watch.is_over(_BASE.ram()) {
                self.end(Phase::Locked, TIMEOUT);
            }
        }
        if let Phase::Enabling(watch) = self.internal.phase {
            self.internal.event.call(_BASE.ram());
            match (self.internal.event.is_answered(), self.internal.event.x_ERR) {
                (true, true) => self.end(Phase::Locked, EVENT_REFUSED),
                (true, false) => self.succeed(),
                (false, _) if watch.is_over(_BASE.ram()) => self.end(Phase::Locked, TIMEOUT),
                (false, _) => {}
            }
        }
    }

    fn begin(&mut self, base: &Base<BAPS_CTRL_BMSTRUCT>) {
        if !matches!(self.i_EVENT, 0 | 4 | 8) {
            return self.end(Phase::Locked, EVENT_NUMBER);
        }
        base.w_COMMAND_REG.store(self.w_COMMAND_REG);
        let [reference, actual] = self.numbers();
        base.a_WR_PAR_NR.iter().zip(reference).for_each(|(cell, number)| cell.store(number));
        base.a_RD_PAR_NR.iter().zip(actual).for_each(|(cell, number)| cell.store(number));
        base.b_COMMAND.store(baps_command::CONFIGURE);
        self.end(Phase::Configuring(base.ram().watch(self.t_TIME)), 0);
        self.x_BUSY = self.us_MODE == 1;
    }

    /// Handles the answer of the drive.
    fn configured(&mut self, base: &Base<BAPS_CTRL_BMSTRUCT>, watch: Watch) {
        self.b_SL_QUIT = base.b_SL_QUIT.load();
        if self.b_SL_QUIT != baps_quit::CONFIGURED {
            self.end(Phase::Locked, NOT_CONFIGURED);
        } else if self.i_EVENT == 0 {
            self.succeed();
        } else {
            self.internal.event = INTR_SET { i_EVENT: self.i_EVENT as i8, x_EN: true, ..Default::default() };
            self.internal.phase = Phase::Enabling(watch);
        }
    }

    fn succeed(&mut self) {
        self.end(Phase::Done, 0);
        self.x_OK = true;
    }

    /// Changes to `phase` with this error. The outputs are then neither busy nor OK.
    fn end(&mut self, phase: Phase, error: u8) {
        self.internal.phase = phase;
        (self.x_BUSY, self.x_OK) = (false, false);
        (self.b_ERR, self.x_ERR) = (error, error != 0);
    }

    /// Writes the numbers that can be changed while the process data run.
    fn write_new_numbers(&self, base: &BAPS_CTRL_BMSTRUCT) {
        let [reference, actual] = self.numbers();
        base.a_WR_PAR_NR.iter().zip(reference).take(2).for_each(|(cell, number)| cell.store(number));
        base.a_RD_PAR_NR.iter().zip(actual).take(4).for_each(|(cell, number)| cell.store(number));
    }
}
