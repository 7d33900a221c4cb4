//! `BAPS_PD_COMM2`, `BAPS_PD_COMM8`: process data (p. 99-103, 112-116), and the parts shared with `BAPS_PD_COMM24`.

use super::OMEGA_DRIVE_LINE_II;
use crate::devices::omega_drive_line_2::registers::BAPS_CTRL_BMSTRUCT;
use crate::devices::omega_drive_line_2::registers::values::{baps_command, baps_quit};
use crate::plc::{Base, function_block};

/// Bit 0 of `b_ERR`.
pub(super) const NOT_EXCHANGED: u8 = 1 << 0;

/// Makes a single exchange: reads the values from the drive, then writes `command`, the new values, and the
/// method and cycle time of the next communications.
pub(super) fn exchange(
    base: &BAPS_CTRL_BMSTRUCT,
    command: u8,
    [w_CONTROLWORD, w_COMMAND_REG]: [u16; 2],
    references: &[u32],
    actuals: &mut [&mut u32],
) {
    base.w_TIMEOUT.update(|value| value.wrapping_add(1));
    actuals.iter_mut().zip(&base.a_RD_VALUE).for_each(|(value, cell)| **value = cell.load());
    base.w_CONTROLWORD.store(w_CONTROLWORD);
    base.w_COMMAND_REG.store(w_COMMAND_REG);
    references.iter().zip(&base.a_WR_VALUE).for_each(|(value, cell)| cell.store(*value));
    base.b_COMMAND.store(command);
}

/// True if an acknowledgement means that values were not exchanged. 16#00 and 16#FF have no meaning, and
/// 16#02 is the acknowledgement of the configuration before (decision D-216).
pub(super) fn is_error(b_SL_QUIT: u8) -> bool {
    !matches!(
        b_SL_QUIT,
        baps_quit::NOTHING | baps_quit::EXCHANGED | baps_quit::CONFIGURED | baps_quit::RE_ARMED
    )
}

macro_rules! block {
    ($name:ident, $count:literal, $page:literal, [$($index:literal $wr:ident $rd:ident),*]) => {
        function_block! {
            #[doc = concat!("Exchanges control word, status word and up to ", $count, " reference and actual values")]
            #[doc = concat!("with the drive (manual p. ", $page, ").")]
            ///
            /// A call reads the values of the last communication and writes the values for the next
            /// communication. The acknowledgement of this next communication is visible at the next call.
            pub struct $name(_BASE: Base<BAPS_CTRL_BMSTRUCT>) {
                in {
                    /// 0: Omega Drive-Line II; with any other value the block does nothing.
                    us_HW_TYPE: u8;
                    /// Control word for the drive.
                    w_CONTROLWORD: u16;
                    /// Transmission method and cycle time, as at `BAPS_INIT`. Another value changes them.
                    w_COMMAND_REG: u16;
                    /// Task that calls the block: 0 any task, 1 the event task "BAPS process data". The input
                    /// has no effect in commram.
                    us_MODE: u8;
                    $(
                        #[doc = concat!("Reference value ", $index, ".")]
                        $wr: u32;
                    )*
                    /// Enables the exchange; TRUE by default.
                    x_EN: bool = true;
                }
                out {
                    /// Status word of the drive.
                    w_STATUSWORD: u16;
                    /// Bit 0: the drive is synchronized to the trigger controller.
                    w_STATUS_REG: u16;
                    $(
                        #[doc = concat!("Actual value ", $index, ".")]
                        $rd: u32;
                    )*
                    /// Acknowledgement of the drive.
                    b_SL_QUIT: u8;
                    /// Bit 0: the drive has not exchanged the values; `b_SL_QUIT` gives the reason.
                    b_ERR: u8;
                    /// `b_ERR` is not 0.
                    x_ERR: bool;
                }
            }
        }

        impl $name {
            /// Runs one PLC cycle.
            pub fn call(&mut self, _BASE: &Base<BAPS_CTRL_BMSTRUCT>) {
                if !self.x_EN || self.us_HW_TYPE != OMEGA_DRIVE_LINE_II {
                    return;
                }
                self.b_SL_QUIT = _BASE.b_SL_QUIT.load();
                self.w_STATUSWORD = _BASE.w_STATUSWORD.load();
                self.w_STATUS_REG = _BASE.w_STATUS_REG.load();
                let actuals = &mut [$(&mut self.$rd),*];
                let words = [self.w_CONTROLWORD, self.w_COMMAND_REG];
                exchange(_BASE, baps_command::EXCHANGE, words, &[$(self.$wr),*], actuals);
                self.b_ERR = if is_error(self.b_SL_QUIT) { NOT_EXCHANGED } else { 0 };
                self.x_ERR = self.b_ERR != 0;
            }
        }
    };
}

block!(BAPS_PD_COMM2, "two", "99-103", [0 ud_WR_VALUE0 ud_RD_VALUE0, 1 ud_WR_VALUE1 ud_RD_VALUE1]);
block!(
    BAPS_PD_COMM8,
    "eight",
    "112-116",
    [
        0 ud_WR_VALUE0 ud_RD_VALUE0,
        1 ud_WR_VALUE1 ud_RD_VALUE1,
        2 ud_WR_VALUE2 ud_RD_VALUE2,
        3 ud_WR_VALUE3 ud_RD_VALUE3,
        4 ud_WR_VALUE4 ud_RD_VALUE4,
        5 ud_WR_VALUE5 ud_RD_VALUE5,
        6 ud_WR_VALUE6 ud_RD_VALUE6,
        7 ud_WR_VALUE7 ud_RD_VALUE7
    ]
);
