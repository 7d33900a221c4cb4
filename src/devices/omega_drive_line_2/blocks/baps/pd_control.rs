//! `BAPS_PD_CONTROL`: monitors that process data are exchanged (p. 117).

use crate::devices::omega_drive_line_2::registers::BAPS_CTRL_BMSTRUCT;
use crate::plc::{Base, Watch, function_block};
use core::time::Duration;

function_block! {
    /// Checks that a `BAPS_PD_COMMxx` is called regularly, with or without success (manual p. 117). A task
    /// other than that of the `BAPS_PD_COMMxx` must call this block.
    pub struct BAPS_PD_CONTROL(_BASE: Base<BAPS_CTRL_BMSTRUCT>) {
        in {
            /// TRUE resets the block.
            x_RESET: bool;
            /// Monitoring time in emulated time; preset 3 s.
            t_TIME: Duration = Duration::from_secs(3);
        }
        out {
            /// No process data were exchanged for `t_TIME`. The output stays TRUE until `x_RESET`.
            x_ERR: bool;
        }
        internal: Option<(u16, Watch)>;
    }
}

impl BAPS_PD_CONTROL {
    /// Runs one PLC cycle.
    pub fn call(&mut self, _BASE: &Base<BAPS_CTRL_BMSTRUCT>) {
        if self.x_RESET {
            (self.x_ERR, self.internal) = (false, None);
            return;
        }
        let now = _BASE.w_TIMEOUT.load();
        match self.internal {
            Some((seen, watch)) if seen == now => self.x_ERR |= watch.is_over(_BASE.ram()),
            _ => self.internal = Some((now, _BASE.ram().watch(self.t_TIME))),
        }
    }
}
