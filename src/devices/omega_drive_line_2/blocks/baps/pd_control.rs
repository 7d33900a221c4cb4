//! `BAPS_PD_CONTROL`: watches that process data are exchanged (p. 117).

use crate::devices::omega_drive_line_2::registers::BAPS_CTRL_BMSTRUCT;
use crate::plc::Base;
use crate::plc::Watch;
use core::time::Duration;

/// Watches that a `BAPS_PD_COMMxx` is called, whatever comes of it (manual p. 117). Belongs to another task.
#[derive(Clone, Debug)]
pub struct BAPS_PD_CONTROL {
    /// Resets the block.
    pub x_RESET: bool,
    /// Monitoring time in emulated time; preset 3 s.
    pub t_TIME: Duration,
    /// No process data were exchanged for `t_TIME`; stays until `x_RESET`.
    pub x_ERR: bool,
    #[doc(hidden)]
    pub internal: Option<(u16, Watch)>,
}

impl Default for BAPS_PD_CONTROL {
    fn default() -> Self {
        BAPS_PD_CONTROL { x_RESET: false, t_TIME: Duration::from_secs(3), x_ERR: false, internal: None }
    }
}

impl BAPS_PD_CONTROL {
    /// One PLC cycle.
    pub fn call(&mut self, _BASE: &Base<BAPS_CTRL_BMSTRUCT>) {
        if self.x_RESET {
            (self.x_ERR, self.internal) = (false, None);
            return;
        }
        let now = _BASE.w_TIMEOUT.load();
        match self.internal {
            Some((seen, watch)) if seen == now => self.x_ERR |= watch.is_over(_BASE),
            _ => self.internal = Some((now, _BASE.watch(self.t_TIME))),
        }
    }
}
